//! The steps of a certificate and their consequences: the rules of a step and Lemma 4 of docs/proofs.md.

use super::apart;
use super::beside;
use super::chain::{Chain, span_is_one};
use super::first_order::FirstOrder;
use super::interval::Interval;
use super::lines::Links;
use super::path::{Place, Span};
use super::problem::{Checked, ensure, problem};
use super::scene::Scene;
use super::shown::{At, Shown};

/// A step of the file.
pub(super) struct Step {
    pub links: Links,
    pub head: Span,
    pub moving: bool,
    pub clear: bool,
    pub spans: Vec<Span>,
    /// Claim: all boards stay clear of these obstacles.
    pub free: Vec<usize>,
    /// Claim: boards are further apart than these metres.
    pub apart: Option<f64>,
    /// Claim by obstacle: its clearance is more than these metres.
    pub beside: Vec<Option<f64>>,
    /// The places of all listed handles with the head at one place.
    pub at: Vec<Place>,
}

/// The consequences of the steps so far.
pub(super) struct Steps {
    /// The end of the last step.
    pub end: Option<Place>,
    /// The steps that are moving, that are clear, and that have a number `apart`.
    pub moving: Shown,
    pub clear: Shown,
    pub apart: Shown,
    /// By obstacle: the steps that stay clear of it, and those with a number for it.
    pub free: Vec<Shown>,
    pub beside: Vec<Shown>,
    /// Spans of the last step.
    pub spans: Vec<Span>,
    /// Lemma 4: S is not beyond this place, the end of handle 1's span in the first step.
    start_of_second: Option<Place>,
    /// Lemma 4: true if handle 2 has come to S.
    has_come: bool,
    /// Lemma 4: true if f > 0 for all links but the head's in every step.
    bodies_moving: bool,
    /// Counts for the report.
    pub steps: u64,
    pub links: u64,
    pub pairs: u64,
}

impl Steps {
    /// Begins at the start of a motion among some obstacles.
    pub fn new(obstacles: usize) -> Self {
        Self {
            end: None,
            moving: Shown::NOTHING,
            clear: Shown::NOTHING,
            apart: Shown::NOTHING,
            free: vec![Shown::NOTHING; obstacles],
            beside: vec![Shown::NOTHING; obstacles],
            spans: Vec::new(),
            start_of_second: None,
            has_come: false,
            bodies_moving: true,
            steps: 0,
            links: 0,
            pairs: 0,
        }
    }

    /// Begins where handle 1 has come from far out, and everything further out is shown: in Lemma 4, S is out there.
    pub fn far_out() -> Self {
        Self { start_of_second: Some(Place(0, f64::INFINITY, 0.0)), has_come: true, ..Self::new(0) }
    }

    /// Checks a step and adds its consequences.
    ///
    /// # Errors
    /// The condition that does not follow.
    pub fn add(&mut self, scene: &Scene, step: Step) -> Checked {
        let Step { links, head, moving, spans, .. } = &step;
        let Span(from, to) = *head;
        span_is_one(scene, *head).map_err(|problem| problem!("the head: {problem}"))?;
        match self.end {
            Some(end) if end != from => return Err(problem!("it does not begin where the step before it ended")),
            Some(_) if from == to => return Err(problem!("it is empty")),
            None if !scene.path.travelled(from).is_at_most(&Interval::new(0.0)) => {
                return Err(problem!("the first step begins beyond the start"));
            }
            _ => {}
        }
        let chain = Chain::check(scene, *head, spans)?;
        let Some(first) = spans.first() else { return Err(problem!("no span is listed")) };
        let start_of_second = *self.start_of_second.get_or_insert(first.1);
        match links {
            Links::All => self.check_all(scene, &chain, start_of_second)?,
            Links::Front => self.check_front(scene, &chain, start_of_second)?,
        }
        self.moving.add(At::Head(to), moving.then_some(0.0), "claims to be moving")?;
        if let Some(link) = chain.products.iter().position(|product| *moving && !product.is_positive()) {
            return Err(problem!("it claims to be moving, but link {link} may stall"));
        }
        self.add_clear(scene, &chain, &step)?;
        self.add_apart(scene, &chain, &step)?;
        self.steps += 1;
        self.links += chain.products.len() as u64;
        self.end = Some(to);
        self.spans = step.spans;
        Ok(())
    }

    /// Checks that the step shows all links, and prepares Lemma 4.
    fn check_all(&mut self, scene: &Scene, chain: &Chain, start_of_second: Place) -> Checked {
        if chain.last() < scene.team.benches && !chain.ends_on_line(scene) {
            return Err(problem!("not all links are listed, and the last handle listed is not on a line without end"));
        }
        self.bodies_moving &= chain.products[1..].iter().all(Interval::is_positive);
        let handle_2 = chain.capsules.get(2).map(|capsule| capsule.span.0);
        let has_come = handle_2.is_some_and(|place| scene.path.in_order(start_of_second, place));
        self.has_come |= has_come && self.bodies_moving;
        Ok(())
    }

    /// Checks Lemma 4 for the links that are not listed.
    fn check_front(&mut self, scene: &Scene, chain: &Chain, start_of_second: Place) -> Checked {
        if scene.team.benches == 1 {
            return Ok(());
        }
        let Some(body) = chain.products.get(1) else { return Err(problem!("links 0 and 1 are not both listed")) };
        let lists_tail = chain.last() == scene.team.benches || chain.ends_on_line(scene);
        if scene.team.own_tail().is_some() && !lists_tail {
            return Err(problem!("the tail has a size of its own, but not all links are listed (Lemma 4)"));
        }
        self.bodies_moving &= body.is_positive();
        let is_ahead = scene.path.in_order(start_of_second, chain.capsules[1].span.0);
        let problem = if !self.bodies_moving {
            "a body link may not have moved forward"
        } else if !self.has_come {
            "handle 2 has not come to the start of handle 1 in a step about all links"
        } else if !is_ahead {
            "handle 1 may be behind its start"
        } else {
            return Ok(());
        };
        Err(problem!("{problem} (Lemma 4)"))
    }

    /// Adds the claims that boards do not touch and stay clear of some obstacles.
    fn add_clear(&mut self, scene: &Scene, chain: &Chain, step: &Step) -> Checked {
        let Step { links, head: Span(_, to), clear, free, .. } = step;
        self.clear.add(At::Head(*to), clear.then_some(0.0), "claims to be clear")?;
        if *clear {
            self.pairs += apart::check(scene, *links, chain, 0.0, None)?;
        }
        let mut claims = vec![None; scene.obstacles.len()];
        for obstacle in free {
            let claim = claims.get_mut(*obstacle);
            let claim = claim.ok_or_else(|| problem!("it names the obstacle {obstacle}, which the scene has not"))?;
            *claim = Some(0.0);
        }
        add_all(&mut self.free, &claims, *to)?;
        beside::check(scene, *links, chain, &claims, None)
    }

    /// Adds the claims that boards are further apart than some metres, and further from obstacles.
    fn add_apart(&mut self, scene: &Scene, chain: &Chain, step: &Step) -> Checked {
        let Step { links, head: Span(_, to), apart, beside: claims, at, .. } = step;
        let (named, obstacles) = (claims.len(), scene.obstacles.len());
        ensure!(named <= obstacles, "it names {named} obstacles, expected at most {obstacles}");
        self.apart.add(At::Head(*to), *apart, "says how far boards are apart")?;
        add_all(&mut self.beside, claims, *to)?;
        if apart.is_none() && claims.iter().all(Option::is_none) {
            return Ok(());
        }
        let step = FirstOrder::new(scene, chain, at)?;
        if let Some(metres) = *apart {
            self.pairs += apart::check(scene, *links, chain, metres, Some(&step))?;
        }
        beside::check(scene, *links, chain, claims, Some(&step))
    }
}

/// Adds a step's claims about obstacles: metres by number, none for those after the last.
fn add_all(shown: &mut [Shown], claims: &[Option<f64>], to: Place) -> Checked {
    for (number, shown) in shown.iter_mut().enumerate() {
        let metres = claims.get(number).copied().flatten();
        shown.add(At::Head(to), metres, format_args!("states a clearance of obstacle {number}"))?;
    }
    Ok(())
}
