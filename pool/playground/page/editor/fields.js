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
/** @typedef {keyof typeof INPUTS | "flags"} FieldKind */

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
    const field = kind === "flags" ? new FlagsField(options) : new Field(INPUTS[kind], options);
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

/**
 * A kind of input: how it is made, what value it has, and how it shows one of the file. `value` is undefined
 * if it is empty.
 * @typedef {{ make: (options: FieldOptions) => any, value: (input: any) => any,
 *   show: (input: any, value: any) => void }} InputKind
 */

/** @type {InputKind["make"]} */
const textInput = ({ readonly = false, placeholder = "" }) =>
  make("input", { type: "text", autocomplete: "off", spellcheck: false, readOnly: readonly, placeholder });

/** @type {InputKind} */
const TEXT = {
  make: textInput,
  value: (input) => input.value || undefined,
  show(input, value) {
    input.value = value === undefined ? "" : typeof value === "string" ? value : JSON.stringify(value);
  },
};

/** @type {InputKind} */
const NUMBER = {
  make: (options) => Object.assign(textInput(options), { inputMode: "decimal" }),
  /** A number, or else the text, which the program then refuses. */
  value(input) {
    const text = input.value.trim();
    if (!text) return undefined;
    return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(text) ? Number(text) : text;
  },
  show(input, value) {
    const text = typeof value === "number" ? numberText(value) : String(value ?? "");
    input.value = typeof value === "object" ? "(see JSON)" : text;
  },
};

/** @type {InputKind} */
const CHECK = {
  make: ({ readonly }) => make("input", { type: "checkbox", disabled: readonly }),
  value: (input) => input.checked,
  show(input, value) {
    input.checked = value === true;
  },
};

/** @type {InputKind} A value of the file that is no option is shown as one. */
const SELECT = {
  make({ options = [], readonly }) {
    const list = options.map(([value, label]) => make("option", { value }, label));
    return make("select", { disabled: readonly }, list);
  },
  value: TEXT.value,
  show(input, value = "") {
    const text = typeof value === "string" ? value : JSON.stringify(value);
    input.querySelector(".odd")?.remove();
    /** @type {HTMLOptionElement[]} */
    const options = [...input.options];
    if (!options.some((option) => option.value === text))
      input.append(make("option", { value: text, className: "odd" }, `${text || "(none)"}`));
    input.value = text;
  },
};

class Field {
  /**
   * @param {InputKind} kind
   * @param {FieldOptions} options
   */
  constructor(kind, options) {
    const { label, unit = -1, path, read, write, hint = "", wide = false } = options;
    this.kind = kind;
    this.read = read;
    this.control = kind.make(options);
    this.control.dataset.key = fieldKey(unit, path);
    if (hint) this.control.title = hint;
    this.element = make("label", { className: `field${wide ? " wide" : ""}` }, [
      make("span", { title: hint }, label),
      this.control,
    ]);
    this.control.addEventListener("input", () => write(kind.value(this.control), this.control.dataset.key));
    if (kind === CHECK) this.element.classList.add("check");
    if (kind === NUMBER) this.listenToArrows(options);
  }

  /** @param {FieldOptions} options */
  listenToArrows({ write, step = 1, min = -Infinity, readonly }) {
    const { control } = this;
    control.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
      const by = event.key === "ArrowUp" ? 1 : event.key === "ArrowDown" ? -1 : 0;
      if (!by || readonly || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      const next = (Number(control.value) || 0) + by * step * (event.shiftKey ? 10 : 1);
      control.value = String(Math.max(min, Math.round(next * 1e6) / 1e6));
      write(Number(control.value), control.dataset.key);
    });
    // What the file has in place of a number that it cannot be without.
    control.addEventListener("change", () => NUMBER.show(control, this.read()));
  }

  refresh() {
    const value = this.read();
    if (document.activeElement === this.control && this.kind.value(this.control) === value) return;
    this.kind.show(this.control, value);
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

const INPUTS = { number: NUMBER, text: TEXT, check: CHECK, select: SELECT };
