//! The benches of a chain: their true rectangles in metres, coloured by speed, with signs at head and tail.

use svg::node::element::{Circle, Group, Path, Polygon, Polyline};

use super::camera::{Camera, StageBox};
use super::metres;
use super::palette::Palette;
use bench_dragon_motion::model::board::Board;
use bench_dragon_motion::model::separation::separation_board_board;
use bench_dragon_motion::model::team::Team;
use bench_dragon_motion::model::{Point, Vector};
use bench_dragon_motion::solve::Chain;

/// Returns the board of a bench of the dragon whose handles begin at `first`. The heading keeps digits that the
/// difference of two far handles has lost.
fn board_from(team: &Team, chain: &Chain, first: usize, bench: usize) -> Board {
    let handle = first + bench;
    let (sine, cosine) = chain.heading[handle].sin_cos();
    let front = Point::new(chain.x[handle], chain.y[handle]);
    Board::from_front(front, Vector::new(cosine, sine), team.link(bench), team.hole_inset, team.board_width(bench))
}

/// Returns the box of a board.
pub fn extent(board: &Board) -> StageBox {
    let mut extent = StageBox::EMPTY;
    board.corners().into_iter().for_each(|corner| extent.include(corner));
    extent
}

/// Returns the benches that may have a part in a box, with their boards, the head first, of the dragon whose handles
/// begin at `first`.
pub fn seen(team: &Team, chain: &Chain, first: usize, view: &StageBox) -> Vec<(usize, Board)> {
    let boards = (0..team.benches).map(|bench| (first + bench, board_from(team, chain, first, bench)));
    boards.filter(|(_, board)| extent(board).meets(view)).collect()
}

/// Returns the pairs of the given benches whose boards overlap, the lower bench first, with the overlap in metres.
/// Boards that share a handle never count.
pub fn overlapping(boards: &[(usize, Board)], tolerance: f64) -> Vec<(usize, usize, f64)> {
    // Sorted by left ends: only boards that begin before a board's right end can overlap it.
    let mut sorted: Vec<(StageBox, usize, &Board)> =
        boards.iter().map(|(bench, board)| (extent(board), *bench, board)).collect();
    sorted.sort_by(|a, b| a.0.least.x.total_cmp(&b.0.least.x));
    let mut pairs = Vec::new();
    for (index, (extent, bench, board)) in sorted.iter().enumerate() {
        let near = sorted[index + 1..].iter().take_while(|(other, ..)| other.least.x <= extent.greatest.x);
        for (_, other_bench, other) in near.filter(|(other, ..)| other.meets(extent)) {
            let separation = separation_board_board(board, other);
            if bench.abs_diff(*other_bench) > 1 && separation < -tolerance {
                pairs.push((*bench.min(other_bench), *bench.max(other_bench), -separation));
            }
        }
    }
    pairs.sort_by_key(|pair| (pair.0, pair.1));
    pairs
}

/// Returns the corners of a board as an SVG list of points.
pub fn corners(board: &Board) -> String {
    let corners = board.corners().map(|corner| format!("{},{}", metres(corner.x), metres(corner.y)));
    corners.join(" ")
}

/// Returns the boards, the tail at the bottom and the head on top. [`handles`] returns the holes of the handles.
pub fn group(boards: &[(usize, Board)], fill: impl Fn(usize) -> String, camera: &Camera, palette: &Palette) -> Group {
    let mut group = Group::new().set("id", "benches").set("stroke-linejoin", "round");
    let width = boards.iter().map(|(_, board)| 2.0 * board.half_width).reduce(f64::min).unwrap_or(0.0);
    // The least width on the sheet at which an edge is visible.
    if width * camera.scale > 5.0 {
        group = group.set("stroke", palette.ground).set("stroke-width", camera.metres(0.8));
    }
    for (bench, board) in boards.iter().rev() {
        let polygon = Polygon::new().set("id", format!("bench-{bench}"));
        group = group.add(polygon.set("fill", fill(*bench)).set("points", corners(board)));
    }
    group
}

/// Returns the holes of the handles, if they are large enough to be seen.
pub fn handles(team: &Team, chain: &Chain, camera: &Camera, palette: &Palette) -> Group {
    let mut group = Group::new().set("id", "handles").set("fill", palette.ground);
    if team.width * camera.scale < 14.0 {
        return group;
    }
    let radius = team.width / 7.0;
    let view = camera.view().padded(radius);
    for (x, y) in chain.x.iter().zip(&chain.y).filter(|(x, y)| view.contains(Point::new(**x, **y))) {
        group = group.add(Circle::new().set("cx", metres(*x)).set("cy", metres(*y)).set("r", metres(radius)));
    }
    group
}

/// Returns the rectangle of a board, without a colour.
pub fn polygon(board: &Board) -> Polygon {
    Polygon::new().set("points", corners(board))
}

/// Returns the outline of a board, `units` wide, or thinner on a board that is hardly wider.
pub fn outline(board: &Board, colour: &str, units: f64, camera: &Camera) -> Polygon {
    let units = units.min(units * 0.3 * board.half_width * camera.scale).max(0.4 * units);
    let outline = Polygon::new().set("points", corners(board)).set("fill", "none");
    outline.set("stroke", colour).set("stroke-width", camera.metres(units)).set("stroke-linejoin", "round")
}

/// Returns chevrons in the direction of travel, with contrast to any board colour. A board too narrow for them gets a
/// single larger one at its front.
pub fn head_sign(board: &Board, camera: &Camera, palette: &Palette) -> Group {
    let (length, width) = (board.half_length, board.half_width);
    let place = |along: f64, across: f64| board.centre + along * board.axis + across * board.across();
    let mut group = Group::new().set("id", "head").set("fill", "none").set("stroke-linejoin", "round");
    let narrow = width * camera.scale < 3.0;
    let (half, tips) = if narrow { (6.0 / camera.scale, vec![1.0]) } else { (0.6 * width, vec![0.85, 0.55, 0.25]) };
    let line = (0.4 * half).max(1.8 / camera.scale);
    for (colour, line) in [(palette.ground, 2.2 * line), (palette.ink, line)] {
        for tip in &tips {
            let (tip, back) = (tip * length, tip * length - 1.5 * half);
            let points = [place(back, half), place(tip, 0.0), place(back, -half)];
            let points = points.map(|point| format!("{},{}", metres(point.x), metres(point.y))).join(" ");
            let chevron = Polyline::new().set("points", points).set("stroke", colour);
            group = group.add(chevron.set("stroke-width", metres(line)));
        }
    }
    group
}

/// Returns bars across the end, longer than the board's width if that is too narrow to be seen.
pub fn tail_sign(board: &Board, camera: &Camera, palette: &Palette) -> Path {
    let (length, width) = (board.half_length, board.half_width.max(4.0 / camera.scale));
    let place = |along: f64, across: f64| {
        let point = board.centre + along * board.axis + across * board.across();
        format!("{} {}", metres(point.x), metres(point.y))
    };
    let bars = [0.9, 0.7, 0.5].map(|at| format!("M{}L{}", place(-at * length, width), place(-at * length, -width)));
    let line = (0.3 * width).max(1.5 / camera.scale);
    let path = Path::new().set("id", "tail").set("d", bars.concat()).set("fill", "none");
    path.set("stroke", palette.ink).set("stroke-width", metres(line))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lying(x: f64, y: f64) -> Board {
        Board::from_front(Point::new(x, y), Vector::x(), 2.0, 0.5, 1.0)
    }

    #[test]
    fn only_boards_that_overlap_and_share_no_handle_are_pairs() {
        // Boards 3 m long and 1 m wide. Boards 0 and 2 overlap by 0.25 m, and boards 0 and 3 touch. Board 1 overlaps
        // board 0 but shares a handle with it.
        let boards = [(0, lying(0.0, 0.0)), (1, lying(0.5, 0.5)), (2, lying(1.0, 0.75)), (3, lying(0.0, -1.0))];
        let found = overlapping(&boards, 1e-9);
        assert_eq!(found.iter().map(|pair| (pair.0, pair.1)).collect::<Vec<_>>(), [(0, 2)]);
        assert!((found[0].2 - 0.25).abs() < 1e-12, "{found:?}");
    }
}
