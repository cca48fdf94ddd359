// The boards as rectangles: their places, and the nearest two. Metres of the stage; knows no canvas and no page.

import { STRIDE } from "./hermite.js";

/** A bench's rectangle: its middle, its direction, half its length and half its width. */
export function rectangle(stage, places, bench) {
  const k = STRIDE * bench, rear = k + STRIDE;
  const x = places[k] - places[rear], y = places[k + 1] - places[rear + 1], link = Math.hypot(x, y) || 1;
  return {
    x: (places[k] + places[rear]) / 2,
    y: (places[k + 1] + places[rear + 1]) / 2,
    c: x / link,
    s: y / link,
    l: (bench === 0 ? stage.head_length : stage.body_length) / 2,
    w: stage.width / 2,
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
 * Returns the middle between the nearest points of two boards, one of which is a corner, or of their overlap; with
 * these points as `ends`, and their distance `away`, m. The boards are of any dragons, numbered through all handles.
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
 * Returns the greatest gap between two rectangles along the normals of their sides (separating axis theorem). It is
 * negative if they overlap: then its size is the shortest way to separate them.
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
 * Boards are compared with those of the same and the adjacent squares of a grid. They are numbered through all handles:
 * the last handle of a dragon has no bench, so boards of two dragons differ by more than one.
 */
function eachWithin(dragons, most, found) {
  const longest = Math.max(
      ...dragons.map(({ stage }) => Math.hypot(Math.max(stage.head_length, stage.body_length), stage.width)));
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
 * Returns the two boards that share no handle and overlap most, and their overlap in metres; null if no two boards are
 * nearer than `tolerance` metres, the rounding of their places.
 */
export function overlapping(dragons, tolerance) {
  let deepest = null;
  eachWithin(dragons, tolerance, (pair, apart) => {
    if (!deepest || -apart > deepest.depth) deepest = { pair, depth: -apart };
  });
  return deepest && { ...deepest, place: nearest(dragons, ...deepest.pair) };
}

/** Returns the nearest two boards that share no handle, and their place; null if none are within `most` metres. */
export function nearestPair(dragons, most) {
  let best = null;
  eachWithin(dragons, most, (pair) => {
    const place = nearest(dragons, ...pair);
    if (place.away < (best?.place.away ?? Infinity)) best = { pair, place };
  });
  return best;
}
