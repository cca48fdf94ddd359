// The drawing: one picture of the stage on a canvas. Knows nothing of the network; keeps the camera and the ground.

import { STRIDE, speedOf } from "./hermite.js";

/** Steps of the colour scale. */
const SHADES = 32;
/** Rectangles filled at once: with thousands in one path, filling it takes six times as long. */
const BATCH = 100;
/** Beyond so many turns the lines of the path lie closer together than pixels. */
const MOST_TURNS = 1500;

const colour = (style, name) => style.getPropertyValue(name).trim();
const channels = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
const mixed = (from, to, part) => `rgb(${from.map((one, k) => Math.round(one + (to[k] - one) * part)).join(" ")})`;

/** The colours of the style sheet, looked up once for each change of theme. */
export function paletteOf(element) {
  const style = getComputedStyle(element);
  const [slow, middle, fast] = ["--slow", "--middle", "--fast"].map((name) => channels(colour(style, name)));
  const shade = (part) => (part < 0.5 ? mixed(slow, middle, 2 * part) : mixed(middle, fast, 2 * part - 1));
  return {
    shades: Array.from({ length: SHADES }, (_, k) => shade(k / (SHADES - 1))),
    ...Object.fromEntries(["ground", "ink", "faint", "danger", "still"].map((name) => [name, colour(style, `--${name}`)])),
  };
}

/** From metres to pixels: what is in the middle, how large, and whether the head stays there. */
export class Camera {
  constructor() {
    this.width = this.height = this.ratio = 1;
    this.reach = 1;
    this.whole();
  }

  whole() {
    this.x = this.y = 0;
    this.zoom = 1;
    this.follow = false;
  }

  /** Pixels of the screen (not of the canvas) for a metre. */
  get scale() {
    return (Math.min(this.width, this.height) / (2.14 * this.reach)) * this.zoom;
  }

  toPixel(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toStage(x, y) {
    return [this.x + (x - this.width / 2) / this.scale, this.y - (y - this.height / 2) / this.scale];
  }

  /** Moves the picture by pixels. */
  pan(x, y) {
    this.follow = false;
    this.x -= x / this.scale;
    this.y += y / this.scale;
  }

  /** Makes the picture `by` times as large and leaves in place what is at a pixel. */
  zoomAt(by, x = this.width / 2, y = this.height / 2) {
    const [before, above] = this.toStage(x, y);
    this.zoom = Math.min(Math.max(2000, 50 * this.reach), Math.max(0.2, this.zoom * by));
    if (this.follow) return;
    const [after, below] = this.toStage(x, y);
    this.x += before - after;
    this.y += above - below;
  }
}

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

/** The bench at a place of the stage, no further from it than `most` metres; -1 for none. */
export function benchAt(stage, places, x, y, most) {
  let best = most, found = -1;
  for (let bench = 0; bench < places.length / STRIDE - 1; bench++) {
    const r = rectangle(stage, places, bench), along = (x - r.x) * r.c + (y - r.y) * r.s, across = (y - r.y) * r.c - (x - r.x) * r.s;
    const away = Math.hypot(Math.max(0, Math.abs(along) - r.l), Math.max(0, Math.abs(across) - r.w));
    if (away < best || (away === 0 && best === 0)) [best, found] = [away, bench];
  }
  return found;
}

/** The middle between the nearest points of two boards: one of the two is always a corner. */
export function nearest(stage, places, ...pair) {
  const [a, b] = pair.map((bench) => rectangle(stage, places, bench));
  let best = Infinity, place = null;
  for (const [one, other] of [[a, b], [b, a]]) {
    for (const [along, across] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
      const x = one.x + along * one.l * one.c - across * one.w * one.s, y = one.y + along * one.l * one.s + across * one.w * one.c;
      const dx = x - other.x, dy = y - other.y, u = dx * other.c + dy * other.s, v = dy * other.c - dx * other.s;
      const nu = Math.max(-other.l, Math.min(other.l, u)), nv = Math.max(-other.w, Math.min(other.w, v)), away = Math.hypot(u - nu, v - nv);
      if (away >= best) continue;
      best = away;
      place = { x: (x + other.x + nu * other.c - nv * other.s) / 2, y: (y + other.y + nu * other.s + nv * other.c) / 2 };
    }
  }
  return place;
}

/** Which shade a speed has. */
const shadeOf = (speed, { low, high }) => Math.min(SHADES - 1, Math.max(0, Math.floor(((speed - low) / (high - low)) * SHADES)));

function outline(context, { x, y, c, s, l, w }) {
  const lx = l * c, ly = l * s, wx = -w * s, wy = w * c;
  context.moveTo(x + lx + wx, y + ly + wy);
  context.lineTo(x - lx + wx, y - ly + wy);
  context.lineTo(x - lx - wx, y - ly - wy);
  context.lineTo(x + lx - wx, y + ly - wy);
  context.closePath();
}

/**
 * The path of a stage, in metres. A spiral on which the team comes in is drawn as far out as `reach`: the team stands
 * there.
 */
export function pathOf({ pitch, path: segments }, reach) {
  const path = new Path2D();
  for (const { kind, x, y, heading, length, curvature, theta_first, theta_last } of segments) {
    const c = Math.cos(heading), s = Math.sin(heading);
    if (kind === "line") {
      path.moveTo(x, y);
      path.lineTo(x + length * c, y + length * s);
    } else if (kind === "arc") {
      const cx = x - s / curvature, cy = y + c / curvature, from = Math.atan2(y - cy, x - cx);
      path.moveTo(x, y);
      path.arc(cx, cy, 1 / Math.abs(curvature), from, from + curvature * length, curvature < 0);
    } else if (kind === "inward_spiral") {
      addSpiral(path, pitch, theta_last, Math.max(theta_first, (2 * Math.PI * reach) / pitch));
    } else {
      addSpiral(path, -pitch, theta_first, theta_last);
    }
  }
  return path;
}

/** The spiral r = pitch * turn from one polar angle to another, as cubic curves that take its tangents over. */
function addSpiral(path, pitch, from, to) {
  const turns = (to - from) / (2 * Math.PI);
  if (turns > MOST_TURNS) return;
  const a = pitch / (2 * Math.PI), steps = Math.ceil(12 * turns), step = (to - from) / steps;
  const at = (angle) => {
    const c = Math.cos(angle), s = Math.sin(angle), x = a * angle * c, y = a * angle * s;
    return [x, y, a * c - y, a * s + x];
  };
  let [x, y, dx, dy] = at(from);
  path.moveTo(x, y);
  for (let k = 1; k <= steps; k++) {
    const [nx, ny, ex, ey] = at(from + k * step), third = step / 3;
    path.bezierCurveTo(x + dx * third, y + dy * third, nx - ex * third, ny - ey * third, nx, ny);
    [x, y, dx, dy] = [nx, ny, ex, ey];
  }
}

/** Lets a context draw in metres, moved by some of its pixels. */
function inMetres(context, camera, right = 0, down = 0) {
  const [left, top] = camera.toPixel(0, 0), { ratio, scale } = camera;
  context.setTransform(ratio * scale, 0, 0, -ratio * scale, ratio * left + right, ratio * top + down);
}

/**
 * The ground with the path on it. A long path takes longer to draw than all its benches, so it is kept with a margin
 * until the camera has moved further than that, or it looks different.
 */
export class Ground {
  constructor() {
    this.canvas = document.createElement("canvas");
    this.context = this.canvas.getContext("2d", { alpha: false });
    this.path = this.look = null;
    this.x = this.y = 0;
  }

  /** Covers another context's canvas. */
  cover(other, camera, palette, path) {
    const { width, height } = other.canvas, scale = camera.scale * camera.ratio, right = width >> 2, down = height >> 2;
    const look = [width, height, camera.scale, camera.ratio, palette.ground].join();
    const moved = () => [Math.round((this.x - camera.x) * scale), Math.round((camera.y - this.y) * scale)];
    const away = moved();
    if (this.path !== path || this.look !== look || Math.abs(away[0]) > right || Math.abs(away[1]) > down) {
      Object.assign(this, { path, look, x: camera.x, y: camera.y });
      this.paint(width + 2 * right, height + 2 * down, () => inMetres(this.context, camera, right, down), palette, camera.scale);
    }
    const [x, y] = moved();
    other.setTransform(1, 0, 0, 1, 0, 0);
    other.drawImage(this.canvas, x - right, y - down);
  }

  paint(width, height, metres, palette, scale) {
    const { canvas, context } = this;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = palette.ground;
    context.fillRect(0, 0, width, height);
    metres();
    context.lineWidth = 1.2 / scale;
    context.strokeStyle = palette.faint;
    context.stroke(this.path);
  }
}

/** Draws everything. `scene` has: stage, places (STRIDE numbers a handle, as all handles here), newest (the
 * handles of the newest frame, for their speeds), range of speeds, ground, path, alert, chosen. */
export function draw(context, camera, palette, scene) {
  const { stage, places, ground, path, alert, chosen } = scene, { ratio, scale } = camera, pixel = 1 / scale;
  const world = () => inMetres(context, camera);
  ground.cover(context, camera, palette, path);
  world();
  context.lineJoin = "miter";
  benches(context, camera, palette, scene);
  const count = places.length / STRIDE - 1, head = rectangle(stage, places, 0), tail = rectangle(stage, places, count - 1);
  const mark = (bench, ink, width, dashes = []) => {
    context.beginPath();
    outline(context, rectangle(stage, places, bench));
    context.setLineDash(dashes.map((dash) => dash * pixel));
    context.strokeStyle = ink;
    context.lineWidth = width * pixel;
    context.stroke();
    context.setLineDash([]);
  };
  const label = (text, x, y, ink, away = 18) => {
    const [px, py] = camera.toPixel(x, y), out = Math.hypot(x, y) || 1;
    if (px < 0 || py < 0 || px > camera.width || py > camera.height) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = "600 15px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineJoin = "round";
    context.lineWidth = 5;
    context.strokeStyle = palette.ground;
    // Outward from the centre of the stage, where there is most room.
    const half = context.measureText(text).width / 2 + 6, within = (at, least, most) => Math.min(Math.max(at, least), most);
    const tx = within(px + (away * 1.6 * x) / out, half, camera.width - half), ty = within(py - (away * y) / out, 14, camera.height - 14);
    context.strokeText(text, tx, ty);
    context.fillStyle = ink;
    context.fillText(text, tx, ty);
    world();
  };
  headSign(context, head, palette, pixel);
  tailSign(context, tail, palette, pixel);
  mark(0, palette.ink, 2.5);
  if (count > 1) mark(count - 1, palette.ink, 1.5);
  const danger = alert && alert.severity !== "ok";
  // Until an event has happened the nearest two boards are marked, afterwards those of the event.
  const ahead = danger && !alert.happened;
  const concerned = ahead ? [alert.bench_a, alert.bench_b] : [alert?.event_bench_a, alert?.event_bench_b];
  const pair = danger ? concerned.filter((bench) => bench !== null && bench < count) : [];
  for (const bench of pair) {
    mark(bench, palette.ground, 7);
    mark(bench, palette.danger, 4);
  }
  if (chosen >= 0 && chosen < count) {
    mark(chosen, palette.ground, 7);
    mark(chosen, palette.ink, 4, [7, 4]);
  }
  // Alerts come once a second, and the place of an approach moves with the boards.
  const place = ahead && pair.length === 2 ? nearest(stage, places, ...pair) : { x: alert?.event_x, y: alert?.event_y };
  if (danger && place.x !== null) target(context, place, palette, pixel);
  if (!pair.includes(0)) label("HEAD", head.x + head.l * head.c, head.y + head.l * head.s, palette.ink);
  if (count > 1) label("TAIL", tail.x - tail.l * tail.c, tail.y - tail.l * tail.s, palette.ink);
  for (const bench of pair) {
    const r = rectangle(stage, places, bench);
    label(bench === 0 ? "HEAD (bench 1)" : `bench ${bench + 1}`, r.x - 0.6 * r.l * r.c, r.y - 0.6 * r.l * r.s, palette.danger, 30);
  }
  if (chosen >= 0 && chosen < count && !pair.includes(chosen)) {
    const r = rectangle(stage, places, chosen);
    label(`bench ${chosen + 1}`, r.x, r.y, palette.ink, 30);
  }
  scaleBar(context, camera, palette);
}

function benches(context, camera, palette, { stage, places, newest, range }) {
  const count = places.length / STRIDE - 1, reach = Math.max(stage.head_length, stage.body_length), shown = Array.from({ length: SHADES + 1 }, () => []);
  const [left, bottom] = camera.toStage(0, camera.height), [right, top] = camera.toStage(camera.width, 0);
  for (let bench = 0; bench < count; bench++) {
    const x = places[STRIDE * bench], y = places[STRIDE * bench + 1], speed = speedOf(newest, bench);
    if (x < left - reach || x > right + reach || y < bottom - reach || y > top + reach) continue;
    shown[speed > 0 && range ? shadeOf(speed, range) : SHADES].push(bench);
  }
  const edged = stage.width * camera.scale > 5;
  context.strokeStyle = palette.ground;
  context.lineWidth = 1 / camera.scale;
  shown.forEach((all, shade) => {
    context.fillStyle = palette.shades[shade] ?? palette.still;
    for (let first = 0; first < all.length; first += BATCH) {
      context.beginPath();
      for (const bench of all.slice(first, first + BATCH)) outline(context, rectangle(stage, places, bench));
      context.fill();
      if (edged) context.stroke();
    }
  });
  if (stage.width * camera.scale < 14) return;
  // Close by, the handles show.
  context.fillStyle = palette.ground;
  context.beginPath();
  for (const bench of shown.flat()) {
    for (const k of [STRIDE * bench, STRIDE * (bench + 1)]) {
      context.moveTo(places[k] + stage.width / 7, places[k + 1]);
      context.arc(places[k], places[k + 1], stage.width / 7, 0, 7);
    }
  }
  context.fill();
}

/** Chevrons in the direction of travel. */
function headSign(context, { x, y, c, s, l, w }, palette, pixel) {
  context.beginPath();
  for (const at of [0.85, 0.6, 0.35]) {
    const tip = at * l, back = tip - 1.2 * w, side = 0.75 * w;
    context.moveTo(x + back * c - side * s, y + back * s + side * c);
    context.lineTo(x + tip * c, y + tip * s);
    context.lineTo(x + back * c + side * s, y + back * s - side * c);
  }
  context.strokeStyle = palette.ink;
  context.lineWidth = Math.max(0.2 * w, 1.5 * pixel);
  context.stroke();
}

/** Bars across the end. */
function tailSign(context, { x, y, c, s, l, w }, palette, pixel) {
  context.beginPath();
  for (const at of [0.9, 0.75, 0.6]) {
    const along = -at * l;
    context.moveTo(x + along * c - w * s, y + along * s + w * c);
    context.lineTo(x + along * c + w * s, y + along * s - w * c);
  }
  context.strokeStyle = palette.ink;
  context.lineWidth = Math.max(0.25 * w, 1.5 * pixel);
  context.stroke();
}

/** A ring and a cross at the place of danger. */
function target(context, { x, y }, palette, pixel) {
  const ring = () => {
    context.beginPath();
    context.arc(x, y, 13 * pixel, 0, 7);
    for (const [dx, dy] of [[1, 0], [0, 1], [-1, 0], [0, -1]]) {
      context.moveTo(x + 7 * dx * pixel, y + 7 * dy * pixel);
      context.lineTo(x + 21 * dx * pixel, y + 21 * dy * pixel);
    }
    context.stroke();
  };
  context.strokeStyle = palette.ground;
  context.lineWidth = 6 * pixel;
  ring();
  context.strokeStyle = palette.danger;
  context.lineWidth = 3 * pixel;
  ring();
}

/** How long some round number of metres is, in the lower right corner. */
function scaleBar(context, camera, palette) {
  const most = Math.min(160, camera.width / 4) / camera.scale, power = 10 ** Math.floor(Math.log10(most));
  const metres = [5, 2, 1].map((one) => one * power).find((one) => one <= most), length = metres * camera.scale;
  const right = camera.width - 18, bottom = camera.height - 18, { ratio } = camera;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.strokeStyle = context.fillStyle = palette.ink;
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(right - length, bottom - 5);
  context.lineTo(right - length, bottom);
  context.lineTo(right, bottom);
  context.lineTo(right, bottom - 5);
  context.stroke();
  context.font = "14px system-ui, sans-serif";
  context.textAlign = "right";
  context.textBaseline = "bottom";
  context.fillText(`${metres} m`, right, bottom - 6);
}
