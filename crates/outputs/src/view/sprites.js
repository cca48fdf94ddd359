// Pictures that the lantern look draws many times, each made once: spots of light, lanterns, dancers and the paving,
// all seen from above. Lengths are metres where nothing else is stated.

/** A number in [0, 1) of an integer, the same in every browser. */
export function hash(n) {
  let bits = Math.imul(n ^ 0x9e3779b9, 0x85ebca6b);
  bits ^= bits >>> 13;
  bits = Math.imul(bits, 0xc2b2ae35);
  bits ^= bits >>> 16;
  return (bits >>> 0) / 4294967296;
}

/** An empty canvas and its context. */
export function blank(width, height, options) {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  return [canvas, canvas.getContext("2d", options)];
}

/** Adds colours at places from 0 to 1 to a gradient. */
function shaded(gradient, ...stops) {
  for (const [at, colour] of stops) gradient.addColorStop(at, colour);
  return gradient;
}

/** The radius of a pool of light. */
export const POOL_RADIUS = 3.2;

/**
 * The light of a bench on the ground. A lamp at the height h lights a place at the distance q by (1 + (q / h)^2)^-1.5
 * (inverse square and cosine). A near and a high lamp are added, less their light at the radius. Far light is redder.
 */
export function pool(red, green, blue) {
  const size = 128, [canvas, context] = blank(size, size), data = context.createImageData(size, size);
  const lamp = (q, height) => (1 + (q / height) ** 2) ** -1.5, light = (q) => 0.72 * lamp(q, 0.5) + 0.28 * lamp(q,
      1.3), end = light(POOL_RADIUS);
  for (let row = 0; row < size; row++) {
    for (let column = 0; column < size; column++) {
      const q = (Math.hypot(column + 0.5 - size / 2, row + 0.5 - size / 2) / (size / 2)) * POOL_RADIUS,
          far = Math.min(1, q / 2.2);
      const alpha = q > POOL_RADIUS ? 0 : (light(q) - end) / (1 - end);
      data.data.set([red, green * (1 - 0.3 * far), blue * (1 - 0.45 * far), 255 * alpha], 4 * (row * size + column));
    }
  }
  context.putImageData(data, 0, 0);
  return canvas;
}

/** A halo: a bright core and a long soft skirt. Colours are "red,green,blue". */
export function halo(core, skirt) {
  const size = 96, half = size / 2, [canvas, context] = blank(size, size);
  const stops = [[0, core, 1], [0.12, core, 0.7], [0.26, skirt, 0.42], [0.5, skirt, 0.16], [0.75, skirt, 0.045],
      [1, skirt, 0]];
  context.fillStyle = shaded(context.createRadialGradient(half, half, 0, half, half, half),
      ...stops.map(([at, colour, alpha]) => [at, `rgba(${colour},${alpha})`]));
  context.fillRect(0, 0, size, size);
  return canvas;
}

/** A barrel of paper with twelve ribs, in colours from the flame outwards. The canvas is 0.3 m wide. */
export function barrel([flame, paper, shade, rim]) {
  const size = 96, half = size / 2, radius = 0.9 * half, [canvas, context] = blank(size, size);
  const disc = (share) => {
    context.beginPath();
    context.arc(half, half, share * radius, 0, 7);
  };
  context.fillStyle = shaded(context.createRadialGradient(half, half, 0, half, half, radius), [0, "#fffdf0"],
      [0.16, flame], [0.42, paper], [0.8, shade], [1, rim]);
  disc(1);
  context.fill();
  context.strokeStyle = "rgba(60,0,0,.28)";
  context.lineWidth = size / 60;
  context.beginPath();
  for (let rib = 0; rib < 12; rib++) {
    const c = radius * Math.cos((rib * Math.PI) / 6), s = radius * Math.sin((rib * Math.PI) / 6);
    context.moveTo(half + 0.36 * c, half + 0.36 * s);
    context.lineTo(half + c, half + s);
  }
  context.stroke();
  for (const [share, colour, width] of [[0.34, "rgba(90,10,0,.55)", size / 30], [0.96, rim, size / 28]]) {
    disc(share);
    Object.assign(context, { strokeStyle: colour, lineWidth: width });
    context.stroke();
  }
  return canvas;
}

/** A gold box: four panes, their posts, the flame. The canvas is 0.3 m wide. */
export function box() {
  const size = 96, half = size / 2, a = 0.76 * half, [canvas, context] = blank(size, size);
  context.fillStyle = shaded(context.createRadialGradient(half, half, 0, half, half, 1.25 * a), [0, "#fffdf0"],
      [0.16, "#fffbe0"], [0.5, "#ffcf52"], [1, "#e8860f"]);
  context.beginPath();
  context.roundRect(half - a, half - a, 2 * a, 2 * a, 0.18 * a);
  context.fill();
  Object.assign(context, { strokeStyle: "#6b3205", lineWidth: size / 22 });
  context.stroke();
  Object.assign(context, { strokeStyle: "rgba(70,10,0,.4)", lineWidth: size / 44 });
  context.beginPath();
  for (const [x, y] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
    context.moveTo(half + a * x, half + a * y);
    context.lineTo(half + 0.32 * a * x, half + 0.32 * a * y);
  }
  context.rect(half - 0.34 * a, half - 0.34 * a, 0.68 * a, 0.68 * a);
  context.stroke();
  return canvas;
}

/** The cloth of dancers, from the shadow to the rim light, and their scarves. */
export const CLOTHES = [
  [["#240709", "#7a1d14", "#ff8a4a"], ["#6b4410", "#c98a2a", "#ffd27a"]],
  [["#0e1018", "#3a2626", "#d07a4a"], ["#5a0f0a", "#b52a18", "#ff8a58"]],
  [["#2a1c06", "#8a5a18", "#ffc26a"], ["#5a0f0a", "#b52a18", "#ff8a58"]],
];

/** A dancer who walks to the right, lit on chest and back by the lanterns. The canvas is 0.64 m wide. */
export function dancer([dark, cloth, rim], [fold, scarf, light]) {
  const size = 96, [canvas, context] = blank(size, size);
  context.translate(size / 2, size / 2);
  context.scale(size / 0.64, size / 0.64);
  context.fillStyle = shaded(context.createRadialGradient(0, 0, 0.05, 0, 0, 0.3), [0, "rgba(0,0,0,.75)"],
      [0.6, "rgba(0,0,0,.5)"], [1, "rgba(0,0,0,0)"]);
  context.fillRect(-0.32, -0.32, 0.64, 0.64);
  context.fillStyle = shaded(context.createLinearGradient(-0.14, 0, 0.14, 0), [0, rim], [0.16, cloth], [0.38, dark],
      [0.62, dark], [0.84, cloth], [1, rim]);
  // The shoulders, from one arm around the back to the other.
  context.beginPath();
  context.moveTo(-0.06, -0.23);
  const curves = [
    [-0.15, -0.22, -0.15, -0.08, -0.13, 0], [-0.15, 0.08, -0.15, 0.22, -0.06, 0.23], [0.04, 0.25, 0.1, 0.2, 0.115, 0.1],
    [0.12, 0.04, 0.12, -0.04, 0.115, -0.1], [0.1, -0.2, 0.04, -0.25, -0.06, -0.23],
  ];
  for (const curve of curves) context.bezierCurveTo(...curve);
  context.fill();
  // The hands on the pole before the chest.
  Object.assign(context, { strokeStyle: cloth, lineWidth: 0.06, lineCap: "round" });
  context.beginPath();
  for (const side of [1, -1]) {
    context.moveTo(0.05, 0.18 * side);
    context.quadraticCurveTo(0.13, 0.13 * side, 0.15, 0.035 * side);
  }
  context.stroke();
  const oval = (x, wide, high, colour) => {
    context.fillStyle = colour;
    context.beginPath();
    context.ellipse(x, 0, wide, high, 0, 0, 7);
    context.fill();
  };
  oval(-0.006, 0.118, 0.105, "rgba(0,0,0,.5)");
  oval(0, 0.106, 0.093, shaded(context.createLinearGradient(-0.11, 0, 0.11, 0), [0, light], [0.2, scarf], [0.5, fold],
      [0.8, scarf], [1, light]));
  // The knot of the scarf.
  context.fillStyle = scarf;
  context.beginPath();
  for (const point of [[-0.09, 0.015], [-0.17, 0.045], [-0.15, 0], [-0.17, -0.04]]) context.lineTo(...point);
  context.fill();
  return canvas;
}

/** The side of the paving, which repeats, and its pixels a metre. */
const PAVING = 9.6, PER_METRE = 48;

/** Stone slabs in rows of 0.8 m. Grey: the colour comes with the light. */
export function paving() {
  const size = PAVING * PER_METRE, [canvas, context] = blank(size, size), tall = 0.8, joint = 0.022;
  context.fillStyle = "#1a1816";
  context.fillRect(0, 0, size, size);
  for (let row = 0; row < PAVING / tall; row++) {
    const first = (row % 2) * 0.37 + hash(row + 900) * 0.2;
    for (let at = first, slab = 0; at < first + PAVING - 1e-6; slab++) {
      const left = first + PAVING - at, usual = [0.8, 1.2, 1.6][Math.floor(3 * hash(row * 91 + slab))],
          long = left - usual < 0.6 ? left : usual;
      const value = 0.56 + 0.3 * hash(row * 57 + slab * 13 + 5), warm = 10 * (hash(row * 31 + slab * 7) - 0.5);
      for (const shift of [0, -PAVING]) {
        const x = (at + shift + joint / 2) * PER_METRE, y = (row * tall + joint / 2) * PER_METRE,
            wide = (long - joint) * PER_METRE, high = (tall - joint) * PER_METRE;
        context.fillStyle = `rgb(${176 * value + warm} ${180 * value} ${186 * value - warm})`;
        context.beginPath();
        context.roundRect(x, y, wide, high, 0.03 * PER_METRE);
        context.fill();
        // Worn edges: light above, dark below.
        context.fillStyle = "rgba(255,245,230,.10)";
        context.fillRect(x + 2, y, wide - 4, 1.5);
        context.fillStyle = "rgba(0,0,0,.22)";
        context.fillRect(x + 2, y + high - 1.5, wide - 4, 1.5);
      }
      at += long;
    }
  }
  const grain = context.getImageData(0, 0, size, size), { data } = grain;
  for (let k = 0; k < data.length; k += 4) {
    const value = 1 + 0.16 * (hash(k) - 0.5);
    for (let channel = k; channel < k + 3; channel++) data[channel] *= value;
  }
  context.putImageData(grain, 0, 0);
  for (let stain = 0; stain < 60; stain++) {
    const radius = (0.2 + 0.8 * hash(stain + 9000)) * PER_METRE, colour = hash(stain) < 0.5 ? "rgba(0,0,0,.16)"
        : "rgba(255,240,220,.07)";
    for (const [right, down] of [0, size, -size].flatMap((right) => [0, size, -size].map((down) => [right, down]))) {
      const x = hash(stain + 7000) * size + right, y = hash(stain + 8000) * size + down;
      context.fillStyle = shaded(context.createRadialGradient(x, y, 0, x, y, radius), [0, colour],
          [1, "rgba(0,0,0,0)"]);
      context.fillRect(x - radius, y - radius, 2 * radius, 2 * radius);
    }
  }
  return { canvas, perMetre: PER_METRE };
}

/** A copy of a picture at `pixels` a metre, whose edges stay smooth; the picture itself if it has no more. */
export function shrunk({ canvas, long, wide }, pixels) {
  if (pixels * long >= canvas.width) return canvas;
  const [copy, context] = blank(Math.ceil(pixels * long), Math.ceil(pixels * wide));
  context.imageSmoothingQuality = "high";
  context.drawImage(canvas, 0, 0, copy.width, copy.height);
  return copy;
}

/** Copies of a picture `radius` pixels large, turned by equal steps through `span` radians. */
export function turned(picture, radius, count, span) {
  const side = Math.ceil(2 * radius * 1.42) + 2;
  return Array.from({ length: count }, (_, k) => {
    const [canvas, context] = blank(side, side);
    context.imageSmoothingQuality = "high";
    context.translate(side / 2, side / 2);
    context.rotate((k * span) / count);
    context.drawImage(picture, -radius, -radius, 2 * radius, 2 * radius);
    return canvas;
  });
}
