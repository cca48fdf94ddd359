// The dragon's head and tail in three dimensions, for the view from a seat: balls of lit paper and tapered tufts.
// Metres: `u` forward, `v` to the left, `w` up. The origin is 1.1 m behind the end of the head's board, and at the end
// of the tail's board.

import { hash } from "./sprites.js";

/** Colours of tufts from their root to their tip, and of their dark rim. */
const FIRE = ["#7c0b10", "#c91a16", "#f0501a", "#ff9a2e", "#ffd873"], FIRE_RIM = "#3a0405";
const HORN = ["#6a3509", "#d8922a", "#ffcf6a", "#fff3c4"], HORN_RIM = "#331602";
const LEAF = ["#04382a", "#0f8a64", "#35c898", "#c4ffe6"], LEAF_RIM = "#021d14";
const GILT = ["#ffb43a", "#ffdf90", "#fff6d8"], GILT_RIM = "#5a2404";
/** The width of a tuft's rim, m, and the least width, pixels. */
const RIM = 0.014, LEAST_RIM = 0.7;

/** The profile of skull and muzzle: forward, up, radius. */
const SKULL = [[-0.12, 2.13, 0.4], [0.04, 2.18, 0.44], [0.2, 2.22, 0.41], [0.36, 2.23, 0.34], [0.54, 2.18, 0.285],
    [0.72, 2.13, 0.25], [0.9, 2.1, 0.235], [1.04, 2.11, 0.215], [1.19, 2.13, 0.165]];
/** Balls of the profile. */
const SMOOTH = 30;

/** Returns the profile at a share of its length. */
function profile(share) {
  const at = share * (SKULL.length - 1), k = Math.min(SKULL.length - 2, Math.floor(at)), part = at - k;
  return SKULL[k].map((one, axis) => one + (SKULL[k + 1][axis] - one) * part);
}

const bothSides = (make) => [1, -1].forEach(make);

/** A figure that is being put together. */
class Figure {
  constructor() {
    this.balls = [];
    this.tufts = [];
  }

  ball(u, v, w, radius, kind) {
    this.balls.push({ u, v, w, radius, kind });
  }

  /** A tuft through places `at` of a share from 0 to 1: u, v, w and the radius. */
  tuft(count, at, colours, rim) {
    this.tufts.push({ points: Array.from({ length: count }, (_, k) => at(k / (count - 1))), colours, rim });
  }
}

/** The head at a show time: the jaw, the mane and the whiskers move. */
export function headFigure(time) {
  const figure = new Figure(), jaw = 0.11 + 0.07 * Math.sin(3.1 * time);
  neck(figure, time);
  for (let k = 0; k < SMOOTH; k++) {
    const [u, w, radius] = profile(k / (SMOOTH - 1));
    figure.ball(u, 0, w, radius, "skin");
  }
  bothSides((side) => cheek(figure, side));
  // The ridge of the nose, and the mouth with its lower jaw and its tongue of fire.
  for (let k = 0; k < 10; k++) figure.ball(0.42 + 0.082 * k, 0, 2.47 - 0.031 * k + (k > 6 ? 0.024 * (k - 6) : 0),
      0.058, "gold");
  for (let k = 0; k < 9; k++) figure.ball(0.34 + (0.68 * k) / 8, 0, 1.85 - jaw * (0.4 + (1.2 * k) / 8),
      0.2 - (0.075 * k) / 8, "skin");
  for (let k = 0; k < 6; k++) figure.ball(0.6 + 0.1 * k, 0, 1.94 - jaw * (0.8 + 0.25 * k), 0.09 - 0.009 * k, "flame");
  bothSides((side) => teeth(figure, side, jaw));
  bothSides((side) => eye(figure, side));
  bothSides((side) => horns(figure, side));
  mane(figure, time);
  bothSides((side) => greens(figure, side, time, jaw));
  bothSides((side) => {
    // A whisker from the nostril, forward, then back.
    const at = (q) => [1.18 + 0.42 * Math.sin(2.8 * q) - 0.55 * q, (0.17 + 0.95 * q) * side,
        2.08 + 0.4 * q * Math.sin(3.6 * q + 1.5 * time), 0.03 * (1 - 0.75 * q)];
    figure.tuft(16, at, GILT, GILT_RIM);
  });
  return figure;
}

function neck(figure, time) {
  for (let k = 0; k < 18;
      k++) figure.ball(-1.75 + 0.097 * k, 0, 1.36 + 0.036 * (k * k) / 14 + 0.02 * Math.sin(3 * time + 0.55 * k),
      0.2 + 0.009 * k, k % 4 === 1 ? "gold" : "skin");
}

function cheek(figure, side) {
  figure.ball(0.24, 0.28 * side, 2.0, 0.24, "skin");
  figure.ball(0.36, 0.26 * side, 1.97, 0.2, "skin");
  figure.ball(0.08, 0.4 * side, 1.98, 0.13, "gold");
  figure.ball(-0.04, 0.43 * side, 2.12, 0.11, "gold");
  figure.ball(1.2, 0.1 * side, 2.2, 0.095, "gold");
  figure.ball(1.272, 0.118 * side, 2.205, 0.042, "dark");
}

function teeth(figure, side, jaw) {
  for (let k = 0; k < 7; k++) figure.ball(0.64 + 0.08 * k, (0.216 - 0.012 * k) * side, 1.94, k === 5 ? 0.056 : 0.036,
      "white");
  for (let k = 0; k < 6; k++) figure.ball(0.62 + 0.075 * k, (0.15 - 0.01 * k) * side, 1.99 - jaw * (1.15 + 0.13 * k),
      0.028, "white");
}

function eye(figure, side) {
  figure.ball(0.43, 0.265 * side, 2.375, 0.168, "gold");
  figure.ball(0.5, 0.292 * side, 2.385, 0.135, "white");
  figure.ball(0.6, 0.335 * side, 2.395, 0.064, "dark");
  figure.ball(0.648, 0.352 * side, 2.42, 0.018, "white");
}

function horns(figure, side) {
  figure.tuft(10, (q) => [0.02 - 0.95 * q, (0.18 + 0.34 * q) * side, 2.5 + 0.7 * Math.sin(1.75 * q),
      0.092 * (1 - 0.8 * q)], HORN, HORN_RIM);
  figure.tuft(5, (q) => [-0.36 - 0.02 * q, (0.31 + 0.24 * q) * side, 2.88 + 0.36 * q, 0.06 * (1 - 0.8 * q)],
      HORN.slice(1), HORN_RIM);
  figure.tuft(5, (q) => [-0.62 + 0.1 * q, (0.4 + 0.1 * q) * side, 3.05 + 0.3 * q, 0.046 * (1 - 0.8 * q)],
      HORN.slice(1), HORN_RIM);
}

/** Three rings of flames behind the skull, the innermost the lightest. */
const RINGS = [[1.25, 0.46, FIRE.slice(0, 3)], [0.95, 0.4, FIRE.slice(1, 4)], [0.62, 0.36, FIRE.slice(2)]], FLAMES = 17;

function mane(figure, time) {
  RINGS.forEach(([reach, out, colours], ring) => {
    for (let flame = 0; flame < FLAMES; flame++) {
      const angle = -0.75 + ((flame + (ring % 2) / 2) / 16) * (Math.PI + 1.5),
          long = reach * (0.8 + 0.4 * hash(flame + 20 * ring)), c = Math.cos(angle), s = Math.sin(angle);
      const at = (q) => [
        0.1 * ring - 0.08 - long * q, c * (out + 0.34 * q * q) + 0.1 * q * Math.sin(4 * time - 3.4 * q + flame),
        2.16 + s * (out + 0.38 * q * q) + 0.06 * q * Math.cos(3.3 * time - 3 * q + flame), 0.1 * (1 - q ** 1.4),
      ];
      figure.tuft(9, at, colours, FIRE_RIM);
    }
  });
}

/** Brow, beard and ear. */
function greens(figure, side, time, jaw) {
  for (let k = 0; k < 3;
      k++) figure.tuft(7, (q) => [0.66 - 0.64 * q - 0.05 * k, (0.3 + 0.05 * q) * side, 2.5 + 0.05 * k +
      (0.1 + 0.1 * k) * q, 0.07 * Math.sin(Math.PI * (0.2 + 0.8 * q))], LEAF.slice(k === 2 ? 1 : 0), LEAF_RIM);
  for (let k = 0; k < 5;
      k++) figure.tuft(7, (q) => [0.95 - 0.13 * k - 0.18 * q, (0.1 + 0.02 * k) * side,
      1.74 - 1.4 * jaw - (0.42 - 0.04 * k) * q + 0.03 * Math.sin(3 * time + k + 2 * q), 0.05 * (1 - 0.95 * q)], LEAF,
      LEAF_RIM);
  figure.tuft(7, (q) => [-0.05 - 0.44 * q, (0.4 + 0.36 * q) * side, 2.2 + 0.24 * q,
      0.1 * Math.sin(Math.PI * (0.3 + 0.7 * q))], LEAF, LEAF_RIM);
}

/** The tail at a show time. */
export function tailFigure(time) {
  const figure = new Figure();
  for (let k = 0; k < 5; k++) figure.ball(0.5 - 0.13 * k, 0, 1.36, 0.2 - 0.01 * k, k % 2 ? "gold" : "skin");
  for (let rank = 0; rank < 2; rank++) {
    for (let flame = -3; flame <= 3; flame++) {
      const long = (1.35 - 0.35 * rank) * (1 - 0.1 * Math.abs(flame)), up = 0.95 - 0.12 * Math.abs(flame) + 0.2 * rank;
      const at = (q) => [
        -0.05 - long * q, 0.1 * flame * (0.5 + 2.1 * q) + 0.1 * q * Math.sin(4 * time - 3 * q + flame),
        1.34 + up * q + 0.05 * q * Math.sin(3 * time + flame), 0.12 * (1 - q ** 1.4),
      ];
      figure.tuft(9, at, rank ? FIRE.slice(2) : FIRE.slice(0, 3), FIRE_RIM);
    }
  }
  return figure;
}

/** Draws a figure at a place of the stage that looks along `c`, `s`. `balls` are the pictures by their kinds. */
export function drawFigure(context, view, figure, { x, y, c, s }, balls) {
  const place = (u, v, w) => view.to(x + u * c - v * s, y + u * s + v * c, w), parts = [];
  for (const { u, v, w, radius, kind } of figure.balls) {
    const at = place(u, v, w);
    if (at) parts.push({ depth: at.depth, at, radius, kind });
  }
  for (const { points, colours, rim } of figure.tufts) {
    const places = points.map(([u, v, w]) => place(u, v, w));
    if (places.every(Boolean)) parts.push({ depth: places[places.length >> 1].depth, places, points, colours, rim });
  }
  parts.sort((one, other) => other.depth - one.depth);
  context.lineJoin = "round";
  for (const part of parts) {
    if (part.places) {
      tuft(context, part);
      continue;
    }
    const half = part.radius * part.at.k;
    context.drawImage(balls[part.kind], part.at.x - half, part.at.y - half, 2 * half, 2 * half);
  }
}

/** A tapered tuft: its rim, its colours from root to tip, and a line of light along it. */
function tuft(context, { places, points, colours, rim }) {
  const first = places[0], last = places.at(-1), root = points[0][3] * first.k;
  outline(context, places, points, 1);
  Object.assign(context, { strokeStyle: rim, lineWidth: 2 * Math.max(LEAST_RIM, RIM * first.k) });
  context.stroke();
  const long = Math.hypot(last.x - first.x, last.y - first.y);
  // A tuft that points at the eye shows its tip.
  if (long < 1) context.fillStyle = colours.at(-1);
  else {
    const fill = context.createLinearGradient(first.x, first.y, last.x, last.y);
    colours.forEach((colour, k) => fill.addColorStop(k / (colours.length - 1), colour));
    context.fillStyle = fill;
  }
  context.fill();
  if (root < 2.5) return;
  outline(context, places, points, 0.34);
  context.fillStyle = "rgba(255,244,200,.3)";
  context.fill();
}

/** The outline of a tuft, of a share of its width. */
function outline(context, places, points, share) {
  const last = places.length - 1, sides = [[], []];
  for (let k = 0; k <= last; k++) {
    const from = places[Math.max(0, k - 1)], to = places[Math.min(last, k + 1)],
        long = Math.hypot(to.x - from.x, to.y - from.y) || 1, { x, y, k: scale } = places[k];
    const half = (share * points[k][3] * scale) / long, across = half * (to.y - from.y), along = half * (to.x - from.x);
    sides[0].push([x + across, y - along]);
    sides[1].push([x - across, y + along]);
  }
  context.beginPath();
  for (const point of sides[0]) context.lineTo(...point);
  for (const point of sides[1].reverse()) context.lineTo(...point);
  context.closePath();
}
