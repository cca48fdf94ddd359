//! The certificate of a greatest ratio. See "The file" in `docs/proofs.md`.

use std::io;

use super::{GreatestRatio, RatioSearch, Stretch};
use crate::capsule::Spanned;
use crate::clearance::Write;
use crate::grid::{GridPoint, fine_place};
use crate::interval::Interval;
use crate::lines::{About, CertificateLine, CertifiedResult, CertifiedSpeed};
use crate::place::Place;
use bench_dragon_motion::Motion;
use bench_dragon_motion::event::Progress;

/// The share of the tolerance that the search uses: the checker has other capsules, and its bounds may be a little
/// greater.
const SHARE: f64 = 0.9;
/// The share of a ratio by which the checker's enclosure of it may be wider.
const SPARE: f64 = 2e-12;

/// Encloses the greatest ratio as [`super::greatest_ratio`] does, and writes a certificate that no handle exceeds
/// `limit` metres per second. `scene` is the text of the motion's scene. The
/// search gives up after `most_handles`.
///
/// # Errors
/// A line cannot be written.
pub fn certify_greatest_ratio(
    motion: &Motion,
    travelled: f64,
    (tolerance, limit): (f64, f64),
    scene: &str,
    most_handles: u64,
    write: Write<'_>,
    progress: Progress<'_>,
) -> io::Result<GreatestRatio> {
    let (version, about) = (env!("CARGO_PKG_VERSION"), Some(About::GreatestSpeed));
    write(&CertificateLine::Certificate { format: crate::FORMAT, version, about, scene })?;
    let search = RatioSearch::new(motion, travelled, most_handles);
    search.speeds.chain.branches.iter().try_for_each(|branch| write(&branch.line()))?;
    let mut steps: Vec<Stretch> = Vec::new();
    let found = search.run(SHARE * tolerance, Some(&mut steps), progress);
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let undecided = || io::Error::other("no certificate is written: the greatest speed is not decided");
    if !found.proved {
        return Err(undecided());
    }
    // Halves leave room for the checker, whose bounds may be a little wider.
    let halves = steps.iter().flat_map(|(from, to)| {
        let middle = 0.5 * from + 0.5 * to;
        [(*from, middle), (middle, *to)]
    });
    for (from, to) in halves {
        let (spans, at) = search.places(from, to).ok_or_else(undecided)?;
        let (from, to) = (search.grid_point(from).head, search.grid_point(to).head);
        write(&CertificateLine::Speeds { from, to, spans, at })?;
    }
    if found.handle > 0 {
        let (spans, at) = search.places(found.travelled, found.travelled).ok_or_else(undecided)?;
        write(&CertificateLine::Fast { handle: found.handle, spans, at })?;
    }
    let ratio_lo = if found.handle > 0 { found.lo * (1.0 - SPARE) } else { found.lo };
    let ratio_hi = if found.hi > 1.0 { (found.lo * (1.0 + tolerance)).max(found.hi) } else { found.hi };
    let (value_lo, value_hi) = GreatestRatio { lo: ratio_lo, hi: ratio_hi, ..found }.divide(limit);
    let time = Interval::point(travelled).over(Interval::point(motion.head_speed())).lo * (1.0 - 1e-15);
    let (handle, time_until) = (found.handle, time.max(0.0));
    let result = CertifiedSpeed { limit, value_lo, value_hi, ratio_lo, ratio_hi, handle, time_until };
    write(&CertificateLine::Result(CertifiedResult::GreatestSpeed(result)))?;
    Ok(GreatestRatio { lo: ratio_lo, hi: ratio_hi, ..found })
}

impl RatioSearch<'_> {
    /// Returns the spans of the handles over a step that no later handle can make faster, and a place of each.
    fn places(&self, from: f64, to: f64) -> Option<(Vec<crate::Span>, Vec<Place>)> {
        let chain = &self.speeds.chain;
        let exact = &chain.exact;
        let [mut from, mut middle, mut to] =
            [from, 0.5 * from + 0.5 * to, to].map(|travelled| self.grid_point(travelled));
        let handles: Vec<Spanned> = chain.spans_until(&mut from, &mut to, |handles| self.speeds.is_enough(handles))?;
        let inside = |handle: &Spanned, place: Place| {
            exact.is_inside(place) && exact.in_order(handle.span.0, place) && exact.in_order(place, handle.span.1)
        };
        if !inside(&handles[0], middle.head) {
            middle = GridPoint::at(from.head, from.travelled);
        }
        middle.extend_to(handles.len() - 1, chain.path, chain.team).ok()?;
        let solved = middle.handles.iter().map(|handle| fine_place(handle.param));
        let at: Vec<Place> = std::iter::once(middle.head).chain(solved.skip(1)).take(handles.len()).collect();
        let holds = handles.iter().zip(&at).all(|(handle, place)| inside(handle, *place));
        holds.then(|| (handles[1..].iter().map(|handle| handle.span).collect(), at))
    }
}
