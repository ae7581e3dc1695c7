// @ts-check
// Fields of the forms: each shows one value of a file, and writes it when it is edited.

import { titleCase } from "#view/battle.js";
import { make } from "#view/dom.js";

/** A form that is rebuilt when its signature changes, and otherwise only refreshed. */
export class Panel {
  /** A text that changes when the form must be rebuilt. */
  signature() {
    return "";
  }

  /**
   * The elements of the form.
   * @returns {Node[]}
   */
  build() {
    return [];
  }

  constructor(element) {
    this.element = element;
    this.fields = [];
    this.shown = null;
  }

  refresh() {
    const signature = this.signature();
    if (signature !== this.shown) this.rebuild(signature);
    this.fields.forEach((field) => field.refresh());
  }

  rebuild(signature) {
    const active = /** @type {HTMLElement | null} */ (document.activeElement);
    const focused = this.element.contains(active) ? active?.dataset.key : null;
    this.shown = signature;
    this.fields = [];
    this.element.replaceChildren(...this.build());
    if (focused) this.find(focused)?.focus();
  }

  find(key) {
    return [...this.element.querySelectorAll("[data-key]")].find((element) => element.dataset.key === key);
  }

  /** Adds a field: `read` gives the value, `write(value, merge)` sets it; undefined means no value. */
  field(kind, options) {
    const field = new FIELDS[kind](options);
    this.fields.push(field);
    return field.element;
  }
}

export function button(label, title, click, properties = {}) {
  const element = make("button", { type: "button", title, ...properties }, label);
  element.addEventListener("click", click);
  return element;
}

const ICONS = {
  up: "M5 12l5-5 5 5",
  down: "M5 8l5 5 5-5",
  remove: "M5 5l10 10M15 5L5 15",
  add: "M10 4v12M4 10h12",
  copy: "M7 7h9v9H7zM4 13V4h9",
};

export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"),
    path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  svg.setAttribute("viewBox", "0 0 20 20");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

export function iconButton(name, title, click) {
  return button(icon(name), title, click, { className: "mini", "aria-label": title });
}

/** The key by which fields, problems and the focus find each other. */
export const fieldKey = (unit, path) => `${unit}:${JSON.stringify(path)}`;

class Field {
  /**
   * The input of the value.
   * @returns {any}
   */
  makeControl(_options) {
    return null;
  }

  /**
   * The value that the input has.
   * @returns {any}
   */
  value() {
    return undefined;
  }

  /** Makes the input show a value. */
  show(_value) {}

  constructor({ label, unit = -1, path, read, write, hint = "", readonly = false, wide = false }) {
    this.read = read;
    this.write = write;
    this.readonly = readonly;
    this.control = this.makeControl(arguments[0]);
    this.control.dataset.key = fieldKey(unit, path);
    if (hint) this.control.title = hint;
    this.element = make("label", { className: `field${wide ? " wide" : ""}` }, [
      make("span", { title: hint }, label),
      this.control,
    ]);
    this.control.addEventListener("input", () => this.write(this.value(), this.control.dataset.key));
  }

  refresh() {
    const value = this.read();
    if (document.activeElement === this.control && this.same(value)) return;
    this.show(value);
  }

  same(value) {
    return this.value() === value;
  }
}

class NumberField extends Field {
  makeControl({ step = "any", min, readonly, placeholder = "" }) {
    return make("input", {
      type: "text",
      inputMode: "decimal",
      autocomplete: "off",
      placeholder: String(placeholder),
      readOnly: readonly,
      "data-step": String(step),
      "data-min": String(min ?? ""),
    });
  }

  constructor(options) {
    super(options);
    const { control } = this;
    control.addEventListener("keydown", (event) => {
      const by = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      const step = Number(control.dataset.step) || 1;
      if (!by || this.readonly || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      const from = Number(control.value) || 0,
        least = control.dataset.min === "" ? -Infinity : Number(control.dataset.min);
      const next = Math.max(least, Math.round((from + by * step * (event.shiftKey ? 10 : 1)) * 1e6) / 1e6);
      control.value = String(next);
      this.write(next, control.dataset.key);
    });
  }

  /** A number, undefined if empty, or else the text, which the program then refuses. */
  value() {
    const text = this.control.value.trim();
    if (!text) return undefined;
    return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(text) ? Number(text) : text;
  }

  show(value) {
    const isPlain = value === undefined || typeof value !== "object";
    this.control.value = value === undefined ? "" : isPlain ? String(value) : "(see JSON)";
  }
}

class TextField extends Field {
  makeControl({ readonly, placeholder = "" }) {
    return make("input", {
      type: "text",
      autocomplete: "off",
      spellcheck: false,
      readOnly: readonly,
      placeholder,
    });
  }

  value() {
    return this.control.value || undefined;
  }

  show(value) {
    this.control.value = value === undefined ? "" : typeof value === "string" ? value : JSON.stringify(value);
  }
}

class CheckField extends Field {
  makeControl({ readonly }) {
    return make("input", { type: "checkbox", disabled: readonly });
  }

  constructor(options) {
    super(options);
    this.element.classList.add("check");
  }

  value() {
    return this.control.checked;
  }

  show(value) {
    this.control.checked = value === true;
  }
}

/** Options are [value, label]; a value of the file that is no option is shown as one. */
class SelectField extends Field {
  makeControl({ options, readonly }) {
    this.options = options;
    const list = options.map(([value, label]) => make("option", { value }, label));
    return make("select", { disabled: readonly }, list);
  }

  value() {
    return this.control.value || undefined;
  }

  show(value = "") {
    const text = typeof value === "string" ? value : JSON.stringify(value);
    this.control.querySelector(".odd")?.remove();
    if (![...this.control.options].some((option) => option.value === text))
      this.control.append(make("option", { value: text, className: "odd" }, `${text || "(none)"}`));
    this.control.value = text;
  }
}

/** A list of keywords, each of which is in it or not. */
class FlagsField {
  constructor({ label, unit, path, read, write, options, readonly, hint = "" }) {
    this.read = read;
    this.boxes = options.map((name) => {
      const box = make("input", { type: "checkbox", disabled: readonly });
      box.dataset.key = fieldKey(unit, [...path, name]);
      box.addEventListener("change", () => {
        const now = this.read();
        const list = Array.isArray(now) ? now.filter((item) => item !== name) : [];
        write(box.checked ? [...list, name] : list);
      });
      return [name, box];
    });
    const flags = this.boxes.map(([name, box]) => make("label", {}, [box, titleCase(name)]));
    this.element = make("fieldset", { className: "flags", title: hint }, [
      make("legend", {}, label),
      ...flags,
    ]);
    this.element.dataset.key = fieldKey(unit, path);
    this.element.tabIndex = -1;
  }

  refresh() {
    const list = this.read();
    for (const [name, box] of this.boxes) box.checked = Array.isArray(list) && list.includes(name);
  }
}

const FIELDS = {
  number: NumberField,
  text: TextField,
  check: CheckField,
  select: SelectField,
  flags: FlagsField,
};
