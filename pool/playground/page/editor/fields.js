// @ts-check
// Fields of the forms: each shows one value of a file, and writes it when it is edited.

import { titleCase } from "#view/battle.js";
import { all, make } from "#view/dom.js";
import { numberText } from "./json.js";

/** @import { Child } from "#view/dom.js" */
/** @import { Merge } from "./history.js" */
/** @import { Path } from "./json.js" */
/**
 * What a field shows and how: `read` gives the value, `write` sets it; undefined means no value. Values are
 * as the file has them, which may be invalid. `unit` is the name of a unit type, or -1 for the scenario file.
 * @typedef {{ label: string, path: Path, read: () => any, write: (value: any, merge?: Merge) => void,
 *   unit?: string | number | null, hint?: string, readonly?: boolean, wide?: boolean, step?: number,
 *   min?: number, placeholder?: string, options?: [value: string, label: string][],
 *   keywords?: string[] }} FieldOptions
 */
/** @typedef {keyof typeof FIELDS} FieldKind */

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

  /** @param {HTMLElement} element */
  constructor(element) {
    this.element = element;
    /** @type {{ refresh: () => void }[]} */
    this.fields = [];
    /** @type {string | null} */
    this.shown = null;
  }

  refresh() {
    const signature = this.signature();
    if (signature !== this.shown) this.rebuild(signature);
    this.fields.forEach((field) => field.refresh());
  }

  /** @param {string} signature */
  rebuild(signature) {
    const active = /** @type {HTMLElement | null} */ (document.activeElement);
    const focused = this.element.contains(active) ? active?.dataset.key : null;
    this.shown = signature;
    this.fields = [];
    this.element.replaceChildren(...this.build());
    if (focused) this.find(focused)?.focus();
  }

  /** @param {string} key */
  find(key) {
    return all("[data-key]", this.element).find((element) => element.dataset.key === key);
  }

  /**
   * Adds a field.
   * @param {FieldKind} kind
   * @param {FieldOptions} options
   */
  field(kind, options) {
    const field = new FIELDS[kind](options);
    this.fields.push(field);
    return field.element;
  }
}

/**
 * @param {Child | Child[]} label
 * @param {string} title
 * @param {() => void} click
 * @param {{ [key: string]: unknown }} [properties]
 */
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

/** @param {keyof typeof ICONS} name */
export function icon(name) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"),
    path = document.createElementNS("http://www.w3.org/2000/svg", "path");
  svg.setAttribute("viewBox", "0 0 20 20");
  path.setAttribute("d", ICONS[name]);
  svg.append(path);
  return svg;
}

/**
 * @param {keyof typeof ICONS} name
 * @param {string} title
 * @param {() => void} click
 */
export function iconButton(name, title, click) {
  return button(icon(name), title, click, { className: "mini", "aria-label": title });
}

/**
 * The key by which fields, problems and the focus find each other.
 * @param {string | number | null} unit
 * @param {Path} path
 */
export const fieldKey = (unit, path) => `${unit}:${JSON.stringify(path)}`;

class Field {
  /**
   * The input of the value.
   * @returns {any}
   * @param {FieldOptions} _options
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

  /**
   * Makes the input show a value.
   * @param {any} _value
   */
  show(_value) {}

  /** @param {FieldOptions} options */
  constructor(options) {
    const { label, unit = -1, path, read, write, hint = "", readonly = false, wide = false } = options;
    this.read = read;
    this.write = write;
    this.readonly = readonly;
    this.control = this.makeControl(options);
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

  /** @param {unknown} value */
  same(value) {
    return this.value() === value;
  }
}

class NumberField extends Field {
  /** @param {FieldOptions} options */
  makeControl({ step, min, readonly, placeholder = "" }) {
    return make("input", {
      type: "text",
      inputMode: "decimal",
      autocomplete: "off",
      placeholder,
      readOnly: readonly,
      "data-step": String(step ?? ""),
      "data-min": String(min ?? ""),
    });
  }

  /** @param {FieldOptions} options */
  constructor(options) {
    super(options);
    const { control } = this;
    control.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
      const by = event.key === "ArrowUp" ? 1 : event.key === "ArrowDown" ? -1 : 0;
      const step = Number(control.dataset.step) || 1;
      if (!by || this.readonly || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      const from = Number(control.value) || 0,
        least = control.dataset.min === "" ? -Infinity : Number(control.dataset.min);
      const next = Math.max(least, Math.round((from + by * step * (event.shiftKey ? 10 : 1)) * 1e6) / 1e6);
      control.value = String(next);
      this.write(next, control.dataset.key);
    });
    // What the file has in place of a number that it cannot be without.
    control.addEventListener("change", () => this.show(this.read()));
  }

  /** A number, undefined if empty, or else the text, which the program then refuses. */
  value() {
    const text = this.control.value.trim();
    if (!text) return undefined;
    return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(text) ? Number(text) : text;
  }

  /** @param {any} value */
  show(value) {
    const text = typeof value === "number" ? numberText(value) : String(value ?? "");
    this.control.value = typeof value === "object" ? "(see JSON)" : text;
  }
}

class TextField extends Field {
  /** @param {FieldOptions} options */
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

  /** @param {any} value */
  show(value) {
    this.control.value = value === undefined ? "" : typeof value === "string" ? value : JSON.stringify(value);
  }
}

class CheckField extends Field {
  /** @param {FieldOptions} options */
  makeControl({ readonly }) {
    return make("input", { type: "checkbox", disabled: readonly });
  }

  /** @param {FieldOptions} options */
  constructor(options) {
    super(options);
    this.element.classList.add("check");
  }

  value() {
    return this.control.checked;
  }

  /** @param {any} value */
  show(value) {
    this.control.checked = value === true;
  }
}

/** Options are [value, label]; a value of the file that is no option is shown as one. */
class SelectField extends Field {
  /** @param {FieldOptions} options */
  makeControl({ options = [], readonly }) {
    const list = options.map(([value, label]) => make("option", { value }, label));
    return make("select", { disabled: readonly }, list);
  }

  value() {
    return this.control.value || undefined;
  }

  /** @param {any} value */
  show(value = "") {
    const text = typeof value === "string" ? value : JSON.stringify(value);
    this.control.querySelector(".odd")?.remove();
    /** @type {HTMLOptionElement[]} */
    const options = [...this.control.options];
    if (!options.some((option) => option.value === text))
      this.control.append(make("option", { value: text, className: "odd" }, `${text || "(none)"}`));
    this.control.value = text;
  }
}

/** A list of keywords, each of which is in it or not. */
class FlagsField {
  /** @param {FieldOptions} options */
  constructor({ label, unit = -1, path, read, write, keywords = [], readonly, hint = "" }) {
    this.read = read;
    this.boxes = keywords.map((name) => {
      const box = make("input", { type: "checkbox", disabled: readonly });
      box.dataset.key = fieldKey(unit, [...path, name]);
      box.addEventListener("change", () => {
        const now = this.read();
        const list = Array.isArray(now) ? now.filter((item) => item !== name) : [];
        write(box.checked ? [...list, name] : list);
      });
      return { name, box };
    });
    const flags = this.boxes.map(({ name, box }) => make("label", {}, [box, titleCase(name)]));
    this.element = make("fieldset", { className: "flags", title: hint }, [
      make("legend", {}, label),
      ...flags,
    ]);
    this.element.dataset.key = fieldKey(unit, path);
    this.element.tabIndex = -1;
  }

  refresh() {
    const list = this.read();
    for (const { name, box } of this.boxes) box.checked = Array.isArray(list) && list.includes(name);
  }
}

const FIELDS = {
  number: NumberField,
  text: TextField,
  check: CheckField,
  select: SelectField,
  flags: FlagsField,
};
