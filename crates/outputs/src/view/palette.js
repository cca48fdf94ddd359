// The colours of the picture: those of the style sheet, and the scale of speeds.

import { STRIDE, speedOf } from "./hermite.js";

/** Steps of the colour scale. */
export const SHADES = 32;
/**
 * The widths of the scale on either side of the head's speed, as shares of it: the first that holds every speed is
 * used.
 */
const WIDTHS = [1, 10, 100, 1000];
/** Samples of the mean speed over one link passage. */
const SAMPLES = 64;
/** Differences from the head's speed that are far smaller than this share of it have no separate colour. */
const FINEST = 0.001;
/** The opacity of colours while the dragon rests. */
const AT_REST = 0.5;

/**
 * The identities of several dragons, besides their names. Each has dashes (pixels of ink and of gap in turn) and the
 * light of its lanterns. Its colour is visible on a light and on a dark ground. Without colour vision two dragons
 * differ in their dashes.
 */
const IDENTITIES = [
  { colour: "#1f6fb5", dashes: [], light: [84, 150, 255] },
  { colour: "#c4560a", dashes: [12, 8], light: [255, 120, 40] },
  { colour: "#0b8560", dashes: [3, 5], light: [50, 225, 140] },
  { colour: "#a8478c", dashes: [22, 5, 4, 5], light: [255, 90, 190] },
  { colour: "#8a6a00", dashes: [28, 14], light: [255, 178, 50] },
  { colour: "#6c58d0", dashes: [8, 3], light: [150, 110, 255] },
  { colour: "#1b8296", dashes: [4, 14], light: [50, 215, 240] },
  { colour: "#c9525c", dashes: [14, 4, 3, 4, 3, 4], light: [255, 56, 36] },
  { colour: "#5f7a1e", dashes: [40, 6], light: [175, 230, 60] },
  { colour: "#757980", dashes: [6, 22], light: [225, 232, 255] },
  { colour: "#1f6fb5", dashes: [16, 16], light: [40, 100, 255] },
  { colour: "#c4560a", dashes: [2, 10], light: [255, 150, 90] },
  { colour: "#0b8560", dashes: [30, 4, 2, 4], light: [130, 255, 190] },
  { colour: "#a8478c", dashes: [8, 8, 2, 8], light: [255, 150, 215] },
  { colour: "#8a6a00", dashes: [4, 4, 12, 4], light: [255, 214, 120] },
  { colour: "#6c58d0", dashes: [20, 10, 6, 10], light: [190, 160, 255] },
].map((one, number) => ({ ...one, number }));

/** The places of identities whose colours are words. */
const NAMED = {
  blue: 0, orange: 1, jade: 2, green: 2, pink: 3, gold: 4, yellow: 4, violet: 5, purple: 5, teal: 6, red: 7, lime: 8,
      silver: 9, white: 9,
};

/**
 * Returns the identities of dragons with these names: a name that is a colour has that colour, the others have the
 * first that are free.
 */
export function identitiesOf(names) {
  const own = names.map((name, k) => (names.indexOf(name) === k && Object.hasOwn(NAMED, name) ? NAMED[name] : null));
  const first = own.map((place, k) => (own.indexOf(place) === k ? place : null)),
      free = IDENTITIES.filter((_, place) => !first.includes(place));
  let next = 0;
  return first.map((place) => (place === null ? free[next++ % free.length] : IDENTITIES[place]));
}

const colour = (style, name) => style.getPropertyValue(name).trim();
const channels = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
const mixed = (from, to, part) => `rgb(${from.map((one, k) => Math.round(one + (to[k] - one) * part)).join(" ")})`;

/** The colours of the style sheet, looked up once for each change of theme. */
export function paletteOf(element) {
  const style = getComputedStyle(element), named = (name) => channels(colour(style, `--${name}`));
  const [slow, middle, fast, ground] = ["slow", "middle", "fast", "ground"].map(named);
  const shade = (part) => (part < 0.5 ? [slow, middle, 2 * part] : [middle, fast, 2 * part - 1]);
  const shades = Array.from({ length: SHADES }, (_, k) => mixed(...shade(k / (SHADES - 1))));
  const resting = shades.map((one) => mixed(ground, one.match(/\d+/g).map(Number), AT_REST));
  const names = ["ground", "ink", "faint", "danger", "warning", "still", "near", "far"];
  return { shades, resting, ...Object.fromEntries(names.map((name) => [name, colour(style, `--${name}`)])) };
}

/**
 * The mean speed of every handle over the last link passage: the show time in which the head travels one link. Behind a
 * bend speeds pulse with that period, which the mean leaves out.
 */
class MeanSpeeds {
  constructor() {
    this.frame = null;
    this.clear();
  }

  clear() {
    /** The travelled metres of each handle since the first frame, and earlier ones with their times. */
    this.travelled = null;
    this.earlier = [];
  }

  /** Adds a frame of a show that plays, and returns the mean speeds. */
  take(frame) {
    const { frame: last } = this, { handles, time } = frame, count = handles.length / STRIDE,
        next = Float64Array.from({ length: count }, (_, k) => speedOf(handles, k));
    this.frame = frame;
    if (!(last?.run === frame.run && last.epoch === frame.epoch && last.handles.length === handles.length &&
        time >= last.time)) this.clear();
    if (!this.travelled) this.travelled = new Float64Array(count);
    else for (let k = 0; k < count; k++) this.travelled[k] += 0.5 * (time - last.time) * (
        next[k] + speedOf(last.handles, k));
    const k = STRIDE * Math.max(0, count - 2), passage = Math.hypot(handles[k] - handles[k + STRIDE],
        handles[k + 1] - handles[k + STRIDE + 1]) / next[0];
    if (!(time - this.earlier.at(-1)?.time < passage / SAMPLES)) this.earlier.push(
        { time, travelled: this.travelled.slice() });
    while (this.earlier.length > 1 && time - this.earlier[1].time >= passage) this.earlier.shift();
    // The beginning of the passage lies between two earlier frames.
    const [first, second = first] = this.earlier, begin = Math.max(first.time, time - passage);
    const share = second.time > first.time ? Math.min(1, (begin - first.time) / (second.time - first.time)) : 0;
    if (!(time > begin)) return next;
    return this.travelled.map(
        (metres, k) => (metres - first.travelled[k] - share * (second.travelled[k] - first.travelled[k])) / (
        time - begin));
  }
}

/** Returns a power of two that no speed of the handles exceeds, and that rounding of the speeds hardly changes. */
function boundOf(handles) {
  let most = 0;
  for (let handle = 0; handle < handles.length / STRIDE; handle++) most = Math.max(most, speedOf(handles, handle));
  return 2 ** (Math.round(Math.log2(most)) + 1);
}

/**
 * The scale of the colours for a run: from rest to twice the head's speed, by the difference from that speed. It is
 * logarithmic because most shows have differences of a thousandth for minutes and of a half for seconds. The scale is
 * only widened, so that a colour keeps its meaning within a run. A bench has the colour of its mean speed over one link
 * passage. The scale keeps the speeds of the last moving frame. The crate `drawing` has the same scale.
 */
export class SpeedScale {
  constructor() {
    this.clear();
  }

  clear() {
    this.head = NaN;
    /** A bound of the speeds of the newest frame's handles; NaN if these are not sent. */
    this.fastest = NaN;
    this.step = 0;
    /** The mean speeds at the last moving frame. */
    this.speeds = null;
    this.means = new MeanSpeeds();
    this.unsent = false;
    this.resting = false;
    this.frame = null;
  }

  /** Adds the newest frame's speeds. */
  take(frame) {
    if (this.frame === frame) return;
    this.frame = frame;
    const { handles } = frame, head = speedOf(handles, 0);
    this.fastest = boundOf(handles);
    this.unsent = Number.isNaN(head);
    this.resting = !(head > 0);
    if (this.resting) return;
    this.speeds = this.means.take(frame);
    // Each frame rounds it again.
    if (!(Math.abs(this.head - head) < 1e-4 * head)) this.head = head;
    let most = 0;
    for (const speed of this.speeds) most = Math.max(most, Math.abs(speed / head - 1));
    while (this.step < WIDTHS.length - 1 && most > WIDTHS[this.step]) this.step++;
  }

  /** The widest difference from the head's speed that has a colour, as a share of it. */
  get width() {
    return WIDTHS[this.step];
  }

  /** Returns the place on the scale, from 0 to 1, of a difference from the head's speed, as a share of it. */
  place(difference) {
    const part = Math.log1p(Math.abs(difference) / FINEST) / Math.log1p(this.width / FINEST);
    return 0.5 + 0.5 * Math.sign(difference) * Math.min(1, part);
  }

  /**
   * Returns true if the show was at rest before the first moving frame: then colours distinguish head, body and tail.
   */
  get unseen() {
    return this.resting && !this.unsent && !this.speeds;
  }

  /** Returns the shade of a bench; SHADES if its speed is not sent. */
  shade(bench) {
    if (this.unseen) return bench === 0 ? SHADES - 1 : bench === this.frame.handles.length / STRIDE - 2 ? 0
        : SHADES >> 1;
    const speed = this.speeds ? this.speeds[bench] : NaN;
    if (Number.isNaN(speed)) return SHADES;
    return Math.min(SHADES - 1, Math.floor(this.place(speed / this.head - 1) * SHADES));
  }

  /** Returns some speeds and their places on the scale. */
  get ticks() {
    if (Number.isNaN(this.head)) return [];
    const shares = [-this.width, -0.1 * this.width, 0, 0.1 * this.width, this.width].filter((share) => share >= -1);
    return shares.map((share) => ({ at: this.place(share), speed: this.head * (1 + share) }));
  }
}
