//! Two of several dragons on the stage: Lemma 12 of docs/proofs.md.

use super::apart::are_apart;
use super::boards::Board;
use super::capsule::Capsule;
use super::chain::{Chain, span_is_one};
use super::events::{Events, Finish};
use super::first_order::FirstOrder;
use super::first_order_board::FirstOrderBoard;
use super::handle::When;
use super::interval::Interval;
use super::path::{Place, Span};
use super::problem::{Checked, ensure, problem};
use super::results::Known;
use super::scene::Scene;
use super::shown::{At, Shown};
use super::steps::Steps;
use super::team::Size;
use super::unlisted::straight_run;
use super::witness::{Evidence, WitnessLine, Witnesses};

/// Facts that the section of a dragon has shown.
pub(super) struct Alone {
    /// The end of its last step.
    end: Option<Place>,
    ends_with_path: bool,
    locks: bool,
}

impl Alone {
    pub fn new(steps: &Steps, events: &Events) -> Self {
        let locks = matches!(events.finish, Some(Finish::Lock(..)));
        Self { end: steps.end, ends_with_path: matches!(events.finish, Some(Finish::PathEnd)), locks }
    }
}

/// Links of travel before the end of a dragon's last step, up to which two boards must be shown to be apart.
const BEFORE_LOCK: f64 = 1e-3;

impl Alone {
    /// Returns the time of the end of the last step of a dragon that locks, in seconds, and the time [`BEFORE_LOCK`]
    /// links of travel before it, the earlier first.
    fn just_before_lock(&self, scene: &Scene) -> Option<[Interval; 2]> {
        let end = scene.time(&scene.path.travelled(self.end.filter(|_| self.locks)?));
        Some([end - scene.team.shortest_link() * Interval::new(BEFORE_LOCK) / scene.head_speed, end])
    }
}

/// The claim about two dragons over an interval of time that boards of the two are further apart than some metres.
pub(super) struct PairClaim<'c> {
    pub metres: f64,
    /// A place of each handle with the heads at one time, for first-order enclosures; without them, the metres are 0.
    pub at: Option<[&'c [Place]; 2]>,
}

/// The section of two dragons.
pub(super) struct Pair {
    pub dragons: [usize; 2],
    /// The time, in seconds, up to which stretches follow one another from the start.
    end: Option<f64>,
    /// The stretches that are clear, or that have a number `apart`.
    shown: Shown,
    witnesses: Witnesses,
    /// Counts for the report.
    pub steps: u64,
    pub links: u64,
    pub pairs: u64,
}

/// The two dragons while their heads are in two spans.
struct Together {
    chains: Vec<Chain>,
    /// The capsules of the handles on the stage.
    capsules: [Vec<Capsule>; 2],
    /// The boards on the line without end, if they are not listed.
    runs: [Vec<(usize, Capsule, Capsule, Size)>; 2],
    links: u64,
}

/// Returns true if a head is certain to be in a span from one time to another. The head stands at the start until its
/// delay has passed, and then again at the path's end.
fn is_in_span(scene: &Scene, Span(lo, hi): Span, from: &Interval, to: &Interval) -> bool {
    scene.path.travelled(lo).is_at_most(&scene.travelled_at(from))
        && (scene.path.is_at_end(hi) || scene.travelled_at(to).is_at_most(&scene.path.travelled(hi)))
}

impl Together {
    /// Checks that both heads are in their spans from one time to another, and Lemma 1 for the listed links.
    fn new(scenes: [&Scene; 2], [from, to]: [f64; 2], heads: [Span; 2], spans: [&[Span]; 2]) -> Checked<Self> {
        let [from, to] = [from, to].map(Interval::new);
        let mut together =
            Self { chains: Vec::new(), capsules: Default::default(), runs: Default::default(), links: 0 };
        for (k, scene) in scenes.into_iter().enumerate() {
            span_is_one(scene, heads[k]).map_err(|problem| problem!("head {k} of the two: {problem}"))?;
            ensure!(is_in_span(scene, heads[k], &from, &to), "head {k} of the two may be outside its span");
            // A run of boards of one size begins behind the head.
            ensure!(!spans[k].is_empty(), "no span is listed");
            let chain = Chain::check(scene, heads[k], spans[k])?;
            let on_stage = |capsule: &Capsule| capsule.placed(&scene.frame);
            together.links += chain.products.len() as u64;
            together.capsules[k] = chain.capsules.iter().map(on_stage).collect();
            if chain.last() < scene.team.benches && chain.ends_on_line(scene) {
                let run = |first: usize| {
                    let (front, rear, size) = straight_run(scene, &chain, first);
                    (first, on_stage(&front), on_stage(&rear), size)
                };
                together.runs[k] = scene.team.runs(chain.last()).map(run).collect();
            }
            together.chains.push(chain);
        }
        Ok(together)
    }

    fn board<'c>(&'c self, scene: &Scene, k: usize, bench: usize) -> Board<'c> {
        let capsules = &self.capsules[k];
        Board::new(&capsules[bench], &capsules[bench + 1], scene.team.size(bench))
    }

    /// Returns all boards of a dragon, those on the line without end as one.
    fn boards<'c>(&'c self, scene: &Scene, k: usize) -> Checked<Vec<Board<'c>>> {
        let listed = self.capsules[k].len() - 1;
        let mut boards: Vec<Board> = (0..listed).map(|bench| self.board(scene, k, bench)).collect();
        if self.runs[k].is_empty() && listed < scene.team.benches {
            return Err(problem!("not all links are listed, and the last handle is not on a line without end"));
        }
        boards.extend(self.runs[k].iter().map(|(_, front, rear, size)| Board::new(front, rear, *size)));
        Ok(boards)
    }
}

impl Together {
    /// Encloses both dragons to the first order on the stage.
    fn first_order(&self, scenes: [&Scene; 2], [from, to]: [f64; 2], at: [&[Place]; 2]) -> Checked<[FirstOrder; 2]> {
        let [from, to] = [from, to].map(Interval::new);
        let of = |k: usize| {
            let step = FirstOrder::in_time(scenes[k], &self.chains[k], at[k], &from, &to);
            step.map(|step| step.placed(&scenes[k].frame))
                .map_err(|problem| problem!("dragon {k} of the two: {problem}"))
        };
        Ok([of(0)?, of(1)?])
    }

    /// Returns all boards of a dragon to the first order, as [`Together::boards`].
    fn first_order_boards(&self, scene: &Scene, k: usize, step: &FirstOrder) -> Vec<FirstOrderBoard> {
        let listed = self.capsules[k].len() - 1;
        let boards = (0..listed).map(|bench| step.board(bench, &scene.team));
        boards.chain(self.runs[k].iter().map(|(first, ..)| step.straight_run(*first, &scene.team))).collect()
    }
}

impl Pair {
    pub fn new(dragons: [usize; 2]) -> Self {
        let witnesses = Witnesses::default();
        Self { dragons, end: None, shown: Shown::NOTHING, witnesses, steps: 0, links: 0, pairs: 0 }
    }

    fn scenes<'s>(&self, scenes: &'s [Scene]) -> [&'s Scene; 2] {
        self.dragons.map(|dragon| &scenes[dragon])
    }

    /// Checks and adds a stretch of time.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_both(
        &mut self,
        scenes: &[Scene],
        [from, to]: [f64; 2],
        (heads, spans): ([Span; 2], [&[Span]; 2]),
        claim: Option<PairClaim>,
    ) -> Checked {
        ensure!(self.witnesses.touched(None).is_none(), "a step after a contact of the two");
        ensure!(from.is_finite() && to.is_finite() && from < to, "it does not go forward in time");
        match self.end {
            Some(end) if end != from => return Err(problem!("it does not begin when the step before it ended")),
            None if from > 0.0 => return Err(problem!("the first step begins after the start")),
            _ => {}
        }
        let scenes = self.scenes(scenes);
        let together = Together::new(scenes, [from, to], heads, spans)?;
        let boards = [together.boards(scenes[0], 0)?, together.boards(scenes[1], 1)?];
        self.shown.add(At::Time(to), claim.as_ref().map(|claim| claim.metres), "says how far boards are apart")?;
        if let Some(PairClaim { metres, at }) = claim {
            let steps = at.map(|at| together.first_order(scenes, [from, to], at)).transpose()?;
            let first_order = steps.map(|steps| [0, 1].map(|k| together.first_order_boards(scenes[k], k, &steps[k])));
            self.pairs += check_pairs(&boards, &Interval::new(metres), first_order.as_ref())?;
        }
        self.links += together.links;
        self.steps += 1;
        self.end = Some(to);
        Ok(())
    }

    /// Checks and adds boards of the two that touch at a time, or that are no further apart than some metres. For boards
    /// that touch, the sections of both dragons alone, if they are given, must prove that the motions continue until
    /// then; otherwise the steps of the two.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add_witness(&mut self, scenes: &[Scene], alone: Option<&[Alone]>, line: &WitnessLine) -> Checked {
        let (whom, (heads, spans)) = (line.whom, line.spans()?);
        let Some(time) = line.time.filter(|time| time.is_finite() && *time >= 0.0) else {
            return Err(problem!("the time is before the start"));
        };
        whom.check(&[], &spans)?;
        let alone = alone.filter(|_| matches!(line.evidence, Evidence::Point(_)));
        if alone.is_none() {
            self.is_reached(time)?;
        }
        let scenes = self.scenes(scenes);
        let together = Together::new(scenes, [time; 2], heads, spans)?;
        let most = match &line.evidence {
            Evidence::Point(point) => {
                for (k, dragon) in self.dragons.into_iter().enumerate() {
                    // Otherwise the motion may have ended with a lock.
                    let has_come = |Alone { end, ends_with_path, .. }: &Alone| {
                        *ends_with_path || end.is_some_and(|end| scenes[k].path.in_order(heads[k].1, end))
                    };
                    ensure!(
                        alone.is_none_or(|alone| has_come(&alone[dragon])),
                        "no step of dragon {dragon} has come there"
                    );
                }
                whom.check_touch(|k, bench| together.board(scenes[k], k, bench), &[], point)?;
                None
            }
            Evidence::Most(most, at) => {
                let steps = together.first_order(scenes, [time; 2], [&at[0], &at[1]])?;
                whom.check_near(|k, bench| steps[k].board(bench, &scenes[k].team), &[], most)?;
                Some(*most)
            }
        };
        self.witnesses.add(whom, most, At::Time(time))
    }

    /// Checks that the steps have come to a time: no link has locked until then.
    fn is_reached(&self, time: f64) -> Checked {
        if self.end.is_some_and(|end| time <= end) {
            Ok(())
        } else {
            Err(problem!("the steps of the two have not come to the time"))
        }
    }

    /// Returns what the section has shown about the two. `alone` has the facts of all dragons.
    pub fn known<'s>(&self, scenes: &'s [Scene], alone: &[Alone]) -> Known<'s> {
        let locks = self.dragons.into_iter().filter_map(|dragon| alone[dragon].just_before_lock(&scenes[dragon]));
        Known {
            scene: &scenes[self.dragons[0]],
            shown: self.shown,
            event: self.witnesses.touched(None),
            near: self.witnesses.near(None),
            is_whole: self.shown.all && self.ends_with_paths(scenes),
            locks: locks.filter(|_| self.end.is_some()).collect(),
        }
    }

    /// Returns true if the steps have come to the ends of both paths.
    fn ends_with_paths(&self, scenes: &[Scene]) -> bool {
        let end = Interval::new(self.end.unwrap_or(0.0));
        self.scenes(scenes).into_iter().all(|scene| scene.time(&scene.path.length).is_at_most(&end))
    }
}

/// Checks that each board of the one is further than some metres from each of the other. Returns the number of pairs.
fn check_pairs(
    boards: &[Vec<Board>; 2],
    metres: &Interval,
    first_order: Option<&[Vec<FirstOrderBoard>; 2]>,
) -> Checked<u64> {
    for (a, one) in boards[0].iter().enumerate() {
        for (b, other) in boards[1].iter().enumerate() {
            let both = first_order.map(|all| [&all[0][a], &all[1][b]]);
            ensure!(
                are_apart(metres, [one, other], both, When::Always),
                "bench {a} of the first and bench {b} of the second may be too near (Lemmas 2 and 6)"
            );
        }
    }
    Ok((boards[0].len() * boards[1].len()) as u64)
}
