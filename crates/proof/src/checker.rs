//! The lines of a certificate in their order: which may follow which, and the room that checks each.

use super::Proved;
use super::events::{Events, LockShown};
use super::greatest::Greatest;
use super::lines::{About, ParsedLine, ProvedEvent, ProvedResult};
use super::path::Span;
use super::pitch::Pitch;
use super::problem::{Checked, Problem, ensure, problem};
use super::results::{Claim, Clearance, Known, Subject};
use super::scene::Scene;
use super::several::{Alone, Pair, PairClaim};
use super::steps::{Step, Steps};

/// The version of the file format.
const FORMAT: u32 = 4;

/// The state of the check.
pub struct Checker {
    pub about: About,
    /// The dragon of a scene of one, or all.
    scenes: Vec<Scene>,
    /// Facts that the sections of dragons have shown; `None` in a scene of one.
    pub alone: Option<Vec<Alone>>,
    /// True in the section of a dragon.
    is_in_section: bool,
    between: Option<Pair>,
    /// The number of results before the section.
    before: usize,
    steps: Steps,
    events: Events,
    greatest: Greatest,
    pitch: Option<Pitch>,
    pub proved: Proved,
}

impl Checker {
    /// Begins with the first line.
    pub fn begin(first: ParsedLine) -> Checked<Self> {
        let ParsedLine::Certificate { format, version, about, scene: text } = first else {
            return Err(problem!("the first line is not that of a certificate"));
        };
        ensure!(format == FORMAT, "a certificate of format {format}, expected {FORMAT}");
        let in_scene = |problem: Problem| problem!("the scene: {problem}");
        let mut scenes = Scene::read_ensemble(&text).map_err(in_scene)?;
        let alone = if scenes.is_empty() { None } else { Some(Vec::new()) };
        if alone.is_none() {
            scenes.push(Scene::read(&text).map_err(in_scene)?);
        } else if !matches!(about, About::Events | About::LeastClearance) {
            return Err(problem!("the scene has several dragons, of which this kind of certificate proves nothing"));
        }
        let dragons =
            if alone.is_some() { scenes.iter().map(|scene| scene.name.clone()).collect() } else { Vec::new() };
        let (results, steps, links, pairs) = (Vec::new(), 0, 0, 0);
        let proved = Proved {
            scene: text,
            version,
            dragons,
            results,
            least_clearance: None,
            least_clearances: Vec::new(),
            obstacle_clearances: Vec::new(),
            greatest_speed: None,
            least_pitch: None,
            steps,
            links,
            pairs,
        };
        let steps = Steps::new(scenes[0].obstacles.len());
        let (events, greatest) = (Events::default(), Greatest::default());
        let (is_in_section, between, before) = (false, None, 0);
        Ok(Self { about, scenes, alone, is_in_section, between, before, steps, events, greatest, pitch: None, proved })
    }

    /// Returns the dragon of the section; the only one of a scene of one.
    fn dragon(&self) -> &Scene {
        &self.scenes[self.alone.as_ref().map_or(0, Vec::len)]
    }

    /// Returns the number of results of all sections so far.
    fn results(&self) -> usize {
        let Proved { results, least_clearance, least_clearances, obstacle_clearances, .. } = &self.proved;
        let of_clearance = usize::from(least_clearance.is_some()) + least_clearances.len();
        results.len() + of_clearance + obstacle_clearances.len()
    }

    /// Returns true if the section of a dragon or of two has its results.
    fn is_section_complete(&self) -> bool {
        let has_begun = self.alone.is_none() || self.is_in_section || self.between.is_some();
        has_begun && self.subject().is_none()
    }

    /// Returns the subject of the next result of a section; `None` after the last.
    fn subject(&self) -> Option<Subject> {
        let earlier = self.results() - self.before;
        // Of two dragons there is one result.
        let (most, obstacles) =
            if self.between.is_some() { (1, 0) } else { (usize::MAX, self.dragon().obstacles.len()) };
        if earlier < most { Subject::nth(self.about, earlier, obstacles) } else { None }
    }

    /// Returns the dragon of a section in a scene of several, or the two.
    fn dragons(&self) -> Vec<usize> {
        match &self.between {
            Some(pair) => pair.dragons.to_vec(),
            None => Vec::from_iter(self.alone.as_ref().map(Vec::len)),
        }
    }

    /// Returns what the section has shown about the subject of a result. It must be the next one.
    fn known(&self, claim: Claim, obstacle: Option<usize>, dragons: &[usize]) -> Checked<Known<'_>> {
        let subject = self.subject().ok_or_else(|| problem!("a result too many: its section has all results"))?;
        if (claim, obstacle) != (subject.claim, subject.obstacle) {
            let first = if self.about == About::Events { "contact, stall, lock, path_end" } else { "least_clearance" };
            return Err(problem!("the results are not {first} and the obstacles in this order"));
        }
        ensure!(*dragons == self.dragons(), "it is not the result for this dragon, or for these two");
        Ok(match (&self.between, &self.alone) {
            (Some(pair), Some(alone)) => pair.known(&self.scenes, alone),
            _ => self.events.known(self.dragon(), &self.steps, &subject),
        })
    }

    /// Checks and adds a result.
    fn add_result(&mut self, result: ProvedResult) -> Checked {
        match result {
            ProvedResult::Event(outcome) => {
                let ProvedEvent { event, obstacle, dragons, .. } = &outcome;
                self.known(Claim::Event(*event), *obstacle, dragons)?.check_event(&outcome)?;
                self.proved.results.push(outcome);
            }
            ProvedResult::LeastClearance(outcome) => {
                let known = self.known(Claim::Clearance, None, &outcome.dragons)?;
                known.check_clearance(&Clearance::from(&outcome))?;
                match self.alone {
                    Some(_) => self.proved.least_clearances.push(outcome),
                    None => self.proved.least_clearance = Some(outcome),
                }
            }
            ProvedResult::ObstacleClearance(outcome) => {
                let known = self.known(Claim::Clearance, Some(outcome.obstacle), &outcome.dragons)?;
                known.check_clearance(&Clearance::from(&outcome))?;
                self.proved.obstacle_clearances.push(outcome);
            }
            ProvedResult::GreatestSpeed(outcome) => {
                self.greatest.check(self.dragon(), &outcome)?;
                self.proved.greatest_speed = Some(outcome);
            }
            ProvedResult::LeastPitch(outcome) => {
                begun(&mut self.pitch)?.check(&outcome)?;
                self.proved.least_pitch = Some(outcome);
            }
        }
        Ok(())
    }

    /// Ends a section, and adds its counts.
    fn end_section(&mut self) -> Checked {
        if (self.is_in_section || self.between.is_some()) && !self.is_section_complete() {
            return Err(problem!("the section before it lacks a result"));
        }
        let Some(alone) = &mut self.alone else {
            return Err(problem!("the scene has one dragon, and no sections"));
        };
        // All dragons are on one stage.
        let next = Steps::new(self.scenes[0].obstacles.len());
        let (steps, events) = (std::mem::replace(&mut self.steps, next), std::mem::take(&mut self.events));
        let mut counts = [steps.steps, steps.links, steps.pairs];
        if self.is_in_section {
            alone.push(Alone::new(&steps, &events));
        }
        if let Some(Pair { steps, links, pairs, .. }) = self.between.take() {
            counts = [steps, links, pairs];
        }
        self.proved.steps += counts[0];
        self.proved.links += counts[1];
        self.proved.pairs += counts[2];
        (self.is_in_section, self.before) = (false, self.results());
        Ok(())
    }

    /// Returns the pair that follows another, in their order; `None` after the last.
    fn next_pair(&self, after: Option<[usize; 2]>) -> Option<[usize; 2]> {
        let count = self.scenes.len();
        let next = match after {
            None => [0, 1],
            Some([a, b]) if b + 1 < count => [a, b + 1],
            Some([a, _]) => [a + 1, a + 2],
        };
        (next[1] < count).then_some(next)
    }

    /// Begins the section of a dragon or of two. They are those that follow the section before.
    fn begin_section(&mut self, dragons: &[usize]) -> Checked {
        let last = self.between.as_ref().map(|pair| pair.dragons);
        self.end_section()?;
        let (alone, count) = (self.alone.as_ref().map_or(0, Vec::len), self.scenes.len());
        match *dragons {
            [dragon] if last.is_none() && dragon == alone && alone < count => self.is_in_section = true,
            [a, b] if alone == count && self.next_pair(last) == Some([a, b]) => self.between = Some(Pair::new([a, b])),
            _ => return Err(problem!("it is not the section that follows: of each dragon, and then of each two")),
        }
        Ok(())
    }

    /// Checks and adds a line of the section of two dragons. Returns another line.
    fn add_of_two(&mut self, line: ParsedLine) -> Checked<Option<ParsedLine>> {
        let (Some(alone), Some(pair)) = (&self.alone, &mut self.between) else { return Ok(Some(line)) };
        let is_about_events = self.about == About::Events;
        match line {
            ParsedLine::Both { from, to, heads, spans: [one, other], apart, at } => {
                let claim = match apart {
                    None => is_about_events.then_some(PairClaim { metres: 0.0, at: None }),
                    Some(_) if is_about_events => return Err(problem!("`apart` in a certificate of events")),
                    Some(metres) => Some(PairClaim { metres, at: Some(at.each_ref().map(Vec::as_slice)) }),
                };
                pair.add_both(&self.scenes, [from, to], (heads, [&one, &other]), claim)?;
            }
            ParsedLine::Witness(line) => {
                pair.add_witness(&self.scenes, is_about_events.then_some(alone.as_slice()), &line)?;
            }
            ParsedLine::Result(_) => return Ok(Some(line)),
            _ => return Err(problem!("it is about one dragon, in a section of two")),
        }
        Ok(None)
    }

    /// Returns true if all results of the question are there.
    pub fn is_complete(&self) -> bool {
        match self.about {
            About::Events | About::LeastClearance => match (&self.alone, &self.between) {
                (None, _) => self.is_section_complete(),
                (Some(_), Some(pair)) => self.is_section_complete() && self.next_pair(Some(pair.dragons)).is_none(),
                (Some(_), None) => self.scenes.len() == 1 && self.is_section_complete(),
            },
            About::GreatestSpeed => self.proved.greatest_speed.is_some(),
            About::LeastPitch => self.proved.least_pitch.is_some(),
        }
    }

    /// Checks the next line.
    pub fn add(&mut self, line: ParsedLine) -> Checked {
        if self.about != About::Events && self.is_complete() {
            return Err(problem!("nothing can follow the result"));
        }
        let question = match &line {
            ParsedLine::Result(result) => Some(result.about()),
            ParsedLine::Speeds { .. } | ParsedLine::Fast { .. } => Some(About::GreatestSpeed),
            _ => None,
        };
        ensure!(!question.is_some_and(|question| question != self.about), "it belongs to another question");
        if let ParsedLine::Section { dragons } = &line {
            return self.begin_section(dragons);
        }
        let is_in_none = self.alone.is_some() && !self.is_in_section && self.between.is_none();
        ensure!(!is_in_none, "no line says which dragon it is about");
        ensure!(
            self.between.is_none() || self.results() == self.before,
            "nothing of two dragons can follow their result"
        );
        let line = match self.add_of_two(line)? {
            None => return Ok(()),
            Some(ParsedLine::Result(result)) => return self.add_result(result),
            Some(line) => line,
        };
        let section = self.alone.as_ref().map(Vec::len);
        if let (ParsedLine::Branch { link, from, to, behind }, true) = (&line, self.about != About::LeastPitch) {
            if self.steps.end.is_some() || self.greatest.steps > 0 {
                return Err(problem!("a branch has to precede all steps"));
            }
            let Scene { path, team, branches, .. } = &mut self.scenes[section.unwrap_or(0)];
            return branches.add(path, team, *link, Span(*from, *to), *behind);
        }
        let so_far = self.results() - self.before;
        let Self { about, scenes, steps, events, greatest, pitch, .. } = self;
        let scene = &scenes[section.unwrap_or(0)];
        if question.is_none() && (events.finish.is_some() || so_far > 0) {
            return Err(problem!("nothing but results can follow a lock, the path's end or a result"));
        }
        match line {
            ParsedLine::Certificate { .. } => Err(problem!("a second first line")),
            ParsedLine::Step { links, from, to, moving, clear, spans, free, apart, beside, at } => {
                let step = Step { links, head: Span(from, to), moving, clear, spans, free, apart, beside, at };
                match pitch {
                    Some(pitch) => pitch.add_step(step),
                    None => steps.add(scene, step),
                }
            }
            ParsedLine::Witness(line) => events.add_witness(scene, steps, &line),
            ParsedLine::Stall { link, from, to, spans } => events.add_stall(scene, steps, link, Span(from, to), &spans),
            ParsedLine::Branch { .. } => Err(problem!("a branch in a certificate of another question")),
            ParsedLine::Lock { link, to, spans, last, window, beyond } => {
                let shown = match (window, beyond) {
                    (Some(window), None) => LockShown::Nearer(window),
                    (None, Some(beyond)) => LockShown::Further(beyond),
                    _ => return Err(problem!("expected one of `window` and `beyond`")),
                };
                events.add_lock(scene, steps, link, to, (&spans, &last), shown)
            }
            ParsedLine::PathEnd {} => events.add_path_end(scene, steps),
            ParsedLine::Speeds { from, to, spans, at } => greatest.add_step(scene, Span(from, to), &spans, &at),
            ParsedLine::Fast { handle, spans, at } => greatest.add_fast(scene, handle, &spans, &at),
            ParsedLine::Reach { radius, from, clearance } if *about == About::LeastPitch && pitch.is_none() => {
                *pitch = Some(Pitch::new(radius, from, clearance)?);
                Ok(())
            }
            ParsedLine::Reach { .. } => Err(problem!("a line `reach` of another question, or a second one")),
            ParsedLine::Overlap { from, to, theta, benches, spans, point, other } => {
                let points = [point, other.unwrap_or(point)];
                begun(pitch)?.add_overlap(scene, [from, to], theta, benches, &spans, points)
            }
            ParsedLine::HeadLocks { from, to } => begun(pitch)?.add_lock(scene, from, to),
            ParsedLine::Far { pitch: free, radius } => begun(pitch)?.add_far(scene, free, radius),
            ParsedLine::Section { .. } | ParsedLine::Both { .. } | ParsedLine::Result(_) => {
                Err(problem!("it is not in a section of two dragons"))
            }
        }
    }

    /// Returns what is proved, after the last line.
    pub fn finished(mut self) -> Proved {
        if self.alone.is_some() {
            // A complete certificate ends with a complete section.
            let _ = self.end_section();
            return self.proved;
        }
        let Steps { steps, links, pairs, .. } = self.steps;
        let of_pitch = self.pitch.as_ref().map_or((0, 0, 0), Pitch::counts);
        let (steps, links) = (steps + self.greatest.steps + of_pitch.0, links + self.greatest.links + of_pitch.1);
        let pairs = pairs + of_pitch.2;
        Proved { steps, links, pairs, ..self.proved }
    }
}

/// Returns the pitch that a line is about.
fn begun(pitch: &mut Option<Pitch>) -> Checked<&mut Pitch> {
    pitch.as_mut().ok_or_else(|| problem!("no line `reach` precedes it"))
}
