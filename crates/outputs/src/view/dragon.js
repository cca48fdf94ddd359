// One dragon of a publisher's show: its present pose, its path and colours, its lanterns and its part of the marks.
// Knows the words at its ends, and no canvas.

import { widestOf } from "./boards.js";
import { centreOf, obstaclesOf, pathOf } from "./drawing.js";
import { STRIDE, speedOf } from "./hermite.js";
import { SpeedScale } from "./palette.js";
import { Show } from "./show.js";
import { nameOf, say } from "./words.js";

/** Returns the distance of the outermost bench from a place. */
function reachOf(stage, handles, { x, y }) {
  let most = 0;
  for (let k = 0; k < handles.length; k += STRIDE) most = Math.max(most,
      Math.hypot(handles[k] - x, handles[k + 1] - y));
  return most + widestOf(stage) + stage.hole_inset || 1;
}

export class Dragon {
  /** `show` selects the show look, `still` stops its motion. */
  constructor(publisher, { show, still }) {
    this.publisher = publisher;
    this.colours = new SpeedScale();
    this.show = show ? new Show(still) : null;
    /** Its sizes and its path, with the events and the obstacles of the whole show. */
    this.stage = null;
    /** Its name among the dragons of its show; empty for a single one. */
    this.part = "";
    /** The number of its first handle and bench in messages. */
    this.first = 0;
    /** Its handles at the moment of the picture, and the newest frame with its handles alone. */
    this.places = this.frame = null;
    this.path = null;
    this.reach = 1;
    this.marks = [];
  }

  /** The name by which people know it; after the publisher's for one of several dragons of several publishers. */
  get name() {
    const { part, publisher } = this;
    return part && publisher.several ? `${publisher.name} ${part}` : this.ownName;
  }

  /** Its name in its show, or that of its publisher for a single dragon. */
  get ownName() {
    return this.part || this.publisher.name;
  }

  /** Returns true if there is something to draw. */
  get isThere() {
    return this.publisher.isThere && this.places !== null;
  }

  get newest() {
    return this.frame;
  }

  get sight() {
    return this.publisher.sight;
  }

  /** Returns words of the picture about it: with its name, and after the publisher's if there are several. */
  own(words) {
    return this.publisher.own(this.part ? say("ofDragon", { words, dragon: this.part }) : words);
  }

  /** Another run, in which it is number `k` of the dragons. */
  begin(stage, k) {
    const { name, first_handle, ...own } = stage.dragons[k], isOnly = stage.dragons.length === 1;
    Object.assign(this, { stage: { ...stage, ...own }, part: isOnly ? "" : name, first: first_handle, isOnly });
    // The first one draws the obstacles of the show.
    this.obstacles = k === 0 ? obstaclesOf(stage) : [];
    this.colours.clear();
    [this.path, this.frame, this.places] = [null, null, null];
  }

  /** Takes its handles out of the newest frame and out of those at the moment of the picture. */
  place(newest, all) {
    const from = STRIDE * this.first, to = this.isOnly ? all.length : from + STRIDE * (this.stage.benches + 1);
    if (this.frame?.of !== newest) this.frame = { ...newest, of: newest, handles: newest.handles.subarray(from, to) };
    if (this.places?.buffer !== all.buffer) this.places = all.subarray(from, to);
    this.colours.take(this.frame);
    this.measure();
  }

  /** Sets the extent of the team, and the path as far out. */
  measure() {
    const { stage } = this, { handles } = this.frame, centre = centreOf(stage), turns = reachOf(stage, handles, centre);
    this.reach = centre.x || centre.y ? reachOf(stage, handles, { x: 0, y: 0 }) : turns;
    // The rounding of positions to 32 bits moves the outermost bench a little.
    if (this.path && turns <= 1.001 * this.path.turns) return;
    // A team that moves outward gets room ahead.
    const room = this.path ? 1.1 : 1;
    this.path = { reach: room * this.reach, turns: room * turns, lines: pathOf(stage, room * turns) };
  }

  /** Returns a bench's number within it; -1 for none of its benches. */
  within(number) {
    const bench = number == null ? -1 : number - this.first;
    return bench >= 0 && bench < this.places.length / STRIDE - 1 ? bench : -1;
  }

  /** Updates its lanterns: the situation, the alert, whether an event has happened, and what is shown. */
  light({ now, sight, alert, happened, shown, epoch }) {
    if (!this.show) return;
    const { places } = this,
        benches = [alert?.event_bench_a, alert?.event_bench_b].map((number) => this.within(number));
    this.show.breathe(now, sight.stale);
    // The place of an event is with its first bench.
    const isFirst = this.isOnly || benches[0] >= 0, x = alert?.event_x ?? places[0], y = alert?.event_y ?? places[1];
    this.show.update({
      time: shown.time, places, stands: sight.stands || sight.stale, jumped: epoch !== shown.from.epoch,
      coming: { benches: benches.filter((bench) => bench >= 0), seconds: sight.seconds }, happened,
      flash: happened && isFirst ? { x, y } : null,
    });
  }

  /** Returns true if its show plays and it stands: before its delay has passed, or at the end of its path. */
  get stands() {
    return this.frame.playing && speedOf(this.frame.handles, 0) === 0;
  }

  /** Returns the words at its ends: head and tail, with its name if there are several. */
  endNames() {
    const gone = this.publisher.several && this.sight.stale ? ` (${say(this.sight.trouble ?? "noFramesNow")})` : "";
    return [this.own(say("head")) + gone, this.own(say("tail"))];
  }

  /** Returns the name of its bench on the picture. */
  benchName(bench) {
    return this.own(nameOf(bench));
  }

  /**
   * Returns a value that changes with its picture, at least once while a board moves by `least` metres.
   */
  lookKey(least) {
    const { frame, colours, marks, stage, publisher, sight } = this, { shown, stream } = publisher;
    const step = least / colours.fastest, moment = step > 0 ? Math.floor(shown.time / step) : shown.time;
    const texts = marks.map(({ kind, pair, benches, text }) => [kind, pair, benches, text]);
    const show = [frame.run, frame.state, moment, shown.from.epoch, stream.alert?.level, stage.scene];
    const light = [this.show?.phase, sight.stale, sight.trouble];
    return [show, colours.resting, this.path.reach, colours.step, colours.head, texts, light].join();
  }

  /** For tests and measurements; empty for a publisher that is gone. */
  report(camera) {
    const { newest, shown } = this.publisher, there = this.isThere && !this.sight.trouble,
        life = this.show?.life ?? null;
    const { name } = this;
    if (!there) return { name, life, state: null, run: null, sequence: null, head: null, shown: null,
        time: newest?.time ?? null };
    const head = camera.toPixel(this.places[0], this.places[1]), { state, run, sequence, time } = newest;
    return { name, life, state, run, sequence, time, head, shown: { ...shown, handles: this.places } };
  }
}
