// The handles on the stage: buttons over the picture that are dragged by pointer or by arrow keys. In: the handles of a
// scene with their places, from the server. Out: the place to which one is dragged. No geometry of paths is here.

import { itemOf, itemWords, made } from "./fields.js";

/** Metres of one arrow key, and with Shift. */
const STEP = 0.1, FINE_STEP = 0.01;
/** Handles that are shown at once. */
const MOST = 300;
const CORNERS = ["corner", "boundary"];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const KINDS = { end: "end", middle: "middle", pitch: "pitch", turns: "length along the spiral", radius: "radius",
  placement: "whole path", heading: "first direction", centre: "place", corner: "corner", rim: "radius",
  keep_out: "keep-out", boundary: "boundary", insert: "new corner" };

export class Handles {
  /**
   * `acts` has drag(handle, to, { free, alt }, gesture), cancel(gesture), remove(name), insert(after, at), show(line)
   * and use(name), the handle in use or null. It also has isBusy(), true until the last drag is answered, and the
   * camera and the canvas.
   */
  constructor(root, acts) {
    Object.assign(this, { root, acts, shown: new Map(), scene: null, held: null, gestures: 0 });
    // The wheel over a handle zooms as beside it.
    root.addEventListener("wheel", (event) => {
      event.preventDefault();
      acts.canvas.dispatchEvent(new WheelEvent("wheel", event));
    }, { passive: false });
  }

  /** Shows the handles of a scene. An element stays as long as its handle, so that it keeps the focus and a finger. */
  show(scene) {
    this.scene = scene;
    const handles = scene.handles.slice(0, MOST), names = new Set(handles.map(({ name }) => name));
    for (const [name, { node }] of this.shown) {
      if (names.has(name) || this.held?.name === name) continue;
      node.remove();
      this.shown.delete(name);
    }
    for (const handle of handles) {
      const known = this.shown.get(handle.name);
      if (known) known.handle = handle;
      else this.add(handle);
      if (known && !this.acts.isBusy()) known.wanted = null;
      this.name(this.shown.get(handle.name));
    }
    this.place();
  }

  add(handle) {
    const node = made("button", { type: "button", className: "handle" });
    const one = { name: handle.name, handle, node, wanted: null };
    node.dataset.handle = handle.name;
    this.shown.set(handle.name, one);
    this.root.append(node);
    node.onpointerdown = (event) => this.grab(one, event);
    node.onpointermove = (event) => this.held === one && this.move(one, event);
    node.onpointerup = node.onpointercancel = () => this.held === one && this.release();
    node.onkeydown = (event) => this.press(one, event);
    node.ondblclick = () => this.insert(one.handle);
    node.onfocus = () => this.acts.show(one.handle.line);
    node.onblur = () => {
      this.acts.show(null);
      this.acts.use(null);
    };
  }

  name({ handle, node }) {
    const item = itemOf(handle.name), words = item ? itemWords(item, this.scene) : "";
    const kind = KINDS[handle.kind] ?? handle.kind;
    node.dataset.kind = handle.kind;
    node.setAttribute("aria-label",
        `${[words, kind].filter(Boolean).join(", ")} at ${handle.x.toFixed(2)}, ${handle.y.toFixed(2)} m`);
    node.title = [words, kind].filter(Boolean).join(", ");
  }

  /** Moves the elements to the places of their handles on the picture. */
  place() {
    const { camera } = this.acts, { width, height } = camera;
    for (const { handle, node } of this.shown.values()) {
      const [x, y] = camera.toPixel(handle.x, handle.y), isIn = x >= 0 && y >= 0 && x <= width && y <= height;
      // A handle out of sight can still be reached by Tab, unless another one has its place in sight.
      node.hidden = !isIn && this.held?.node !== node && document.activeElement !== node;
      node.style.transform = `translate(${x}px, ${y}px)`;
    }
  }

  grab(one, event) {
    if (event.button > 0) return;
    one.node.setPointerCapture(event.pointerId);
    const { camera } = this.acts, [x, y] = camera.toPixel(one.handle.x, one.handle.y);
    // The picture stands still below the pointer.
    camera.release();
    this.held = one;
    this.offset = [x - event.clientX, y - event.clientY];
    this.from = [event.clientX, event.clientY];
    this.isMoved = false;
    this.gestures++;
  }

  move(one, event) {
    if (!this.isMoved && Math.hypot(event.clientX - this.from[0], event.clientY - this.from[1]) < 3) return;
    this.isMoved = true;
    one.node.classList.add("held");
    this.acts.use(one.name);
    const to = this.acts.camera.toStage(event.clientX + this.offset[0], event.clientY + this.offset[1]);
    this.acts.drag(one.handle, to, { free: event.shiftKey, alt: event.altKey }, `drag ${this.gestures}`);
  }

  release() {
    this.held?.node.classList.remove("held");
    this.held = null;
    this.acts.use(null);
  }

  press(one, event) {
    const { key, shiftKey, altKey, ctrlKey, metaKey, repeat } = event;
    if (ctrlKey || metaKey) return;
    if (key === "Escape") {
      if (this.held) this.acts.cancel(`drag ${this.gestures}`);
      this.release();
      one.node.blur();
    } else if (key === "Delete" || key === "Backspace") this.remove(one.handle);
    else if (key === "Insert" || key === "+") this.insert(one.handle);
    else if (ARROWS[key]) {
      if (!repeat) this.gestures++;
      const step = shiftKey ? FINE_STEP : STEP, [right, up] = ARROWS[key], [x, y] = one.wanted ??
          [one.handle.x, one.handle.y];
      // Presses add up while answers are on their way.
      one.wanted = [x + right * step, y + up * step];
      this.acts.use(one.name);
      this.acts.drag(one.handle, one.wanted, { free: shiftKey, alt: altKey }, `drag ${this.gestures}`);
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** Removes a corner, or the piece or obstacle of another handle. */
  remove({ name, kind }) {
    const removed = CORNERS.includes(kind) ? name : itemOf(name);
    if (removed) this.acts.remove(removed);
  }

  /** Adds a corner between a corner and the next one. */
  insert({ name, kind, x, y }) {
    if (!CORNERS.includes(kind)) return;
    const list = name.replace(/\[\d+\]$/, ""), of = this.scene.handles.filter((one) => one.name.startsWith(`${list}[`));
    const next = of[(of.findIndex((one) => one.name === name) + 1) % of.length];
    this.acts.insert(name, [(x + next.x) / 2, (y + next.y) / 2].map((one) => Math.round(10 * one) / 10));
  }
}
