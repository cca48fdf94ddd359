// The still background of the view from a seat, drawn once for each seat. The background is the stone floor, the night
// over the village, and the heads of the spectators who sit in front. The village stands on a ring around the stage, so
// that another seat sees other houses.

import { blank, hash } from "./sprites.js";

/** The side of the paving, which repeats, and the depths between which the paving fades, m. */
const PAVING = 9.6, FADING = [14, 44];
/** The number of houses of the ring, and the distance at which the village has its true scale, m. */
const HOUSES = 34, USUAL = 38;

const mod = (one, by) => ((one % by) + by) % by;

function shade(context, place, ...stops) {
  const made = context.createLinearGradient(...place);
  for (const [at, colour] of stops) made.addColorStop(at, colour);
  return made;
}

/** The floor: one row of pixels at a time, each with the paving at its own scale. */
export function floorOf(view, { canvas: slabs, perMetre }) {
  const { width, height, eye } = view, [floor, context] = blank(width, height, { alpha: false }),
      pattern = context.createPattern(slabs, "repeat");
  const right = eye.x * view.rightX + eye.y * view.rightY, away = eye.x * view.awayX + eye.y * view.awayY;
  context.fillStyle = "#000";
  context.fillRect(0, 0, width, height);
  for (let row = Math.max(0, Math.floor(view.horizon)); row < height; row++) {
    const here = view.floorAt(row + 0.5);
    if (!here || here.depth > 400) continue;
    const k = view.f / here.depth, part = k / perMetre;
    pattern.setTransform(
        new DOMMatrix([part, 0, 0, part, view.cx - mod(right, PAVING) * k,
        row + 0.5 - mod(-(away + here.away), PAVING) * k]));
    context.fillStyle = pattern;
    context.fillRect(0, row, width, 1);
    // Far slabs are finer than a pixel: one grey in their place.
    const far = Math.min(0.85, (here.depth - FADING[0]) / (FADING[1] - FADING[0]));
    if (far <= 0) continue;
    context.fillStyle = `rgba(96,92,90,${far})`;
    context.fillRect(0, row, width, 1);
  }
  return floor;
}

/** Sky, hills and village, down to the foot of the houses. */
export function nightOf(view, lamp, glow) {
  const { eye, width } = view, foot = view.to(eye.x + view.awayX * view.village, eye.y + view.awayY * view.village, 0);
  const high = Math.max(2, Math.min(view.height, Math.round(foot?.y ?? 2))),
      [canvas, context] = blank(width, high, { alpha: false });
  context.fillStyle = shade(context, [0, 0, 0, high], [0, "#02030a"], [0.6, "#060816"], [0.9, "#120c16"],
      [1, "#1a0e12"]);
  context.fillRect(0, 0, width, high);
  stars(context, width, high, view.seat.turns);
  hills(context, width, high, view.seat.turns);
  // A village at twice the distance is drawn a little larger than it would be.
  const metre = foot ? foot.k * Math.sqrt(view.village / USUAL) : 1;
  houses(context, { width, high, metre, turns: view.seat.turns, lamp, glow });
  watchers(context, width, high, metre);
  return canvas;
}

function stars(context, width, high, turns) {
  for (let star = 0; star < 160; star++) {
    const size = 0.6 + 1.2 * hash(star + 300) ** 4;
    context.fillStyle = `rgba(220,228,255,${0.12 + 0.5 * hash(star) ** 3})`;
    context.fillRect(mod(hash(star + 100) - 6 * turns, 1) * width, hash(star + 200) * high * 0.8, size, size);
  }
}

function hills(context, width, high, turns) {
  for (const [size, foot, colour, seed] of [[0.36, 0.74, "#06070f", 1], [0.2, 0.88, "#05050b", 9]]) {
    context.fillStyle = colour;
    context.beginPath();
    context.moveTo(0, high);
    for (let step = 0; step <= 80; step++) {
      const at = step / 80 - 6 * turns, wave = 0.5 + 0.25 * Math.sin(5.1 * at + seed) + 0.18 *
          Math.sin(11 * at + 2 * seed) + 0.07 * Math.sin(29 * at + seed);
      context.lineTo((step / 80) * width, high * (foot - size * wave));
    }
    context.lineTo(width, high);
    context.fill();
  }
}

/** The width of a house of the ring and of the lane beside it, m. */
const wideOf = (house) => 4 + 3.6 * hash(house + 40), laneOf = (house) => (hash(house + 70) < 0.3 ? 0.8 : 0);
const RING = Array.from({ length: HOUSES }, (_, house) => wideOf(house) + laneOf(house)).reduce((sum, one) => sum +
    one);

function houses(context, { width, high, metre, turns, lamp, glow }) {
  // The house at the picture's left edge.
  let at = mod(turns * RING - width / 2 / metre, RING), house = 0;
  while (at >= wideOf(house) + laneOf(house)) at -= wideOf(house) + laneOf(house++);
  for (let x = -at * metre; x < width; house = (house + 1) % HOUSES) {
    context.save();
    context.setTransform(metre, 0, 0, -metre, x, high);
    houseOf(context, house, lamp, glow);
    context.restore();
    x += (wideOf(house) + laneOf(house)) * metre;
  }
}

/** Steps of a gable, and the height of a step, m. */
const STEPS = 3, STEP = 0.5;

/** A house whose gables rise in steps, the horse's head of the region: white walls lit from below, black tiles. */
function houseOf(context, house, lamp, glow) {
  const wide = wideOf(house), top = 2.9 + 1.5 * hash(house + 60), tread = wide / (2 * STEPS + 1);
  context.fillStyle = shade(context, [0, 0, 0, top + STEPS * STEP], [0, "#7a3d1a"], [0.18, "#4e2714"],
      [0.45, "#2c1710"], [1, "#120b0e"]);
  context.beginPath();
  context.moveTo(0, 0);
  for (let step = 0; step <= STEPS; step++) {
    context.lineTo(step * tread, top + step * STEP);
    context.lineTo((step + 1) * tread, top + step * STEP);
  }
  for (let step = STEPS; step >= 0; step--) {
    context.lineTo(wide - (step + 1) * tread, top + step * STEP);
    context.lineTo(wide - step * tread, top + step * STEP);
  }
  context.lineTo(wide, 0);
  context.fill();
  for (let step = 0; step <= STEPS; step++) {
    for (const left of step === STEPS ? [step * tread] : [step * tread, wide - (step + 1) * tread]) tiles(context,
        left, tread, top + step * STEP);
  }
  if (hash(house + 9) < 0.65) window_(context, wide * (0.3 + 0.24 * hash(house + 3)), top - 1.3,
      0.4 + 0.4 * hash(house + 5));
  door(context, wide / 2, lamp, glow);
}

/** A run of tiles with its ends bent up. */
function tiles(context, left, long, y) {
  context.fillStyle = "#040406";
  context.beginPath();
  context.moveTo(left - 0.16, y - 0.03);
  context.lineTo(left - 0.26, y + 0.24);
  context.quadraticCurveTo(left - 0.05, y + 0.1, left + 0.2, y + 0.11);
  context.lineTo(left + long - 0.2, y + 0.11);
  context.quadraticCurveTo(left + long + 0.05, y + 0.1, left + long + 0.26, y + 0.24);
  context.lineTo(left + long + 0.16, y - 0.03);
  context.fill();
  context.fillStyle = "rgba(160,96,60,.16)";
  context.fillRect(left, y - 0.05, long, 0.02);
}

function window_(context, x, y, alpha) {
  context.fillStyle = "#2a1408";
  context.fillRect(x - 0.06, y - 0.06, 0.92, 0.82);
  context.globalAlpha = alpha;
  context.fillStyle = shade(context, [0, y + 0.7, 0, y], [0, "#ffb24a"], [1, "#b85a1a"]);
  context.fillRect(x, y, 0.8, 0.7);
  context.globalAlpha = 1;
  context.fillStyle = "#3a1c0a";
  for (let bar = 1; bar < 4; bar++) context.fillRect(x + 0.2 * bar - 0.015, y, 0.03, 0.7);
  for (let bar = 1; bar < 3; bar++) context.fillRect(x, y + 0.233 * bar - 0.015, 0.8, 0.03);
}

/** A door between red couplets and two lanterns. */
function door(context, x, lamp, glow) {
  context.fillStyle = "#0a0406";
  context.fillRect(x - 0.55, 0, 1.1, 1.75);
  context.fillStyle = "#060306";
  context.fillRect(x - 0.9, 1.78, 1.8, 0.12);
  context.fillStyle = "#9c1a10";
  for (const side of [-1, 1]) context.fillRect(x + side * 0.7 - 0.08, 0.45, 0.16, 1.15);
  for (const side of [-1, 1]) {
    const at = x + side * 1.15, y = 1.95;
    context.globalCompositeOperation = "lighter";
    context.globalAlpha = 0.8;
    context.drawImage(glow, at - 1.5, y - 1.5, 3, 3);
    context.globalCompositeOperation = "source-over";
    context.globalAlpha = 1;
    context.save();
    context.scale(1, -1);
    context.drawImage(lamp, at - 0.21, -y - 0.31, 0.42, 0.62);
    context.restore();
  }
}

/** The spectators who stand at the far side, lit by the dragon. */
function watchers(context, width, high, metre) {
  for (let k = 0; k < width / (0.4 * metre); k++) {
    const x = (k + 0.6 * hash(k + 11)) * 0.4 * metre, tall = (1.42 + 0.3 * hash(k + 12)) *
        (hash(k + 77) < 0.1 ? 1.22 : 1) * metre;
    context.fillStyle = shade(context, [0, high - tall, 0, high], [0, "#8a4520"], [0.12, "#5a2a16"], [0.3, "#2a130d"],
        [1, "#0f0706"]);
    context.beginPath();
    context.ellipse(x, high - tall + 0.12 * metre, 0.095 * metre, 0.125 * metre, 0, 0, 7);
    context.fill();
    context.beginPath();
    context.moveTo(x - 0.24 * metre, high);
    // A cubic reaches three quarters of the way to its control points.
    const shoulders = high - (tall - 0.2 * metre) / 0.75;
    context.bezierCurveTo(x - 0.26 * metre, shoulders, x + 0.26 * metre, shoulders, x + 0.24 * metre, high);
    context.fill();
  }
}

/** The spectators who sit in front: shadows with a rim of light. The canvas is as wide as the picture. */
export function frontRow({ width, height }) {
  const [canvas, context] = blank(width, Math.max(1, Math.round(0.2 * height))), size = 0.115 * height,
      apart = 0.92 * size;
  const rim = Math.max(1.2, 0.0026 * height);
  for (let k = -1; k < width / apart + 1; k++) {
    const x = (k + 0.4 * hash(k + 500)) * apart, y = canvas.height - size * (0.5 + 0.24 * hash(k + 600));
    for (const [up, colour] of [[rim, "rgba(255,150,70,.6)"], [0, "#030203"]]) {
      const at = (right, down) => [x + right * size, down === null ? canvas.height : y + down * size - up];
      context.fillStyle = colour;
      context.beginPath();
      context.ellipse(...at(0, 0), 0.165 * size, 0.21 * size, 0.06 * (hash(k + 5) - 0.5), 0, 7);
      context.fill();
      context.beginPath();
      context.moveTo(...at(-0.48, null));
      context.bezierCurveTo(...at(-0.46, 0.24), ...at(-0.16, 0.24), ...at(-0.1, 0.14));
      context.lineTo(...at(0.1, 0.14));
      context.bezierCurveTo(...at(0.16, 0.24), ...at(0.46, 0.24), ...at(0.48, null));
      context.fill();
    }
  }
  return canvas;
}
