// @ts-check
// EditorPage: connects the document, the map, the forms and the engine.

import { readAddress } from "#view/address.js";
import { all, byId, make, messageOf, say } from "#view/dom.js";
import { everyFrame } from "#view/frames.js";
import { clamp } from "#view/numbers.js";
import { theme } from "#view/theme.js";
import { LINK } from "../link.js";
import { Arena } from "./arena.js";
import { Commands } from "./commands.js";
import { ScenarioDocument, isNumber, stemOf } from "./document.js";
import { button } from "./fields.js";
import { FileStore, filesOfLink } from "./files.js";
import { GroupsPanel, ScenarioPanel } from "./groups.js";
import { MapEditor } from "./map.js";
import { Checker, TABS } from "./problems.js";
import { TextPanel } from "./text.js";
import { TOOL_HINTS } from "./tools.js";
import { TypesPanel } from "./types.js";

/** @import { Engine } from "../engine.js" */
/** @import { Builtins, ScenarioFiles } from "../protocol.d.ts" */
/** @import { Opened } from "./files.js" */
/** @import { Layout, Tab } from "./problems.js" */

export class EditorPage {
  /**
   * @param {Engine} engine
   * @param {Builtins} builtins
   * @param {Opened} opened
   * @param {string} playground The address of the page that plays.
   */
  constructor(engine, builtins, opened, playground) {
    this.engine = engine;
    this.playground = playground;
    this.builtins = builtins;
    /** The selected group, or -1. */
    this.group = -1;
    this.goalSelected = false;
    /** @type {Layout | null} Where the units of groups start. */
    this.layout = null;
    /** Whether the map is drawn as it is. */
    this.isDrawn = false;
    /** @type {{ [type: string]: number }} */
    this.lastUnits = { MARINE: 1 };
    /** @type {Tab} */
    this.tab = "groups";
    this.doc = new ScenarioDocument(builtins, opened.files);
    this.store = new FileStore(this, opened);
    this.checker = new Checker(this);
    this.arena = new Arena(this);
    this.map = new MapEditor(byId("map"), this);
    this.panels = {
      groups: new GroupsPanel(byId("groups"), this),
      scenario: new ScenarioPanel(byId("scenario"), this),
      types: new TypesPanel(byId("types"), this),
      json: new TextPanel(this),
    };
  }

  start() {
    this.fillChoices();
    new Commands(this).listen();
    this.showTab("groups");
    this.doc.listeners.push(() => this.refresh());
    this.refresh();
    theme.listeners.push(() => this.redraw());
    addEventListener("resize", () => this.redraw());
    this.checker.check();
    everyFrame(() => {
      if (this.isDrawn) return;
      this.isDrawn = true; // also if it fails, which it would in every picture
      this.map.draw();
    });
    document.documentElement.dataset.ready = "";
  }

  /**
   * Shows the group and the tab of a link, and gives what the link says that cannot be followed.
   * @param {string} link
   */
  follow(link) {
    const group = this.doc.groups().length,
      { said, problem } = readAddress(link, { ...LINK, tab: [...TABS], group });
    if (said.has("group")) this.selectGroup(Number(said.get("group")));
    if (said.has("tab")) this.showTab(/** @type {Tab} */ (said.get("tab")));
    return problem;
  }

  fillChoices() {
    byId("rules").replaceChildren(
      ...this.builtins.rules.map((name) => make("option", { value: name }, `${name} rules`)),
    );
    /** @type {(name: string, text: string) => HTMLButtonElement} */
    const choose = (name, text) =>
      button(name, `Begin with ${name}`, () => {
        byId("begin").close();
        this.load({ source: `${name.replaceAll(" ", "_")}.json`, text, unit_files: [] });
      });
    byId("choices").replaceChildren(
      choose("new scenario", this.builtins.new),
      ...this.builtins.scenarios.map(({ name, text }) => choose(name, text)),
    );
  }

  /**
   * Begins with other files; saving in place then asks first.
   * @param {ScenarioFiles} files
   */
  load(files) {
    if (!this.doc.isSaved && !confirm("Lose the changes that are not saved?")) return;
    this.store.isTargets = false;
    this.group = -1;
    this.map.camera = null;
    this.layout = null;
    this.doc.load(files);
  }

  // What is shown

  redraw() {
    this.isDrawn = false;
  }

  /** Only the map changed: while it is drawn on. */
  showMap() {
    this.map.update(this.doc, this.layout);
    this.showPointer(); // the square may be another one now
    this.redraw();
  }

  refresh() {
    const { doc } = this;
    if (this.group >= doc.groups().length) this.group = -1;
    const name = doc.shown.value(["name"]);
    byId("name").textContent = typeof name === "string" && name ? name : stemOf(doc.state.source);
    document.title = `${doc.isSaved ? "" : "\u2022 "}${byId("name").textContent} - scenario editor`;
    byId("undo").disabled = !doc.past.length;
    byId("redo").disabled = !doc.future.length;
    byId("save").classList.toggle("unsaved", !doc.isSaved);
    byId("save").title = this.store.target
      ? `Save to ${this.store.target} (Ctrl+S)`
      : "Download the files (Ctrl+S)";
    this.map.brush.show();
    byId("paint").setAttribute("aria-pressed", String(this.map.brush.paintsBlocked));
    byId("hint").textContent = TOOL_HINTS[this.map.brush.tool];
    byId("map").classList.toggle("drawing", this.map.brush.tool !== "select");
    this.showStale();
    this.panels[this.tab].refresh();
    this.checker.show();
    this.showMap();
    if (doc.state !== this.checker.checked) this.checker.soon();
  }

  /** While the text is no JSON, map and forms show the last one that was, and cannot be edited. */
  showStale() {
    const { isStale, shown, state } = this.doc;
    const consequence = shown.isObject ? "this is its last valid map" : "it has no map to show";
    document.body.classList.toggle("stale", isStale);
    for (const name of ["groups", "scenario"]) byId(name).inert = isStale;
    byId("stale").hidden = !isStale;
    byId("stale").textContent = `${stemOf(state.source)}.json is no valid JSON: ${consequence}.`;
  }

  /** Says what the square under the pointer is, or the one at which keys draw. */
  showPointer() {
    const { width, height, blocked } = this.map.draft ?? this.doc.map(),
      [x, y] = this.map.square ?? [-1, -1];
    const isInside = x >= 0 && y >= 0 && x < width && y < height;
    const kind = isInside && blocked[y * width + x] ? "blocked" : "walkable";
    byId("pointer").textContent = isInside ? `square ${x}, ${y} \u00b7 ${kind}` : "";
  }

  /** @param {Tab} tab */
  showTab(tab) {
    this.tab = tab;
    all("main")[0].classList.toggle("wide", tab === "json");
    this.redraw();
    for (const name of TABS) {
      byId(name).hidden = name !== tab;
      const [button] = all(`[data-tab="${name}"]`);
      button.setAttribute("aria-selected", String(name === tab));
      button.tabIndex = name === tab ? 0 : -1;
    }
    this.panels[tab].refresh();
    this.checker.show();
  }

  // Groups

  /** @param {number} index */
  selectGroup(index) {
    this.group = index;
    this.goalSelected = false;
    if (index >= 0 && this.tab !== "groups" && this.tab !== "json") this.showTab("groups");
    this.refresh();
  }

  selectGoal() {
    this.group = -1;
    this.goalSelected = true;
    this.refresh();
  }

  /**
   * Adds a group like the last one, at a point or in the middle of the map.
   * @param {string} faction
   * @param {number} [x]
   * @param {number} [y]
   */
  addGroup(faction, x, y) {
    const { doc } = this,
      { width, height } = doc.map();
    const units = doc.groups()[this.group]?.units;
    const like = units?.length ? Object.fromEntries(units) : this.lastUnits;
    this.lastUnits = like;
    const side = faction === "ENEMY" ? 0.7 : 0.3;
    doc.addGroup(faction, x ?? Math.round(width * side), y ?? Math.round(height / 2), like);
    this.map.brush.tool = "select";
    this.selectGroup(doc.groups().length - 1);
    if (this.tab !== "groups") this.showTab("groups");
  }

  duplicateGroup() {
    const group = this.doc.groups()[this.group];
    if (!group || !isNumber(group.x) || !isNumber(group.y)) return;
    const { height } = this.doc.map();
    const y = group.y + 4 < height ? group.y + 4 : group.y - 4;
    this.doc.addGroup(group.faction, group.x, y, Object.fromEntries(group.units));
    this.selectGroup(this.doc.groups().length - 1);
  }

  deleteGroup() {
    if (this.group < 0) return;
    const { group } = this;
    this.group = -1;
    this.doc.removeGroup(group);
  }

  /**
   * @param {number} dx
   * @param {number} dy
   * @param {number} by
   */
  nudge(dx, dy, by) {
    const { doc } = this,
      group = doc.groups()[this.group];
    /** @param {number} value */
    const tidy = (value) => Math.round(value * 100) / 100;
    if (group && isNumber(group.x) && isNumber(group.y))
      return doc.moveGroup(
        this.group,
        tidy(group.x + dx * by),
        tidy(group.y + dy * by),
        `nudge ${this.group}`,
      );
    const [x, y] = this.map.info.attack_point;
    if (!this.goalSelected || Number.isNaN(x)) return;
    const { width, height } = doc.map();
    const point = [clamp(tidy(x + dx * by), 0, width), clamp(tidy(y + dy * by), 0, height)];
    doc.setKey(["attack_point"], point, "nudge goal");
  }

  /**
   * Opens the type of a unit.
   * @param {number} unit
   */
  doubleClick(unit) {
    if (this.map.brush.tool !== "select") return;
    if (unit < 0) {
      this.map.camera = null;
      return this.redraw();
    }
    this.panels.types.name = this.map.type(unit).name;
    this.showTab("types");
  }

  /**
   * @param {string} name
   * @param {string} text
   */
  addType(name, text) {
    this.panels.types.name = name;
    this.doc.addUnit(name, text);
  }

  togglePaint() {
    this.map.brush.paintsBlocked = !this.map.brush.paintsBlocked;
    this.refresh();
  }

  fit() {
    this.map.camera = null;
    this.redraw();
  }
}

/**
 * Starts the page.
 * @param {Engine} engine
 * @param {(builtins: Builtins) => Promise<Opened>} open
 * @param {string} playground
 */
export async function startEditor(engine, open, playground) {
  theme.start();
  const builtins = await engine.request({ type: "get_builtins" });
  const link = location.hash.slice(1);
  let problem = "";
  const handedOver = await filesOfLink(link, builtins).catch((error) => {
    problem = `The scenario of this link cannot be opened: ${messageOf(error)}`;
    return null;
  });
  const opened = await open(builtins);
  const page = new EditorPage(engine, builtins, opened, playground);
  page.start();
  if (handedOver) {
    Object.assign(byId("seed"), { value: handedOver.seed });
    Object.assign(byId("rules"), { value: handedOver.rules });
    page.load(handedOver.files);
  }
  const ignored = page.follow(link);
  if (ignored) problem ||= `The address cannot be followed: ${ignored}.`;
  if (problem) say(problem);
  return page;
}
