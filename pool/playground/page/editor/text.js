// @ts-check
// TextPanel: the JSON texts of the files, which are edited here too.

import { byId, make } from "#view/dom.js";
import { stemOf } from "./document.js";
import { INDENT } from "./json.js";

/** @import { PlacedProblem } from "./problems.js" */

/** @import { EditorPage } from "./editor.js" */

/** Milliseconds without typing that separate two changes. */
const PAUSE = 1000;

export class TextPanel {
  /** @param {EditorPage} page */
  constructor(page) {
    this.page = page;
    /** @type {HTMLSelectElement} */
    this.choice = byId("file");
    /** @type {HTMLTextAreaElement} */
    this.area = byId("text");
    /** @type {HTMLElement} */
    this.lines = byId("lines");
    /** Whether Tab leaves the text, after Escape. */
    this.leaves = false;
    /** When the text was changed last. */
    this.written = 0;
    /** The name of the unit type whose file is shown; null for the scenario file. */
    this.name = /** @type {string | null} */ (null);
    /** The files that can be chosen, as they were last. */
    this.names = "";
    this.choice.addEventListener("change", () => this.show(this.choice.value || null));
    this.area.addEventListener("input", () => this.write());
    this.area.addEventListener("blur", () => this.page.doc.settle());
    this.area.addEventListener("scroll", () => (this.lines.scrollTop = this.area.scrollTop));
    this.area.addEventListener("keydown", (event) => this.key(event));
    byId("format").addEventListener("click", () => {
      const file = this.file.formatted();
      if (this.index < 0) this.page.doc.change({ scenario: file });
      else this.page.doc.setUnit(this.index, () => file);
    });
  }

  get index() {
    return this.name === null ? -1 : this.page.doc.units.findIndex((unit) => unit.name === this.name);
  }

  get file() {
    const { doc } = this.page;
    return this.index < 0 ? doc.scenario : doc.units[this.index].file;
  }

  /** @param {string | null} name */
  show(name) {
    this.name = name;
    this.refresh();
  }

  refresh() {
    const { doc } = this.page;
    if (this.name !== null && this.index < 0) this.name = null;
    /** @type {[string, string][]} */
    const units = doc.units.map(({ name }) => [name, name]);
    const names = [["", stemOf(doc.state.source)], ...units];
    const key = JSON.stringify(names);
    if (key !== this.names) {
      this.names = key;
      this.choice.replaceChildren(...names.map(([value, name]) => make("option", { value }, `${name}.json`)));
    }
    this.choice.value = this.name ?? "";
    const { text } = this.file;
    if (this.file.withLineEnds(this.area.value) !== text) this.area.value = text;
    const lines = text.split("\n").length;
    if (this.lines.childElementCount !== lines)
      this.lines.replaceChildren(...Array.from({ length: lines }, (_, i) => make("i", {}, String(i + 1))));
  }

  /**
   * Marks the lines with problems.
   * @param {PlacedProblem[]} problems
   */
  mark(problems) {
    const wrong = new Set(problems.filter(({ unit }) => unit === this.name).map(({ line }) => line));
    [...this.lines.children].forEach((line, i) => line.classList.toggle("wrong", wrong.has(i + 1)));
  }

  /**
   * Selects a range of the text and scrolls to it.
   * @param {number} start
   * @param {number} end
   */
  select(start, end) {
    const { area } = this;
    area.focus();
    // A text area has one character for CR and LF.
    const [from, to] = [start, end].map((at) => at - this.file.text.slice(0, at).split("\r\n").length + 1);
    area.setSelectionRange(from, to);
    const line = this.file.position(start).line - 1;
    const height = parseFloat(getComputedStyle(area).lineHeight);
    area.scrollTop = Math.max(0, line * height - area.clientHeight / 3);
    this.lines.scrollTop = area.scrollTop;
  }

  /**
   * Tab indents, after Escape it leaves the text.
   * @param {KeyboardEvent} event
   */
  key(event) {
    if (event.key === "Escape") this.leaves = true;
    else if (event.key !== "Tab") this.leaves = false;
    if (event.key !== "Tab" || event.shiftKey || this.leaves) return;
    event.preventDefault();
    this.area.setRangeText(INDENT, this.area.selectionStart, this.area.selectionEnd, "end");
    this.write();
  }

  /** Makes the text the file's. What is typed without a pause is undone as one. */
  write() {
    const now = performance.now();
    if (now - this.written > PAUSE) this.page.doc.settle();
    this.written = now;
    this.page.doc.setText(this.index, this.file.withLineEnds(this.area.value), "text");
  }
}
