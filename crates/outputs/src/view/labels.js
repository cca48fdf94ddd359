// Words on the picture: their plates, and the lines to their boards. Keeps the layout between pictures, so that words
// stand still beside their boards and move without jumps.

import { longestOf, rectangle } from "./boards.js";
import { STRIDE } from "./hermite.js";
import { RING, along, beyond, layout, shortOf, standsAtOwn } from "./label_layout.js";

/** The least time between two layouts of the same labels, and the time in which words move to a new place (ms). */
const INTERVAL = 250, EASING = 200;
/** The size of letters, and the distance of two lines (px). */
const LETTERS = 15, LEADING = 18;
/** The share of a board's part between its neighbours on which lines end. */
const FREE = 0.9;
/** The narrowest picture on which sentences stand in one line (px). */
export const NARROW = 700;

export class Labels {
  /** `isStill`: true for a user who prefers no motion. */
  constructor(isStill) {
    this.isStill = isStill;
    this.shown = new Map();
    this.placed = [];
    this.key = null;
    this.laidAt = this.drawnAt = -Infinity;
    /** True while a word moves, and if the layout is of an earlier picture. */
    this.isMoving = this.isLate = false;
  }

  /** Returns true if the words want another picture now. */
  isDue(now) {
    return this.isMoving || (this.isLate && now - this.laidAt >= INTERVAL);
  }

  /**
   * Draws labels, in the order of their importance. Each has `text`, `key`, `ink`, and `large` (times the usual size).
   * Each label also has either `dragon` and `bench`, or the place `x`, `y` of an event. `keep` are boxes that words may
   * not cover. Returns the boxes written, each with its text, its bench, and the end of its line.
   */
  draw(context, camera, palette, { dragons, items, rings, marked, keep }) {
    const { width, height, ratio, unit } = camera, now = performance.now();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    Object.assign(context, { textAlign: "center", textBaseline: "middle", lineJoin: "round", lineCap: "round" });
    const starts = firsts(dragons),
        all = items.map((item) => this.measured(context, camera, item, starts)).filter(
        ({ x, y }) => x >= 0 && y >= 0 && x <= width && y <= height);
    const key = [all.map((one) => one.key), width, height, camera.c, camera.s].join();
    if (key !== this.key || now - this.laidAt >= INTERVAL) {
      const last = new Map([...this.shown].map(([one, { x, y }]) => [one, { x, y }]));
      const signs = rings.map(([x, y]) => ({ x, y, radius: RING * unit })),
          outlined = marked.map(({ dragon, bench }) => starts.get(dragon) + bench);
      const boards = dragons.flatMap((dragon) => Array.from({ length: dragon.places.length / STRIDE - 1 },
          (_, bench) => boardOf(dragon, bench, camera)));
      this.placed = layout({ boards, items: all, rings: signs, marked: outlined, keep, width, height, unit, last });
      [this.key, this.laidAt] = [key, now];
    }
    const labels = this.move(now, all, camera, dragons);
    for (const label of labels) if (label.line) this.leader(context, palette, unit, label);
    for (const label of labels) this.plate(context, palette, unit, label);
    context.lineCap = "butt";
    return [...keep, ...labels.map(({ item, box, line, isBadge }) => (
        { ...box, text: item.text, bench: item.bench ?? null, dragon: item.bench === undefined ? null
        : dragons.indexOf(item.dragon), end: line?.to ?? null, isBadge }))];
  }

  measured(context, camera, item, starts) {
    const { unit, width } = camera, { text, large = 1, dragon, bench } = item, rows = text.split("\n");
    const wide = (size) => {
      context.font = `600 ${LETTERS * unit * size}px system-ui, sans-serif`;
      return Math.max(...rows.map((row) => context.measureText(row).width));
    };
    // On a phone a long sentence is smaller.
    const size = large * Math.min(1, (width - 30 * unit) / wide(large)), half = wide(size) / 2 + 6 * unit,
        tall = (0.5 * LEADING * rows.length * size + 3) * unit;
    if (bench === undefined) {
      const [x, y] = camera.toPixel(item.x, item.y);
      return { ...item, rows, size, half, tall, x, y };
    }
    const own = boardOf(dragon, bench, camera);
    return { ...item, rows, size, half, tall, x: own.x, y: own.y, own, board: starts.get(dragon) + bench };
  }

  /** Moves the words of the last layout with their boards, and part of the way to a new place beside them. */
  move(now, items, camera, dragons) {
    // After a rest a word begins to move, however long the rest was.
    const passed = this.isMoving ? Math.min(100, now - this.drawnAt) : 1000 / 60;
    const part = this.isStill ? 1 : 1 - Math.exp((-3 * passed) / EASING);
    const kept = new Map();
    this.drawnAt = now;
    [this.isMoving, this.isLate] = [false, this.laidAt !== now];
    const { unit } = camera;
    const labels = this.placed.flatMap(({ item: { key }, box, line, share, isBadge, goal }, index) => {
      const item = items.find((one) => one.key === key);
      if (!item) return [];
      const end = item.own ? along(item.own, share) : { x: item.x, y: item.y };
      // The place of a layout beside the end of its line.
      const wanted = goal ?? (this.placed[index].goal = { x: box.x - end.x, y: box.y - end.y }),
          from = this.shown.get(key);
      const isOther = !from || from.share !== share || isBadge;
      const far = isOther ? 0 : Math.hypot(wanted.x - from.x, wanted.y - from.y),
          offset = isOther || far < 0.5 ? wanted : { x: from.x + part * (wanted.x - from.x),
          y: from.y + part * (wanted.y - from.y) };
      this.isMoving ||= far >= 0.5;
      kept.set(key, { ...offset, share });
      const at = { x: end.x + offset.x, y: end.y + offset.y, half: item.half, tall: item.tall };
      const isBare = !line || (item.own && standsAtOwn(item.own, boardsNear(dragons, camera, at, unit), at, unit));
      return [{ item, box: at, line: isBare ? null : lineOf(at, end, item.own ? 0 : shortOf(item) * unit), isBadge }];
    });
    this.shown = kept;
    return labels;
  }

  leader(context, palette, unit, { item, line: { from, to } }) {
    const stroke = (colour, width) => {
      Object.assign(context, { strokeStyle: colour, lineWidth: width * unit });
      context.beginPath();
      context.moveTo(from.x, from.y);
      context.lineTo(to.x, to.y);
      context.stroke();
    };
    const dot = (colour, radius) => {
      context.fillStyle = colour;
      context.beginPath();
      context.arc(to.x, to.y, radius * unit, 0, 7);
      context.fill();
    };
    stroke(palette.near, 4.5);
    if (item.own) dot(palette.near, 5);
    stroke(item.ink, 1.8);
    if (item.own) dot(item.ink, 3.5);
  }

  plate(context, palette, unit, { item, box: { x, y, half, tall }, isBadge }) {
    const { ink, rows, size } = item;
    context.font = `600 ${LETTERS * unit * (isBadge ? 0.85 : size)}px system-ui, sans-serif`;
    if (isBadge) {
      Object.assign(context, { strokeStyle: palette.near, lineWidth: 4 * unit, fillStyle: ink });
      context.strokeText(item.bench + 1, x, y);
      context.fillText(item.bench + 1, x, y);
      return;
    }
    context.beginPath();
    context.roundRect(x - half, y - tall, 2 * half, 2 * tall, 4 * unit);
    context.globalAlpha = 0.9;
    context.fillStyle = palette.near;
    context.fill();
    context.globalAlpha = 1;
    Object.assign(context, { strokeStyle: ink, lineWidth: 1.2 * unit, fillStyle: ink });
    context.stroke();
    rows.forEach((row, k) => context.fillText(row, x, y + (k - (rows.length - 1) / 2) * LEADING * unit * size));
  }
}

/** A line from the edge of a box to a place, or to `short` pixels before it. */
function lineOf({ x, y, half, tall }, end, short) {
  const dx = end.x - x, dy = end.y - y, away = Math.hypot(dx, dy) || 1,
      out = Math.min(1, half / Math.abs(dx || 1e-9), tall / Math.abs(dy || 1e-9));
  return { from: { x: x + dx * out, y: y + dy * out }, to: { x: end.x - (dx * short) / away,
      y: end.y - (dy * short) / away } };
}

/** A board of a dragon in pixels of the screen. */
function boardOf({ stage, places }, bench, camera) {
  const { scale, c, s } = camera, board = rectangle(stage, places, bench), [x, y] = camera.toPixel(board.x, board.y);
  return { x, y, c: board.c * c - board.s * s, s: -(board.c * s + board.s * c), l: board.l * scale, w: board.w * scale,
      free: Math.max(0, FREE * (1 - (2 * stage.hole_inset) / board.l)) };
}

/** The boards that may be taken for the board of a box. */
function boardsNear(dragons, camera, box, unit) {
  const [x, y] = camera.toStage(box.x, box.y), near = [];
  for (const dragon of dragons) {
    const { stage, places } = dragon, reach = beyond(box, unit) / camera.scale + longestOf(stage);
    for (let bench = 0; bench < places.length / STRIDE - 1; bench++) {
      const k = STRIDE * bench;
      if (Math.abs(places[k] - x) < reach && Math.abs(places[k + 1] - y) < reach) near.push(
          boardOf(dragon, bench, camera));
    }
  }
  return near;
}

/** The index of each dragon's first board among the boards of all. */
function firsts(dragons) {
  const starts = new Map();
  let next = 0;
  for (const dragon of dragons) {
    starts.set(dragon, next);
    next += dragon.places.length / STRIDE - 1;
  }
  return starts;
}
