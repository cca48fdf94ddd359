// The lock of the show look: the page cancels the browser's own actions on menu, wheel, touch, drag and selection. With
// #hands the camera still moves by pointer and keys. A held Shift+L shows that the page is locked.

/** The time for which Shift+L is held, and the time for which the tag is shown (ms). */
const HELD = 1000, SHOWN = 3000;

/** Locks the page. `words` returns the words of the tag. */
export function lock(words) {
  const tag = document.body.appendChild(Object.assign(document.createElement("p"), { id: "locked", hidden: true }));
  let timer = null;
  for (const kind of ["contextmenu", "wheel", "touchstart", "touchmove", "dragstart", "selectstart", "gesturestart"]) {
    addEventListener(kind, (event) => event.preventDefault(), { passive: false });
  }
  const release = () => {
    clearTimeout(timer);
    timer = null;
  };
  addEventListener("keydown", ({ key, shiftKey }) => {
    if (!(shiftKey && key.toLowerCase() === "l")) return release();
    timer ??= setTimeout(() => {
      tag.textContent = words();
      tag.hidden = false;
      setTimeout(() => (tag.hidden = true), SHOWN);
    }, HELD);
  });
  addEventListener("keyup", release);
}
