// One publisher's dragon: its stream, its present pose, its path and colours, its state and its marks. Knows the words
// for its marks, and no canvas.

import { centreOf, obstaclesOf, pathOf } from "./drawing.js";
import { STRIDE } from "./hermite.js";
import { Nearest, Overlap, marksOf } from "./marks.js";
import { SpeedScale } from "./palette.js";
import { Show } from "./show.js";
import { Stream } from "./stream.js";
import { Transport } from "./transport.js";
import { benchesOf, nameOf, remaining, say } from "./words.js";

/** The situation without anything to show. */
const WAITING = { name: "waiting", severity: "ok", happened: false, sentence: null };
/** A state that the server does not list is shown as one without danger. */
const UNKNOWN = { ...WAITING, name: "unknown" };
/** The time without frames after which the page reports silence (ms). */
const SILENCE = 2000;
/** The number of `ended` among the states of playback. */
const ENDED = 3;
/** Milliseconds between the frames of the slowest publisher. */
const LONGEST_PERIOD = 10_000;

/** Returns the distance of the outermost bench from a place. */
function reachOf(stage, handles, { x, y }) {
  let most = 0;
  for (let k = 0; k < handles.length; k += STRIDE) most = Math.max(most, Math.hypot(handles[k] - x, handles[k + 1] - y));
  return most + stage.width + stage.hole_inset || 1;
}

/**
 * Returns the time at which the head reaches the end of the path, if the show gets there and no counted event is
 * before.
 */
function pathEnd(stage, alert) {
  const end = stage.events.find(({ event, time }) => event === "path_end" && time <= stage.freeze_time);
  return end && alert?.event == null ? end.time : NaN;
}

function overlapWords({ pair, depth }) {
  return depth < 0.0005 ? say("touchNow", { benches: benchesOf(pair) }) : say("overlapNow", { benches: benchesOf(pair), metres: depth.toFixed(3) });
}

export class Dragon {
  /**
   * `name` is the publisher's, written before its words if there are `several`; `show` selects the show look, `still`
   * stops its motion.
   */
  constructor(name, { several, show, still }) {
    this.name = name;
    this.several = several;
    this.stream = new Stream(several ? name : null);
    this.colours = new SpeedScale();
    this.show = show ? new Show(still) : null;
    this.overlap = new Overlap();
    this.nearest = new Nearest();
    this.transport = new Transport();
    /** The handles at the moment of the picture, and the two frames around it. */
    this.places = this.shown = null;
    this.path = this.run = this.team = this.epoch = null;
    /** The age of the frames in the last pictures, ms; the frames a second, NaN until they have been counted. */
    this.latency = [];
    this.rate = NaN;
    this.counted = 0;
    this.reach = 1;
    this.state = WAITING;
    this.sight = null;
    this.marks = [];
  }

  get stage() {
    return this.stream.stage;
  }

  get newest() {
    return this.stream.playback.newest;
  }

  /** Returns true if there is something to draw. */
  get isThere() {
    return Boolean(this.newest && this.stage);
  }

  /** Returns a word or a sentence of the picture, after the publisher's name if there are several. */
  own(words) {
    return this.several ? `${this.name}: ${words}` : words;
  }

  /**
   * Returns the situation: the state, the next event, the seconds of wall time until then at the last known rate, and
   * whether the show stands.
   */
  situation(now) {
    const { playback, stage, alert, trouble } = this.stream, { newest } = playback;
    const silence = newest ? now - newest.at : 0;
    const silent = !trouble && newest && silence > Math.max(SILENCE, 3 * (playback.isPaced ? playback.interval : LONGEST_PERIOD)) ? Math.floor(silence / 1000) : null;
    const lost = trouble ?? (newest && stage ? null : "noStage");
    const current = lost ? WAITING : stage.states[newest.state] ?? UNKNOWN;
    this.transport.look(now, newest, lost ?? (silent === null ? null : "silent"), (number) => this.cueOf(number), this.stream.facts?.loop_stand ?? null);
    let [seconds, ahead] = [NaN, null];
    if (!lost && silent === null && newest.playback !== ENDED && !current.happened) {
      ahead = alert?.event ?? "path_end";
      seconds = ((alert?.event_time ?? pathEnd(stage, alert)) - playback.time(now)) / this.transport.pace;
    }
    return { state: current, alert, trouble: lost, silent, stale: Boolean(lost) || silent !== null, seconds, ahead, stands: !newest?.playing, benches: stage?.benches, obstacles: stage?.obstacles, now: "" };
  }

  /** Returns a cue of the run by its number; null for one that is not known. The stage has the first cues only. */
  cueOf(number) {
    const { stage, cue } = this.stream;
    return stage?.cues.find((one) => one.number === number) ?? (cue?.number === number ? { ...cue, time: cue.cue_time } : null);
  }

  /**
   * Updates the situation and the places. Returns true for a new team, for which earlier choices do not fit. `struck`
   * is then true if something has just happened.
   */
  look(now) {
    const before = this.state, { playback } = this.stream, { newest, stage } = this;
    this.sight = this.situation(now);
    this.state = this.sight.state;
    this.struck = false;
    if (!this.isThere) return false;
    this.shown = playback.at(now, this.places);
    this.places = this.shown.handles;
    const isOther = this.run !== newest.run && this.begin(stage, newest);
    this.colours.take(newest);
    this.measure(stage, newest);
    const { alert } = this.stream, known = stage.states[newest.state] ?? UNKNOWN;
    const deepest = known.happened && known.severity !== "ok" ? this.overlap.look(stage, this.places, newest, this.reach, now) : null;
    const near = newest.playing || this.show ? null : this.nearest.look(stage, this.places, newest);
    const all = marksOf({ state: known, alert, stage, places: this.places, overlap: deepest, near });
    // Marks are for the crew; an audience sees lanterns that burn white.
    this.marks = this.show ? [] : this.named(all, deepest);
    this.sight.now = deepest && !this.sight.trouble ? overlapWords(deepest) : "";
    const happened = this.state.happened && this.state.severity === "error";
    this.struck = happened && before !== WAITING && before.name !== this.state.name;
    const { from } = this.shown;
    this.show?.breathe(now, this.sight.stale);
    this.show?.update({
      time: this.shown.time, places: this.places, stands: this.sight.stands || this.sight.stale, jumped: this.epoch !== from.epoch,
      coming: { benches: [alert?.event_bench_a, alert?.event_bench_b].filter((bench) => bench != null), seconds: this.sight.seconds },
      happened: happened ? { x: alert?.event_x ?? this.places[0], y: alert?.event_y ?? this.places[1] } : null,
    });
    this.epoch = from.epoch;
    return isOther;
  }

  /** Measures the age of the frame in the picture that has just been drawn, if the clock is known. */
  drawn() {
    const { clock } = this.stream, { from, to, time } = this.shown;
    if (clock === null) this.latency.length = 0;
    if (clock === null || from === to) return;
    const part = (time - from.time) / (to.time - from.time);
    this.latency.push(performance.now() + clock - (from.sent + (to.sent - from.sent) * part));
    if (this.latency.length > 600) this.latency.shift();
  }

  /** Counts the frames since the last call, `ms` ago. */
  count(passed) {
    const { received } = this.stream;
    this.rate = ((received - this.counted) * 1000) / passed;
    this.counted = received;
  }

  /** Another run: another path and other speeds. */
  begin(stage, newest) {
    const look = JSON.stringify({ ...stage, run_id: null, scene: null, scene_hash: null, proved: null }), isOther = this.team !== null && this.team !== look;
    [this.team, this.run] = [look, newest.run];
    this.colours.clear();
    return isOther;
  }

  /** Sets the extent of the team, and draws the path as far out. */
  measure(stage, newest) {
    const centre = centreOf(stage), turns = reachOf(stage, newest.handles, centre);
    this.reach = centre.x || centre.y ? reachOf(stage, newest.handles, { x: 0, y: 0 }) : turns;
    // The rounding of positions to 32 bits moves the outermost bench a little.
    if (this.path && this.path.run === this.run && turns <= 1.001 * this.path.turns) return;
    // A team that moves outward gets room ahead.
    const room = this.path?.run === this.run ? 1.1 : 1;
    this.path = { run: this.run, reach: room * this.reach, turns: room * turns, lines: pathOf(stage, room * turns), obstacles: obstaclesOf(stage) };
  }

  /** Words for the marks, in the page's language. */
  named(marks, deepest) {
    const { seconds } = this.sight, time = seconds > -1 ? remaining(Math.max(0, seconds)).join(" ") : null;
    for (const mark of marks) {
      mark.names = mark.pair.map((bench) => this.own(nameOf(bench)));
      const benches = mark.pair.length ? benchesOf(mark.pair) : "", { alert } = this.stream;
      if (mark.kind === "coming") mark.text = this.own(say(time === null ? "comingStill" : "coming", { kind: say(alert.event), benches, time }));
      if (mark.line) mark.text = this.own(say("distance", { metres: mark.place.away.toFixed(3) }));
      if (mark.kind === "overlap") mark.text = this.own(overlapWords(deepest));
    }
    return marks;
  }

  /** Returns the words at its ends: head and tail, with its name if there are several. */
  endNames() {
    const gone = this.several && this.sight.stale ? ` (${say(this.sight.trouble ?? "noFramesNow")})` : "";
    return [this.own(say("head")) + gone, this.own(say("tail"))];
  }

  /** Returns a value that changes with its picture. */
  lookKey() {
    const { newest, colours, shown, stream, marks, stage } = this, texts = marks.map(({ kind, pair, text }) => [kind, pair, text]);
    return [newest.run, newest.state, colours.resting, shown.time, shown.from.epoch, this.path.reach, colours.step, colours.head, stream.alert?.level, texts, stage.scene, this.show?.phase, this.sight.stale].join();
  }

  /** Returns the reason why no frames come, after the first frame; empty while they come. */
  notice() {
    const { newest, sight } = this, stopped = sight.trouble ?? (sight.silent === null ? null : "silent");
    if (!stopped || !this.isThere) return "";
    const words = { server: "lostServer", silent: "silent" }[stopped] ?? "lostPublisher";
    return this.own(say(words, { seconds: sight.silent, time: newest.time.toFixed(1) }));
  }

  /** For tests and measurements; empty for a publisher that is gone. */
  report(camera) {
    const { newest } = this, there = this.isThere && !this.sight.trouble;
    if (!there) return { name: this.name, life: this.show?.life ?? null, state: null, run: null, sequence: null, head: null, shown: null, time: newest?.time ?? null };
    const head = camera.toPixel(this.places[0], this.places[1]);
    return { name: this.name, life: this.show?.life ?? null, state: newest.state, run: newest.run, sequence: newest.sequence, time: newest.time, head, shown: this.shown };
  }
}
