// The picture of the stage: one scene at one time, its ghost, and the marks of its events. In: stages and frames of the
// server. Out: a canvas, drawn by the modules of the page of `view`.

import { benchAt } from "../boards.js";
import { Camera } from "../camera.js";
import { Ground, draw } from "../drawing.js";
import { STRIDE } from "../hermite.js";
import { Labels } from "../labels.js";
import { identitiesOf, paletteOf } from "../palette.js";
import { Publisher } from "../publisher.js";

/** Frames that do not move: the stream of a publisher whose only frame is the newest. */
class Still {
  constructor() {
    Object.assign(this, { stage: null, alert: null, cue: null, facts: null, chase: null, trouble: null, running: null,
      clock: null });
    const playback = (this.playback = { newest: null, isPaced: false, interval: 0, reader: { setStage: () => null },
      time: () => playback.newest.time,
      at: () => ({ time: playback.newest.time, handles: playback.newest.handles, from: playback.newest,
        to: playback.newest }) });
  }
}

/** The share of the picture that stays free around the places in sight. */
const MARGIN = 0.12;
/**
 * The nearest boards of another scene, or of many benches, take long to find. So they are looked for in a picture that
 * has not changed for a time (ms).
 */
const MANY = 500, REST = 300;
/** The identity of the ghost: grey, in short dashes. */
const GHOST = { colour: "#757980", dashes: [3, 6], light: [0, 0, 0] };

export class Picture {
  /** `overlay` is called with every picture; `measure` draws its places on it. */
  constructor(canvas, measure, overlay) {
    Object.assign(this, { canvas, measure, overlay });
    this.context = canvas.getContext("2d");
    this.camera = new Camera();
    this.camera.still = true;
    // A picture of the ground lies below.
    this.ground = new Ground(true, 0);
    this.labels = new Labels(matchMedia("(prefers-reduced-motion: reduce)").matches);
    this.live = new Publisher("", {}, new Still());
    this.ghost = null;
    /** The stage whose frame has not come. */
    this.coming = null;
    /** The events of the scene as they are known, and the marked one. */
    this.events = [];
    this.event = null;
    this.chosen = { dragon: null, bench: -1 };
    this.look = null;
    this.drawn = this.restsAt = 0;
    this.dress();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.dress());
  }

  dress() {
    this.palette = paletteOf(this.canvas);
    this.look = null;
  }

  /** Takes the stage of a scene; it is shown with its first frame. */
  take(stage) {
    this.coming = stage;
  }

  /** Takes a frame; returns true if it can be shown. */
  frame(frame) {
    const { stream } = this.live;
    const isOther = this.coming?.run_id === frame.run;
    if (isOther) [stream.stage, this.coming] = [this.coming, null];
    if (stream.stage?.run_id !== frame.run) return false;
    if (isOther || frame.handles.length / STRIDE > MANY) this.restsAt = performance.now() + REST;
    stream.playback.newest = frame;
    return true;
  }

  get stage() {
    return this.live.stream.stage;
  }

  get time() {
    return this.live.newest?.time ?? 0;
  }

  /** Marks an event of the list of events, or none. */
  mark(event) {
    this.event = event;
  }

  /** Keeps the present picture as a ghost; none if there is one. Returns true for a ghost. */
  pin() {
    if (this.ghost || !this.live.isThere) this.ghost = null;
    else {
      this.ghost = new Publisher("", {}, new Still());
      this.ghost.stream.stage = { ...this.stage, obstacles: [] };
      this.ghost.stream.playback.newest = this.live.newest;
    }
    this.look = null;
    return this.ghost !== null;
  }

  /** Shows places of the stage, all of them and little else. */
  fit(places) {
    if (places.length < 2) return this.camera.whole();
    const [xs, ys] = [0, 1].map((axis) => places.map((place) => place[axis]));
    const [left, right, low, high] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const { width, height } = this.camera, shorter = Math.min(width, height), room = 1 + 2 * MARGIN;
    const scale = Math.min(width / ((right - left) * room || 1), height / ((high - low) * room || 1));
    this.camera.view((left + right) / 2, (low + high) / 2, shorter / scale);
  }

  size() {
    const { width, height } = this.canvas.getBoundingClientRect(), ratio = devicePixelRatio;
    Object.assign(this.camera, { width, height, ratio });
    const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width === wide && this.canvas.height === high) return;
    Object.assign(this.canvas, { width: wide, height: high });
    this.look = null;
  }

  /** Draws a picture if something has changed. */
  pass(now) {
    this.size();
    const { live, ghost, camera } = this;
    if (!live.isThere) return;
    this.judge(live.newest, now >= this.restsAt);
    for (const one of ghost ? [live, ghost] : [live]) {
      one.newest.at = now;
      one.stream.alert = one === live ? this.alert() : null;
      one.update(now);
    }
    const identities = live.dragons.length > 1 ? identitiesOf(live.dragons.map(({ ownName }) => ownName)) : [null];
    live.dragons.forEach((dragon, k) => (dragon.identity = identities[k]));
    camera.update(live.dragons, Infinity);
    camera.reach = Math.max(...live.dragons.map(({ path }) => path.reach));
    const hasFocus = document.activeElement === this.canvas, { measure, palette } = this;
    const look = [live.newest.sequence, now >= this.restsAt, live.dragons.map((dragon) => dragon.lookKey(0)), camera.x, camera.y,
      camera.scale, this.chosen.bench, measure.key, hasFocus && measure.on, ghost?.newest.run].join();
    if (look === this.look && !this.labels.isDue(now)) return;
    this.look = look;
    const dragons = [...live.dragons.map((dragon) => this.drawable(dragon)),
      ...(ghost?.dragons ?? []).map((dragon) => ({ ...this.drawable(dragon), marks: [], endNames: ["", ""],
        identity: GHOST, stale: true }))];
    this.written = draw(this.context, camera, palette, { ground: this.ground, dragons, labels: this.labels, measure,
      hasFocus });
    this.drawn++;
    this.overlay(live.newest);
  }

  drawable(dragon) {
    const { stage, places, colours, path, obstacles, marks, identity } = dragon,
        chosen = dragon === this.chosen.dragon ? this.chosen.bench : -1;
    return { stage, places, colours, path: path.lines, obstacles, marks, identity, stale: false, chosen,
      chosenName: dragon.benchName(chosen), endNames: dragon.endNames() };
  }

  /**
   * Sets the state of a frame to the latest event before it. Boards that may overlap are searched from then on; the
   * nearest boards before. Neither is searched without a clearance.
   */
  judge(frame, isAtRest) {
    const passed = this.events.findLast(({ time }) => time <= frame.time)?.event;
    frame.state = Math.max(0, this.stage.states.findIndex(({ name }) => name === passed));
    const isTouching = this.events.some(({ event, time }) => event === "contact" && time <= frame.time);
    frame.clearance = !isAtRest ? NaN : isTouching ? -1 : 1;
  }

  /** Returns the marked event as the alert of a publisher. */
  alert() {
    if (!this.event) return null;
    const { event, time, bench_a, bench_b, x, y } = this.event, level = time <= this.time ? event : "approaching";
    return { event, level, event_time: time, event_bench_a: bench_a, event_bench_b: bench_b, event_x: x, event_y: y,
      bench_a: null, bench_b: null, severity: "warning", sentence: "" };
  }

  /** Selects the bench at a pixel. */
  choose(x, y) {
    const place = this.camera.toStage(x, y);
    this.chosen = { dragon: null, bench: -1 };
    this.look = null;
    for (const dragon of this.live.isThere ? this.live.dragons : []) {
      const bench = benchAt(dragon.stage, dragon.places, ...place, 8 / this.camera.scale);
      if (bench >= 0) return (this.chosen = { dragon, bench });
    }
    return null;
  }
}
