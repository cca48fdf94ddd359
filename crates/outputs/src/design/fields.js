// The numbers of the scene as fields, in groups: a number, its unit, a slider, the accepted range. In: the scene. Out:
// new values, additions and removals.

const TITLES = [["path", "Path"], ["placement", "Placement"], ["team", "Team"], ["motion", "Motion"],
  ["dragons", "Dragons"], ["stage", "Stage"], ["obstacles", "Obstacles"], ["require", "Required"], ["cues", "Cues"],
  ["alerts", "Alerts"], ["publish", "Publishing"]];
const UNITS = { metres: "m", "metres per second": "m/s", seconds: "s", turns: "turns", "frames per second": "Hz" };
/** The part of a field's name that names a thing among several. */
const ITEM = /^(?:dragons\[\d+\]\.)?(?:path\.pieces|stage\.obstacles|cues)\[\d+\]|^dragons\[\d+\]/;
const NOUNS = { pieces: "Piece", obstacles: "Obstacle", cues: "Cue", dragons: "Dragon" };
/** The groups whose numbers *Fit* may change. */
const FITTED = ["path", "placement", "team"];
/** The number of fields of a group above which it is closed at first. */
const MANY = 80;

/** Returns a table of names as words. */
const wordsOf = (name) => name.replaceAll(/[._]/g, " ").replaceAll(/\[(\d+)\]/g, (_, k) => ` ${Number(k) + 1}`).trim();

/** Returns a unit as it stands beside a number. */
export const unitOf = (unit) => UNITS[unit] ?? "";

/** Returns the fields of a scene, with those that it leaves to their defaults and that most scenes need. */
function fieldsOf({ fields, obstacles = [] }) {
  const all = fields.filter(({ value }) => value === null || typeof value !== "object");
  const has = (name) => all.some((field) => field.name === name), missing = { unit: "metres", min: 0, max: 1e6 };
  for (const { name, line } of obstacles) {
    const last = all.findLastIndex((field) => field.name.startsWith(`${name}.`));
    if (!has(`${name}.keep_out`)) all.splice(last + 1, 0, { ...missing, name: `${name}.keep_out`, value: 0, line });
  }
  if (!has("require.clearance")) all.push({ ...missing, name: "require.clearance", value: null, line: null });
  return all;
}

/** Returns the item of a field, as it is named in a request; "" for a field of a table. */
export const itemOf = (name) => ITEM.exec(name)?.[0] ?? "";

/** Returns an item in words: its noun, its number from 1, its kind and its name. */
export function itemWords(item, scene) {
  const [, noun, number] = /(\w+)\[(\d+)\]$/.exec(item) ?? [null, "", 0];
  const piece = scene.pieces?.find(({ name }) => name === item), obstacle = scene.obstacles?.find(
      ({ name }) => name === item);
  const own = { cues: scene.cues?.[number]?.name, dragons: scene.dragons?.[number], obstacles: obstacle?.title }[noun];
  const dragon = /^(dragons\[\d+\])\./.exec(item)?.[1];
  return [`${NOUNS[noun] ?? noun} ${Number(number) + 1}`, piece?.kind ?? obstacle?.kind, own,
    dragon && itemWords(dragon, scene)].filter(Boolean).join(" · ");
}

/** Returns the group of a field. */
function groupOf(name) {
  const rest = name.replace(/^dragons\[\d+\]\./, "");
  if (rest.startsWith("stage.obstacles")) return "obstacles";
  const [group] = rest.split(/[.[]/);
  return TITLES.some(([key]) => key === group) ? group : name === rest ? "scene" : "dragons";
}

/** Returns the label of a field below the heading of its group or item. */
function labelOf(name, item) {
  const named = name.replace(/\[([01])\]$/, (_, axis) => ` ${"xy"[axis]}`);
  const rest = named.slice(item.length).replace(/^\./, ""), [group] = rest.split(".");
  return wordsOf(TITLES.some(([key]) => key === group) && rest !== group ? rest.slice(group.length + 1) : rest);
}

/** Creates an element with properties, attributes and children. */
export function made(tag, { attributes = {}, ...properties } = {}, ...children) {
  const one = Object.assign(document.createElement(tag), properties);
  for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
  one.append(...children);
  return one;
}

/** Returns a number without digits that a slider does not have. */
function rounded(value, [low, high]) {
  const step = 10 ** Math.floor(Math.log10((high - low) / 200));
  return Number((Math.round(value / step) * step).toPrecision(12));
}

export class Fields {
  /**
   * `acts` has set(name, value, gesture), remove(item), show(line), focus(field) and vary(names of the marked numbers).
   * A gesture has a key of its own, which a slider keeps while it is dragged.
   */
  constructor(root, acts) {
    Object.assign(this, { root, acts, key: null, rows: new Map(), marked: new Set(), gestures: 0 });
  }

  /** Shows the fields of a scene. The field that has the focus keeps what the user types. */
  show(scene) {
    const fields = fieldsOf(scene);
    const items = JSON.stringify([scene.pieces, scene.obstacles, scene.dragons]);
    const key = JSON.stringify([fields.map(({ name }) => name), items, scene.cues?.map(({ name }) => name)]);
    // A name with a number may be that of another piece now.
    if (items !== this.items) this.marked.clear();
    this.items = items;
    if (key !== this.key) this.build(fields, scene);
    this.key = key;
    for (const field of fields) this.update(field);
  }

  build(fields, scene) {
    const focus = document.activeElement?.dataset.field, groups = new Map(), isOpen = (group, all) =>
      this.root.querySelector(`[data-group="${group}"]`)?.open ?? all.length <= MANY;
    for (const field of fields) groups.set(groupOf(field.name), [...groups.get(groupOf(field.name)) ?? [], field]);
    const order = [...new Set([...TITLES.map(([group]) => group), ...groups.keys()])].filter(
        (group) => groups.has(group));
    this.rows.clear();
    const built = order.map((group) => {
      const all = groups.get(group), title = TITLES.find(([one]) => one === group)?.[1] ?? wordsOf(group);
      const details = made("details", { open: isOpen(group, all), attributes: { "data-group": group } },
          made("summary", { textContent: title }));
      let item = "";
      for (const field of all) {
        const own = itemOf(field.name);
        if (own !== item && own) details.append(this.heading(own, field, scene));
        item = own;
        details.append(this.row(field, own, scene));
      }
      return details;
    });
    this.root.replaceChildren(...built);
    this.marked = new Set([...this.marked].filter((name) => this.root.querySelector(`[data-vary="${CSS.escape(name)}"]`)));
    this.acts.vary([...this.marked]);
    if (focus) this.root.querySelector(`[data-field="${CSS.escape(focus)}"]`)?.focus();
  }

  heading(item, { line }, scene) {
    const words = itemWords(item, scene);
    const remove = made("button", { type: "button", textContent: "×", title: `Remove ${words}`,
      onclick: () => this.acts.remove(item), attributes: { "aria-label": `Remove ${words}`, "data-remove": item } });
    return made("h3", { onclick: () => this.acts.show(line), attributes: { "data-item": item } }, words, remove);
  }

  row(field, item, scene) {
    const { name, unit, choices, value } = field, isNumber = typeof value === "number" || (value === null && !choices);
    const label = labelOf(name, item);
    const full = item ? `${itemWords(item, scene)}: ${label}` : wordsOf(name);
    const input = choices ? made("select", {}, ...choices.map((one) => new Option(one, one)))
        : made("input", { type: isNumber ? "number" : typeof value === "boolean" ? "checkbox" : "text" });
    Object.assign(input.dataset, { field: name });
    input.setAttribute("aria-label", unit ? `${full}, ${unit}` : full);
    if (value === null) input.placeholder = "none";
    const slider = isNumber ? made("input", { type: "range", attributes: { "data-slider": name,
      "aria-label": `${full}, slider`, tabindex: "-1" } }) : null;
    const isFitted = field.slider && !field.integer && FITTED.includes(groupOf(name));
    const row = { field, input, slider, node: made("label", { className: "field" },
        made("span", { textContent: label, title: name }), ...(slider ? [slider] : []), input,
        made("i", { textContent: unitOf(unit) }), ...(isFitted ? [this.mark(name, full)] : [])) };
    this.rows.set(name, row);
    this.listen(row);
    return row.node;
  }

  /** Returns the mark of a number that *Fit* may change. */
  mark(name, full) {
    const mark = made("input", { type: "checkbox", checked: this.marked.has(name), title: "Fit may change this number",
      attributes: { "data-vary": name, "aria-label": `${full}: Fit may change it` } });
    mark.onchange = () => {
      if (mark.checked) this.marked.add(name);
      else this.marked.delete(name);
      this.acts.vary([...this.marked]);
    };
    return mark;
  }

  listen(row) {
    const { input, slider } = row;
    const valueOf = () => (input.type === "checkbox" ? input.checked : input.type === "number" ? input.valueAsNumber
        : input.value);
    const send = () => {
      const value = valueOf();
      if (value === row.sent || Number.isNaN(value)) return;
      row.sent = value;
      row.shown = undefined;
      this.acts.set(row.field.name, value, `field ${row.field.name} ${this.gestures}`);
    };
    input.onfocus = () => this.acts.focus(row.field);
    input.oninput = () => {
      row.isTyped = input.type === "number" || input.type === "text";
      send();
    };
    input.onchange = () => {
      send();
      this.end();
    };
    input.onblur = () => this.end();
    if (!slider) return;
    slider.oninput = () => {
      if (!row.isHeld) this.acts.focus(row.field);
      row.isHeld = true;
      const { integer, slider: range } = row.field, value = slider.valueAsNumber;
      input.value = integer ? Math.round(value) : rounded(value, range);
      send();
    };
    slider.onchange = () => this.end();
  }

  /** Ends a gesture: the next input of a field is another one. */
  end() {
    this.gestures++;
    for (const row of this.rows.values()) {
      if (!row.isTyped && !row.isHeld) continue;
      row.isTyped = row.isHeld = false;
      this.update(row.field);
    }
  }

  /** Shows the value of a field; a field that the user types in or drags keeps its own. */
  update(field) {
    const row = this.rows.get(field.name);
    if (!row) return;
    const { input, slider } = row, { value, min, max, integer, unit } = field;
    const isShown = value === row.shown && !row.isRefused;
    row.field = field;
    if (isShown && !row.isTyped && !row.isHeld) return;
    row.shown = row.isTyped || row.isHeld ? undefined : value;
    row.isRefused = false;
    row.node.classList.remove("refused");
    input.removeAttribute("aria-invalid");
    if (input.type === "number") Object.assign(input, { step: integer ? 1 : "any",
        title: Number.isFinite(min) ? `accepted: ${min} to ${max} ${unit ?? ""}` : "" });
    if (!row.isTyped && !row.isHeld) {
      if (input.type === "checkbox") input.checked = value;
      else input.value = value ?? "";
      row.sent = value;
    }
    if (!slider || row.isHeld) return;
    slider.hidden = !field.slider || value === null;
    if (slider.hidden) return;
    const [low, high] = field.slider;
    Object.assign(slider, { min: low, max: high, step: integer ? 1 : "any", value });
  }

  /** Marks the field of an error. */
  refuse(name, sentence) {
    const row = this.rows.get(name);
    if (!row) return;
    row.isRefused = true;
    row.node.classList.add("refused");
    row.input.setAttribute("aria-invalid", "true");
    row.input.title = sentence;
  }

  /** Fields act only on a text without an error. */
  enable(isEnabled) {
    this.root.inert = !isEnabled;
  }
}
