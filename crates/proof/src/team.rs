//! The team of benches of a scene.

use serde::Deserialize;

use super::interval::Interval;
use super::problem::{Checked, problem};

/// The sizes that a scene may leave out, metres: those of the paper.
const HEAD_LENGTH: f64 = 3.41;
const BODY_LENGTH: f64 = 2.20;
const WIDTH: f64 = 0.30;
const HOLE_INSET: f64 = 0.275;

/// Limit of benches.
const MOST: usize = 1_000_000;

/// Limit of the width of a head or a tail, in widths of the body, with room for the rounding of decimals.
const MOST_WIDTHS: f64 = 10.0 * (1.0 + 1e-12);

/// The team of benches.
#[derive(Clone)]
pub(super) struct Team {
    pub benches: usize,
    pub hole_inset: Interval,
    /// By kind of bench (head, body, tail): the metres between its handles, and the width of its board.
    links: [Interval; 3],
    widths: [Interval; 3],
    /// True if the tail has a size of its own.
    tail_differs: bool,
}

/// The size of a board, or of a run of boards on one straight line.
#[derive(Clone, Copy)]
pub(super) struct Size {
    /// The metres between its handles.
    pub link: Interval,
    pub hole_inset: Interval,
    pub width: Interval,
}

impl Team {
    /// Returns the metres between the two handles of a bench.
    pub fn link(&self, bench: usize) -> &Interval {
        &self.links[self.kind(bench)]
    }

    fn kind(&self, bench: usize) -> usize {
        if bench > 0 && bench + 1 == self.benches { 2 } else { bench.min(1) }
    }

    /// Returns the kind of a bench's link: 0 for the head's, 2 for that of a tail with a size of its own, 1 for all
    /// others.
    pub fn link_kind(&self, bench: usize) -> usize {
        if self.own_tail() == Some(bench) { 2 } else { bench.min(1) }
    }

    /// Returns the size of the board of a bench.
    pub fn size(&self, bench: usize) -> Size {
        Size { link: *self.link(bench), hole_inset: self.hole_inset, width: self.widths[self.kind(bench)] }
    }

    /// Returns the first benches of the runs of equal boards from a bench on, which is not the head: a tail with a size
    /// of its own is a run by itself.
    pub fn runs(&self, first: usize) -> impl Iterator<Item = usize> + use<> {
        std::iter::once(first).chain(self.own_tail().filter(|tail| first < *tail))
    }

    /// Returns the size of the run of equal boards that begins with a bench, as one board.
    pub fn run(&self, first: usize) -> Size {
        let last = self.own_tail().filter(|tail| first < *tail).map_or(self.benches - 1, |tail| tail - 1);
        Size { link: self.links(first, last), ..self.size(first) }
    }

    /// Returns the tail, if there are benches between it and the head and it has a size of its own: Lemma 4 does not
    /// hold for it.
    pub fn own_tail(&self) -> Option<usize> {
        (self.tail_differs && self.benches > 2).then(|| self.benches - 1)
    }

    /// Returns the longest link and the widest board behind the head's, in metres.
    pub fn behind_head(&self) -> [Interval; 2] {
        [self.links, self.widths].map(|[_, body, tail]| body.max(&tail))
    }

    /// Returns the shortest link, in metres.
    pub fn shortest_link(&self) -> Interval {
        let [head, body, tail] = self.links;
        head.min(&body).min(&tail)
    }

    /// Returns by kind of bench (head, body, tail) the link and the width of the board, in metres.
    pub fn kinds(&self) -> [[Interval; 2]; 3] {
        std::array::from_fn(|kind| [self.links[kind], self.widths[kind]])
    }

    /// Returns the same team in units of `unit` metres.
    pub fn in_units(&self, unit: &Interval) -> Self {
        let Self { benches, hole_inset, links, widths, tail_differs } = self;
        Self {
            benches: *benches,
            hole_inset: hole_inset / unit,
            links: links.map(|link| link / unit),
            widths: widths.map(|width| width / unit),
            tail_differs: *tail_differs,
        }
    }

    /// Returns the same team with boards that are larger by `metres` on each side.
    pub fn grown(&self, metres: &Interval) -> Self {
        Self {
            hole_inset: self.hole_inset + metres,
            widths: self.widths.map(|width| width + metres * Interval::new(2.0)),
            ..self.clone()
        }
    }

    /// Returns the metres of the links from bench `first` to bench `last` in one line.
    pub fn links(&self, first: usize, last: usize) -> Interval {
        let number = |links: usize| Interval::new(links as f64);
        if last > first && self.own_tail() == Some(last) {
            return self.link(first) + self.link(1) * number(last - first - 1) + self.link(last);
        }
        self.link(first) + self.link(1) * number(last - first)
    }
}

/// The table `[team]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TeamText {
    benches: usize,
    head_length: Option<f64>,
    body_length: Option<f64>,
    width: Option<f64>,
    hole_inset: Option<f64>,
    head_width: Option<f64>,
    tail_width: Option<f64>,
    tail_length: Option<f64>,
}

impl TeamText {
    pub fn read(&self) -> Checked<Team> {
        if self.benches == 0 || self.benches > MOST {
            return Err(problem!("team.benches is {}, expected from 1 to {MOST}", self.benches));
        }
        let hole_inset = Interval::positive("team.hole_inset", self.hole_inset.unwrap_or(HOLE_INSET))?;
        let link = |field: &str, length: f64| {
            let link = Interval::positive(field, length)? - Interval::new(2.0) * hole_inset;
            if link.is_positive() { Ok(link) } else { Err(problem!("{field} leaves no bench between its holes")) }
        };
        let (body_length, width) = (self.body_length.unwrap_or(BODY_LENGTH), self.width.unwrap_or(WIDTH));
        let of_end = |field: &str, given: Option<f64>| match given {
            Some(own) if own > MOST_WIDTHS * width => Err(problem!("{field} is more than 10 times team.width")),
            given => Interval::positive(field, given.unwrap_or(width)),
        };
        let tail_length = self.tail_length.unwrap_or(body_length);
        let of_body = Interval::positive("team.width", width)?;
        let widths =
            [of_end("team.head_width", self.head_width)?, of_body, of_end("team.tail_width", self.tail_width)?];
        let head_link = link("team.head_length", self.head_length.unwrap_or(HEAD_LENGTH))?;
        let (body_link, tail_link) = (link("team.body_length", body_length)?, link("team.tail_length", tail_length)?);
        // The second of two benches is the tail.
        let body_link = if self.benches == 2 { tail_link } else { body_link };
        Ok(Team {
            benches: self.benches,
            hole_inset,
            links: [head_link, body_link, tail_link],
            widths,
            tail_differs: tail_length != body_length || self.tail_width.is_some_and(|own| own != width),
        })
    }
}
