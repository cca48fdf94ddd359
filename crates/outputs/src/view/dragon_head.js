// The dragon's head and tail of the lantern look, seen from above, each drawn once. Both look to the right; lengths are
// metres before they are enlarged.

import { blank } from "./sprites.js";

/** A tongue of flame from a base to a tip, `wide` at the base and bent to one side. */
function flame(context, [bx, by], [tx, ty], wide, bend) {
  const dx = tx - bx, dy = ty - by, length = Math.hypot(dx, dy), nx = -dy / length, ny = dx / length;
  const at = (along, aside) => [bx + dx * along + nx * aside, by + dy * along + ny * aside];
  context.beginPath();
  context.moveTo(...at(0, wide));
  context.bezierCurveTo(...at(0.4, wide + bend), ...at(0.7, bend), tx, ty);
  context.bezierCurveTo(...at(0.6, bend - wide), ...at(0.3, -wide), ...at(0, -wide));
  context.closePath();
}

function paint(context, fill, stroke, width) {
  context.fillStyle = fill;
  context.fill();
  if (!stroke) return;
  Object.assign(context, { strokeStyle: stroke, lineWidth: width });
  context.stroke();
}

function ellipse(context, x, y, wide, high, turn, fill) {
  context.beginPath();
  context.ellipse(x, y, wide, high, turn, 0, 7);
  context.fillStyle = fill;
  context.fill();
}

function gradient(context, kind, place, ...stops) {
  const made = kind === "line" ? context.createLinearGradient(...place) : context.createRadialGradient(...place);
  for (const [at, colour] of stops) made.addColorStop(at, colour);
  return made;
}

/** The mane's ranks, from the lowest: the flames' colour and edge. */
const MANE = [["#7c0d12", "#3a0507"], ["#c3161a", "#6d0a0d"], ["#f0601a", "#a8300c"], ["#ffb43a", "#d06a10"]];

function mane(context) {
  MANE.forEach(([colour, edge], rank) => {
    const count = 6 - rank;
    for (let k = 0; k < count; k++) {
      const angle = (0.1 + (0.9 * k) / count) * 1.15, long = 0.62 - 0.1 * rank - (rank < 2 ? 0.05 * k : 0);
      const base = [-0.78 - 0.05 * k - 0.16 * Math.cos(angle), 0.24 * Math.sin(angle)],
          tip = [-0.84 - 1.35 * long * Math.cos(angle), long * Math.sin(angle) + 0.02];
      flame(context, base, tip, 0.07 - 0.008 * rank, 0.05);
      paint(context, colour, edge, 0.008);
    }
  });
}

function horns(context) {
  for (const [width, colour] of [[0.085, "#3a1a04"], [0.062, "#a86a1c"], [0.036, "#e8b44a"], [0.012, "#fff0b8"]]) {
    Object.assign(context, { strokeStyle: colour, lineWidth: width });
    context.beginPath();
    context.moveTo(-0.62, 0.14);
    context.bezierCurveTo(-0.85, 0.3, -1, 0.26, -1.28, 0.4);
    context.moveTo(-0.9, 0.265);
    context.quadraticCurveTo(-0.98, 0.38, -1.02, 0.5);
    context.stroke();
  }
}

function ears(context) {
  flame(context, [-0.56, 0.22], [-0.8, 0.52], 0.08, -0.05);
  paint(context, "#138a66", "#06402f", 0.014);
  flame(context, [-0.56, 0.23], [-0.72, 0.44], 0.04, -0.03);
  paint(context, "#ff8fa0");
  // The frill of the cheeks.
  for (let k = 0; k < 4; k++) {
    flame(context, [-0.34 - 0.07 * k, 0.19 + 0.012 * k], [-0.46 - 0.1 * k, 0.36 - 0.02 * k], 0.05, 0.02);
    paint(context, k % 2 ? "#ffcf5a" : "#1da37a", "#5a2404", 0.01);
  }
}

/** Half of the skull's outline, from the snout to the neck. */
const SKULL = [[0, 0.1, -0.05, 0.15, -0.13, 0.155], [-0.2, 0.16, -0.24, 0.11, -0.3, 0.13],
    [-0.36, 0.16, -0.38, 0.27, -0.52, 0.27], [-0.68, 0.27, -0.78, 0.2, -0.86, 0.1]];

function skull(context) {
  context.beginPath();
  for (const side of [1, -1]) {
    context.moveTo(0, 0);
    for (const curve of SKULL) context.bezierCurveTo(...curve.map((one, k) => (k % 2 ? side * one : one)));
    context.lineTo(-0.86, 0);
    context.closePath();
  }
}

/** Paper over a frame, lit from within, with scales. */
function lacquer(context) {
  skull(context);
  Object.assign(context, { strokeStyle: "#4a0608", lineWidth: 0.036 });
  context.stroke();
  paint(context, gradient(context, "line", [-0.86, 0, 0, 0], [0, "#8f0d14"], [0.35, "#d8261c"], [0.7, "#ff8a24"],
      [1, "#ffd77a"]));
  context.save();
  context.clip();
  context.fillStyle = gradient(context, "disc", [-0.42, 0, 0.02, -0.42, 0, 0.36], [0, "rgba(255,246,200,.95)"],
      [0.35, "rgba(255,205,100,.6)"], [1, "rgba(255,120,30,0)"]);
  context.fillRect(-1, -0.4, 1, 0.8);
  Object.assign(context, { strokeStyle: "rgba(110,16,8,.55)", lineWidth: 0.008 });
  for (let row = 0; row < 6; row++) {
    for (let k = -3; k <= 3; k++) {
      context.beginPath();
      context.arc(-0.58 - 0.045 * row, (k + (row % 2) / 2) * 0.075, 0.04, -1.2, 1.2);
      context.stroke();
    }
  }
  context.restore();
  // The ridge of the nose.
  Object.assign(context, { strokeStyle: "#fff3c4", lineWidth: 0.03 });
  context.beginPath();
  context.moveTo(-0.1, 0);
  context.lineTo(-0.5, 0);
  context.stroke();
  Object.assign(context, { strokeStyle: "#a8300c", lineWidth: 0.008 });
  context.beginPath();
  for (let k = 0; k < 6; k++) {
    context.moveTo(-0.16 - 0.055 * k, -0.05);
    context.quadraticCurveTo(-0.19 - 0.055 * k, 0, -0.16 - 0.055 * k, 0.05);
  }
  context.stroke();
}

function face(context) {
  ellipse(context, -0.07, 0.085, 0.056, 0.046, 0.4, "#5a0c06");
  ellipse(context, -0.07, 0.085, 0.046, 0.036, 0.4, "#ffc04a");
  ellipse(context, -0.058, 0.088, 0.022, 0.017, 0.4, "#2a0404");
  // An eye is a lamp under a brow of jade.
  ellipse(context, -0.415, 0.165, 0.1, 0.072, 0.3, "#3a0506");
  ellipse(context, -0.4, 0.168, 0.074, 0.052, 0.3, gradient(context, "disc", [-0.395, 0.17, 0.005, -0.4, 0.168, 0.075],
      [0, "#fffbe0"], [0.45, "#ffe27a"], [1, "#ff9a1e"]));
  ellipse(context, -0.378, 0.174, 0.03, 0.022, 0.3, "#120202");
  ellipse(context, -0.37, 0.166, 0.008, 0.008, 0, "#ffffff");
  for (const [colour, wide, up] of [["#053d2c", 0.05, 0], ["#17a57e", 0.042, 0.004], ["#8df0c4", 0.014, 0.012]]) {
    flame(context, [-0.27, 0.105 + up], [-0.66, 0.2 + up], wide, 0.02);
    paint(context, colour);
  }
}

/** The head: a canvas of `long` by `wide` metres, whose snout ends `front` metres from its left edge. */
export function headPicture() {
  const long = 2.1, wide = 1.4, front = long - 0.06, perMetre = 260, [canvas, context] = blank(long * perMetre,
      wide * perMetre);
  const both = (part) => {
    for (const side of [1, -1]) {
      context.save();
      context.scale(1, side);
      part(context);
      context.restore();
    }
  };
  context.scale(perMetre, perMetre);
  context.translate(front, wide / 2);
  context.lineJoin = context.lineCap = "round";
  [mane, horns, ears].forEach(both);
  // The lower jaw.
  ellipse(context, -0.12, 0, 0.15, 0.135, 0, "#8c1016");
  lacquer(context);
  both(face);
  return { canvas, long, wide, front };
}

/** The tail: flames in four shades, whose root is `front` metres from the left edge. */
export function tailPicture() {
  const long = 1.5, wide = 1, front = long - 0.3, perMetre = 200, [canvas, context] = blank(long * perMetre,
      wide * perMetre);
  context.scale(perMetre, perMetre);
  context.translate(front, wide / 2);
  for (const [part, colour] of [[1, "#7c0d12"], [0.82, "#c3161a"], [0.62, "#f0701a"], [0.4, "#ffcf5a"]]) {
    for (const [angle, length] of [[0, 1.15], [0.42, 0.9], [-0.42, 0.9], [0.85, 0.6], [-0.85, 0.6]]) {
      context.save();
      context.rotate(angle);
      flame(context, [0.08 * part, 0], [-length * part, 0.03 * Math.sign(angle || 1)], 0.09 * part, 0.03 * part);
      context.restore();
      paint(context, colour);
    }
  }
  return { canvas, long, wide, front };
}
