// The drawing: one picture of the stage on a canvas. Knows nothing of the network; keeps the ground.

import { longestOf, rectangle } from "./boards.js";
import { STRIDE } from "./hermite.js";
import { NARROW } from "./labels.js";
import { SHADES } from "./palette.js";
import { between, doubled, scaleBar, target } from "./signs.js";

/** Edges drawn at once: a path with thousands takes several times as long. */
const BATCH = 100;
/** The inner and outer edge of the line around a dragon, pixels beyond its boards. */
const CASING_FROM = 1, CASING_TO = 4;
/** The opacity of a stale dragon beside live ones. */
const DIMMED = 0.4;
/** The number of turns beyond which the lines of the path are closer than pixels. */
const MOST_TURNS = 1500;

/** Adds a rectangle to the context's path. */
export function outline(context, { x, y, c, s, l, w }) {
  const lx = l * c, ly = l * s, wx = -w * s, wy = w * c;
  context.moveTo(x + lx + wx, y + ly + wy);
  context.lineTo(x - lx + wx, y - ly + wy);
  context.lineTo(x - lx - wx, y - ly - wy);
  context.lineTo(x + lx - wx, y + ly - wy);
  context.closePath();
}

/** A point and the direction of travel at a polar angle of a spiral about the origin, as [x, y, along x, along y]. */
function onSpiral(a, angle) {
  const c = Math.cos(angle), s = Math.sin(angle), x = a * angle * c, y = a * angle * s;
  return [x, y, a * c - y, a * s + x];
}

/**
 * The place and the direction of a segment's spiral on the stage. The spiral's centre is `x`, `y`, and its x axis has
 * the direction `c`, `s`. `side` is -1 where the spiral is mirrored. These follow from the segment's beginning and the
 * side to which it bends. A spiral without a curvature is about the origin.
 */
export function spiralFrame({ kind, x, y, heading, curvature, theta_first, pitch }) {
  if (curvature === null) return { x: 0, y: 0, c: 1, s: 0, side: 1 };
  const inward = kind === "inward_spiral", a = (inward ? pitch : -pitch) / (2 * Math.PI);
  const [px, py, dx, dy] = onSpiral(a, theta_first), side = Math.sign(inward ? -curvature : curvature);
  const turned = heading - side * (inward ? Math.atan2(-dy, -dx) : Math.atan2(dy, dx));
  const c = Math.cos(turned), s = Math.sin(turned);
  return { x: x - c * px + s * side * py, y: y - s * px - c * side * py, c, s, side };
}

/** The place of the centre of the spiral on which a team comes in; the origin of a team that comes in on a line. */
export function centreOf({ path, start_turn }) {
  const spiral = path.find(({ kind }) => kind.endsWith("_spiral"));
  return spiral && start_turn !== null ? spiralFrame(spiral) : { x: 0, y: 0 };
}

/**
 * The path of a stage, in metres. A spiral on which the team comes in is drawn as far out as `reach` from its centre,
 * where the team stands.
 */
export function pathOf({ path: segments, start_turn }, reach) {
  const path = new Path2D();
  for (const segment of segments) {
    const { kind, x, y, heading, length, curvature, theta_first, theta_last, pitch } = segment;
    const c = Math.cos(heading), s = Math.sin(heading);
    if (kind === "line") {
      path.moveTo(x, y);
      path.lineTo(x + length * c, y + length * s);
    } else if (kind === "arc") {
      const cx = x - s / curvature, cy = y + c / curvature, from = Math.atan2(y - cy, x - cx);
      path.moveTo(x, y);
      path.arc(cx, cy, 1 / Math.abs(curvature), from, from + curvature * length, curvature < 0);
    } else if (kind === "inward_spiral") {
      const first = start_turn === null ? theta_first : Math.max(theta_first, (2 * Math.PI * reach) / pitch);
      addSpiral(path, spiralFrame(segment), pitch, theta_last, first);
    } else {
      addSpiral(path, spiralFrame(segment), -pitch, theta_first, theta_last);
    }
  }
  return path;
}

/** The obstacles of a stage, each with its shape in metres, its keep-out, its name and a place on its outline. */
export function obstaclesOf({ obstacles }) {
  const drawn = obstacles.filter(({ outline }) => outline.length);
  return drawn.map(({ name, kind, keep_out, outline }) => {
    const shape = new Path2D(), { x, y, heading, curvature } = outline[0], last = outline.at(-1);
    if (kind === "circle") shape.arc(x - Math.sin(heading) / curvature, y + Math.cos(heading) / curvature,
        1 / curvature, 0, 2 * Math.PI);
    else {
      for (const side of outline) shape.lineTo(side.x, side.y);
      if (kind === "line") shape.lineTo(last.x + last.length * Math.cos(last.heading),
          last.y + last.length * Math.sin(last.heading));
      else shape.closePath();
    }
    return { shape, rim: rimOf(kind, outline, keep_out), name, keepOut: keep_out,
        isFull: kind === "circle" || kind === "polygon", isBoundary: kind === "boundary", x, y };
  });
}

/** The dashes around a keep-out, pixels. */
const KEEP_OUT_DASHES = [7, 5];

/** The outline of a keep-out: the outlines around its sides, one over the other. The band covers their inner parts. */
function rimOf(kind, outline, keepOut) {
  const rim = new Path2D(), quarter = Math.PI / 2;
  for (const { x, y, heading, length, curvature } of outline) {
    const c = Math.cos(heading), s = Math.sin(heading);
    if (kind === "circle") {
      rim.arc(x - s / curvature, y + c / curvature, 1 / curvature + keepOut, 0, 2 * Math.PI);
      continue;
    }
    const [endX, endY] = [x + length * c, y + length * s];
    rim.moveTo(x + keepOut * s, y - keepOut * c);
    rim.arc(endX, endY, keepOut, heading - quarter, heading + quarter);
    rim.arc(x, y, keepOut, heading + quarter, heading + 3 * quarter);
    rim.closePath();
  }
  return rim;
}

/** The obstacles on the ground: each keep-out is a pale band about the outline, with dashes around all of them. */
function paintObstacles(context, palette, pixel, obstacles, transparent) {
  const kept = obstacles.filter(({ keepOut }) => keepOut > 0);
  context.lineJoin = context.lineCap = "round";
  Object.assign(context, { strokeStyle: palette.ink, lineWidth: 2 * pixel, globalAlpha: 0.6 });
  context.setLineDash(KEEP_OUT_DASHES.map((dash) => dash * pixel));
  for (const { rim } of kept) context.stroke(rim);
  context.setLineDash([]);
  const bands = (colour, alpha) => {
    Object.assign(context, { strokeStyle: colour, globalAlpha: alpha });
    for (const { shape, keepOut } of kept) {
      context.lineWidth = 2 * keepOut;
      context.stroke(shape);
    }
  };
  if (transparent) context.globalCompositeOperation = "destination-out";
  bands(palette.ground, 1);
  context.globalCompositeOperation = "source-over";
  bands(palette.faint, 0.25);
  context.globalAlpha = 1;
  context.fillStyle = palette.faint;
  Object.assign(context, { strokeStyle: palette.ink, lineWidth: 1.5 * pixel });
  for (const { shape, isFull } of obstacles) {
    if (isFull) context.fill(shape);
    context.stroke(shape);
  }
  context.lineJoin = "miter";
  context.lineCap = "butt";
}

/** The spiral r = pitch * turn from one polar angle to another, as cubic curves with its tangents. */
function addSpiral(path, { x: cx, y: cy, c, s, side }, pitch, from, to) {
  const turns = (to - from) / (2 * Math.PI);
  if (turns > MOST_TURNS) return;
  const a = pitch / (2 * Math.PI), steps = Math.ceil(12 * turns), step = (to - from) / steps;
  const at = (angle) => {
    const [x, y, dx, dy] = onSpiral(a, angle);
    return [cx + c * x - s * side * y, cy + s * x + c * side * y, c * dx - s * side * dy, s * dx + c * side * dy];
  };
  let [x, y, dx, dy] = at(from);
  path.moveTo(x, y);
  for (let k = 1; k <= steps; k++) {
    const [nx, ny, ex, ey] = at(from + k * step), third = step / 3;
    path.bezierCurveTo(x + dx * third, y + dy * third, nx - ex * third, ny - ey * third, nx, ny);
    [x, y, dx, dy] = [nx, ny, ex, ey];
  }
}

/** Sets a context to draw in metres, with an offset in pixels. */
function inMetres(context, camera, right = 0, down = 0) {
  const [left, top] = camera.toPixel(0, 0), { ratio, scale, c, s } = camera, pixels = ratio * scale;
  context.setTransform(pixels * c, -pixels * s, -pixels * s, -pixels * c, ratio * left + right, ratio * top + down);
}

/**
 * The ground with the path on it. A long path takes longer to draw than all its benches. So it is kept with a margin
 * until the camera moves beyond the margin, or the path changes.
 */
export class Ground {
  /** A transparent ground is only the path. `margin` is a share of the picture; 0 suits paths that often change. */
  constructor(transparent, margin = 0.25) {
    Object.assign(this, { transparent, margin });
    this.canvas = document.createElement("canvas");
    this.context = this.canvas.getContext("2d", { alpha: transparent });
    this.paths = [];
    this.look = null;
    this.x = this.y = 0;
  }

  /**
   * Covers another context's canvas: the ground with paths on it, each with its `lines`, its `obstacles` and `dashes`
   * in pixels.
   */
  cover(other, camera, palette, paths) {
    const { width, height } = other.canvas, { c, s, unit } = camera, scale = camera.scale * camera.ratio,
        [right, down] = [width, height].map((pixels) => Math.floor(pixels * this.margin));
    const look = [width, height, camera.scale, camera.ratio, c, s, palette.ground, palette.faint].join();
    const moved = () => {
      const dx = (this.x - camera.x) * scale, dy = (this.y - camera.y) * scale;
      return [Math.round(dx * c - dy * s), Math.round(-dx * s - dy * c)];
    };
    const away = moved();
    const isSame = this.paths.length === paths.length && paths.every(({ lines }, k) => lines === this.paths[k].lines);
    if (!isSame || this.look !== look || Math.abs(away[0]) > right || Math.abs(away[1]) > down) {
      Object.assign(this, { paths, look, x: camera.x, y: camera.y });
      this.paint(width + 2 * right, height + 2 * down, () => inMetres(this.context, camera, right, down), palette,
          unit / camera.scale);
    }
    const [x, y] = moved();
    this.at = [x - right, y - down];
    other.setTransform(1, 0, 0, 1, 0, 0);
    if (this.transparent) other.clearRect(0, 0, width, height);
    other.drawImage(this.canvas, ...this.at);
  }

  /** Dims the drawing since then, to the share `left`. */
  dim(other, left) {
    const { width, height } = other.canvas;
    other.setTransform(1, 0, 0, 1, 0, 0);
    other.globalAlpha = 1 - left;
    if (!this.transparent) other.drawImage(this.canvas, ...this.at);
    else {
      other.globalCompositeOperation = "destination-out";
      other.fillRect(0, 0, width, height);
      other.globalAlpha = 1;
      other.globalCompositeOperation = "destination-over";
      other.drawImage(this.canvas, ...this.at);
      other.globalCompositeOperation = "source-over";
    }
    other.globalAlpha = 1;
  }

  paint(width, height, metres, palette, pixel) {
    const { canvas, context } = this;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, width, height);
    context.fillStyle = palette.ground;
    if (!this.transparent) context.fillRect(0, 0, width, height);
    metres();
    for (const { obstacles } of this.paths) paintObstacles(context, palette, pixel, obstacles, this.transparent);
    context.lineWidth = 1.2 * pixel;
    context.strokeStyle = palette.faint;
    for (const { lines, dashes } of this.paths) {
      context.setLineDash(dashes.map((dash) => dash * pixel));
      context.stroke(lines);
    }
    context.setLineDash([]);
  }
}

/**
 * Draws everything: ground, dragons, labels and measure. No words are written if `labels` is null. `hasFocus` is true
 * if the picture has the focus. A dragon has stage, places (STRIDE numbers a handle, as all handles here), colours (a
 * SpeedScale), path, and marks (see marks.js). It has chosen (a bench, or -1), its chosenName, and its endNames. It
 * also has stale (true if it is stale beside live ones), and identity (see palette.js; null for a single dragon).
 * `ghosts` are outlines at other times, each with `stage`, `places`, `kind` and `text`. Returns the words written, as
 * boxes in pixels.
 */
export function draw(context, camera, palette, { ground, dragons, ghosts = [], labels, measure, hasFocus }) {
  ground.cover(context, camera, palette,
      dragons.map(({ path, obstacles, identity }) => ({ lines: path, obstacles, dashes: identity?.dashes ?? [] })));
  const stale = dragons.filter((dragon) => dragon.stale);
  for (const dragon of stale) drawDragon(context, camera, palette, ground.transparent, dragon);
  if (stale.length) ground.dim(context, DIMMED);
  for (const ghost of ghosts) drawGhost(context, camera, palette, ghost);
  for (const dragon of dragons) if (!dragon.stale) drawDragon(context, camera, palette, ground.transparent, dragon);
  const measured = measure.draw(context, camera, palette, hasFocus);
  if (!labels) return measured;
  const keep = [scaleBar(context, camera, palette), ...measured], { items, rings, marked } = wordsOf(dragons, palette,
      camera.width < NARROW);
  for (const [k, { kind, places: [x, y], text }] of ghosts.entries()) items.push(
      { key: `ghost ${k} ${text}`, text, ink: palette[GHOSTS[kind].ink], x, y });
  return labels.draw(context, camera, palette, { dragons, items, rings: rings.map(({ x, y }) => camera.toPixel(x, y)),
      marked, keep });
}

/** The outlines of a team at other times: dashed before the shown time, in the colour of danger at an event. */
const GHOSTS = { before: { ink: "ink", dashes: [3, 3] }, after: { ink: "ink", dashes: [] },
    event: { ink: "danger", dashes: [] } };
/** The opacity of a ghost. */
const GHOSTLY = 0.55;

function drawGhost(context, camera, palette, { stage, places, kind }) {
  const pixel = camera.unit / camera.scale, { ink, dashes } = GHOSTS[kind];
  inMetres(context, camera);
  Object.assign(context, { strokeStyle: palette[ink], lineWidth: pixel, globalAlpha: GHOSTLY });
  context.setLineDash(dashes.map((dash) => dash * pixel));
  for (const bench of inSight(camera, stage, places)) {
    context.beginPath();
    outline(context, rectangle(stage, places, bench));
    context.stroke();
  }
  context.setLineDash([]);
  context.globalAlpha = 1;
}

function drawDragon(context, camera, palette, transparent, dragon) {
  const { stage, places, marks, chosen, identity } = dragon, pixel = camera.unit / camera.scale;
  inMetres(context, camera);
  context.lineJoin = "miter";
  const count = places.length / STRIDE - 1, board = (bench) => rectangle(stage, places, bench);
  const mark = (bench, ink, width, dashes = []) => {
    const trace = () => {
      context.beginPath();
      outline(context, board(bench));
      context.stroke();
    };
    doubled(context, palette, pixel, ink, width, trace, dashes);
  };
  if (identity) casing(context, camera, palette, transparent, dragon);
  benches(context, camera, palette, dragon);
  headSign(context, board(0), palette, pixel);
  if (count > 1) tailSign(context, board(count - 1), palette, pixel);
  mark(0, palette.ink, 2);
  if (count > 1) mark(count - 1, palette.ink, 1);
  // The first in the list lies on top.
  for (const { pair, ink, dashes } of marks.toReversed()) pair.filter((bench) => bench < count).forEach(
      (bench) => mark(bench, palette[ink], 3.5, dashes));
  if (chosen >= 0 && chosen < count) mark(chosen, palette.ink, 3, [7, 4]);
  for (const { kind, place, line, ink, ghost } of marks.toReversed()) {
    if (place && kind !== "nearest") target(context, place, palette, pixel, palette[ink], ghost);
    if (line) between(context, line, palette, pixel, palette[ink]);
  }
}

/**
 * A line around all boards together, below them, in the colour and the dashes of a dragon. The line is left out between
 * two turns of a coil without room for it.
 */
function casing(context, camera, palette, transparent, { stage, places, identity }) {
  const pixel = camera.unit / camera.scale;
  context.beginPath();
  for (let k = 0; k < places.length; k += STRIDE) context.lineTo(places[k], places[k + 1]);
  context.lineJoin = "round";
  context.strokeStyle = identity.colour;
  context.lineWidth = stage.width + 2 * CASING_TO * pixel;
  context.setLineDash(identity.dashes.map((dash) => dash * pixel));
  context.stroke();
  context.setLineDash([]);
  if (transparent) context.globalCompositeOperation = "destination-out";
  context.strokeStyle = palette.ground;
  context.lineWidth = stage.width + 2 * CASING_FROM * pixel;
  context.stroke();
  context.globalCompositeOperation = "source-over";
  context.lineJoin = "miter";
}

/**
 * The words of all dragons, the most important first; the signs that they leave free, and the outlined boards. On a
 * narrow picture sentences have two lines.
 */
function wordsOf(dragons, palette, isNarrow) {
  const items = [], rings = [], marked = [], named = new Set();
  const name = (dragon, bench, text, ink) => {
    const key = `${dragons.indexOf(dragon)} ${bench}`;
    if (text && !named.has(key)) items.push({ key, text, ink, dragon, bench });
    named.add(key);
  };
  const each = (write) => dragons.forEach((dragon) => write(dragon, dragon.places.length / STRIDE - 1));
  each(({ marks }) => {
    for (const { place } of marks) if (place) rings.push(place);
  });
  each(({ marks }, _) => {
    for (const { kind, place, ink, text } of marks) {
      if (!place || !text) continue;
      const isEvent = kind !== "nearest";
      items.push({ key: `${kind} ${items.length}`, text: isNarrow && isEvent ? halved(text) : text, ink: palette[ink],
          large: isEvent ? 1.25 : 1, hasRing: isEvent, ...place });
    }
  });
  each((dragon, count) => {
    for (const { pair, ink, names } of dragon.marks) {
      pair.forEach((bench, k) => {
        if (bench >= count) return;
        marked.push({ dragon, bench });
        name(dragon, bench, names[k], palette[ink]);
      });
    }
  });
  each((dragon, count) => {
    const { chosen, chosenName, endNames: [front, rear] } = dragon;
    if (chosen >= 0 && chosen < count) {
      marked.push({ dragon, bench: chosen });
      name(dragon, chosen, chosenName, palette.ink);
    }
    name(dragon, 0, front, palette.ink);
    if (count > 1) name(dragon, count - 1, rear, palette.ink);
  });
  // The least important: the names of the obstacles.
  each(({ obstacles }) => {
    for (const { name: text, isBoundary, x, y } of obstacles) if (!isBoundary) items.push({ key: `obstacle ${text}`,
        text, ink: palette.ink, x, y });
  });
  return { items, rings, marked };
}

/** A sentence in two lines, divided at the comma or space nearest to its middle. */
function halved(text) {
  const places = [...text.matchAll(/[,，] ?| /g)].map(({ index, 0: gap }) => index + gap.length);
  if (!places.length) return text;
  const cost = (at) => Math.abs(at - text.length / 2) - (/[,，]/.test(text.slice(at - 2, at)) ? text.length / 6 : 0);
  const at = places.reduce((best, one) => (cost(one) < cost(best) ? one : best));
  return `${text.slice(0, at).trim()}\n${text.slice(at)}`;
}

/** The benches that are in the picture. */
function inSight(camera, stage, places) {
  const count = places.length / STRIDE - 1, reach = longestOf(stage), seen = [];
  const across = camera.width / camera.scale / 2, down = camera.height / camera.scale / 2, { c, s } = camera;
  const wide = Math.abs(c) * across + Math.abs(s) * down + reach, high = Math.abs(s) * across + Math.abs(c) * down +
      reach;
  for (let bench = 0; bench < count; bench++) {
    const x = places[STRIDE * bench] - camera.x, y = places[STRIDE * bench + 1] - camera.y;
    if (x > -wide && x < wide && y > -high && y < high) seen.push(bench);
  }
  return seen;
}

/**
 * Boards in a colour, with an edge if a colour and a width are given. Each board is one line of the board's width in a
 * separate path. Browsers draw a single line as a rectangle, which is faster than a path of several corners.
 */
export function fillBoards(context, stage, places, benches, colour, edge) {
  context.strokeStyle = colour;
  for (const bench of benches) {
    const { x, y, c, s, l, w } = rectangle(stage, places, bench);
    context.lineWidth = 2 * w;
    context.beginPath();
    context.moveTo(x - l * c, y - l * s);
    context.lineTo(x + l * c, y + l * s);
    context.stroke();
  }
  if (!edge) return;
  [context.strokeStyle, context.lineWidth] = edge;
  for (let first = 0; first < benches.length; first += BATCH) {
    context.beginPath();
    for (const bench of benches.slice(first, first + BATCH)) outline(context, rectangle(stage, places, bench));
    context.stroke();
  }
}

function benches(context, camera, palette, { stage, places, colours }) {
  const shown = Array.from({ length: SHADES + 1 }, () => []);
  for (const bench of inSight(camera, stage, places)) shown[colours.shade(bench)].push(bench);
  const shades = colours.resting ? palette.resting : palette.shades, wide = stage.width * camera.scale;
  const edge = wide > 5 ? [palette.ground, 1 / camera.scale] : null;
  shown.forEach((all, shade) => fillBoards(context, stage, places, all, shades[shade] ?? palette.still, edge));
  if (wide < 14) return;
  // Large boards show their handles.
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

/** A sign on a board: a line with a rim. One is light and one dark, so that one is visible on every colour. */
function onBoard(context, palette, width, pixel) {
  context.strokeStyle = palette.near;
  context.lineWidth = width + 3 * pixel;
  context.stroke();
  context.strokeStyle = palette.far;
  context.lineWidth = width;
  context.stroke();
}

/** Chevrons in the direction of travel. */
function headSign(context, { x, y, c, s, l, w }, palette, pixel) {
  context.beginPath();
  for (const at of [0.85, 0.5, 0.15]) {
    const tip = at * l, back = tip - 1.2 * w, side = 0.75 * w;
    context.moveTo(x + back * c - side * s, y + back * s + side * c);
    context.lineTo(x + tip * c, y + tip * s);
    context.lineTo(x + back * c + side * s, y + back * s - side * c);
  }
  onBoard(context, palette, Math.max(0.2 * w, 1.5 * pixel), pixel);
}

/** Bars across the end. */
function tailSign(context, { x, y, c, s, l, w }, palette, pixel) {
  context.beginPath();
  for (const at of [0.88, 0.64, 0.4]) {
    const along = -at * l;
    context.moveTo(x + along * c - w * s, y + along * s + w * c);
    context.lineTo(x + along * c + w * s, y + along * s - w * c);
  }
  onBoard(context, palette, Math.max(0.25 * w, 1.5 * pixel), pixel);
}
