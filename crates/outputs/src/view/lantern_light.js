// The light of a dragon's lanterns: red for a single dragon, a colour of its own for each of several. The middle
// lantern of a board is gold for every dragon.

/** Red paper lanterns over a flame. Each colour is red, green and blue. */
const FIRE = {
  number: -1, pools: [[255, 117, 41], [255, 143, 61]], lit: [255, 117, 41], glow: [255, 84, 30], core: [255, 176, 96],
      spill: [255, 104, 36], thread: [255, 150, 70],
  halo: [[255, 150, 70], [255, 70, 24]], wet: [255, 110, 40], dot: "#ffd890",
  // Paper from the flame outwards, from above and from the side; the edge of a board, its top and its side.
  barrel: ["#fff0b0", "#ff6a2e", "#d81f14", "#5e0a08"], paper: ["#ffdc8c", "#ff6a2a", "#d9200f", "#8a0c0a"],
  edge: "#7a3518", top: "#8a3014", side: "#c2501c",
};

const mixed = (from, to, part) => from.map((one, k) => Math.round(one + (to[k] - one) * part));
const white = (light, part) => mixed(light, [255, 250, 232], part);
const dark = (light, part) => mixed(light, [0, 0, 0], part);
const css = (light) => `rgb(${light.join(" ")})`;

/** Returns the colours of the lanterns of a dragon with an identity (see palette.js); of a single one for null. */
export function lightOf(identity) {
  if (!identity) return FIRE;
  const { light, number } = identity, paper = [white(light, 0.7), light, dark(light, 0.3), dark(light, 0.65)].map(css);
  return {
    number, pools: [light, white(light, 0.2)], lit: light, glow: light, core: white(light, 0.45), spill: light,
        thread: white(light, 0.3),
    halo: [white(light, 0.35), light], wet: light, dot: css(white(light, 0.5)), barrel: paper, paper,
    edge: css(dark(light, 0.5)), top: css(dark(light, 0.55)), side: css(dark(light, 0.35)),
  };
}

/** Things that are made once for the light of each identity. */
export class OfLight {
  /** `make` gets the colours of `lightOf`. */
  constructor(make) {
    this.make = make;
    this.made = new Map();
  }

  of(identity) {
    const number = identity ? identity.number : FIRE.number;
    if (!this.made.has(number)) this.made.set(number, this.make(lightOf(identity)));
    return this.made.get(number);
  }
}
