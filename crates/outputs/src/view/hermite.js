// The handles at the moment of display: cubic Hermite interpolation between the frames of a stream.
//
// The rules are those of the Rust `HermiteReader` (crates/client/src/hermite.rs) and of examples/python/hermite.py. The
// module imports nothing and knows no page: any page may use it unchanged.

/** Numbers of a handle: x, y (m), heading (rad), vx, vy (m per simulated second). */
export const STRIDE = 5;

/**
 * A frame that is pushed.
 *
 * @typedef {object} Frame
 * @property {number} due - the moment of the frame, ms of wall time on any clock that runs evenly
 * @property {number} time - its simulated time, s
 * @property {number} scale - simulated seconds per second of wall time, from this frame on
 * @property {boolean} playing - false while the show stands still: only for that reason its velocities are zero
 * @property {string|number} run - the run of the publisher
 * @property {number} epoch - grows by one at every jump of simulated time
 * @property {Float32Array|Float64Array} handles - STRIDE numbers a handle, head first
 */

/** The speed of a handle without its sign, m per simulated second; NaN if it is not sent. */
export function speedOf(handles, handle) {
  const vx = handles[STRIDE * handle + 3], vy = handles[STRIDE * handle + 4];
  return Math.sqrt(vx * vx + vy * vy);
}

/** The latest frames of a stream, and the poses between them. */
export class HermiteReader {
  /** Keeps the latest `keep` frames: a display that runs d seconds behind r frames a second needs d r + 2. */
  constructor(keep = 64) {
    this.keep = Math.max(2, keep);
    /** @type {Frame[]} */
    this.frames = [];
    this.stage = null;
  }

  /**
   * Sets the `stage` message of a run: the last handle of each of its dragons has the heading of its last bench.
   * Without the stage of its run, a frame is of one dragon.
   */
  setStage(stage) {
    this.stage = stage;
  }

  /** Adds the next frame of a stream, and drops the frames of another run. */
  push(frame) {
    if (this.newest && this.newest.run !== frame.run) this.clear();
    this.frames.push(frame);
    if (this.frames.length > this.keep) this.frames.shift();
  }

  clear() {
    this.frames = [];
  }

  /** The newest frame; null if none has come. */
  get newest() {
    return this.frames.at(-1) ?? null;
  }

  /**
   * Returns the state at a moment on the clock of `due`: the simulated time, the handles, and the two frames around
   * them. Both are the same frame if the handles are exactly a frame's. There is no interpolation before the oldest
   * kept frame, after the newest, and at a jump of simulated time. Returns null if no frame has come.
   *
   * Headings follow from the positions, as in the frames. Without velocities in the stream the path between
   * two frames is a straight line.
   *
   * @param {number} moment - ms
   * @param {Float64Array} [into] - is filled and used again if it has the right length
   */
  at(moment, into) {
    const { frames } = this;
    if (!frames.length) return null;
    let after = frames.length;
    while (after > 0 && frames[after - 1].due > moment) after--;
    const from = frames[Math.max(0, after - 1)], next = frames[after];
    const handles = into?.length === from.handles.length ? into : new Float64Array(from.handles.length);
    if (!next || moment <= from.due || !continues(from, next)) {
      handles.set(from.handles);
      return { time: from.time, handles, from, to: from };
    }
    const time = timeBetween(from, next, moment), length = next.time - from.time;
    interpolate(from, next, length, (time - from.time) / length, handles);
    setHeadings(handles, this.stage?.run_id === from.run ? this.stage.dragons : []);
    return { time, handles, from, to: next };
  }
}

/** Returns true if simulated time runs without a jump from a frame to a later one. */
function continues(from, to) {
  return from.run === to.run && from.epoch === to.epoch && from.handles.length === to.handles.length &&
      to.time > from.time;
}

/** The simulated time at a moment between two frames. */
function timeBetween(from, to, moment) {
  // The rate in force holds until the next frame; the end of the show may come earlier.
  if (from.playing) return Math.min(to.time, from.time + (from.scale * (moment - from.due)) / 1000);
  // A show that was resumed between the two, whose first frame afterwards was skipped on its way here.
  return Math.max(from.time, to.time - (to.scale * (to.due - moment)) / 1000);
}

/** Fills in positions and rates at the share `u` of the way, `length` simulated seconds, from one frame to the next. */
function interpolate(from, to, length, u, handles) {
  const count = handles.length;
  for (let k = 0; k < count; k += STRIDE) {
    coordinate(from, to, k, length, u, handles);
    coordinate(from, to, k + 1, length, u, handles);
  }
}

/**
 * Sets every heading to the heading of the bench behind; the last heading of each dragon, to the heading of the bench
 * before.
 */
function setHeadings(handles, dragons) {
  const count = handles.length;
  for (let k = STRIDE; k < count; k += STRIDE) {
    handles[k - STRIDE + 2] = Math.atan2(handles[k - STRIDE + 1] - handles[k + 1], handles[k - STRIDE] - handles[k]);
  }
  for (const tail of [...dragons.map((dragon) => dragon.first_handle + dragon.benches), count / STRIDE - 1])
    handles[STRIDE * tail + 2] = handles[STRIDE * (tail - 1) + 2];
}

/**
 * The coordinate at the index `k` and its rate. The polynomial is that of least degree through both positions and the
 * velocities of those frames that play: cubic, quadratic, or a straight line.
 */
function coordinate(from, to, k, length, u, handles) {
  const start = from.handles[k], end = to.handles[k], step = end - start, w = 1 - u;
  const first = from.handles[k + 3] * length, last = to.handles[k + 3] * length;
  let value = start + step * u, slope = step;
  if (!Number.isNaN(first) && !Number.isNaN(last)) {
    if (from.playing && to.playing) {
      const fromFirst = first - step, fromLast = last - step;
      value += u * w * (w * fromFirst - u * fromLast);
      slope += w * (w - 2 * u) * fromFirst + u * (u - 2 * w) * fromLast;
    } else if (from.playing) {
      value = start + u * (first + u * (step - first));
      slope = first + 2 * u * (step - first);
    } else if (to.playing) {
      value = end - w * (last + w * (step - last));
      slope = last + 2 * w * (step - last);
    }
  }
  handles[k] = value;
  handles[k + 3] = slope / length;
}
