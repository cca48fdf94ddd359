// Signs on the picture: outlines visible on any colour, rings, the scale bar.

/**
 * Strokes a line in a colour with a light and a dark edge, one of which is visible on every ground, with any colour
 * vision. `trace` makes the path and strokes it; all widths in pixels.
 */
export function doubled(context, palette, pixel, ink, width, trace, dashes = []) {
  for (const [colour, wide, dashed] of [[palette.far, width + 4.5, []], [palette.near, width + 3, []],
      [ink, width, dashes]]) {
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

/** A line between two places, with a dot at each end. */
export function between(context, ends, palette, pixel, ink) {
  doubled(context, palette, pixel, ink, 2.5, () => {
    context.beginPath();
    for (const { x, y } of ends) {
      context.moveTo(x + 2.5 * pixel, y);
      context.arc(x, y, 2.5 * pixel, 0, 7);
    }
    context.moveTo(ends[0].x, ends[0].y);
    context.lineTo(ends[1].x, ends[1].y);
    context.stroke();
  });
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

/** Writes words on a plate whose middle is at a pixel, moved into the picture; returns its box. */
export function plate(context, camera, palette, x, y, text) {
  const { unit, width, height } = camera, size = 15 * unit, tall = size / 2 + 4 * unit;
  Object.assign(context, { font: `600 ${size}px system-ui, sans-serif`, textAlign: "center", textBaseline: "middle",
      fillStyle: palette.ground });
  const half = context.measureText(text).width / 2 + 6 * unit;
  const within = (at, most, edge) => Math.max(edge, Math.min(most - edge, at));
  const box = { x: within(x, width, half), y: within(y, height, tall), half, tall, text };
  context.fillRect(box.x - half, box.y - tall, 2 * half, 2 * tall);
  Object.assign(context, { strokeStyle: palette.ink, lineWidth: 1.2 * unit, fillStyle: palette.ink });
  context.strokeRect(box.x - half, box.y - tall, 2 * half, 2 * tall);
  context.fillText(text, box.x, box.y);
  return box;
}
