// The switch of the keys (WCAG 2.1.4): letters typed anywhere act only where the user has switched them on. The choice
// is kept in the browser.

const STORED = "bench-dragon keys";

export class KeySwitch {
  /** `given`: true if the address switches the keys on. `box` is the switch on the page. */
  constructor(given, box) {
    this.on = given || stored();
    box.checked = this.on;
    box.onchange = () => {
      this.on = box.checked;
      try {
        localStorage.setItem(STORED, this.on ? "on" : "off");
      } catch {
        // A browser without storage forgets the choice.
      }
    };
  }

  /** Returns true if a key may act: keys are on, or the focus is within the element of the key. */
  acts({ target }, element) {
    return this.on || element.contains(target);
  }
}

function stored() {
  try {
    return localStorage.getItem(STORED) === "on";
  } catch {
    return false;
  }
}
