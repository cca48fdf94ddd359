// The time line: plays, pauses and scrubs; events and cues, which can be dragged; the clearance as a curve. In: the
// scene, its results, the shown time. Out: times, and places of cues.

import { Curve } from "../curve.js";
import { capital, say } from "../words.js";
import { made } from "./fields.js";

const element = (id) => document.getElementById(id);
/** Seconds of one arrow key on a cue, and with Shift. */
const STEP = 0.5, FINE_STEP = 0.1;

export class TimeLine {
  /** `acts` has at(time), cue(number, time, gesture) and drop(). */
  constructor(acts) {
    Object.assign(this, { acts, time: 0, start: 0, end: 1, playing: false, before: 0, cues: [], events: [],
      held: null, gestures: 0, facts: null });
    this.curve = new Curve(element("curve"));
    [this.line, this.marks, this.toggle, this.speed] = ["when", "marks", "play", "speed"].map(element);
    this.line.oninput = () => {
      this.play(false);
      this.go(this.line.valueAsNumber);
    };
    this.toggle.onclick = () => this.play(!this.playing);
  }

  /** Shows a scene's line; its results follow. */
  show({ start, end, cues }) {
    Object.assign(this, { start, end, cues });
    Object.assign(this.line, { min: start, max: end });
    this.mark();
    this.put();
  }

  /** Shows the events, and the times of cues that depend on them. */
  showEvents({ list = [], cues, end }) {
    this.events = list;
    cues?.forEach(({ at }, k) => this.cues[k] && (this.cues[k] = { ...this.cues[k], at }));
    if (Number.isFinite(end)) this.last = end;
    this.mark();
  }

  /** Shows the curve of the clearance. */
  showFacts({ list = [], curve }, stage) {
    const least = list.find(({ check }) => check === "clearance");
    this.facts = curve?.length && least?.time != null ? { clearance: { points: curve, least } } : null;
    this.stage = { ...stage, freeze_time: this.end };
    this.put();
  }

  get span() {
    return this.end - this.start || 1;
  }

  share(time) {
    return (time - this.start) / this.span;
  }

  mark() {
    const focus = document.activeElement?.dataset?.cue;
    const events = this.events.filter(({ time }) => Number.isFinite(time)).map((event) => {
      const mark = made("i", { className: event.event === "path_end" ? "event end" : "event",
        title: `${capital(say(event.event))}, ${event.time.toFixed(1)} s` });
      mark.style.setProperty("--share", this.share(event.time));
      return mark;
    });
    const cues = this.cues.map((cue, number) => this.cueMark(cue, number));
    this.marks.replaceChildren(...events, ...cues);
    if (focus) this.marks.querySelector(`[data-cue="${focus}"]`)?.focus();
  }

  cueMark({ name, at }, number) {
    if (this.held?.number === number) return this.held.node;
    const words = `Cue ${number + 1}, ${name}, ${Number.isFinite(at) ? `${at.toFixed(1)} s` : "not reached"}`;
    const node = made("button", { type: "button", className: "cue", title: words,
      attributes: { "aria-label": words, "data-cue": number, "data-handle": `cues[${number}]` } });
    node.style.setProperty("--share", this.share(at ?? this.end));
    const send = (time) => this.acts.cue(number, Math.min(this.end, Math.max(this.start, time)),
        `cue ${this.gestures}`);
    node.onpointerdown = ({ pointerId }) => {
      node.setPointerCapture(pointerId);
      this.held = { number, node };
      this.gestures++;
    };
    node.onpointermove = ({ clientX }) => {
      if (this.held?.node !== node) return;
      const { left, width } = this.marks.getBoundingClientRect(), share = (clientX - left) / width;
      node.style.setProperty("--share", Math.min(1, Math.max(0, share)));
      send(this.start + share * this.span);
    };
    node.onpointerup = node.onpointercancel = () => {
      this.held = null;
      this.acts.drop();
      this.mark();
    };
    node.onkeydown = (event) => {
      const { key, shiftKey, repeat } = event, way = { ArrowLeft: -1, ArrowRight: 1 }[key];
      if (!way) return;
      event.preventDefault();
      event.stopPropagation();
      if (!repeat) this.gestures++;
      send((this.cues[number]?.at ?? this.time) + way * (shiftKey ? FINE_STEP : STEP));
    };
    node.onclick = () => this.go(this.cues[number]?.at ?? this.time);
    return node;
  }

  play(playing) {
    if (playing && this.time >= Math.min(this.end, this.last ?? Infinity) - 1e-9) this.go(this.start);
    this.playing = playing;
    this.before = performance.now();
    this.toggle.textContent = playing ? "❚❚ Pause" : "▶ Play";
    this.toggle.setAttribute("aria-pressed", playing);
  }

  /** Shows a time. */
  go(time) {
    this.time = Math.min(this.end, Math.max(this.start, time));
    this.acts.at(this.time);
    this.put();
  }

  /** Advances a show that plays. */
  pass(now) {
    if (!this.playing) return;
    const time = this.time + ((now - this.before) / 1000) * Number(this.speed.value),
        end = Math.min(this.end, this.last ?? Infinity);
    this.before = now;
    this.go(Math.min(time, end));
    if (time >= end) this.play(false);
  }

  put() {
    const { line, time } = this;
    line.value = time;
    line.setAttribute("aria-valuetext", `${time.toFixed(1)} s`);
    element("clock").textContent = `${time.toFixed(1)} / ${this.end.toFixed(1)} s`;
    this.curve.show(this.facts, this.stage, time);
  }
}
