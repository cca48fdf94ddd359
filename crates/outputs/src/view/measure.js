// The measure: the distance of two places of the stage. In: places by click, or by key at the middle of the picture.
// Out: a line and its length on the picture.

import { doubled, plate } from "./signs.js";
import { say } from "./words.js";

/** Half the size of the cross at a place, px. */
const CROSS = 9;

export class Measure {
  /** `tell` is called with every change in words. */
  constructor(tell) {
    this.on = false;
    this.places = [];
    this.tell = tell;
  }

  toggle(on = !this.on) {
    this.on = on;
    this.places = [];
    this.tell(on ? say("measureFirst") : "");
  }

  /** Takes the next place, in metres; the third begins another measurement. */
  take(place) {
    this.places = this.places.length === 2 ? [place] : [...this.places, place];
    if (this.places.length === 2) this.tell(this.words);
  }

  get metres() {
    const [[ax, ay], [bx, by]] = this.places;
    return Math.hypot(bx - ax, by - ay);
  }

  /** The result in words, once both places are known. */
  get words() {
    const [[ax, ay], [bx, by]] = this.places.map((place) => place.map((one) => one.toFixed(3)));
    return say("measured", { metres: this.metres.toFixed(3), ax, ay, bx, by });
  }

  /** Returns a value that changes with the drawing. */
  get key() {
    return [this.on, this.places].join();
  }

  /**
   * Draws the places and the line; while the picture has the focus, a cross at its middle too. Returns the box of the
   * words.
   */
  draw(context, camera, palette, hasFocus) {
    if (!this.on) return [];
    const { ratio, unit } = camera, points = this.places.map(([x, y]) => camera.toPixel(x, y));
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const line = (ax, ay, bx, by) => {
      context.beginPath();
      context.moveTo(ax, ay);
      context.lineTo(bx, by);
      context.stroke();
    };
    const crosses = hasFocus ? [...points, [camera.width / 2, camera.height / 2]] : points, half = CROSS * unit;
    doubled(context, palette, unit, palette.ink, 2, () => {
      for (const [x, y] of crosses) {
        line(x - half, y, x + half, y);
        line(x, y - half, x, y + half);
      }
      if (points.length === 2) line(...points[0], ...points[1]);
    });
    if (points.length < 2) return [];
    const [[ax, ay], [bx, by]] = points;
    return [plate(context, camera, palette, (ax + bx) / 2, (ay + by) / 2,
        say("distance", { metres: this.metres.toFixed(3) }))];
  }
}
