// The places of words on the picture. A label is never read as that of another board: it stands at its own board, or a
// line leads from it to that board. Pixels of the screen; knows no canvas and no page.
//
// A board is { x, y, c, s, l, w, free }: middle, direction, half length, half width, and a share of the half length. On
// that share no other board of the chain lies. A box is { x, y, half, tall }: middle, half width, half height. A line
// is { from, to }.

/** The side of the squares of the map of boards (px). */
const SQUARE = 4;
/** Directions around a place, and distances from it in units, that are tried. */
const DIRECTIONS = 32, DISTANCES = [16, 28, 44, 66, 94, 130, 175, 230, 300];
/** The cost of a box that covers nothing but boards, and of one that covers a ring, in units of a line's length. */
const COVERING = 90, ON_RING = 200;
/** The cost of a move since the last layout, for each unit, and at most. */
const MOVING = 0.25, MOST_MOVING = 60;
/** Units within which a box stands at its own board, so that it needs no line. */
const AT_BOARD = 8;
/** The least length of a line to a place without a board, in units. */
const LEAST_LINE = 6;
/** The radius of the sign at an event's place, in units: its line ends there. */
export const RING = 27;

/** Returns the distance from the place of an item without a board at which its line ends, in units. */
export const shortOf = ({ hasRing }) => (hasRing ? RING : 4);

/** Returns the distance from a point to a board. */
export function toBoard({ x, y, c, s, l, w }, px, py) {
  const dx = px - x, dy = py - y;
  return Math.hypot(Math.max(0, Math.abs(dx * c + dy * s) - l), Math.max(0, Math.abs(dy * c - dx * s) - w));
}

/** Returns the point of a board at a share of half its length from its middle. */
export const along = ({ x, y, c, s, l }, share) => ({ x: x + share * l * c, y: y + share * l * s });

/** Returns the distance from a board to a box, sampled. */
function boardToBox(board, { x, y, half, tall }) {
  let least = Infinity;
  for (let i = -6; i <= 6; i++) for (let j = -2; j <= 2; j++) least = Math.min(least,
      toBoard(board, x + (i / 6) * half, y + (j / 2) * tall));
  return least;
}

const areApart = (a, b, gap) => Math.abs(a.x - b.x) > a.half + b.half + gap ||
    Math.abs(a.y - b.y) > a.tall + b.tall + gap;
const side = (a, b, p) => (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
const cross = (p, q) => side(p.from, p.to, q.from) * side(p.from, p.to, q.to) < 0 &&
    side(q.from, q.to, p.from) * side(q.from, q.to, p.to) < 0;

/** Returns true if a predicate holds somewhere along a line, sampled. */
function someAlong({ from, to }, count, holds) {
  for (let k = 0; k <= count;
      k++) if (holds(from.x + ((to.x - from.x) * k) / count, from.y + ((to.y - from.y) * k) / count)) return true;
  return false;
}
const meetsBox = (line, { x, y, half, tall }, gap = 2) => someAlong(line, 24, (px, py) => Math.abs(px - x) < half +
    gap && Math.abs(py - y) < tall + gap);
const meetsBoard = (line, board) => someAlong(line, 40, (px, py) => toBoard(board, px, py) < 1.5);
function meetsRing({ from, to }, { x, y, radius }) {
  const dx = to.x - from.x, dy = to.y - from.y,
      part = Math.max(0, Math.min(1, ((x - from.x) * dx + (y - from.y) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(from.x + part * dx - x, from.y + part * dy - y) < radius;
}
const coversRing = (box, { x, y, radius }) => Math.hypot(Math.max(0, Math.abs(x - box.x) - box.half),
    Math.max(0, Math.abs(y - box.y) - box.tall)) < radius;

/** The squares of the picture that boards cover. */
class BoardMap {
  constructor(boards, width, height) {
    this.columns = Math.ceil(width / SQUARE) + 1;
    this.rows = Math.ceil(height / SQUARE) + 1;
    this.covered = new Uint8Array(this.columns * this.rows);
    for (const board of boards) {
      const reach = board.l + board.w, { x, y } = board;
      for (let row = Math.max(0, Math.floor((y - reach) / SQUARE));
          row <= Math.min(this.rows - 1, (y + reach) / SQUARE); row++) {
        for (let column = Math.max(0, Math.floor((x - reach) / SQUARE));
            column <= Math.min(this.columns - 1, (x + reach) / SQUARE); column++) {
          if (toBoard(board, column * SQUARE, row * SQUARE) === 0) this.covered[row * this.columns + column] = 1;
        }
      }
    }
  }

  /** Returns the share of a box that boards cover. */
  share({ x, y, half, tall }) {
    let [covered, all] = [0, 0];
    for (let py = y - tall; py <= y + tall; py += SQUARE) {
      for (let px = x - half; px <= x + half; px += SQUARE) {
        const column = Math.round(px / SQUARE), row = Math.round(py / SQUARE);
        all++;
        if (column >= 0 && row >= 0 && column < this.columns && row < this.rows) covered += this.covered[
            row * this.columns + column];
      }
    }
    return covered / all;
  }
}

/**
 * Places labels in the order of their importance. Each of `items` has a `key` and the size of its box, `half` and
 * `tall`. Each item also has either `board` (an index among `boards`) or the place `x`, `y` of an event. `marked`:
 * indices of outlined boards; `rings`: { x, y, radius }; `keep`: boxes that are taken; `last`: the earlier offsets by
 * key.
 *
 * Returns a label for each item: `box`, its `line` (null for a badge), and the end `share` of the line on the board.
 * `isBadge` marks a label without room, whose number stands on the board itself.
 */
export function layout({ boards, items, rings, marked, keep, width, height, unit, last }) {
  const map = new BoardMap(boards, width, height), boxes = [...keep], lines = [], placed = [];
  // Words cover no place and no board that other words need for the end of their line.
  const places = items.filter(({ board }) => board === undefined).map((item) => ({ ...item, item, half: 0, tall: 0 }));
  const uncovered = [...new Set([...marked, ...items.flatMap(({ board }) => board ?? [])])];
  const spine = (board) => ({ from: along(board, 1), to: along(board, -1) });
  for (const item of items) {
    const own = item.board === undefined ? null : boards[item.board],
        others = marked.filter((k) => k !== item.board).map((k) => boards[k]);
    const ends = own ? [0, own.free, -own.free].map((share) => ({ share, ...along(own, share) }))
        : [{ share: 0, x: item.x, y: item.y }];
    const foreign = own ? rings : rings.filter(({ x, y }) => Math.hypot(x - item.x, y - item.y) > 1);
    let best = null;
    // With `relaxed`, boxes and lines may meet rings, and lines to events may cross outlined boards.
    const attempt = (end, angle, far, relaxed) => {
      const c = Math.cos(angle), s = Math.sin(angle), { half, tall } = item;
      const box = { x: end.x + c * (far * unit + half * Math.abs(c)), y: end.y + s * (far * unit + tall * Math.abs(s)),
          half, tall };
      if (box.x - half < 2 || box.y - tall < 2 || box.x + half > width - 2 || box.y + tall > height - 2) return;
      if (boxes.some((one) => !areApart(box, one, 3 * unit))) return;
      if (places.some((one) => one.item !== item && !areApart(box, one, 4 * unit))) return;
      const dx = end.x - box.x, dy = end.y - box.y, away = Math.hypot(dx, dy) || 1,
          out = Math.min(1, half / Math.abs(dx || 1e-9), tall / Math.abs(dy || 1e-9));
      if (!own && (1 - out) * away < (shortOf(item) + LEAST_LINE) * unit) return;
      const short = own ? 0 : (shortOf(item) * unit) / away, line = { from: { x: box.x + dx * out, y: box.y + dy * out },
          to: { x: end.x - dx * short, y: end.y - dy * short } };
      const length = Math.hypot(line.from.x - line.to.x, line.from.y - line.to.y) / unit;
      if (best && length >= best.cost) return;
      if (uncovered.some((k) => meetsBox(spine(boards[k]), box, boards[k].w))) return;
      if (lines.some((one) => cross(line, one) || meetsBox(one, box)) ||
          boxes.some((one) => meetsBox(line, one))) return;
      if ((!relaxed || own) && others.some((board) => meetsBoard(line, board))) return;
      const onRing = foreign.some((ring) => meetsRing(line, ring)) || rings.some((ring) => coversRing(box, ring));
      if (onRing && !relaxed) return;
      const before = last.get(item.key), moved = before ? Math.hypot(before.x - (box.x - end.x),
          before.y - (box.y - end.y)) / unit : 0;
      const cost = length + COVERING * map.share(box) + (onRing ? ON_RING : 0) + Math.min(MOST_MOVING, MOVING * moved);
      if (!best || cost < best.cost) best = { cost, box, line, share: end.share };
    };
    for (const relaxed of [false, true]) {
      for (const end of best ? [] : ends) {
        for (let turn = 0; turn < DIRECTIONS; turn++) for (const far of DISTANCES) attempt(end,
            (2 * Math.PI * turn) / DIRECTIONS, far, relaxed);
      }
    }
    if (!best) {
      // A number on the board itself cannot be read as another board's.
      placed.push(own ? { item, box: { x: own.x, y: own.y, half: 0, tall: 0 }, line: null, share: 0, isBadge: true }
          : null);
      continue;
    }
    const { box, line, share } = best;
    boxes.push(box);
    if (!own || !standsAtOwn(own, boards, box, unit)) lines.push(line);
    placed.push({ item, box, line, share, isBadge: false });
  }
  return placed.filter(Boolean);
}

/** Returns the distance from the middle of a box from which a board is too far to be taken for the box's own. */
export const beyond = ({ half, tall }, unit) => Math.hypot(half, tall) + 3 * AT_BOARD * unit;

/** Returns true if a box is at its own board, and more than twice as far from every other: it then needs no line. */
export function standsAtOwn(own, boards, box, unit) {
  const near = boardToBox(own, box), centre = toBoard(own, box.x, box.y);
  if (near >= AT_BOARD * unit) return false;
  return boards.every((board) => {
    if ((board.x === own.x && board.y === own.y) || toBoard(board, box.x, box.y) > beyond(box, unit)) return true;
    return toBoard(board, box.x, box.y) > centre && boardToBox(board, box) > 2 * near + 2;
  });
}
