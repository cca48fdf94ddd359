//! The steps of a certificate and their consequences: the rules of a step, Lemmas 3 and 4 of docs/proofs.md.

use super::apart;
use super::boards::Board;
use super::capsule::Capsule;
use super::chain::{Chain, span_is_one};
use super::first_order::FirstOrder;
use super::interval::Interval;
use super::lines::Links;
use super::path::{Place, Span};
use super::problem::{Checked, ensure, problem};
use super::scene::Scene;
use super::shown::{At, Shown};
use super::team::Size;
use super::unlisted::{check_ring, first_partner, straight_run};

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
        let Step { links, head, moving, clear, spans, free, apart, beside, at } = step;
        let Span(from, to) = head;
        span_is_one(scene, head).map_err(|problem| problem!("the head: {problem}"))?;
        match self.end {
            Some(end) if end != from => return Err(problem!("it does not begin where the step before it ended")),
            Some(_) if from == to => return Err(problem!("it is empty")),
            None if !scene.path.travelled(from).is_at_most(&Interval::new(0.0)) => {
                return Err(problem!("the first step begins beyond the start"));
            }
            _ => {}
        }
        let chain = Chain::check(scene, head, &spans)?;
        let Some(first) = spans.first() else { return Err(problem!("no span is listed")) };
        let start_of_second = *self.start_of_second.get_or_insert(first.1);
        match links {
            Links::All => self.check_all(scene, &chain, start_of_second)?,
            Links::Front => self.check_front(scene, &chain, start_of_second)?,
        }
        self.add_moving(moving, to, &chain)?;
        self.add_clear(scene, links, clear, to, &chain)?;
        self.add_free(scene, links, &free, to, &chain)?;
        let claims = apart.is_some() || beside.iter().any(Option::is_some);
        let first_order = if claims { Some(FirstOrder::new(scene, &chain, &at)?) } else { None };
        self.add_apart(scene, links, apart.zip(first_order.as_ref()), to, &chain)?;
        self.add_beside(scene, links, (&beside, first_order.as_ref()), to, &chain)?;
        self.steps += 1;
        self.links += chain.products.len() as u64;
        self.end = Some(to);
        self.spans = spans;
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

    fn add_moving(&mut self, moving: bool, to: Place, chain: &Chain) -> Checked {
        if !moving {
            self.moving.all = false;
            return Ok(());
        }
        self.moving.continues("claims to be moving")?;
        if let Some(link) = chain.products.iter().position(|product| !product.is_positive()) {
            return Err(problem!("it claims to be moving, but link {link} may stall"));
        }
        self.moving.extend(At::Head(to), 0.0);
        Ok(())
    }

    fn add_clear(&mut self, scene: &Scene, links: Links, clear: bool, to: Place, chain: &Chain) -> Checked {
        if !clear {
            self.clear.all = false;
            return Ok(());
        }
        self.clear.continues("claims to be clear")?;
        self.pairs += check_clear(scene, links, chain)?;
        self.clear.extend(At::Head(to), 0.0);
        Ok(())
    }

    /// Checks that all boards stay clear of some obstacles (Lemma 9).
    fn add_free(&mut self, scene: &Scene, links: Links, free: &[usize], to: Place, chain: &Chain) -> Checked {
        if scene.obstacles.is_empty() && free.is_empty() {
            return Ok(());
        }
        if let Some(obstacle) = free.iter().find(|obstacle| **obstacle >= scene.obstacles.len()) {
            return Err(problem!("it names the obstacle {obstacle}, which the scene has not"));
        }
        let runs = runs_on_ground(scene, links, chain);
        let boards = boards_on_ground(scene, links, chain, &runs);
        for (number, (obstacle, shown)) in scene.obstacles.iter().zip(&mut self.free).enumerate() {
            if !free.contains(&number) {
                shown.all = false;
                continue;
            }
            shown.continues(&format!("claims to be clear of obstacle {number}"))?;
            if let Some((bench, _)) = boards.iter().find(|(_, board)| !obstacle.is_avoided_by(board)) {
                return Err(problem!("bench {bench}, or one behind it, may be at obstacle {number} (Lemma 9)"));
            }
            shown.extend(At::Head(to), 0.0);
        }
        Ok(())
    }

    fn add_apart(
        &mut self,
        scene: &Scene,
        links: Links,
        apart: Option<(f64, &FirstOrder)>,
        to: Place,
        chain: &Chain,
    ) -> Checked {
        let Some((metres, step)) = apart else {
            self.apart.all = false;
            return Ok(());
        };
        self.apart.continues("says how far boards are apart")?;
        ensure!(metres.is_finite(), "`apart` is {metres:?}, expected a number");
        self.pairs += apart::check(scene, links, chain, step, metres)?;
        self.apart.extend(At::Head(to), metres);
        Ok(())
    }

    /// Checks the clearances of obstacles (Lemma 11).
    fn add_beside(
        &mut self,
        scene: &Scene,
        links: Links,
        (claims, step): (&[Option<f64>], Option<&FirstOrder>),
        to: Place,
        chain: &Chain,
    ) -> Checked {
        if claims.len() > scene.obstacles.len() {
            return Err(problem!("it names {} obstacles, expected at most {}", claims.len(), scene.obstacles.len()));
        }
        let runs = runs_on_ground(scene, links, chain);
        let boards = step.map_or_else(Vec::new, |_| boards_on_ground(scene, links, chain, &runs));
        let first_order = |step: &FirstOrder, bench: usize| {
            let is_listed = bench < chain.last();
            if !is_listed { step.straight_run(bench, &scene.team) } else { step.board(bench, &scene.team) }
        };
        let first_order: Vec<_> = boards.iter().filter_map(|(bench, _)| Some(first_order(step?, *bench))).collect();
        for (number, (obstacle, shown)) in scene.obstacles.iter().zip(&mut self.beside).enumerate() {
            let Some(metres) = claims.get(number).copied().flatten() else {
                shown.all = false;
                continue;
            };
            shown.continues(&format!("states a clearance of obstacle {number}"))?;
            ensure!(metres.is_finite(), "`beside` of obstacle {number} is {metres:?}, expected a number");
            let far = Interval::new(metres);
            let mut pairs = boards.iter().zip(&first_order);
            if let Some(((bench, _), _)) =
                pairs.find(|((_, board), first)| !obstacle.is_further_than(&far, board, first))
            {
                return Err(problem!("bench {bench}, or one behind it, may be nearer to obstacle {number} (Lemma 11)"));
            }
            shown.extend(At::Head(to), metres);
        }
        Ok(())
    }
}

/// The first of some boards on the line without end, the first and the last handle, and their size.
type Run = (usize, Capsule, Capsule, Size);

/// Returns the boards on the line without end that a step does not list: all, or of a step of the front links a tail
/// with a size of its own.
fn runs_on_ground(scene: &Scene, links: Links, chain: &Chain) -> Vec<Run> {
    let last = chain.last();
    let first = if links == Links::All { Some(last) } else { scene.team.own_tail() };
    let first = first.filter(|first| (last..scene.team.benches).contains(first));
    let run = |first: usize| {
        let (front, rear, size) = straight_run(scene, chain, first);
        (first, front, rear, size)
    };
    first.into_iter().flat_map(|first| scene.team.runs(first)).map(run).collect()
}

/// Returns the boards that obstacles concern, with their benches: all, those on the line as one, or boards 0 and 1 and
/// a tail with a size of its own.
fn boards_on_ground<'c>(scene: &Scene, links: Links, chain: &'c Chain, runs: &'c [Run]) -> Vec<(usize, Board<'c>)> {
    let team = &scene.team;
    let concerns = |bench: &usize| links == Links::All || *bench < 2 || team.own_tail() == Some(*bench);
    let mut boards: Vec<(usize, Board)> = (chain.capsules.windows(2).enumerate())
        .filter(|(bench, _)| concerns(bench))
        .map(|(bench, pair)| (bench, Board::new(&pair[0], &pair[1], team.size(bench))))
        .collect();
    boards.extend(runs.iter().map(|(first, front, rear, size)| (*first, Board::new(front, rear, *size))));
    boards
}

/// Checks that no two boards touch that share no handle. A step of the front links concerns only the pairs of Lemma 4. Returns the number of pairs.
fn check_clear(scene: &Scene, links: Links, chain: &Chain) -> Checked<u64> {
    let team = &scene.team;
    let boards: Vec<Board> = (chain.capsules.windows(2).enumerate())
        .map(|(index, pair)| Board::new(&pair[0], &pair[1], team.size(index)))
        .collect();
    let (mut pairs, zero) = (0, Interval::new(0.0));
    for a in 0..boards.len() {
        let Some(first) = first_partner(scene, links, a) else { break };
        for b in first..boards.len() {
            if !boards[a].is_apart_from(&boards[b]) && check_ring(scene, chain, a..a + 1, b, &zero).is_err() {
                return Err(problem!("it claims to be clear, but benches {a} and {b} may touch (Lemma 2)"));
            }
            pairs += 1;
        }
    }
    if chain.last() == team.benches {
        return Ok(pairs);
    }
    if chain.ends_on_line(scene) {
        check_line(scene, links, chain, &boards)?;
        let about = if links == Links::All { boards.len() } else { boards.len().min(2) };
        return Ok(pairs + about as u64);
    }
    // Only a step of the front links gets here.
    check_ring(scene, chain, 0..2, chain.last(), &zero)?;
    Ok(pairs + 2)
}

/// Checks Lemma 3, *Line*: the boards behind the last listed handle are on one line. The listed boards that the step
/// concerns are apart from them, and they are apart from each other.
fn check_line(scene: &Scene, links: Links, chain: &Chain, boards: &[Board]) -> Checked {
    let team = &scene.team;
    let last = chain.last();
    ensure!(
        (team.hole_inset + team.hole_inset).is_below(team.link(1)),
        "it claims to be clear, but benches on a line touch (Lemma 3)"
    );
    for (a, board) in boards.iter().enumerate() {
        let Some(first) = first_partner(scene, links, a) else { break };
        let is_apart = |first: usize| {
            let (front, rear, size) = straight_run(scene, chain, first);
            board.is_apart_from(&Board::new(&front, &rear, size))
        };
        ensure!(
            team.runs(last.max(first)).all(is_apart),
            "it claims to be clear, but bench {a} may touch one on the line (Lemmas 2 and 3)"
        );
    }
    Ok(())
}
