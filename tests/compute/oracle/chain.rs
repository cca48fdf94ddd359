//! A team on a path: the places of its handles, the stretches that they cover, and the first stall and lock of any
//! link.
//!
//! A handle's place is a function of the place of the handle ahead. While the head goes from one place to another, the
//! handle therefore covers the image of the stretch that the handle ahead covers. As long as the follower does not
//! jump, this image lies between its places at the ends and at its turning points. So no event between two
//! configurations is missed, however short.

use super::geometry::{Param, Path, Vector};
use super::links::{Configuration, Link};

pub struct Team {
    pub benches: usize,
    pub head_length: f64,
    pub body_length: f64,
    pub tail_length: f64,
    pub head_width: f64,
    pub width: f64,
    pub tail_width: f64,
    pub hole_inset: f64,
}

impl Team {
    fn is_tail(&self, bench: usize) -> bool {
        bench > 0 && bench + 1 == self.benches
    }

    pub fn link(&self, bench: usize) -> f64 {
        let board = match bench {
            0 => self.head_length,
            _ if self.is_tail(bench) => self.tail_length,
            _ => self.body_length,
        };
        board - 2.0 * self.hole_inset
    }

    pub fn width(&self, bench: usize) -> f64 {
        match bench {
            0 => self.head_width,
            _ if self.is_tail(bench) => self.tail_width,
            _ => self.width,
        }
    }
}

/// A stretch of path that a handle covers.
#[derive(Clone, Copy)]
pub struct Span {
    pub low: Param,
    pub high: Param,
}

impl Span {
    fn around(places: impl Iterator<Item = Param>) -> Self {
        let span = places.fold(None, |span: Option<Self>, place| match span {
            None => Some(Self { low: place, high: place }),
            Some(Self { low, high }) => Some(Self {
                low: if place.s < low.s { place } else { low },
                high: if place.s > high.s { place } else { high },
            }),
        });
        span.expect("at least one place")
    }
}

/// The team with its head at one place.
#[derive(Clone)]
pub struct Pose {
    pub head: f64,
    pub handles: Vec<Handle>,
}

#[derive(Clone, Copy)]
pub struct Handle {
    pub place: Param,
    pub point: Vector,
    pub tangent: Vector,
    /// Speed over the head's, positive forward.
    pub speed: f64,
    /// Cosine at the front handle of the bench that this handle leads; NaN for the last handle.
    pub front_cosine: f64,
    pub rear_cosine: f64,
}

/// Returns the distance before a lock within which rounding may have put the team past it, metres.
pub fn last_bits(lock: f64) -> f64 {
    1e-12 * (1.0 + lock)
}

pub struct Chain<'a> {
    pub path: &'a Path,
    pub team: &'a Team,
    links: [Link<'a>; 2],
    /// The link of a tail that differs from the body's.
    tail: Option<Link<'a>>,
}

impl<'a> Chain<'a> {
    pub fn new(path: &'a Path, team: &'a Team) -> Self {
        let tail = (team.benches > 2 && team.tail_length != team.body_length)
            .then(|| Link::new(path, team.link(team.benches - 1)));
        Self { path, team, links: [0, 1].map(|bench| Link::new(path, team.link(bench))), tail }
    }

    fn link(&self, bench: usize) -> &Link<'a> {
        self.tail.as_ref().filter(|_| self.team.is_tail(bench)).unwrap_or(&self.links[bench.min(1)])
    }

    /// Returns true if the searches for stalls and jumps were complete.
    pub fn is_complete(&self) -> bool {
        self.links.iter().chain(&self.tail).all(|link| link.complete)
    }

    pub fn pose(&self, head: f64) -> Pose {
        let mut place = self.path.place_at(head);
        let mut speed = 1.0;
        let mut handles = Vec::with_capacity(self.team.benches + 1);
        for bench in 0..self.team.benches {
            let Configuration { rear, front_cosine, rear_cosine, .. } = self.link(bench).configuration(place);
            let (point, tangent) = self.path.point_and_tangent(place);
            handles.push(Handle { place, point, tangent, speed, front_cosine, rear_cosine });
            place = rear;
            speed *= front_cosine / rear_cosine;
        }
        let (point, tangent) = self.path.point_and_tangent(place);
        handles.push(Handle { place, point, tangent, speed, front_cosine: f64::NAN, rear_cosine: f64::NAN });
        Pose { head, handles }
    }

    /// Returns true if a link stands at the start where its follower has jumped: such a start is illegal.
    pub fn starts_beyond_a_jump(&self) -> bool {
        let beyond =
            |(bench, handle): (usize, &Handle)| self.link(bench).jumps.iter().any(|jump| jump.0 <= handle.place.s);
        self.pose(0.0).handles[..self.team.benches].iter().enumerate().any(beyond)
    }

    /// Returns the stretch that the handle behind covers.
    fn image(&self, bench: usize, span: Span) -> Span {
        let link = self.link(bench);
        let ends = [span.low, span.high].into_iter().map(|place| link.configuration(place).rear);
        Span::around(ends.chain(link.stalls_between(span.low.s, span.high.s).map(|configuration| configuration.rear)))
    }

    /// Returns the stretch that each handle covers while the head goes from one pose to another, with no lock between.
    pub fn spans(&self, from: &Pose, to: &Pose) -> Vec<Span> {
        let mut spans = Vec::with_capacity(from.handles.len());
        let mut turns = false;
        for (k, (one, other)) in from.handles.iter().zip(&to.handles).enumerate() {
            let mut span = Span::around([one.place, other.place].into_iter());
            // Only behind a handle that turns round do the ends not determine the stretch.
            if turns {
                let image = self.image(k - 1, spans[k - 1]);
                span = Span::around([span.low, span.high, image.low, image.high].into_iter());
            }
            turns |= k < self.team.benches && self.link(k).stalls_between(span.low.s, span.high.s).next().is_some();
            spans.push(span);
        }
        spans
    }

    /// Returns the first bench for whose front handle `happens` holds on the stretch covered since the start.
    fn first_bench(&self, head: f64, happens: impl Fn(&Link, Span) -> bool) -> Option<usize> {
        let mut span = Span { low: self.path.place_at(0.0), high: self.path.place_at(head) };
        for bench in 0..self.team.benches {
            if happens(self.link(bench), span) {
                return Some(bench);
            }
            if self.link(bench).jump_between(span.low.s, span.high.s).is_some() {
                return None;
            }
            span = self.image(bench, span);
        }
        None
    }

    /// Returns the least distance of the head up to `most` at which `happens` holds for some bench's stretch, metres.
    fn first(&self, most: f64, happens: impl Fn(&Link, Span) -> bool) -> Option<(f64, usize)> {
        self.first_bench(most, &happens)?;
        let (mut low, mut high) = (0.0, most);
        // Stretches only grow, so a condition that holds once holds for every longer stretch.
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.first_bench(middle, &happens).is_some() { high = middle } else { low = middle }
        }
        // In the last bits before one link's jump its follower may be past the jump, and the next link's follower with
        // it.
        let bench = self.first_bench((high + last_bits(high)).min(most), &happens)?;
        Some((high, bench))
    }

    /// Returns the first lock of any link: metres of the head, the bench, and true if the lock is doubtful.
    pub fn lock(&self) -> Option<(f64, usize, bool)> {
        let jumps = |link: &Link, span: Span| link.jump_between(span.low.s, span.high.s).is_some();
        let (at, bench) = self.first(self.path.end, jumps)?;
        let place = self.pose(at).handles[bench].place.s;
        let nearest = self.link(bench).jumps.iter().min_by(|a, b| (a.0 - place).abs().total_cmp(&(b.0 - place).abs()));
        Some((at, bench, nearest.is_some_and(|(_, doubtful)| *doubtful)))
    }

    /// Returns the first stall of any link before the end of the motion.
    pub fn stall(&self, end: f64) -> Option<(f64, usize)> {
        let start = self.pose(0.0);
        if let Some(bench) = start.handles.iter().position(|handle| handle.front_cosine <= 0.0) {
            return Some((0.0, bench));
        }
        self.first(end, |link, span| link.stalls_between(span.low.s, span.high.s).next().is_some())
    }
}
