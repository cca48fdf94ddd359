//! The search: scattered starts, then Nelder and Mead's simplex (the crate argmin) from the best of them.
//!
//! The margin is a least value of many distances: it has edges, and none of its derivatives is of use. Candidates are
//! judged at samples first. Samples bound the margin from above, so a candidate whose bound is not above the best exact
//! margin cannot win, and is not judged exactly. The same seed gives the same answer, since no time decides anything.

use std::cell::RefCell;
use std::ops::{ControlFlow, Range};

use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::neldermead::NelderMead;
use bench_dragon_motion::event::unreported;
use bench_dragon_show::scene::values::{Found, Values, replaced};
use bench_dragon_show::scene::{Scene, SceneError, SceneText};

use crate::judge::{Judgement, Rules};

/// Scattered starts, and more for each number.
const SCATTERED: usize = 16;
const SCATTERED_MORE: usize = 6;
/// The starts from which a simplex searches at samples, and its steps.
const DESCENTS: usize = 2;
const DESCENT_STEPS: u64 = 30;
/// The simplices that search exactly, each smaller than the one before, and their steps.
const SIZES: [f64; 2] = [0.06, 0.01];
const EXACT_STEPS: u64 = 30;
/// The size of a first simplex, in ranges.
const SIZE: f64 = 0.12;
/// The part of a shortfall that other distances add to the least one, so that a candidate with fewer of them is better.
const OTHERS: f64 = 0.1;
/// The cost of a scene that is refused.
const REFUSED: f64 = 1e3;
/// Limits that are told: those within this of the least margin, in metres.
const LIMITS: f64 = 1e-3;

/// A number that may change.
#[derive(Debug, Clone, PartialEq)]
pub struct Vary {
    /// Its name in the scene, such as `path.pieces[2].radius`.
    pub field: String,
    /// The range, in which the answer lies; `None` for a quarter of the number to either side, at least 0.5.
    pub range: Option<(f64, f64)>,
}

/// The failure of a search.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// The scene has no number of that name.
    #[error("the scene has no number {0}, expected one of its numbers, such as {1}")]
    NoNumber(String, String),
    /// Every candidate is refused.
    #[error("no scene with numbers of these ranges is accepted: {0}")]
    Refused(SceneError),
    /// The margin of the best candidate could not be computed.
    #[error("the search for the least distances of the best numbers gave up")]
    GaveUp,
}

/// The answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The numbers that may change, in the order of the request, with their values.
    pub fields: Vec<(String, f64)>,
    /// The text with these numbers.
    pub text: String,
    /// The exact margins.
    pub judgement: Judgement,
    /// The margin of the rest, if the search has left out the boundary, because the team stands outside it at the start
    /// with all numbers that were tried first.
    pub without_boundary: Option<f64>,
    /// The scenes that were judged, at samples and exactly.
    pub judged: (usize, usize),
}

impl Fitted {
    /// Returns true if everything that is required is kept.
    pub fn is_found(&self) -> bool {
        self.judgement.margin() >= 0.0
    }

    /// Returns the distances that limit the margin.
    pub fn limits(&self) -> impl Iterator<Item = &crate::judge::Part> {
        let most = self.judgement.margin() + LIMITS;
        self.judgement.parts.iter().filter(move |part| part.margin <= most)
    }
}

/// Searches for numbers with which a scene keeps `clearance` metres between boards, and its keep-outs. A search that
/// `progress` stops answers with the best so far.
///
/// # Errors
/// [`FitError`]
pub fn fit(
    text: &SceneText,
    vary: &[Vary],
    clearance: f64,
    seed: u64,
    progress: &mut dyn FnMut(f64, f64) -> ControlFlow<()>,
) -> Result<Fitted, FitError> {
    let scene = text.parse().map_err(FitError::Refused)?;
    let of_text = Values::of(&text.text);
    let fields = vary.iter().map(|vary| field(&of_text, vary)).collect::<Result<Vec<_>, _>>()?;
    let rules = Rules::new(&scene, clearance, &mut |_| progress(0.0, f64::NEG_INFINITY));
    let dimensions = fields.len();
    let scattered = SCATTERED + SCATTERED_MORE * dimensions;
    let per_step = 2;
    let steps = DESCENTS as u64 * DESCENT_STEPS + SIZES.len() as u64 * EXACT_STEPS;
    let expected = scattered + per_step * steps as usize;
    let state = State { progress, refusal: None, best: None, given: Vec::new(), judged: (0, 0), stopped: false };
    let mut search = Search { text, fields, rules, expected, state: RefCell::new(state) };
    // Only a boundary outside which the team stands is looked at again.
    if !search.rules.with_boundary {
        search.rules.with_boundary = search.can_start_inside(scattered, seed);
    }
    search.run(scattered, seed);
    search.finish()
}

/// A number with its range.
struct Field {
    name: String,
    span: Range<usize>,
    given: f64,
    range: (f64, f64),
    /// The decimals of an answer.
    decimals: usize,
}

fn field(of_text: &Values, vary: &Vary) -> Result<Field, FitError> {
    let found = of_text.get(&vary.field).zip(of_text.number(&vary.field));
    let Some((Found { name, span, .. }, value)) = found else {
        let names = of_text.numbers().map(|number| number.name.as_str());
        let some: Vec<&str> = names.filter(|name| name.starts_with("path")).take(3).collect();
        return Err(FitError::NoNumber(vary.field.clone(), some.join(", ")));
    };
    let around = (0.25 * value.abs()).max(0.5);
    let least = if value > 0.0 { 0.5 * value } else { f64::NEG_INFINITY };
    let range = vary.range.unwrap_or(((value - around).max(least), value + around));
    // A ten-thousandth of a metre, and finer in a narrow range.
    let decimals = (4.0 - (range.1 - range.0).log10().floor().min(0.0)).clamp(4.0, 12.0) as usize;
    Ok(Field { name: name.clone(), span: span.clone(), given: value, range, decimals })
}

/// A candidate that was judged exactly.
struct Best {
    values: Vec<f64>,
    place: Vec<f64>,
    judgement: Judgement,
}

struct State<'p> {
    progress: &'p mut dyn FnMut(f64, f64) -> ControlFlow<()>,
    refusal: Option<SceneError>,
    best: Option<Best>,
    /// The places judged at samples with their costs, the best first.
    given: Vec<(f64, Vec<f64>)>,
    judged: (usize, usize),
    stopped: bool,
}

struct Search<'s, 'p> {
    text: &'s SceneText,
    fields: Vec<Field>,
    rules: Rules,
    expected: usize,
    state: RefCell<State<'p>>,
}

/// The costs of a search: at samples, or exact.
struct Costs<'a, 's, 'p> {
    search: &'a Search<'s, 'p>,
    exact: bool,
}

impl CostFunction for Costs<'_, '_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, place: &Vec<f64>) -> Result<f64, Error> {
        // Outside the ranges, the cost is that of the nearest place, and more with the distance.
        let inside: Vec<f64> = place.iter().map(|part| part.clamp(0.0, 1.0)).collect();
        let outside: f64 = place.iter().zip(&inside).map(|(part, inside)| (part - inside).abs()).sum();
        let (search, exact) = (self.search, self.exact);
        let cost = if exact { search.exact(&inside) } else { search.sampled(&inside, f64::NEG_INFINITY) };
        // The first costs of a simplex must not fail, so a search that is stopped runs out of steps.
        Ok(cost.unwrap_or(REFUSED) + outside)
    }
}

impl Search<'_, '_> {
    fn run(&self, scattered: usize, seed: u64) {
        let mut random = fastrand::Rng::with_seed(seed);
        let part = |field: &Field| ((field.given - field.range.0) / (field.range.1 - field.range.0)).clamp(0.0, 1.0);
        let given: Vec<f64> = self.fields.iter().map(part).collect();
        let mut starts: Vec<(f64, Vec<f64>)> = Vec::new();
        for number in 0..=scattered {
            let place = if number == 0 { given.clone() } else { self.fields.iter().map(|_| random.f64()).collect() };
            // The least margin with which a start is among the best.
            let floor = starts.get(DESCENTS - 1).map_or(f64::NEG_INFINITY, |(cost, _)| -cost);
            let Some(cost) = self.sampled(&place, floor) else { return };
            starts.push((cost, place));
            starts.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        }
        for (_, start) in starts.into_iter().take(DESCENTS) {
            if self.descend(&start, SIZE, DESCENT_STEPS, false).is_none() {
                return;
            }
        }
        for size in SIZES {
            let best = self.state.borrow().best.as_ref().map(|best| best.place.clone());
            let sampled = self.state.borrow().given.first().map(|(_, place)| place.clone());
            let Some(start) = best.or(sampled) else { return };
            if self.descend(&start, size, EXACT_STEPS, true).is_none() {
                return;
            }
        }
    }

    /// Returns true if one of the scattered starts has a team that stands inside the boundary.
    fn can_start_inside(&self, scattered: usize, seed: u64) -> bool {
        let mut random = fastrand::Rng::with_seed(seed);
        (0..scattered).any(|_| {
            let place: Vec<f64> = self.fields.iter().map(|_| random.f64()).collect();
            let scene = self.scene(&self.values(&place));
            scene.is_some_and(|scene| Rules::new(&scene, self.rules.clearance, &mut |_| self.told(0.0)).with_boundary)
        })
    }

    /// Searches by a simplex of a size from a place; `None` if it was stopped.
    fn descend(&self, start: &[f64], size: f64, steps: u64, exact: bool) -> Option<()> {
        let mut simplex = vec![start.to_vec()];
        for k in 0..start.len() {
            let mut corner = start.to_vec();
            corner[k] += if corner[k] + size > 1.0 { -size } else { size };
            simplex.push(corner);
        }
        // A tolerance that is not negative is accepted.
        let solver = NelderMead::new(simplex).with_sd_tolerance(1e-6).ok()?;
        let executor = Executor::new(Costs { search: self, exact }, solver);
        executor.configure(|state| state.max_iters(steps)).timer(false).run().ok()?;
        (!self.state.borrow().stopped).then_some(())
    }

    /// Returns the values at a place, rounded as they are written.
    fn values(&self, place: &[f64]) -> Vec<f64> {
        let value = |(field, part): (&Field, &f64)| {
            let value = field.range.0 + part * (field.range.1 - field.range.0);
            // Text of a number reads back. Zero has no sign.
            format!("{value:.0$}", field.decimals).parse().unwrap_or(value) + 0.0
        };
        self.fields.iter().zip(place).map(value).collect()
    }

    fn changed(&self, values: &[f64]) -> String {
        // A whole number keeps its point, since TOML distinguishes 3 and 3.0.
        let spans = self.fields.iter().zip(values).map(|(field, value)| (field.span.clone(), format!("{value:?}")));
        replaced(&self.text.text, spans.collect())
    }

    fn scene(&self, values: &[f64]) -> Option<Scene> {
        let text = SceneText { text: self.changed(values), ..self.text.clone() };
        text.parse().map_err(|refusal| self.state.borrow_mut().refusal = Some(refusal)).ok()
    }

    /// Returns the cost of a place at samples; `None` once the search is stopped.
    fn sampled(&self, place: &[f64], floor: f64) -> Option<f64> {
        self.report()?;
        let judgement = self
            .scene(&self.values(place))
            .and_then(|scene| self.rules.sampled(&scene, floor, &mut || self.told(self.done()).is_break()));
        let cost = judgement.map_or(REFUSED, |judgement| cost(&judgement));
        let mut state = self.state.borrow_mut();
        state.judged.0 += 1;
        state.given.push((cost, place.to_vec()));
        state.given.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        state.given.truncate(DESCENTS);
        Some(cost)
    }

    /// Returns the exact cost of a place, or that at samples where it cannot win; `None` once the search is stopped.
    fn exact(&self, place: &[f64]) -> Option<f64> {
        self.report()?;
        let values = self.values(place);
        let Some(scene) = self.scene(&values) else { return Some(REFUSED) };
        let best = self.state.borrow().best.as_ref().map_or(f64::INFINITY, |best| cost(&best.judgement));
        self.state.borrow_mut().judged.0 += 1;
        let mut is_stopped = || self.told(self.done()).is_break();
        let bound = self.rules.sampled(&scene, f64::NEG_INFINITY, &mut is_stopped);
        let bound = bound.map_or(REFUSED, |judgement| cost(&judgement));
        if bound >= best {
            return Some(bound);
        }
        let done = self.done();
        let judgement = self.rules.exact(&scene, &mut |_| self.told(done));
        if self.state.borrow().stopped {
            return None;
        }
        let Some(judgement) = judgement else { return Some(REFUSED) };
        let cost = cost(&judgement);
        let mut state = self.state.borrow_mut();
        state.judged.1 += 1;
        if cost < best {
            log::info!("an exact margin of {} m, with {values:?}", judgement.margin());
            state.best = Some(Best { values, place: place.to_vec(), judgement });
        }
        Some(cost)
    }

    fn done(&self) -> f64 {
        self.state.borrow().judged.0 as f64 / self.expected as f64
    }

    /// Tells how far the search has come and the best margin so far; `None` once it is stopped.
    fn report(&self) -> Option<()> {
        self.told(self.done()).is_continue().then_some(())
    }

    fn told(&self, share: f64) -> ControlFlow<()> {
        let mut state = self.state.borrow_mut();
        let of_best = state.best.as_ref().map(|best| best.judgement.margin());
        let margin = of_best.or(state.given.first().map(|(cost, _)| -cost)).unwrap_or(f64::NEG_INFINITY);
        let flow = (state.progress)(share.min(1.0), margin);
        state.stopped |= flow.is_break();
        if state.stopped { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Returns the best that was found. One that was judged at samples alone is judged exactly now.
    fn finish(self) -> Result<Fitted, FitError> {
        let mut state = self.state.borrow_mut();
        let (refusal, best) = (state.refusal.take(), state.best.take());
        let (given, judged, stopped) = (std::mem::take(&mut state.given), state.judged, state.stopped);
        drop(state);
        let (values, judgement) = match best {
            Some(best) => (best.values, best.judgement),
            None if stopped => return Err(FitError::GaveUp),
            None => {
                let (cost, place) = given.first().cloned().ok_or(FitError::GaveUp)?;
                let values = self.values(&place);
                let text = SceneText { text: self.changed(&values), ..self.text.clone() };
                let scene = text.parse().map_err(|error| FitError::Refused(refusal.unwrap_or(error)))?;
                let judgement = (cost < REFUSED).then(|| self.rules.exact(&scene, &mut unreported)).flatten();
                (values, judgement.ok_or(FitError::GaveUp)?)
            }
        };
        let text = self.changed(&values);
        let without_boundary = (!self.rules.with_boundary).then(|| judgement.margin());
        let judgement = match without_boundary {
            None => judgement,
            Some(_) => {
                let changed = SceneText { text: text.clone(), ..self.text.clone() };
                let scene = changed.parse().map_err(FitError::Refused)?;
                let rules = Rules { with_boundary: true, ..self.rules };
                rules.exact(&scene, &mut unreported).ok_or(FitError::GaveUp)?
            }
        };
        let fields = self.fields.iter().map(|field| field.name.clone()).zip(values).collect();
        Ok(Fitted { fields, text, judgement, without_boundary, judged })
    }
}

/// Returns the cost of a candidate: minus its margin; where it is negative, more for each further shortfall.
fn cost(judgement: &Judgement) -> f64 {
    let margin = judgement.margin();
    if margin >= 0.0 {
        return -margin;
    }
    let others: f64 = judgement.parts.iter().map(|part| part.margin.min(0.0)).sum();
    -(margin + OTHERS * (others - margin)).max(-REFUSED)
}
