// Pictures that the view from a seat draws many times: lanterns and dancers seen from the side, balls of lit paper,
// reflections. Lengths are metres, upward; each picture is cut once for sizes that are nearly equal.

import { blank } from "./sprites.js";

/** The step of the sizes in which pictures are cut. */
const SIZES = 1.07;
/** The directions and the moments of a step in which dancers are drawn. */
const YAWS = 8, PHASES = 8;
/** The size of a dancer's picture, and of a lantern's, m. */
const PERSON = [1.1, 1.84], LANTERN = [0.42, 0.62];
/** The number of pixels of all kept pictures, from which they are dropped. */
const KEPT = 24e6;

function stops(gradient, colours) {
  colours.forEach(([at, colour]) => gradient.addColorStop(at, colour));
  return gradient;
}

function shape(context, points, fill) {
  context.beginPath();
  context.moveTo(...points[0]);
  for (const point of points.slice(1)) point.length === 2 ? context.lineTo(...point) : point.length === 4
      ? context.quadraticCurveTo(...point) : context.bezierCurveTo(...point);
  context.closePath();
  if (!fill) return;
  context.fillStyle = fill;
  context.fill();
}

function oval(context, x, y, wide, high, fill, turn = 0) {
  context.beginPath();
  context.ellipse(x, y, wide, high, turn, 0, 7);
  context.fillStyle = fill;
  context.fill();
}

function line(context, width, colour, ...points) {
  Object.assign(context, { lineWidth: width, strokeStyle: colour });
  context.beginPath();
  for (const point of points) context.lineTo(...point);
  context.stroke();
}

// Lanterns: a barrel of ribbed red paper, and a hexagon of gold paper with a painted flower.

const BARREL = [[-0.085, 0.1], [-0.19, 0.17, -0.19, 0.43, -0.085, 0.5], [0.085, 0.5],
    [0.19, 0.43, 0.19, 0.17, 0.085, 0.1]];
const HEXAGON = [[-0.105, 0.1], [-0.152, 0.31], [-0.105, 0.5], [0.105, 0.5], [0.152, 0.31], [0.105, 0.1]];
/** The places of the colours of paper, from the flame outwards. */
const PAPER = [0.2, 0.5, 0.82, 1];
const GOLD = [[0, "#fffdf0"], [0.3, "#fff2c0"], [0.66, "#ffc650"], [1, "#c96d10"]];

/** A gold lantern, or one of paper in these colours. */
function lantern(context, colours) {
  const isGold = !colours;
  context.fillStyle = "#2a0a06";
  context.fillRect(-0.035, 0, 0.07, 0.1);
  const paper = isGold ? HEXAGON : BARREL;
  shape(context, paper, stops(context.createRadialGradient(0, 0.25, 0.01, 0, 0.3, 0.235),
      isGold ? GOLD : [[0, "#fffbe4"], ...PAPER.map((at, k) => [at, colours[k]])]));
  context.save();
  context.clip();
  isGold ? flower(context) : ribs(context);
  context.restore();
  // Rims of gilded wood, a tuft.
  for (const y of [0.085, 0.485]) {
    context.fillStyle = "#7a3f0c";
    context.fillRect(-0.1, y - 0.006, 0.2, 0.036);
    context.fillStyle = "#f2b84a";
    context.fillRect(-0.1, y + 0.006, 0.2, 0.018);
  }
  line(context, 0.012, "#c9a05a", [0, 0.515], [0, 0.56]);
  oval(context, 0, 0.57, 0.022, 0.022, "#d8261c");
}

function ribs(context) {
  Object.assign(context, { strokeStyle: "rgba(120,6,0,.42)", lineWidth: 0.007 });
  for (let rib = 0; rib < 4; rib++) {
    context.beginPath();
    context.ellipse(0, 0.3, 0.001 + 0.048 * rib, 0.235, 0, 0, 7);
    context.stroke();
  }
}

function flower(context) {
  for (const side of [-1, 1]) line(context, 0.008, "rgba(130,58,0,.5)", [side * 0.05, 0.1], [side * 0.075, 0.31],
      [side * 0.05, 0.5]);
  for (let petal = 0; petal < 5; petal++) {
    const angle = (petal + 0.25) * 1.2566;
    oval(context, 0.038 * Math.cos(angle), 0.3 + 0.038 * Math.sin(angle), 0.036, 0.022, "rgba(206,26,14,.82)", angle);
  }
  oval(context, 0, 0.3, 0.018, 0.018, "#ffe9a0");
}

// Dancers: from the feet in the dark to shoulders in the light of the lanterns.

/** Coats from the feet up, and scarves: fold, cloth, light. */
const CLOTHES = [
  [["#0b0203", "#4e100c", "#b0451f"], ["#5e3608", "#b57a22", "#f0be66"]],
  [["#06070b", "#241c24", "#84503a"], ["#64120b", "#b02a16", "#f0764a"]],
  [["#0d0802", "#59390e", "#c28434"], ["#64120b", "#b02a16", "#f0764a"]],
];

/** A leg at a moment of its step: hip, knee, foot and toe. The foot is off the ground while it moves ahead. */
function leg(context, { face, side, hip }, at, apart) {
  const swing = 0.3 * Math.sin(at), lift = Math.max(0, 0.13 * Math.cos(at)), from = apart * 0.085 * face;
  const knee = [from + (0.62 * swing + 0.06) * side, 0.46 + 0.6 * lift],
      foot = [from + (swing - 0.03) * side, 0.06 + lift];
  Object.assign(context, { lineWidth: 0.135 });
  context.beginPath();
  context.moveTo(from, hip);
  context.quadraticCurveTo(from + 0.5 * (knee[0] - from), hip - 0.15, ...knee);
  context.lineTo(...foot);
  context.stroke();
  line(context, 0.08, "#040203", foot, [foot[0] + 0.12 * side, foot[1] - 0.015]);
}

/** A dancer `yaw` turns from the seat at a moment of a step. */
function dancer(context, [[dark, cloth, light], [fold, scarf, rim]], yaw, phase) {
  const angle = 2 * Math.PI * yaw, side = Math.sin(angle), face = Math.cos(angle), at = 2 * Math.PI * phase;
  const bob = 0.02 * Math.abs(Math.cos(at)), hip = 0.84 + bob, shoulder = 1.4 + bob,
      wide = 0.125 + 0.1 * Math.abs(face);
  const coat = stops(context.createLinearGradient(0, 0, 0, 1.6), [[0, "#040203"], [0.3, dark], [0.55, cloth],
      [0.84, light], [1, light]]);
  Object.assign(context, { lineCap: "round", lineJoin: "round", strokeStyle: coat });
  const legs = [at, at + Math.PI];
  legs.forEach((moment, k) => {
    context.strokeStyle = coat;
    leg(context, { face, side, hip }, moment, k ? 1 : -1);
  });
  // The far arm, the coat with its skirt, the near arm: both reach up to the pole below the board.
  const hand = [0.27 * side, 1.19 + bob],
      arms = [-1, 1].map((one) => [[one * wide * 0.82, shoulder - 0.07], [one * wide * 0.95 + 0.14 * side, 1.14],
      [hand[0] + 0.045 * one * face, hand[1]]]);
  line(context, 0.085, dark, ...arms[0]);
  shape(context, [
    [-wide * 0.98, hip - 0.2], [-wide * 0.66, 1.08, -wide, shoulder - 0.05],
        [-wide * 0.78, shoulder + 0.05, 0, shoulder + 0.08],
    [wide * 0.78, shoulder + 0.05, wide, shoulder - 0.05], [wide * 0.66, 1.08, wide * 0.98, hip - 0.2],
        [0, hip - 0.25, -wide * 0.98, hip - 0.2],
  ], coat);
  if (face > 0.3) line(context, 0.014, fold, [0.02 * side, shoulder], [0.03 * side, hip - 0.16]);
  line(context, 0.058, scarf, [-wide * 0.72, 1.0], [wide * 0.72, 0.99]);
  line(context, 0.02, rim, [-wide * 0.7, 1.02], [wide * 0.7, 1.01]);
  line(context, 0.08, cloth, ...arms[1]);
  oval(context, ...hand, 0.045, 0.04, "#a8623a");
  headOf(context, { side, face, bob }, [fold, scarf, rim]);
}

function headOf(context, { side, face, bob }, [fold, scarf, rim]) {
  const y = 1.575 + bob, x = 0.02 * side, skin = face > -0.35 ? ["#c27a4a", "#7a3c20", "#240d08"] : ["#5a2416",
      "#2c100a", "#0c0504"];
  line(context, 0.09, skin[1], [0, 1.43 + bob], [x, y - 0.06]);
  const lit = context.createRadialGradient(x + 0.05 * side, y - 0.05, 0.01, x, y, 0.125);
  oval(context, x, y, 0.086, 0.112, stops(lit, [[0, skin[0]], [0.55, skin[1]], [1, skin[2]]]));
  if (face > 0.3) for (const eye of [-1, 1]) oval(context, x + 0.034 * eye * face + 0.03 * side, y + 0.01, 0.01, 0.008,
      "#1a0705");
  // A scarf bound round the head, with its knot behind.
  shape(context, [[x - 0.098, y + 0.035], [x - 0.104, y + 0.145, x, y + 0.148],
      [x + 0.104, y + 0.145, x + 0.098, y + 0.035], [x, y + 0.075, x - 0.098, y + 0.035]], scarf);
  shape(context, [[x - 0.09, y + 0.085], [x, y + 0.158, x + 0.09, y + 0.085], [x, y + 0.12, x - 0.09, y + 0.085]], rim);
  if (Math.abs(side) > 0.3) shape(context, [[x - 0.085 * side, y + 0.06], [x - 0.2 * side, y + 0.02],
      [x - 0.16 * side, y - 0.05]], fold);
}

/** A picture and where it stands: `left` and `up` of its foot, in pixels. */
function cut([wide, high], scale, paint) {
  const [canvas, context] = blank(Math.ceil(wide * scale) + 2, Math.ceil(high * scale) + 2), left = canvas.width / 2,
      up = canvas.height - 1;
  context.setTransform(scale, 0, 0, -scale, left, up);
  paint(context);
  return { canvas, left, up };
}

/** Pictures by their sizes. */
export class Cuts {
  constructor() {
    this.kept = new Map();
    this.pixels = 0;
  }

  /** Returns the picture number `which` of a kind at a scale, in pixels a metre. */
  take(which, scale, size, paint) {
    const step = Math.round(Math.log(scale) / Math.log(SIZES)), key = step * 1000 + which, found = this.kept.get(key);
    if (found) return found;
    if (this.pixels > KEPT) {
      this.kept.clear();
      this.pixels = 0;
    }
    const made = cut(size, SIZES ** step, paint);
    this.pixels += made.canvas.width * made.canvas.height;
    this.kept.set(key, made);
    return made;
  }

  /** A gold lantern for null, or one of paper in the colours of a light (see lantern_light.js). */
  lantern(scale, light) {
    return this.take(light ? 901 + light.number : 999, scale, LANTERN, (context) => lantern(context, light?.paper));
  }

  /** A dancer in one of three clothes, who faces `yaw` turns from the seat, at `phase`, a share of two steps. */
  dancer(scale, clothes, yaw, phase) {
    const turned = ((Math.round(yaw * YAWS) % YAWS) + YAWS) % YAWS, step = Math.floor(phase * PHASES) % PHASES;
    return this.take((clothes * YAWS + turned) * PHASES + step, scale, PERSON,
        (context) => dancer(context, CLOTHES[clothes], turned / YAWS, step / PHASES));
  }
}

/** A ball of paper over a lamp. */
export function ball(core, middle, rim) {
  const size = 96, half = size / 2, [canvas, context] = blank(size, size);
  const shade = context.createRadialGradient(half * 0.86, half * 0.74, 0, half, half, half * 0.985);
  oval(context, half, half, half, half, stops(shade, [[0, core], [0.5, middle], [0.94, rim], [1, "rgba(0,0,0,0)"]]));
  return canvas;
}

/** The reflection of a lantern in wet stone: long, brightest near its foot. `colour` is red, green and blue. */
export function reflection(colour) {
  const [wide, high, bright] = [32, 128, 40], [canvas, context] = blank(wide, high),
      data = context.createImageData(wide, high);
  for (let row = 0; row < high; row++) {
    for (let column = 0; column < wide; column++) {
      const across = (2 * column + 1) / wide - 1, along = (row - bright) / (row < bright ? bright : high - bright);
      const alpha = Math.exp(-5 * across * across) * (1 - across * across) * Math.max(0, 1 - along * along) ** 2;
      data.data.set([...colour, 255 * alpha], 4 * (row * wide + column));
    }
  }
  context.putImageData(data, 0, 0);
  return canvas;
}
