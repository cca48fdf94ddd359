//! The last row behind a band of the table, from which the band's node chains start.
//!
//! In: that row's pieces. Out: a node at any phase.

use super::polynomial::{from_slopes, horner};
use super::rows::Piece;
use super::track::{Node, Track};
use crate::model::path::Param;

/// The last row behind a band, from which its node chains start.
pub(super) struct Row<'a> {
    track: &'a Track<'a>,
    pieces: Vec<RowPiece>,
}

/// The places of a piece in one row: metres of travel from its centre as a polynomial of beta.
struct RowPiece {
    piece: Piece,
    centre: Param,
    metres: [f64; 6],
}

impl<'a> Row<'a> {
    /// Each piece has the rounding of its own centre, and therefore a jump at its ends, which would make the next band
    /// cut its pieces without need. So every piece continues the one before, and the accumulated rounding is spread
    /// over all phases.
    pub(super) fn new(track: &'a Track<'a>, nodes: &[(Piece, [Node; 5])]) -> Self {
        let mut pieces: Vec<RowPiece> = Vec::with_capacity(nodes.len());
        for &(piece, nodes) in nodes {
            let half = 0.5 * (piece.end - piece.begin);
            let mut metres = from_slopes(nodes.map(|node| -half * node.spacing));
            let centre = nodes[2].at;
            if let Some(before) = pieces.last().filter(|before| before.piece.end == piece.begin) {
                let reached = horner(&before.metres, 1.0).0 - track.path.arc_length(before.centre, centre);
                metres[0] = reached - horner(&metres, -1.0).0;
            }
            pieces.push(RowPiece { piece, centre, metres });
        }
        let drift = pieces.last().map_or(0.0, |last| last.metres[0]);
        for RowPiece { piece, metres, .. } in &mut pieces {
            metres[0] -= drift * 0.5 * (piece.begin + piece.end);
            metres[1] -= drift * 0.5 * (piece.end - piece.begin);
        }
        Self { track, pieces }
    }

    pub(super) fn node(&self, phase: f64) -> Option<Node> {
        let at = self.pieces.partition_point(|known| known.piece.end < phase);
        let RowPiece { piece, centre, metres } = self.pieces.get(at).filter(|known| known.piece.begin <= phase)?;
        let (offset, rate) = horner(metres, piece.beta(phase));
        let at = self.track.advanced(*centre, offset);
        let (tangent, spacing) = (self.track.path.tangent(at), -rate * piece.beta_per_alpha());
        // No link of the band is led from here, so that the heading does not matter.
        Some(Node { at, tangent, spacing, heading: 0.0, heading_rate: 0.0 })
    }
}
