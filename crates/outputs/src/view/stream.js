// The stream: receives frames, stage and alerts, reconnects, and interpolates between two frames.
// Knows nothing of the page.

import { HermiteReader } from "./hermite.js";

const VERSION = 3;
const HEADER_BYTES = 72;
/** The number of `playing` among the states of playback. */
const PLAYING = 0;
/** Frames that are kept: half a second at the highest rate, and more than the longest gap at the lowest. */
const KEPT_FRAMES = 64;
/** The rate above which more frames make the interpolated motion no smoother. */
const MOST_FRAMES = 125;
/** The gap above which frames (ms) are shown without interpolation: the motion between them is not known. */
const LONGEST_GAP = 1000;
/** The interval of requests for the clock (ms); a server that owes an answer and has sent nothing for as long is gone. */
const CLOCK_INTERVAL = 5000;
/** The window of the past (ms) from which the jitter of the frames is estimated. */
const JITTER_WINDOW = 2000;

/** Parses a frame of the server's layout. Null for a layout of another version. */
export function frameOf(data, at) {
  const bytes = new DataView(data);
  if (data.byteLength < HEADER_BYTES || bytes.getUint8(0) !== VERSION) return null;
  return {
    at,
    state: bytes.getUint8(1),
    playing: bytes.getUint8(2) === PLAYING,
    playback: bytes.getUint8(2),
    time: bytes.getFloat64(8, true),
    scale: bytes.getFloat64(16, true),
    sequence: Number(bytes.getBigUint64(24, true)),
    run: String(bytes.getBigUint64(32, true)),
    sent: Number(bytes.getBigUint64(40, true)) / 1e6,
    tick: Number(bytes.getBigUint64(48, true)),
    clearance: bytes.getFloat32(56, true),
    epoch: bytes.getUint32(60, true),
    cue: bytes.getUint32(64, true),
    handles: new Float32Array(data, HEADER_BYTES),
  };
}

/**
 * Returns the milliseconds of wall time from one frame to the next. Simulated time has no jitter. If it stands still,
 * jumps or changes its rate, the moments of sending are used.
 */
function elapsed(from, to) {
  const even = from.playing && to.playing && from.epoch === to.epoch && from.scale === to.scale && to.time > from.time;
  return even ? (1000 * (to.time - from.time)) / to.scale : Math.max(0, to.sent - from.sent);
}

/** The last frames, and a clock that runs evenly a little behind them, even if they come unevenly. */
class Playback {
  constructor() {
    this.reader = new HermiteReader(KEPT_FRAMES);
    this.clear();
  }

  clear() {
    this.reader.clear();
    this.offsets = [];
    this.earliest = this.lag = this.shown = NaN;
    this.interval = 50;
    this.isPaced = false;
    this.drawnAt = 0;
  }

  get newest() {
    return this.reader.newest;
  }

  push(frame) {
    const last = this.newest;
    if (last && (last.run !== frame.run || last.handles.length !== frame.handles.length)) this.clear();
    // The frame's place on the clock of the publisher: wall time since the first frame that came.
    frame.due = this.newest ? last.due + elapsed(last, frame) : 0;
    this.reader.push(frame);
    this.offsets.push({ at: frame.at, offset: frame.at - frame.due });
    while (this.offsets[0].at < frame.at - JITTER_WINDOW) this.offsets.shift();
    const offsets = this.offsets.map((one) => one.offset).sort((a, b) => a - b);
    this.earliest = offsets[0];
    const spread = offsets[Math.floor(0.95 * (offsets.length - 1))] - offsets[0];
    const { frames } = this.reader, count = Math.min(frames.length, 16);
    this.isPaced = count > 1;
    if (this.isPaced) this.interval = (frame.due - frames.at(-count).due) / (count - 1);
    this.lag = Math.min(this.interval, LONGEST_GAP) + Math.min(spread, 100);
  }

  /** The show's time now, in seconds, as far as the newest frame reaches or a little further. */
  time(now) {
    const { newest } = this;
    if (!newest.playing) return newest.time;
    return newest.time + (Math.min(now - this.earliest - newest.due, this.interval) * newest.scale) / 1000;
  }

  /** Returns the state to draw now: see `HermiteReader.at`. `into` is used again. */
  at(now, into) {
    const { frames } = this.reader;
    const passed = Math.min(now - this.drawnAt, 1000), target = now - this.earliest - this.lag;
    this.drawnAt = now;
    const error = target - this.shown - passed;
    // A small error is corrected slowly, invisibly.
    this.shown = Math.abs(error) < 300 ? this.shown + passed + error * Math.min(1, passed / 300) : target;
    const after = frames.findIndex((frame) => frame.due > this.shown);
    const tooFar = after > 0 && frames[after].due - frames[after - 1].due > LONGEST_GAP;
    return this.reader.at(tooFar ? frames[after].due : this.shown, into);
  }
}

/** The server's stream, reopened whenever it breaks. */
export class Stream {
  /** The stream of a publisher; of the server's only publisher if `name` is null. */
  constructor(name = null) {
    this.name = name;
    this.playback = new Playback();
    this.messages = { stage: {}, alert: {}, cue: {}, facts: {}, chase: {} };
    /** The reason why no frames come: a key of the page's words, or the server's reason; null while they come. */
    this.trouble = "server";
    /** The names of the shows that run on the server's machine instead; null while that is not known. */
    this.running = null;
    this.received = 0;
    /** The transport times of the last frames, ms. */
    this.ways = [];
    /**
     * The offset of the frames' clock to this page's, ms; null while unknown, and always for another machine's frames.
     */
    this.clock = null;
    /** Called with each message that is no frame and no clock. */
    this.onmessage = null;
    this.retry = 250;
    this.open();
  }

  open() {
    const whose = this.name === null ? "" : `&name=${encodeURIComponent(this.name)}`;
    // Beside this module, which a proxy may have below a path.
    const address = new URL(`frames?rate=${MOST_FRAMES}${whose}`, import.meta.url);
    address.protocol = address.protocol.replace("http", "ws");
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    let requested = null, checked = 0, heard = 0, nearest = Infinity;
    const again = () => {
      clearInterval(requests);
      socket.onopen = socket.onmessage = socket.onclose = null;
      socket.close();
      this.lose("server");
      setTimeout(() => this.open(), this.retry);
      this.retry = Math.min(4000, 2 * this.retry);
    };
    const requestClock = () => {
      // Do not wait for the socket to close: a machine that was switched off never closes it.
      const isSilent = requested !== null && heard < checked;
      if (isSilent || socket.readyState !== WebSocket.OPEN) return again();
      checked = performance.now();
      if (requested !== null) return;
      requested = checked;
      socket.send("clock");
    };
    let requests = setInterval(requestClock, CLOCK_INTERVAL);
    socket.onclose = again;
    socket.onopen = () => {
      this.retry = 250;
      this.trouble = "publisher";
      requestClock();
    };
    socket.onmessage = ({ data }) => {
      heard = performance.now();
      if (typeof data !== "string") return this.receive(data);
      const message = JSON.parse(data);
      if (message.type === "clock") {
        // The shortest round trip bounds the offset between the two clocks best.
        const now = performance.now(), way = now - requested;
        requested = null;
        if (message.monotonic_ns === null) {
          // No publisher, or one on another machine: earlier measurements of its frames were wrong.
          [nearest, this.clock] = [Infinity, null];
          this.ways.length = 0;
        } else if (this.clock === null || way <= nearest) {
          nearest = way;
          this.clock = Number(message.monotonic_ns) / 1e6 - (now - way / 2);
        }
      } else this.handle(message);
      if (message.type === "stage" && requested === null) {
        // Another publisher may have another clock. The time limit of the answer is the same.
        clearInterval(requests);
        requests = setInterval(requestClock, CLOCK_INTERVAL);
        requestClock();
      }
    };
  }

  /** The last picture is kept until there is a newer one. The next frames may be of another clock. */
  lose(trouble) {
    this.trouble = trouble;
    this.clock = null;
  }

  /** Sends a message. Returns false if there is no server. */
  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  handle(message) {
    this.onmessage?.(message);
    if (message.type === "waiting") {
      this.lose(message.reason ?? "publisher");
      this.running = message.running ?? null;
    }
    message.at = performance.now();
    if (this.messages[message.type]) this.messages[message.type].newest = message;
  }

  receive(data) {
    const frame = frameOf(data, performance.now());
    if (!frame) return this.lose("version");
    if (this.trouble !== null) this.playback.clear();
    this.trouble = null;
    this.received++;
    if (this.clock !== null && this.ways.push(frame.at + this.clock - frame.sent) > 600) this.ways.shift();
    this.playback.push(frame);
  }

  /** The stage of the run of the latest frames, if it is known. */
  get stage() {
    return this.ofRun("stage");
  }

  /** The latest alert of that run, or null. */
  get alert() {
    return this.ofRun("alert");
  }

  /** The latest cue of that run, or null. */
  get cue() {
    return this.ofRun("cue");
  }

  /** The facts about that run's scene that take time to compute, or null. */
  get facts() {
    return this.ofRun("facts");
  }

  /** The latest status of a chase of that run, or null. */
  get chase() {
    return this.ofRun("chase");
  }

  /** Messages of the next run may come before its first frame: until then those of the last run are kept. */
  ofRun(type) {
    const run = this.playback.newest?.run, { newest, kept } = this.messages[type];
    if (newest && newest.run_id === run) return (this.messages[type].kept = newest);
    return kept && kept.run_id === run ? kept : null;
  }
}
