// The eye of a spectator: from metres of the stage, with heights, to pixels of a canvas. Knows no canvas and no dragon.

/** The height of the boards, which are carried, m. */
export const BOARD = 1.18;
/**
 * The field of view across the picture; the height looked at, m; the share of the angle down to it that the eye tilts.
 */
const FIELD = (54 * Math.PI) / 180, AIM = 0.9, TILT = 0.6;
/** The nearest that is drawn, m. */
const NEAREST = 0.5;
/** The least distance of the village from the eye, m, and metres of it behind the outermost board. */
const VILLAGE = 38, BEHIND = 9;
/** The limits of a seat's distance and height, m. */
const DISTANCE = [2, 5000], HEIGHT = [0.3, 1000];

const within = ([least, most], one) => Math.min(most, Math.max(least, one));

/** Returns a seat that an eye can have: turns counter-clockwise from the stage's south; distance and height, m. */
export function seatOf({ turns, distance, height }) {
  return { turns, distance: within(DISTANCE, distance), height: within(HEIGHT, height) };
}

/** A place on the picture: pixels `x` and `y`, pixels a metre there `k`, and the `depth` in metres. */
const spot = () => ({ x: 0, y: 0, k: 0, depth: 0 });

export class SeatView {
  /** The picture in pixels, the seat, and the stage: its middle `x`, `y` and its `reach`, m. */
  constructor({ width, height }, seat, stage) {
    const angle = 2 * Math.PI * seat.turns, c = Math.cos(angle), s = Math.sin(angle),
        pitch = TILT * Math.atan2(seat.height - AIM, seat.distance);
    Object.assign(this, { width, height, seat });
    this.eye = { x: stage.x + s * seat.distance, y: stage.y - c * seat.distance, z: seat.height };
    [this.rightX, this.rightY, this.awayX, this.awayY] = [c, s, -s, c];
    [this.cos, this.sin] = [Math.cos(pitch), Math.sin(pitch)];
    this.f = width / 2 / Math.tan(FIELD / 2);
    [this.cx, this.cy] = [width / 2, height / 2];
    this.horizon = this.cy - (this.f * this.sin) / this.cos;
    /** The distance of the village from the eye, m. */
    this.village = Math.max(VILLAGE, seat.distance + stage.reach + BEHIND);
    this.key = [width, height, seat.turns, seat.distance, seat.height, stage.x, stage.y, this.village].join();
  }

  /** Returns the place of a point of the stage at a height; null if it is behind the eye. */
  to(x, y, z, out = spot()) {
    const dx = x - this.eye.x, dy = y - this.eye.y, right = dx * this.rightX + dy * this.rightY;
    const away = dx * this.awayX + dy * this.awayY, down = this.eye.z - z, depth = away * this.cos + down * this.sin;
    if (depth < NEAREST) return null;
    const k = this.f / depth;
    out.x = this.cx + right * k;
    out.y = this.cy + (down * this.cos - away * this.sin) * k;
    out.k = k;
    out.depth = depth;
    return out;
  }

  /** Returns the distance `away` and the `depth` of the floor at a row of pixels, m; null above the horizon. */
  floorAt(row) {
    const tangent = (row - this.cy) / this.f,
        away = (this.eye.z * (this.cos - tangent * this.sin)) / (this.sin + tangent * this.cos);
    const depth = away * this.cos + this.eye.z * this.sin;
    return depth > 0 ? { away, depth } : null;
  }

  /** Returns the ratio of height to width of a circle on the floor, as seen from the eye. */
  flat({ depth }) {
    return Math.min(1, this.eye.z / depth);
  }

  /**
   * Returns the direction of a dancer as seen: 0 towards the eye, then turning to the right of the picture, in turns.
   */
  facing(c, s) {
    const right = c * this.rightX + s * this.rightY, away = c * this.awayX + s * this.awayY;
    return Math.atan2(right, -away) / (2 * Math.PI);
  }

  /** Returns true if a direction leads away from the eye. */
  leads(c, s) {
    return c * this.awayX + s * this.awayY > 0;
  }
}
