// A picture of the ground below the stage, scaled by two clicks and a distance. In: an image file, places, metres. Out:
// an element below the canvas. The picture stays in the browser.

const element = (id) => document.getElementById(id);
const STORED = "bench-dragon design ground";
/** The longest side of the kept picture, pixels; the metres of its width before it is scaled. */
const MOST_PIXELS = 2000, FIRST_WIDTH = 30;
/** The time after a change until it is stored (ms). */
const DELAY = 300;

/** Returns a picture as a data address, small enough to be kept in the browser. */
async function smaller(file) {
  const bitmap = await createImageBitmap(file), longest = Math.max(bitmap.width, bitmap.height),
      share = Math.min(1, MOST_PIXELS / longest);
  const canvas = Object.assign(document.createElement("canvas"),
      { width: Math.round(bitmap.width * share), height: Math.round(bitmap.height * share) });
  canvas.getContext("2d").drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  return canvas.toDataURL("image/jpeg", 0.85);
}

export class GroundPicture {
  /** `measure` takes the two places; `tell` is called with a sentence. */
  constructor(camera, measure, tell) {
    Object.assign(this, { camera, measure, tell, image: element("ground-picture"), placed: null, isMoving: false });
    element("ground-file").onchange = ({ target }) => this.open(target.files[0], target);
    element("ground-scale").onclick = () => this.scale();
    element("ground-form").onsubmit = (event) => {
      event.preventDefault();
      this.scaled(element("ground-metres").valueAsNumber);
    };
    element("ground-move").onclick = () => this.move(!this.isMoving);
    element("ground-remove").onclick = () => this.show(null);
    element("ground-opacity").oninput = ({ target }) => this.change({ opacity: target.valueAsNumber });
    try {
      this.show(JSON.parse(localStorage.getItem(STORED)));
    } catch {
      this.show(null);
    }
  }

  async open(file, input) {
    if (!file) return;
    try {
      const source = await smaller(file), [x, y] = this.camera.toStage(this.camera.width / 2, this.camera.height / 2);
      this.show({ source, x, y, width: FIRST_WIDTH, opacity: 0.6 });
      this.tell("Click two places of the picture whose distance you know.");
      this.scale();
    } catch {
      this.tell(`${file.name} is no picture that this browser can read: expected PNG or JPEG.`);
    }
    input.value = "";
  }

  /** Asks for two places. */
  scale() {
    this.move(false);
    this.measure.toggle(true);
  }

  /** Asks for the distance of the two places. */
  measured() {
    if (!this.placed || this.measure.places.length < 2) return;
    element("ground-form").hidden = false;
    element("ground-metres").value = this.measure.metres.toFixed(2);
    element("ground-metres").select();
  }

  /** Scales the picture about the first place, so that the two places are `metres` apart. */
  scaled(metres) {
    const { measure, placed } = this, by = metres / measure.metres, [[x, y]] = measure.places;
    element("ground-form").hidden = true;
    measure.toggle(false);
    if (!placed || !(by > 0 && by < Infinity)) return;
    this.change({ width: placed.width * by, x: x + (placed.x - x) * by, y: y + (placed.y - y) * by });
    this.tell(`The picture is ${(placed.width * by).toFixed(2)} m wide. Move it with “Move picture”.`);
  }

  move(isMoving) {
    this.isMoving = isMoving;
    element("ground-move").setAttribute("aria-pressed", isMoving);
  }

  /** Moves the picture by pixels of the screen. */
  pan(x, y) {
    const { scale } = this.camera;
    this.change({ x: this.placed.x + x / scale, y: this.placed.y - y / scale });
  }

  change(changes) {
    if (this.placed) this.show({ ...this.placed, ...changes });
  }

  show(placed) {
    this.placed = Number.isFinite(placed?.width) && String(placed.source).startsWith("data:image/") ? placed : null;
    for (const one of document.querySelectorAll("[data-ground]")) one.hidden = !this.placed;
    this.image.hidden = !this.placed;
    if (!this.placed) this.move(false);
    else if (this.image.src !== placed.source) this.image.src = placed.source;
    element("ground-opacity").value = this.placed?.opacity ?? 1;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.store(), DELAY);
  }

  store() {
    try {
      if (this.placed) localStorage.setItem(STORED, JSON.stringify(this.placed));
      else localStorage.removeItem(STORED);
    } catch {
      this.tell("This browser has no room to keep the picture: open it again after a reload.");
    }
  }

  /** Moves the element with the camera. */
  place() {
    if (!this.placed) return;
    const { x, y, width, opacity } = this.placed, { camera, image } = this, [left, top] = camera.toPixel(x, y);
    image.style.width = `${width * camera.scale}px`;
    image.style.opacity = opacity;
    image.style.transform = `translate(${left}px, ${top}px) translate(-50%, -50%)`;
  }
}
