// The camera: from metres to pixels and back. Shows everything, one bench, or a fixed view; may be turned.

import { longestOf, widestOf } from "./boards.js";
import { STRIDE } from "./hermite.js";

/** The margin on each side of everything shown, as a share of its size. */
const MARGIN = 0.05;
/** Boards of the longest kind that fit the shorter side of the picture while one bench is followed. */
const BOARDS_FOLLOWED = 2.5;
/** The share of the frame below which the frame is fitted again. The frame is also fitted when something leaves it. */
const LEAST_FILLED = 0.75;
/** The time in which the camera moves most of the way to a new frame, ms. */
const EASING = 700;
/**
 * The room ahead of a head that moves outward: metres, at most a head's board, and at least this share of the shorter
 * side.
 */
const LEAD = 3, LEAD_SHARE = 0.12;
/** The distance of a head from the middle of the box, as a share of half the box, beyond which it needs room. */
const OUTER = 0.7;

export class Camera {
  constructor() {
    this.width = this.height = this.ratio = 1;
    /** The middle of the frame and its half sizes, along the screen's axes; and their targets. */
    this.frame = this.goal = null;
    /** The greatest distance of a bench from the centre so far, m. */
    this.reach = 1;
    /** True for a user who prefers no motion: a new frame is shown at once. */
    this.still = false;
    this.followed = 0;
    this.turn(0);
    this.whole();
  }

  /** Turns the picture by degrees, counter-clockwise. */
  turn(degrees) {
    [this.c, this.s] = degrees % 90 ? [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)]
        : [[1, 0], [0, 1], [-1, 0], [0, -1]][((degrees / 90) % 4 + 4) % 4];
  }

  whole() {
    this.mode = "whole";
    this.zoom = 1;
    this.stale = true;
    if (this.frame) this.aim(this.frame);
  }

  /** Keeps a bench (from 0) in the middle. */
  follow(bench) {
    Object.assign(this, { mode: "bench", followed: bench, zoom: 1 });
  }

  /** Shows a place and its surroundings, in metres along the shorter side. */
  view(x, y, metres) {
    Object.assign(this, { mode: "free", x, y, zoom: 1, metres });
  }

  /** Resets the choices that were made for another team. */
  forget() {
    this.frame = this.goal = null;
    if (this.mode === "free" && !this.metres) this.mode = "whole";
    this.zoom = 1;
  }

  /**
   * Updates the frame. `teams` are all teams, each with `stage` and `places`, and `followed` is the team of the
   * followed bench. The camera keeps up with `rate`, the simulated seconds per second of the fastest show.
   */
  update(teams, passed, followed = teams[0], rate = 1) {
    this.longest = Math.max(...teams.map(({ stage }) => longestOf(stage)));
    const all = teams.map(({ stage, places }) => this.box(stage, places)).reduce(around), { places } = followed;
    const boards = teams.reduce((box, { stage, places }) => this.ahead(box, all, stage, places), all);
    const box = teams.flatMap(({ stage }) => this.obstacles(stage)).reduce(around, boards);
    if (!this.goal || this.stale || outgrown(this.goal, box)) this.goal = grown(box);
    if (!this.frame || this.stale) this.frame = this.goal;
    this.stale = false;
    const part = this.still ? 1 : 1 - Math.exp((-passed * Math.max(1, rate)) / EASING),
        close = Math.max(...this.frame.map((one, k) => Math.abs(one - this.goal[k]))) < 1e-4 * this.goal[2];
    this.frame = close ? this.goal : this.frame.map((one, k) => one + part * (this.goal[k] - one));
    if (this.mode === "whole") this.aim(this.frame);
    const k = STRIDE * Math.min(this.followed, places.length / STRIDE - 1);
    if (this.mode === "bench") [this.x, this.y] = places.slice(k, k + 2);
  }

  aim([right, up]) {
    [this.x, this.y] = [right * this.c + up * this.s, up * this.c - right * this.s];
  }

  /** Returns the box of a team, along the screen's axes: the middle and half the sizes. */
  box(stage, places) {
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let k = 0; k < places.length; k += STRIDE) {
      const x = places[k] * this.c - places[k + 1] * this.s, y = places[k] * this.s + places[k + 1] * this.c;
      if (x < left) left = x;
      if (x > right) right = x;
      if (y < low) low = y;
      if (y > high) high = y;
    }
    const edge = widestOf(stage) + stage.hole_inset;
    return [(left + right) / 2, (low + high) / 2, (right - left) / 2 + edge, (high - low) / 2 + edge];
  }

  /** Returns the boxes of the obstacles of a stage, without its boundary, whose streets may be long. */
  obstacles({ obstacles = [] }) {
    const sides = obstacles.filter(({ kind }) => kind !== "boundary").flatMap(({ outline }) => outline);
    return sides.map(({ x, y, heading, length, curvature }) => {
      const c = Math.cos(heading), s = Math.sin(heading), radius = curvature ? 1 / curvature : length / 2;
      const [cx, cy] = curvature ? [x - radius * s, y + radius * c] : [x + radius * c, y + radius * s];
      return [cx * this.c - cy * this.s, cx * this.s + cy * this.c, Math.abs(radius), Math.abs(radius)];
    });
  }

  /** Returns a box with room ahead of a head that leaves the box `all` of everything, in the outer part of it. */
  ahead(box, [x, y, wide, high], stage, places) {
    const [px, py, heading] = places, { c, s } = this, dx = Math.cos(heading), dy = Math.sin(heading);
    const lead = Math.max(Math.min(LEAD, stage.head_length), 2 * LEAD_SHARE * Math.min(wide, high));
    const axes = [[px * c - py * s, dx * c - dy * s, x, wide], [px * s + py * c, dx * s + dy * c, y, high]];
    const room = axes.map(([at, along, middle, half]) => {
      const isLeaving = Math.abs(at - middle) > OUTER * half && (at - middle) * along > 0;
      return isLeaving ? at + Math.sign(along) * lead * Math.abs(along) : at;
    });
    return around(box, [room[0], room[1], 0, 0]);
  }

  /** Pixels of the screen (not of the canvas) for a metre. */
  get scale() {
    const shorter = Math.min(this.width, this.height);
    if (this.mode === "whole" && this.frame) return this.zoom * Math.min(this.width / this.frame[2],
        this.height / this.frame[3]) / 2;
    if (this.mode === "bench") return (this.zoom * shorter) / (BOARDS_FOLLOWED * (this.longest ?? 1));
    return (this.zoom * shorter) / (this.metres || 10);
  }

  /** Sizes of words and signs: they grow with the picture, so that they are readable from the same distance. */
  get unit() {
    return Math.max(1, Math.min(this.width, this.height) / 800);
  }

  /** Returns the camera as it is kept. */
  kept() {
    const { mode, followed, x, y, zoom, metres, c, s } = this;
    return { mode, followed, x, y, zoom, metres: metres ?? null, c, s };
  }

  /** Takes a kept camera; false if it is none. */
  recall({ mode, followed, x, y, zoom, metres, c, s }) {
    const isPlace = [x, y, c, s].every(Number.isFinite) && Math.abs(Math.hypot(c, s) - 1) < 1e-9,
        isSize = zoom > 0 && zoom < Infinity && (metres === null || (metres > 0 && metres < Infinity));
    if (!["whole", "bench", "free"].includes(mode) || !(Number.isInteger(followed) && followed >= 0) || !isPlace ||
        !isSize) return false;
    Object.assign(this, { mode, followed, x, y, zoom, metres, c, s, stale: true });
    if (mode === "whole" && this.frame) this.aim(this.frame);
    return true;
  }

  toPixel(x, y) {
    const dx = x - this.x, dy = y - this.y, { scale, c, s } = this;
    return [this.width / 2 + (dx * c - dy * s) * scale, this.height / 2 - (dx * s + dy * c) * scale];
  }

  toStage(x, y) {
    const right = (x - this.width / 2) / this.scale, up = (this.height / 2 - y) / this.scale;
    return [this.x + right * this.c + up * this.s, this.y + up * this.c - right * this.s];
  }

  /** From now on only the user moves it. */
  release() {
    if (this.mode === "free") return;
    const { scale } = this;
    this.mode = "free";
    this.metres = null;
    this.zoom = (scale * 10) / Math.min(this.width, this.height);
  }

  /** Moves the picture by pixels. */
  pan(x, y) {
    this.release();
    const right = -x / this.scale, up = y / this.scale;
    this.x += right * this.c + up * this.s;
    this.y += up * this.c - right * this.s;
  }

  /** Makes the picture `by` times as large around a pixel. */
  zoomAt(by, x = this.width / 2, y = this.height / 2) {
    if (this.mode === "whole") this.release();
    const [before, above] = this.toStage(x, y), { scale } = this;
    // From a millimetre across the screen to fifty times everything.
    const most = Math.min(this.width, this.height) / 1e-3, least = Math.min(this.width,
        this.height) / (50 * this.reach);
    this.zoom *= Math.min(most, Math.max(least, by * scale)) / scale;
    if (this.mode === "bench") return;
    const [after, below] = this.toStage(x, y);
    this.x += before - after;
    this.y += above - below;
  }
}

/** Returns the box around two boxes. */
function around([x, y, wide, high], [bx, by, bw, bh]) {
  const [left, right, low, top] = [Math.min(x - wide, bx - bw), Math.max(x + wide, bx + bw),
      Math.min(y - high, by - bh), Math.max(y + high, by + bh)];
  return [(left + right) / 2, (low + top) / 2, (right - left) / 2, (top - low) / 2];
}

const grown = ([x, y, wide, high]) => [x, y, wide * (1 + MARGIN), high * (1 + MARGIN)];

/** Returns true if a box has left a frame, or become small in it. */
function outgrown([x, y, wide, high], [bx, by, bw, bh]) {
  const outside = Math.abs(bx - x) + bw > wide || Math.abs(by - y) + bh > high;
  return outside || (bw < LEAST_FILLED * wide && bh < LEAST_FILLED * high);
}
