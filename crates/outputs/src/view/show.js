// The show look: lacquered boards, a lantern at every handle, a dragon's head after its pearl, embers behind its tail,
// a flash at the contact. The boards stay the true rectangles; the rest is ornament. Stands still for users who prefer
// no motion.

import { rectangle } from "./boards.js";
import { fillBoards } from "./drawing.js";
import { STRIDE } from "./hermite.js";

/** The lifetime of the glow behind head and tail, and of the flash, ms. */
const TRAIL = 3500;
const FLASH = 1600;
/** Pixels of the picture of a glow. */
const GLOW = 128;
/** The most lanterns that glow: of more, every second one glows, or every third, and so on. */
const MOST_GLOWS = 1200;

/** A spot of light, made once for each colour. */
function glowOf(colour) {
  const canvas = Object.assign(document.createElement("canvas"), { width: GLOW, height: GLOW }), context = canvas.getContext("2d"), half = GLOW / 2;
  const fade = context.createRadialGradient(half, half, 0, half, half, half);
  [[0, "ff"], [0.12, "b0"], [0.35, "48"], [0.65, "14"], [1, "00"]].forEach(([at, alpha]) => fade.addColorStop(at, colour + alpha));
  context.fillStyle = fade;
  context.fillRect(0, 0, GLOW, GLOW);
  return canvas;
}

export class Show {
  /** `still`: only the dragon moves. */
  constructor(still) {
    this.still = still;
    this.glows = new Map();
    this.trail = [];
    this.flash = null;
    this.now = 0;
  }

  /** Returns a value that changes whenever the glow must be drawn again. */
  get phase() {
    return this.still ? 0 : Math.floor(this.now / 33);
  }

  /** Begins the next picture: the places of head and tail, and the place of an event that has just happened. */
  update(now, places, jumped, happened) {
    this.now = now;
    if (jumped) this.trail = [];
    this.trail = this.trail.filter(({ at }) => now - at < TRAIL);
    const last = this.trail.at(-1), tail = places.length - STRIDE;
    if (!this.still && !(last && now - last.at < 50)) this.trail.push({ at: now, head: [places[0], places[1]], tail: [places[tail], places[tail + 1]] });
    if (happened && !this.flash) this.flash = { at: now, place: happened };
    if (!happened) this.flash = null;
  }

  glow(context, colour, x, y, radius, alpha) {
    if (!this.glows.has(colour)) this.glows.set(colour, glowOf(colour));
    context.globalAlpha = alpha;
    context.drawImage(this.glows.get(colour), x - radius, y - radius, 2 * radius, 2 * radius);
  }

  /** Draws all but the crown, in metres; restores the context. */
  draw(context, camera, palette, { stage, places }, benches) {
    const pixel = camera.unit / camera.scale, count = places.length / STRIDE - 1, wide = stage.width * camera.scale;
    const light = (draw) => this.light(context, palette, draw);
    light(() => this.embers(context, palette, pixel, stage));
    fillBoards(context, stage, places, benches, palette.wood, wide > 4 ? [palette.rim, Math.max(0.06 * stage.width, 0.7 / camera.scale)] : null);
    light(() => {
      const radius = Math.max(2.1 * stage.width, 7 * pixel);
      const each = Math.ceil(benches.length / MOST_GLOWS);
      for (const k of benches) if (k % each === 0) this.glow(context, palette.gold, places[STRIDE * k], places[STRIDE * k + 1], radius, 0.5 * this.flicker(k));
    });
    this.lanterns(context, palette, pixel, stage, places, benches, wide);
    if (count > 1) this.tail(context, palette, pixel, rectangle(stage, places, count - 1));
  }

  /** Draws the layer above all marks: the head, and the flash. */
  crown(context, camera, palette, { stage, places }) {
    const light = (draw) => this.light(context, palette, draw);
    this.head(context, palette, camera.unit / camera.scale, rectangle(stage, places, 0), this.flicker(0), light);
    if (this.flash) light(() => this.burst(context, palette, camera));
  }

  /** Lights add up at night; by day they tint. */
  light(context, palette, draw) {
    context.globalCompositeOperation = palette.night ? "lighter" : "source-over";
    draw();
    context.globalCompositeOperation = "source-over";
    context.globalAlpha = 1;
  }

  flicker(k) {
    return this.still ? 1 : 1 + 0.18 * Math.sin(this.now / 230 + 2.4 * k) * Math.sin(this.now / 570 + k);
  }

  /** Draws the fading trail of head and tail. */
  embers(context, palette, pixel, stage) {
    for (const { at, head, tail } of this.trail) {
      const left = 1 - (this.now - at) / TRAIL;
      this.glow(context, palette.gold, ...head, Math.max(3 * stage.width, 22 * pixel) * (0.4 + 0.6 * left), 0.3 * left * left);
      this.glow(context, palette.lantern, ...tail, Math.max(2 * stage.width, 16 * pixel) * (0.3 + 0.7 * left), 0.4 * left * left);
    }
  }

  lanterns(context, palette, pixel, stage, places, benches, wide) {
    const radius = Math.max(0.36 * stage.width, 1.7 * pixel);
    for (const [part, colour] of wide > 9 ? [[1, palette.silk], [0.62, palette.lantern]] : [[1, palette.lantern]]) {
      context.fillStyle = colour;
      for (const k of benches) {
        const x = places[STRIDE * k], y = places[STRIDE * k + 1], r = radius * part;
        // The corners of a dot are invisible.
        if (wide < 5) context.fillRect(x - r, y - r, 2 * r, 2 * r);
        else {
          context.beginPath();
          context.arc(x, y, r, 0, 7);
          context.fill();
        }
      }
    }
  }

  /** Seen from above; its snout ends where the board does. */
  head(context, palette, pixel, { x, y, c, s, l, w }, flicker, light) {
    const size = Math.max(3.2 * w, 24 * pixel), front = l - 0.95 * size;
    context.save();
    context.transform(c, s, -s, c, x + front * c, y + front * s);
    context.scale(size, size);
    light(() => {
      this.glow(context, palette.gold, 0.1, 0, 2.4, 0.5 * flicker);
      this.glow(context, palette.lantern, 1.75, 0, 1, 0.9 * flicker);
    });
    const shape = (colour, edge, ...sides) => {
      context.beginPath();
      for (const side of sides) {
        const [start, ...curves] = side;
        context.moveTo(...start);
        for (const curve of curves) curve.length === 2 ? context.lineTo(...curve) : curve.length === 4 ? context.quadraticCurveTo(...curve) : context.bezierCurveTo(...curve);
        context.closePath();
      }
      context.fillStyle = colour;
      context.fill();
      context.strokeStyle = edge;
      context.lineWidth = 0.045;
      context.lineJoin = "round";
      context.stroke();
    };
    const both = (side) => [side, side.map((curve) => curve.map((one, k) => (k % 2 ? -one : one)))];
    const mane = [[0.1, 0.4], [-0.3, 0.62, -0.75, 0.95], [-0.6, 0.62, -0.62, 0.52], [-0.95, 0.6, -1.25, 0.5], [-0.95, 0.4, -0.85, 0.28], [-1.2, 0.22, -1.5, 0], [-0.5, 0], [0.1, 0]];
    shape(palette.silk, palette.rim, ...both(mane));
    shape(palette.rim, palette.wood, ...both([[0.0, 0.3], [-0.35, 0.42, -0.62, 0.28, -1.0, 0.36], [-0.7, 0.5, -0.35, 0.62, 0.08, 0.46]]));
    const skull = [[1, 0], [1, 0.2, 0.86, 0.3], [0.74, 0.34, 0.62, 0.24], [0.45, 0.26, 0.34, 0.46], [0.16, 0.62, -0.06, 0.5], [-0.34, 0.44, -0.42, 0.2], [-0.46, 0]];
    const lower = skull.slice(0, -1).reverse();
    context.beginPath();
    context.moveTo(...skull[0]);
    for (const curve of skull.slice(1)) curve.length === 2 ? context.lineTo(...curve) : context.quadraticCurveTo(...curve);
    skull.slice(1, -1).reverse().forEach(([hx, hy], k) => context.quadraticCurveTo(hx, -hy, ...lower[k].slice(-2).map((one, at) => (at ? -one : one))));
    context.closePath();
    const lacquer = context.createLinearGradient(-0.4, 0, 1, 0);
    lacquer.addColorStop(0, palette.silk);
    lacquer.addColorStop(0.55, palette.gold);
    lacquer.addColorStop(1, palette.lantern);
    context.fillStyle = lacquer;
    context.fill();
    context.strokeStyle = palette.wood;
    context.lineWidth = 0.06;
    context.stroke();
    // Whiskers, brows, the ridge of the nose.
    context.strokeStyle = palette.rim;
    context.lineCap = "round";
    for (const side of [1, -1]) {
      const sway = this.still ? 0 : 0.06 * Math.sin(this.now / 400 + side);
      context.lineWidth = 0.05;
      context.beginPath();
      context.moveTo(0.85, 0.26 * side);
      context.bezierCurveTo(1.0, 0.6 * side, 0.6, (0.85 + sway) * side, 0.15, (0.88 - sway) * side);
      context.stroke();
    }
    context.strokeStyle = palette.wood;
    context.lineWidth = 0.05;
    context.beginPath();
    context.moveTo(0.72, 0);
    context.lineTo(-0.2, 0);
    context.stroke();
    const dots = (colour, ...all) => {
      context.fillStyle = colour;
      for (const [dx, dy, radius] of all) {
        for (const side of [1, -1]) {
          context.beginPath();
          context.arc(dx, dy * side, radius, 0, 7);
          context.fill();
        }
      }
    };
    dots("#ffffff", [0.3, 0.26, 0.13]);
    dots("#100608", [0.34, 0.25, 0.07], [0.9, 0.12, 0.045]);
    // The pearl in front of it.
    dots(palette.lantern, [1.75, 0, 0.17]);
    dots("#fffdf4", [1.79, 0, 0.09]);
    context.lineCap = "butt";
    context.restore();
  }

  /** A fin of flames. */
  tail(context, palette, pixel, { x, y, c, s, l, w }) {
    const size = Math.max(2.6 * w, 18 * pixel);
    context.save();
    context.transform(c, s, -s, c, x - l * c, y - l * s);
    context.scale(size, size);
    for (const [part, colour] of [[1, palette.silk], [0.62, palette.gold]]) {
      context.beginPath();
      context.moveTo(0.5 * part, 0);
      context.quadraticCurveTo(0.1 * part, 0.45 * part, -0.75 * part, 0.62 * part);
      context.quadraticCurveTo(-0.4 * part, 0.3 * part, -0.55 * part, 0.2 * part);
      context.quadraticCurveTo(-0.9 * part, 0.16 * part, -1.25 * part, 0);
      context.quadraticCurveTo(-0.9 * part, -0.16 * part, -0.55 * part, -0.2 * part);
      context.quadraticCurveTo(-0.4 * part, -0.3 * part, -0.75 * part, -0.62 * part);
      context.quadraticCurveTo(0.1 * part, -0.45 * part, 0.5 * part, 0);
      context.fillStyle = colour;
      context.fill();
    }
    context.restore();
  }

  /** One flash, then a calm glow, without repetition. */
  burst(context, palette, camera) {
    const { at, place } = this.flash, part = this.still ? 1 : Math.min(1, (this.now - at) / FLASH);
    const size = Math.min(camera.width, camera.height) / camera.scale;
    this.glow(context, palette.danger, place.x, place.y, 0.16 * size, 0.75);
    if (part === 1) return;
    const left = (1 - part) ** 2;
    this.glow(context, palette.lantern, place.x, place.y, size * (0.12 + 0.6 * Math.sqrt(part)), left);
    this.glow(context, palette.gold, place.x, place.y, size * (0.06 + 0.2 * part), left);
    context.globalAlpha = left;
    context.strokeStyle = palette.lantern;
    context.lineWidth = 0.008 * size * (1 - part);
    context.beginPath();
    for (let ray = 0; ray < 24; ray++) {
      const angle = (ray * Math.PI) / 12, from = size * 0.06 * (1 + 3 * part), to = from + size * (ray % 2 ? 0.1 : 0.2) * part;
      context.moveTo(place.x + from * Math.cos(angle), place.y + from * Math.sin(angle));
      context.lineTo(place.x + to * Math.cos(angle), place.y + to * Math.sin(angle));
    }
    context.stroke();
  }
}
