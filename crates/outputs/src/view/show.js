// The state of one dragon in the show look: the lanterns that burn white, the lit lanterns, the trail, the flash. A
// contact, an obstacle, a stall and a lock flash. In: the pose, the situation. Out: figures for lanterns.js, seat.js.

import { STRIDE } from "./hermite.js";

/** The time of a flash (ms), and the time for which embers last after the show stands (ms). */
const FLASH = 1600, EMBERS = 1500;
/** The time after which the lanterns of a lost dragon die down, the time of that, and of their rise (ms). */
const KEPT = 2000, DYING = 6000, RISING = 2000;
/** The benches, as a share of the team, whose lanterns die down at the same time. */
const TOGETHER = 0.3;
/** The time after which the flames of a paused show stand still (ms). */
const RESTING = 60_000;
/** Seconds of show time between two places of the trail, and its length. */
const TRAIL_STEP = 0.5, TRAIL = 4;
/** Seconds before an event from which its lanterns begin to burn white. */
const BURNING = 10;

/** Returns a smooth step from 0 to 1. */
const smooth = (part) => {
  const within = Math.min(1, Math.max(0, part));
  return within * within * (3 - 2 * within);
};

export class Show {
  /** `still`: only the dragon moves. */
  constructor(still) {
    this.still = still;
    this.trail = [];
    this.flash = null;
    /** The share of the lanterns that are lit, and of the embers. */
    this.life = 0;
    this.embers = 1;
    this.now = this.time = this.stoodAt = this.lostAt = 0;
    /** The benches whose lanterns burn white, each with its share of white, from 0 to 1. */
    this.burning = new Map();
  }

  /** Begins a picture: without frames the lanterns die down after a while; with frames they rise. */
  breathe(now, isLost) {
    const passed = Math.min(now - this.now, 1000);
    this.now = now;
    if (!isLost) [this.life, this.lostAt] = [Math.min(1, this.life + passed / RISING), now];
    else if (now - this.lostAt > KEPT) this.life = Math.max(0, this.life - passed / DYING);
  }

  /**
   * Begins the next picture, at the show time `time`. `stands`: the show stands still. `jumped`: another epoch.
   * `coming`: the benches of the next event and the seconds until then. `happened`: the event is past. `flash`: the
   * event's place then, if this dragon's flash shows it, or null.
   */
  update({ time, places, stands, jumped, coming, happened, flash }) {
    const { now } = this, tail = places.length - STRIDE;
    if (!stands) this.stoodAt = now;
    this.embers = this.still ? 0 : Math.max(0, 1 - (now - this.stoodAt) / EMBERS);
    if (jumped) this.trail = [];
    this.trail = this.trail.filter((one) => time - one.time < TRAIL);
    if (!(time - this.trail.at(-1)?.time < TRAIL_STEP)) this.trail.push({ time, x: places[tail], y: places[tail + 1] });
    this.time = time;
    const burn = happened ? 1 : smooth((BURNING - coming.seconds) / BURNING);
    this.burning = new Map(burn > 0 ? coming.benches.map((bench) => [bench, burn]) : []);
    if (flash && !this.flash) this.flash = { at: now, place: flash };
    if (!flash) this.flash = null;
  }

  /** Returns the share to which the lanterns of a bench are lit, from 0 to 1: the tail's die first. */
  lit(bench, count) {
    return this.life === 1 ? 1 : smooth((this.life * (1 + TOGETHER) - bench / count) / TOGETHER);
  }

  /** Returns the flash as a share of its time, 1 after it, and its place; null without one. */
  get burst() {
    return this.flash && { place: this.flash.place, part: this.still ? 1
        : Math.min(1, (this.now - this.flash.at) / FLASH) };
  }

  /** The seconds that flames flicker by; they rest while the system wants no motion, and when a pause is long. */
  get flames() {
    return this.still ? 0 : Math.min(this.now, this.stoodAt + RESTING) / 1000;
  }

  /** Returns a value that changes whenever the lanterns must be drawn again. */
  get phase() {
    return [Math.floor(this.flames * 30), this.life, this.embers, this.burst?.part].join();
  }
}
