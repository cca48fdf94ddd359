// Signs and words on the picture: outlines visible on any colour, rings, labels that do not overlap, the scale bar.

/**
 * Strokes a line in a colour with a light and a dark edge, one of which is visible on every ground, with any colour
 * vision. `trace` makes the path and strokes it; all widths in pixels.
 */
export function doubled(context, palette, pixel, ink, width, trace, dashes = []) {
  for (const [colour, wide, dashed] of [[palette.far, width + 4.5, []], [palette.near, width + 3, []], [ink, width, dashes]]) {
    context.setLineDash(dashed.map((dash) => dash * pixel));
    context.strokeStyle = colour;
    context.lineWidth = wide * pixel;
    trace();
  }
  context.setLineDash([]);
}

/** A ring and a cross at the present place of something, or dashed and wider (a ghost) at its future place. */
export function target(context, { x, y }, palette, pixel, ink, ghost) {
  const around = ghost ? 19 : 13;
  const ring = () => {
    context.beginPath();
    context.arc(x, y, around * pixel, 0, 7);
    context.stroke();
  };
  const cross = () => {
    context.beginPath();
    for (const [dx, dy] of [[1, 0], [0, 1], [-1, 0], [0, -1]]) {
      context.moveTo(x + (around - 6) * dx * pixel, y + (around - 6) * dy * pixel);
      context.lineTo(x + (around + 8) * dx * pixel, y + (around + 8) * dy * pixel);
    }
    context.stroke();
  };
  doubled(context, palette, pixel, ink, 3, cross);
  doubled(context, palette, pixel, ink, 3, ring, ghost ? [9, 5] : []);
}

/** Directions in which a label tries to stand, after outward from the middle of the picture: turns. */
const TURNS = [0, 0.5, 0.125, -0.125, 0.25, -0.25, 0.375, -0.375];

/** Words at places, each where it covers no other. */
export class Labels {
  constructor(camera) {
    this.camera = camera;
    this.all = [];
    this.boxes = [];
    this.signs = [];
  }

  /** Words at a distance in pixels from a place of the stage, `large` times the usual size. */
  add(text, x, y, ink, away = 22, large = 1) {
    const [px, py] = this.camera.toPixel(x, y);
    if (px < 0 || py < 0 || px > this.camera.width || py > this.camera.height) return;
    this.all.push({ text, px, py, ink, away, large });
  }

  /** A box that words may not cover. */
  keep(box) {
    this.boxes.push(box);
  }

  /** A ring around a place of the stage, which words leave free if they can. */
  ring(x, y) {
    const [px, py] = this.camera.toPixel(x, y), reach = 29 * this.camera.unit;
    this.signs.push({ x: px, y: py, half: reach, tall: reach });
  }

  write(context, palette) {
    const { width, height, ratio, unit } = this.camera;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineJoin = "round";
    for (const { text, px, py, ink, away, large: wanted } of this.all) {
      const font = (size) => (context.font = `600 ${15 * unit * size}px system-ui, sans-serif`);
      font(wanted);
      // On a phone a long sentence is smaller.
      const large = wanted * Math.min(1, (width - 24 * unit) / context.measureText(text).width);
      font(large);
      const half = context.measureText(text).width / 2 + 6 * unit, tall = 12 * unit * large;
      const within = (at, least, most) => Math.min(Math.max(at, least), Math.max(least, most));
      const outward = Math.atan2(py - height / 2, px - width / 2);
      const boxes = TURNS.flatMap((turn) => [1, 2, 3.5].map((far) => {
        const angle = outward + 2 * Math.PI * turn, dx = Math.cos(angle), dy = Math.sin(angle);
        // A wide label is further away at the side than above.
        const x = within(px + dx * (away * unit * far + half * Math.abs(dx)), half, width - half);
        return { x, y: within(py + dy * away * unit * far, tall, height - tall), half, tall, text };
      }));
      const off = (box, all) => !all.some((other) => Math.abs(other.x - box.x) < other.half + box.half && Math.abs(other.y - box.y) < other.tall + box.tall);
      const free = (box) => off(box, this.boxes);
      const clear = (box) => Math.abs(px - box.x) > half || Math.abs(py - box.y) > tall + 10 * unit;
      const apart = boxes.filter((box) => free(box) && clear(box));
      const box = apart.find((box) => off(box, this.signs)) ?? apart[0] ?? boxes.find(free);
      if (!box) continue;
      this.boxes.push(box);
      context.lineWidth = 5 * unit * large;
      context.strokeStyle = palette.near;
      context.strokeText(text, box.x, box.y);
      context.fillStyle = ink;
      context.fillText(text, box.x, box.y);
    }
  }
}

/** Draws the length of a round number of metres in the lower right corner; returns its box. */
export function scaleBar(context, camera, palette) {
  const { ratio, unit, width, height } = camera;
  const most = Math.min(160 * unit, width / 4) / camera.scale, power = 10 ** Math.floor(Math.log10(most));
  const metres = [5, 2, 1].map((one) => one * power).find((one) => one <= most), length = metres * camera.scale;
  const right = width - 18 * unit, bottom = height - 18 * unit, text = `${+metres.toPrecision(1)} m`;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.lineJoin = "miter";
  context.beginPath();
  context.moveTo(right - length, bottom - 6 * unit);
  context.lineTo(right - length, bottom);
  context.lineTo(right, bottom);
  context.lineTo(right, bottom - 6 * unit);
  context.strokeStyle = palette.near;
  context.lineWidth = 6 * unit;
  context.stroke();
  context.strokeStyle = context.fillStyle = palette.ink;
  context.lineWidth = 2 * unit;
  context.stroke();
  context.font = `600 ${14 * unit}px system-ui, sans-serif`;
  context.textAlign = "right";
  context.textBaseline = "bottom";
  context.lineJoin = "round";
  context.strokeStyle = palette.near;
  context.lineWidth = 5 * unit;
  context.strokeText(text, right, bottom - 7 * unit);
  context.fillText(text, right, bottom - 7 * unit);
  return { x: right - length / 2, y: bottom - 12 * unit, half: Math.max(length / 2, 30 * unit), tall: 18 * unit, text };
}
