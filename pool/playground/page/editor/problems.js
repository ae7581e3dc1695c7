// @ts-check
// Checker: requests what is wrong with the files, and shows it in the list, the fields and the tabs.

import { all, byId, make, messageOf, tell } from "#view/dom.js";
import { counted } from "#view/numbers.js";
import { EngineLost } from "../engine.js";
import { seedOfField } from "./arena.js";
import { NAME_RULE, UNIT_NAME, isNumber, stemOf } from "./document.js";
import { button, fieldKey } from "./fields.js";

/** @import { EditorPage } from "./editor.js" */
/** @import { CheckedFiles, Problem, Summary } from "../protocol.d.ts" */
/** @import { ReadGroup } from "./document.js" */
/** @import { State } from "./history.js" */
/** @import { Path } from "./json.js" */
/**
 * A problem with the unit type and the part of its text that it is about; `unit` is null for the scenario.
 * @typedef {Problem & { unit: string | null, steps: Path, start: number, end: number }} PlacedProblem
 */

/** The forms, and the text. */
export const TABS = /** @type {const} */ (["groups", "scenario", "types", "json"]);
/** @typedef {(typeof TABS)[number]} Tab */
/** Milliseconds without a change after which the files are checked. */
const CHECK_AFTER = 120;

/** The program's response about the units of groups. */
export class Layout {
  /**
   * @param {ReadGroup[]} groups
   * @param {CheckedFiles} checked
   */
  constructor(groups, checked) {
    this.types = checked.types;
    /** The units that the seed draws, in a generated scenario. */
    this.drawn = checked.drawn;
    this.entries = groups.map((group, i) => ({
      key: Layout.key(group),
      x: group.x,
      y: group.y,
      units: checked.groups[i],
    }));
  }

  /** @param {ReadGroup} group */
  static key({ faction, units }) {
    return JSON.stringify([faction, units]);
  }

  /**
   * The units of a group as it was then, though it may have moved since.
   * @param {ReadGroup} group
   * @param {number} index
   */
  find(group, index) {
    const key = Layout.key(group);
    if (!isNumber(group.x) || !isNumber(group.y)) return null;
    /** @param {(typeof this.entries)[number] | undefined} entry */
    const isSame = (entry) => entry?.key === key && entry.units !== null;
    const same = [this.entries[index], ...this.entries].find(isSame);
    return same?.units ? { ...same, units: same.units } : null;
  }
}

export class Checker {
  /** @param {EditorPage} page */
  constructor(page) {
    this.page = page;
    /** What is wrong with the files, as far as the program has responded. */
    /** @type {PlacedProblem[]} */
    this.problems = [];
    /** How many there are: the program lists the first of many. */
    this.total = 0;
    /** @type {PlacedProblem[]} What is probably a mistake in valid files. */
    this.warnings = [];
    /** @type {State | null} The state of the document that it is about. */
    this.checked = null;
    /** @type {Summary | null} Sizes of a valid scenario. */
    this.summary = null;
    /** What the list shows. */
    this.listed = "";
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
  }

  soon() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.check(), CHECK_AFTER);
  }

  async check() {
    const { state } = this.page.doc,
      groups = this.page.doc.groups();
    /** @param {ReadGroup} group */
    const isReadable = ({ x, y, faction, units }) =>
      isNumber(x) &&
      isNumber(y) &&
      typeof faction === "string" &&
      units.every(([, n]) => Number.isInteger(n) && n >= 0 && n < 2 ** 32);
    /** @type {ReadGroup} */
    const unknown = { x: 0, y: 0, faction: "", units: [] };
    const readable = groups.map((group) => (isReadable(group) ? group : unknown));
    try {
      const files = this.page.doc.files();
      const seed = String(seedOfField() ?? 0n);
      const request = { type: /** @type {const} */ ("check_files"), files, groups: readable, seed };
      const checked = await this.page.engine.request(request);
      if (state !== this.page.doc.state) return;
      this.checked = state;
      this.page.layout = new Layout(groups, checked);
      this.problems = checked.problems.map((problem) => this.placed(problem));
      this.total = checked.n_problems;
      this.warnings = [...checked.warnings, ...this.unsaved()].map((warning) => this.placed(warning));
      this.summary = checked.summary;
      byId("draw").hidden = !checked.drawn;
    } catch (error) {
      if (!(error instanceof EngineLost)) tell(`The files cannot be checked: ${messageOf(error)}`, true);
      return;
    }
    this.show();
    this.page.showMap();
  }

  /**
   * The unit types that were added and whose names the program refuses to save; a download takes any.
   * @returns {Problem[]}
   */
  unsaved() {
    const { doc, store } = this.page;
    if (!store.target) return [];
    // Those that were added have no keys of the file yet.
    const refused = doc.units.filter(({ name, keys }) => !keys.length && !UNIT_NAME.test(name));
    return refused.map(({ name }) => ({
      file: `${name}.json`,
      line: null,
      column: null,
      path: "",
      message: `a unit type of this name cannot be saved: ${NAME_RULE}`,
    }));
  }

  /**
   * A problem with the file, path and offsets that it is about. `unit` is null for the scenario file.
   * @param {Problem} problem
   * @returns {PlacedProblem}
   */
  placed(problem) {
    const unit = this.page.doc.units.find(({ name }) => problem.file === `${name}.json`);
    const isScenario = problem.file === this.page.doc.state.source || !unit;
    const file = isScenario ? this.page.doc.scenario : unit.file;
    const path = file.locate(problem.path);
    let [start, end] = file.span(path);
    let { line, column } = problem;
    if (line && !problem.path) start = end = file.offset(line, column ?? 1);
    else if (!line) ({ line, column } = file.position(start));
    return { ...problem, unit: isScenario ? null : unit.name, steps: path, start, end, line, column };
  }

  show() {
    const { problems, warnings, total: n } = this;
    const state = byId("state");
    const isCurrent = this.checked === this.page.doc.state;
    state.className = `badge ${n ? "invalid" : isCurrent ? "valid" : ""}`;
    const found = n ? counted(n, "problem") : warnings.length ? counted(warnings.length, "warning") : "";
    state.textContent = isCurrent || n ? found || "Valid" : "checking\u2026";
    byId("play").disabled = n > 0;
    byId("problems").classList.toggle("invalid", found !== "");
    byId("problems").querySelector("h2").textContent = found || "No problems";
    const key = JSON.stringify([problems, warnings, n]);
    if (key !== this.listed) {
      this.listed = key;
      /** @param {PlacedProblem} problem */
      const item = (problem) => {
        const where = make("small", {}, `${stemOf(problem.file)}.json:${problem.line}:${problem.column}`);
        const title = "Show where this is";
        return make(
          "li",
          {},
          button([where, problem.message], title, () => this.goTo(problem)),
        );
      };
      byId("problems")
        .querySelector("ol")
        .replaceChildren(...[...problems, ...warnings].map(item));
      const unlisted = n - problems.length;
      if (unlisted)
        byId("problems")
          .querySelector("ol")
          .append(make("li", {}, `and ${unlisted} more`));
    }
    const { summary } = this;
    byId("summary").textContent =
      isCurrent && summary
        ? `${summary.n_agents} agents, ${summary.n_enemies} enemies, ${summary.n_actions} actions, ` +
          `obs ${summary.obs_size}, state ${summary.state_size}`
        : "";
    /** @type {Set<string>} */
    const tabs = new Set(problems.map((problem) => this.tabOf(problem)));
    for (const tab of TABS) all(`[data-tab="${tab}"]`)[0].classList.toggle("wrong", tabs.has(tab));
    this.markFields();
    this.page.panels.json.mark(problems);
  }

  /** Marks the fields that have problems. */
  markFields() {
    /** @type {HTMLElement} */
    const panel = byId(this.page.tab);
    all("[aria-invalid]", panel).forEach((element) => element.removeAttribute("aria-invalid"));
    all(".why", panel).forEach((element) => element.remove());
    for (const problem of this.problems) {
      const element = this.fieldOf(problem, panel);
      if (!element) continue;
      element.setAttribute("aria-invalid", "true");
      if (element.classList.contains("group")) continue;
      const why = make("p", { className: "why" }, problem.message);
      (element.closest(".unit-row, .field") ?? element).append(why);
    }
  }

  /**
   * The element of a panel for a problem: that of its key, or of the nearest key around it.
   * @param {PlacedProblem} problem
   * @param {HTMLElement} panel
   */
  fieldOf({ unit, path, steps }, panel) {
    // A key that is missing has a path too.
    const written = path.match(/[^.[\]]+/g) ?? [];
    /** @type {Path[]} */
    const paths = [written.map((step) => (/^\d+$/.test(step) ? Number(step) : step))];
    paths.push(...steps.map((_, i) => steps.slice(0, steps.length - i)));
    if (path.startsWith("terrain")) paths.push(["terrain_preset"]);
    for (const candidate of paths) {
      const key = fieldKey(unit ?? -1, candidate);
      const found = all("[data-key]", panel).find((element) => element.dataset.key === key);
      if (found) return found;
    }
    return null;
  }

  /**
   * @param {PlacedProblem} problem
   * @returns {Tab}
   */
  tabOf({ unit, path, steps }) {
    if (unit !== null) return path ? "types" : "json";
    if (!path) return "json";
    if (path.startsWith("groups")) return steps.length ? "groups" : "json";
    return "scenario";
  }

  goToFirst() {
    const [first] = [...this.problems, ...this.warnings];
    if (first) this.goTo(first);
  }

  /**
   * Selects what a problem is about.
   * @param {PlacedProblem} problem
   */
  goTo(problem) {
    const { unit, steps } = problem;
    const tab = this.page.tab === "json" ? "json" : this.tabOf(problem);
    if (tab === "groups" && isNumber(steps[1])) this.page.selectGroup(steps[1]);
    if (tab === "types") this.page.panels.types.name = unit ?? "";
    if (tab !== "json") {
      this.page.showTab(tab);
      const element = this.fieldOf(problem, byId(tab));
      if (element) {
        element.focus();
        element.scrollIntoView({ block: "center" });
        return;
      }
    }
    // The text, also of a key without a field.
    this.page.panels.json.name = unit;
    this.page.showTab("json");
    this.page.panels.json.select(problem.start, problem.end);
  }
}
