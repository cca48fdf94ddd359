// Pointer input: mouse, fingers and keys on the picture. Maps gestures to actions, and does not know the actions.

/**
 * `acts` has pan(x, y) and zoomAt(by, x, y) in pixels, isFree() (true if two fingers may move the picture), and tap(x,
 * y). It also has `keys`, an action for each key, and isWanted(event), true if the key of a letter or a sign may act.
 */
export function attach(canvas, acts) {
  const fingers = new Map();
  let moved = 0;
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    if (!fingers.size) moved = 0;
    fingers.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
  };
  canvas.onpointermove = (event) => {
    const old = fingers.get(event.pointerId);
    if (!old) return;
    const now = { x: event.offsetX, y: event.offsetY }, x = now.x - old.x, y = now.y - old.y;
    moved += Math.hypot(x, y);
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const apart = (one) => Math.hypot(one.x - other.x, one.y - other.y) || 1;
      acts.zoomAt(apart(now) / apart(old), (now.x + other.x) / 2, (now.y + other.y) / 2);
      if (acts.isFree()) acts.pan(x / 2, y / 2);
    } else if (moved > 6) acts.pan(x, y);
    fingers.set(event.pointerId, now);
  };
  canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
  canvas.onpointerup = (event) => {
    fingers.delete(event.pointerId);
    if (moved <= 6 && !fingers.size) acts.tap(event.offsetX, event.offsetY);
  };
  const wheel = (event) => {
    event.preventDefault();
    acts.zoomAt(Math.exp(-event.deltaY / (event.deltaMode ? 20 : 500)), event.offsetX, event.offsetY);
  };
  canvas.addEventListener("wheel", wheel, { passive: false });
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const typing = event.target instanceof HTMLInputElement;
    if (typing && event.key !== "Escape") return;
    if (typing) event.target.blur();
    if (event.target.closest?.("dialog")) return;
    if (event.key.length === 1 && !acts.isWanted(event)) return;
    acts.keys[event.key.length === 1 ? event.key.toLowerCase() : event.key]?.(event);
  });
}
