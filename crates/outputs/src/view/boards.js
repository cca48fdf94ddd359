// The boards as rectangles: their places, the nearest two, and the nearest obstacle. Metres of the stage; knows no
// canvas and no page.

import { STRIDE } from "./hermite.js";

/** The length and the width of a bench's board, m. */
export function boardSize(stage, bench) {
  if (bench === 0) return [stage.head_length, stage.head_width];
  return bench + 1 === stage.benches ? [stage.tail_length, stage.tail_width] : [stage.body_length, stage.width];
}

/** The length of a team's longest board, m. */
export const longestOf = (stage) => Math.max(stage.head_length, stage.body_length, stage.tail_length);

/** The width of a team's widest board, m. */
export const widestOf = (stage) => Math.max(stage.head_width, stage.width, stage.tail_width);

/** A bench's rectangle: its middle, its direction, half its length and half its width. */
export function rectangle(stage, places, bench) {
  const k = STRIDE * bench, rear = k + STRIDE;
  const x = places[k] - places[rear], y = places[k + 1] - places[rear + 1], link = Math.hypot(x, y) || 1;
  const [length, width] = boardSize(stage, bench);
  return {
    x: (places[k] + places[rear]) / 2,
    y: (places[k + 1] + places[rear + 1]) / 2,
    c: x / link,
    s: y / link,
    l: length / 2,
    w: width / 2,
  };
}

/** Returns the bench at a place of the stage, at most `most` metres away; -1 for none. */
export function benchAt(stage, places, x, y, most) {
  let best = most, found = -1;
  for (let bench = 0; bench < places.length / STRIDE - 1; bench++) {
    const r = rectangle(stage, places, bench), along = (x - r.x) * r.c + (y - r.y) * r.s,
        across = (y - r.y) * r.c - (x - r.x) * r.s;
    const away = Math.hypot(Math.max(0, Math.abs(along) - r.l), Math.max(0, Math.abs(across) - r.w));
    if (away < best || (away === 0 && best === 0)) [best, found] = [away, bench];
  }
  return found;
}

/** The number of a dragon's boards. */
const countOf = ({ places }) => places.length / STRIDE - 1;

/**
 * Returns the dragon of a bench among several, by its number through all handles; undefined for none of their benches.
 */
export const ownerOf = (dragons, number) =>
  dragons.find((dragon) => number >= dragon.first && number < dragon.first + countOf(dragon));

/** Returns the board of a bench by its number through all handles. */
function boardOf(dragons, number) {
  const { stage, places, first } = ownerOf(dragons, number);
  return rectangle(stage, places, number - first);
}

/**
 * Returns the middle between the nearest points of two boards, one of which is a corner, or of their overlap. The
 * result also has these points as `ends`, and their distance as `away`, m. The boards are of any dragons, numbered
 * through all handles.
 */
export function nearest(dragons, ...pair) {
  const [a, b] = pair.map((number) => boardOf(dragons, number));
  let best = Infinity, place = null;
  for (const [one, other] of [[a, b], [b, a]]) {
    for (const [along, across] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
      const x = one.x + along * one.l * one.c - across * one.w * one.s,
          y = one.y + along * one.l * one.s + across * one.w * one.c;
      const dx = x - other.x, dy = y - other.y, u = dx * other.c + dy * other.s, v = dy * other.c - dx * other.s;
      const nu = Math.max(-other.l, Math.min(other.l, u)), nv = Math.max(-other.w, Math.min(other.w, v)),
          away = Math.hypot(u - nu, v - nv);
      if (away >= best) continue;
      best = away;
      const foot = { x: other.x + nu * other.c - nv * other.s, y: other.y + nu * other.s + nv * other.c };
      place = { x: (x + foot.x) / 2, y: (y + foot.y) / 2, ends: [{ x, y }, foot], away };
    }
  }
  return place;
}

/**
 * Returns the greatest gap between two rectangles along the normals of their sides (separating axis theorem). The gap
 * is negative if they overlap: then its size is the shortest way to separate them.
 */
function gap(a, b) {
  const dx = b.x - a.x, dy = b.y - a.y, cos = Math.abs(a.c * b.c + a.s * b.s), sin = Math.abs(a.c * b.s - a.s * b.c);
  return Math.max(
    Math.abs(dx * a.c + dy * a.s) - a.l - b.l * cos - b.w * sin,
    Math.abs(dy * a.c - dx * a.s) - a.w - b.l * sin - b.w * cos,
    Math.abs(dx * b.c + dy * b.s) - b.l - a.l * cos - a.w * sin,
    Math.abs(dy * b.c - dx * b.s) - b.w - a.l * sin - a.w * cos,
  );
}

/**
 * Calls `found` with each two boards that share no handle and whose gap is at most `most` metres, and with that gap.
 * Boards are compared with the boards of the same and the adjacent squares of a grid. Boards are numbered through all
 * handles: the last handle of a dragon has no bench, so boards of two dragons differ by more than one.
 */
function eachWithin(dragons, most, found) {
  const longest = Math.max(
      ...dragons.map(({ stage }) => Math.hypot(longestOf(stage), widestOf(stage))));
  const side = longest + Math.max(0, most), squares = new Map(), boards = new Map();
  for (const dragon of dragons) {
    const { stage, places, first } = dragon, count = countOf(dragon);
    for (let bench = 0; bench < count; bench++) {
      const board = rectangle(stage, places, bench), number = first + bench;
      const column = Math.floor(board.x / side), row = Math.floor(board.y / side);
      for (let right = -1; right <= 1; right++) {
        for (let up = -1; up <= 1; up++) {
          for (const other of squares.get(`${column + right},${row + up}`) ?? []) {
            if (number - other < 2) continue;
            const apart = gap(boards.get(other), board);
            if (apart <= most) found([other, number], apart);
          }
        }
      }
      boards.set(number, board);
      const key = `${column},${row}`, here = squares.get(key);
      here ? here.push(number) : squares.set(key, [number]);
    }
  }
}

/**
 * Returns the two boards that share no handle and overlap most, and their overlap in metres. Returns null if no two
 * boards are nearer than `tolerance` metres, the rounding of their places.
 */
export function overlapping(dragons, tolerance) {
  let deepest = null;
  eachWithin(dragons, tolerance, (pair, apart) => {
    if (!deepest || -apart > deepest.depth) deepest = { pair, depth: -apart };
  });
  return deepest && { ...deepest, place: nearest(dragons, ...deepest.pair) };
}

/**
 * Returns the nearest two boards that share no handle, and their place; null for teams without two such boards. The
 * search is within the distance of `before`, the nearest two at an earlier moment, or of any two.
 */
export function nearestPair(dragons, before) {
  const start = before ?? anyPair(dragons);
  let best = start && { pair: start, place: nearest(dragons, ...start) };
  if (!best?.place.away) return best;
  eachWithin(dragons, best.place.away, (pair, apart) => {
    if (apart >= best.place.away) return;
    const place = nearest(dragons, ...pair);
    if (place.away < best.place.away) best = { pair, place };
  });
  return best;
}

/** Returns the first two boards that share no handle; null if there are none. */
function anyPair(dragons) {
  const long = dragons.find((dragon) => countOf(dragon) > 2);
  if (long) return [long.first, long.first + 2];
  return dragons.length > 1 ? [dragons[0].first, dragons[1].first] : null;
}

/**
 * The sides of an obstacle of a stage message, each as its two ends, and a circle around them. Boards have to keep the
 * distance `keep` from the sides. A circle has one side, its centre.
 */
export function sidesOf({ kind, keep_out, outline }) {
  const { x, y, heading, curvature } = outline[0];
  if (kind === "circle") {
    const centre = { x: x - Math.sin(heading) / curvature, y: y + Math.cos(heading) / curvature };
    return { keep: keep_out + 1 / curvature, sides: [[centre, centre]], middle: centre, radius: 0 };
  }
  const sides = outline.map(({ x, y, heading, length }) => [{ x, y },
    { x: x + length * Math.cos(heading), y: y + length * Math.sin(heading) }]);
  const middle = { x: 0, y: 0 };
  for (const [from] of sides) {
    middle.x += from.x / sides.length;
    middle.y += from.y / sides.length;
  }
  const radius = Math.max(...sides.flat().map((end) => Math.hypot(end.x - middle.x, end.y - middle.y)));
  return { keep: keep_out, sides, middle, radius };
}

/** Returns the distance of a point from a side, m. */
function awayFrom({ x, y }, [from, to]) {
  const dx = to.x - from.x, dy = to.y - from.y, square = dx * dx + dy * dy || 1;
  const part = Math.max(0, Math.min(1, ((x - from.x) * dx + (y - from.y) * dy) / square));
  return Math.hypot(x - from.x - part * dx, y - from.y - part * dy);
}

/** Returns the nearest points of a board and of a side that does not cross it, as `ends`; and their distance, m. */
function fromSide(board, side) {
  const { x, y, c, s, l, w } = board;
  const onBoard = (end) => [(end.x - x) * c + (end.y - y) * s, (end.y - y) * c - (end.x - x) * s];
  const onStage = (u, v) => ({ x: x + u * c - v * s, y: y + u * s + v * c });
  const [[fu, fv], [tu, tv]] = side.map(onBoard), du = tu - fu, dv = tv - fv, square = du * du + dv * dv || 1;
  const within = (at, most) => Math.max(-most, Math.min(most, at));
  let best = null;
  const take = (...points) => {
    const [u, v, a, b] = points, away = Math.hypot(u - a, v - b);
    if (!(away >= best?.away)) best = { away, points };
  };
  for (const [a, b] of [[fu, fv], [tu, tv]]) take(within(a, l), within(b, w), a, b);
  for (const [u, v] of [[l, w], [l, -w], [-l, w], [-l, -w]]) {
    const part = Math.max(0, Math.min(1, ((u - fu) * du + (v - fv) * dv) / square));
    take(u, v, fu + part * du, fv + part * dv);
  }
  const [u, v, a, b] = best.points;
  return { ends: [onStage(u, v), onStage(a, b)], away: best.away };
}

/** Returns the place between a board and the distance that it has to keep from a side. */
function placeBetween({ ends: [on, off], away }, keep) {
  const share = away > 0 ? (away - keep) / away : 0;
  const x = on.x + share * (off.x - on.x), y = on.y + share * (off.y - on.y);
  return { x: (on.x + x) / 2, y: (on.y + y) / 2, ends: [on, { x, y }], away: away - keep };
}

/** Returns the place between a bench and an obstacle (see `sidesOf`): from the board to the edge of the keep-out. */
export function nearObstacle(dragons, number, { sides, keep }) {
  const board = boardOf(dragons, number);
  return placeBetween(sides.map((side) => fromSide(board, side)).reduce((a, b) => (b.away < a.away ? b : a)), keep);
}

/** Returns the board and the obstacle, by its number in the list, with the least clearance, and its place. */
export function nearestObstacle(dragons, obstacles) {
  let best = null, least = Infinity;
  for (const dragon of dragons) {
    for (let bench = 0; bench < countOf(dragon); bench++) {
      const board = rectangle(dragon.stage, dragon.places, bench), reach = Math.hypot(board.l, board.w);
      obstacles.forEach(({ sides, keep, middle, radius }, obstacle) => {
        // The outline of a boundary is around the boards: its circle excludes no board.
        const beyond = Math.hypot(board.x - middle.x, board.y - middle.y) - radius - reach - keep;
        if (beyond >= least) return;
        for (const side of sides) {
          if (awayFrom(board, side) - reach - keep >= least) continue;
          const found = fromSide(board, side);
          if (found.away - keep >= least) continue;
          least = found.away - keep;
          best = { number: dragon.first + bench, obstacle, place: placeBetween(found, keep) };
        }
      });
    }
  }
  return best;
}
