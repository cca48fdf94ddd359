// The marks on the picture: the next event and its place, the nearest boards now, and the overlap after a contact.

import { nearObstacle, nearest, nearestObstacle, nearestPair, overlapping, ownerOf, sidesOf } from "./boards.js";
import { STRIDE } from "./hermite.js";

/** The greatest error of a gap by the rounding of places to 32 bits, metres for each metre from the centre. */
const ROUNDING = 1e-6;
/** The interval of searches for overlapping boards in a team of more benches than `SMALL`, ms. */
const SEARCH_INTERVAL = 200;
const SMALL = 500;
/** The interval of searches for the nearest boards while a show plays, ms; in a team of more benches than `SMALL`. */
const NEAREST_INTERVAL = 200, NEAREST_OF_MANY = 1000;

/** The benches among these numbers, which count through all handles: the numbers of obstacles follow the handles. */
const benchesAmong = (dragons, ...numbers) => numbers.filter((number) => number != null && ownerOf(dragons, number));

/** The deepest overlap of a stream of pictures, searched only if the publisher reports one. */
export class Overlap {
  constructor() {
    this.found = null;
    this.at = -Infinity;
  }

  look(dragons, newest, reach, now) {
    const tolerance = ROUNDING * Math.max(1, reach);
    if (!(newest.clearance <= tolerance)) return (this.found = null);
    if (newest.handles.length / STRIDE > SMALL && now - this.at < SEARCH_INTERVAL) return this.found;
    this.at = now;
    return (this.found = overlapping(dragons, tolerance));
  }
}

/**
 * The nearest two boards, and the board nearest to an obstacle. The boards are searched a few times a second; their
 * places are computed for each picture.
 */
export class Nearest {
  constructor() {
    this.stage = this.pair = this.met = this.key = null;
    this.at = -Infinity;
  }

  /** Returns the lines, at most one of each kind; none without a clearance, and none where boards or obstacles meet. */
  look(dragons, newest, { stage, shown, now }) {
    if (this.stage !== stage) {
      const obstacles = stage.obstacles.filter(({ outline }) => outline.length);
      Object.assign(this, { stage, obstacles, shapes: obstacles.map(sidesOf), pair: null, met: null, key: null,
          at: -Infinity });
    }
    if (!(newest.clearance > 0)) return [];
    const key = [newest.run, shown.from.epoch, shown.time].join();
    const interval = newest.handles.length / STRIDE > SMALL ? NEAREST_OF_MANY : NEAREST_INTERVAL;
    if (this.key !== key && now - this.at >= interval) {
      [this.key, this.at] = [key, now];
      this.pair = nearestPair(dragons, this.pair)?.pair ?? null;
      this.met = nearestObstacle(dragons, this.shapes);
    }
    const lines = [], { pair, met } = this;
    if (pair) lines.push({ benches: pair, place: nearest(dragons, ...pair) });
    if (met) lines.push({ benches: [met.number], obstacle: this.obstacles[met.obstacle],
        place: nearObstacle(dragons, met.number, this.shapes[met.obstacle]) });
    return lines.filter(({ place }) => place.away > 0);
  }
}

/**
 * The marks of a state. Each has the benches it concerns (`pair`, numbers through all handles), a place, and a colour
 * of the palette. A mark also states whether the place is a ghost (in the future), and whether the outlines are dashed.
 * Its `line` is between the two. The caller, which knows the language, sets `text` and `names`. `near` are the lines of
 * `Nearest`.
 */
export function marksOf({ state, alert, dragons, overlap, near }) {
  const still = overlap ? [] : near.map(({ place, benches, obstacle }) => ({ kind: "nearest", pair: [], benches,
      obstacle, place, line: place.ends, ink: "ink" }));
  if (state.severity === "ok" || !alert) return still;
  if (!state.happened) {
    const event = benchesAmong(dragons, alert.event_bench_a, alert.event_bench_b),
        now = benchesAmong(dragons, alert.bench_a, alert.bench_b);
    const marks = [];
    if (now.length === 2) {
      const place = nearest(dragons, ...now);
      marks.push({ kind: "now", pair: now, place, line: place.away > 0 ? place.ends : null, ink: "warning",
          dashes: [7, 5] });
    }
    if (alert.event_x !== null) marks.push({ kind: "coming", pair: event,
        place: { x: alert.event_x, y: alert.event_y }, ink: "danger", ghost: true });
    return [...marks.reverse(), ...still.filter(({ obstacle }) => obstacle || now.length < 2)];
  }
  const marks = [];
  if (overlap) marks.push({ kind: "overlap", pair: overlap.pair, place: overlap.place, ink: "danger" });
  if (state.name === "obstacle") {
    // The point of the board that met the obstacle, as it was then.
    if (alert.event_x !== null) marks.push({ kind: "link", pair: benchesAmong(dragons, alert.event_bench_a),
        place: { x: alert.event_x, y: alert.event_y }, ink: "danger" });
  } else if (state.name !== "contact" && alert.event_bench_a !== null) {
    // A link that stalls or locks is marked at the present place of its rear handle.
    const owner = ownerOf(dragons, alert.event_bench_a), rear = STRIDE *
        (alert.event_bench_a + 1 - (owner?.first ?? 0));
    const place = owner && { x: owner.places[rear], y: owner.places[rear + 1] };
    if (place) marks.push({ kind: "link", pair: [alert.event_bench_a], place, ink: "danger" });
  }
  return marks;
}
