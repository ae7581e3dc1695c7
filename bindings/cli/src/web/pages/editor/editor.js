// @ts-check
// EditorPage: connects the document, the map, the forms and the program that serves the page.

import { TOOL_HINTS, TOOL_KEYS } from "./brush.js";
import { all, byId, make } from "#view/dom.js";
import { clamp } from "#view/numbers.js";
import { theme } from "#view/theme.js";
import { Connection } from "../connection.js";
import { Arena } from "./arena.js";
import { ScenarioDocument, isNumber, stemOf } from "./document.js";
import { button } from "./fields.js";
import { FileStore } from "./files.js";
import { GroupsPanel, ScenarioPanel } from "./groups.js";
import { MapEditor } from "./map.js";
import { Checker, TABS } from "./problems.js";
import { TextPanel } from "./text.js";
import { TypesPanel } from "./types.js";

export class EditorPage {
  constructor() {
    this.group = -1;
    this.goalSelected = false;
    this.layout = null;
    this.checker = new Checker(this);
    this.arena = new Arena(this);
    /** @type {{ [type: string]: number }} */
    this.lastUnits = { MARINE: 1 };
    this.connection = new Connection({
      open: () => this.connected(),
      close: () => this.say("The connection to smaclite-pool is lost; edits stay here. Trying again\u2026"),
      refuse: (error) => this.say(error),
    });
  }

  async connected() {
    this.say("");
    if (this.doc) return this.checker.check();
    try {
      this.builtins = await this.connection.request({ type: "get_builtins" });
      this.start(await this.connection.request({ type: "open_files" }));
    } catch (error) {
      this.say(`The files cannot be opened: ${error.message}`);
    }
  }

  start({ files, target, exists }) {
    this.doc = new ScenarioDocument(this.builtins, files);
    this.store = new FileStore(this, { target, exists });
    this.map = new MapEditor(byId("map"), this);
    this.panels = {
      groups: new GroupsPanel(byId("groups"), this),
      scenario: new ScenarioPanel(byId("scenario"), this),
      types: new TypesPanel(byId("types"), this),
      json: new TextPanel(this),
    };
    this.fillChoices();
    this.listen();
    const hash = new URLSearchParams(location.hash.slice(1));
    this.group = Number(hash.get("group") ?? -1);
    this.showTab(TABS.includes(hash.get("tab")) ? hash.get("tab") : "groups");
    this.doc.listeners.push(() => this.refresh());
    this.refresh();
    theme.listeners.push(() => this.redraw());
    addEventListener("resize", () => this.redraw());
    this.checker.check();
    const frame = () => {
      if (this.isStale) this.map.draw();
      this.isStale = false;
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    document.documentElement.dataset.ready = "";
  }

  fillChoices() {
    const option = (name) => make("option", { value: name }, name.replaceAll("_", " "));
    byId("policy").replaceChildren(...this.builtins.policies.map(option));
    byId("policy").value = "nearest";
    byId("rules").replaceChildren(
      ...this.builtins.rules.map((name) => make("option", { value: name }, `${name} rules`)),
    );
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

  /** Begins with other files; saving in place then asks first. */
  load(files) {
    this.store.isTargets = false;
    this.group = -1;
    this.map.camera = null;
    this.layout = null;
    this.doc.load(files);
  }

  // What is shown

  redraw() {
    this.isStale = true;
  }

  /** Only the map changed: while it is drawn on. */
  showMap() {
    this.map.update(this.doc, this.layout);
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
    all("[data-tool]").forEach((element) => {
      element.setAttribute("aria-pressed", String(element.dataset.tool === this.map.brush.tool));
    });
    byId("paint").setAttribute("aria-pressed", String(this.map.brush.paintsBlocked));
    byId("size").textContent = String(this.map.brush.size);
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

  /** @param {{ square: number[] }} point */
  showPointer({ square: [x, y] }) {
    const { width, height, blocked } = this.doc.map();
    const isInside = x >= 0 && y >= 0 && x < width && y < height;
    const kind = isInside && blocked[y * width + x] ? "blocked" : "walkable";
    byId("pointer").textContent = isInside ? `square ${x}, ${y} \u00b7 ${kind}` : "";
  }

  say(text, isError = true) {
    clearTimeout(this.quiet);
    byId("message").hidden = !text;
    byId("message").textContent = text;
    byId("message").classList.toggle("info", !isError);
  }

  /** A message that goes away. */
  tell(text, isError = false) {
    this.say(text, isError);
    this.quiet = setTimeout(() => this.say(""), 6000);
  }

  showTab(tab) {
    this.tab = tab;
    document.querySelector("main").classList.toggle("wide", tab === "json");
    if (this.map) this.redraw();
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

  /** Adds a group like the last one, at a point or in the middle of the map. */
  addGroup(faction, x, y) {
    const { doc } = this,
      { width, height } = doc.map();
    const units = doc.groups()[this.group]?.units;
    const like = units?.length ? Object.fromEntries(units) : this.lastUnits;
    this.lastUnits = like;
    const sides = { ALLY: 0.3, ENEMY: 0.7 };
    doc.addGroup(faction, x ?? Math.round(width * sides[faction]), y ?? Math.round(height / 2), like);
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

  nudge(dx, dy, by) {
    const { doc } = this,
      group = doc.groups()[this.group];
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

  /** Opens the type of a unit. */
  doubleClick(unit) {
    if (this.map.brush.tool !== "select") return;
    if (unit < 0) {
      this.map.camera = null;
      return this.redraw();
    }
    this.panels.types.name = this.map.type(unit).name;
    this.showTab("types");
  }

  addType(name, text) {
    this.panels.types.name = name;
    this.doc.addUnit(name, text);
  }

  // Events

  listen() {
    const clicks = {
      undo: () => this.doc.undo(),
      redo: () => this.doc.redo(),
      new: () => byId("begin").showModal(),
      open: () => byId("files").click(),
      save: () => this.store.save(),
      download: () => this.store.download(),
      theme: () => theme.toggle(),
      help: () => byId("keys").showModal(),
      leave: () => this.arena.leave(),
      state: () => {
        const [first] = [...this.checker.problems, ...this.checker.warnings];
        if (first) this.checker.goTo(first);
      },
      paint: () => this.togglePaint(),
      fit: () => this.fit(),
      copy: () => this.copyText(),
    };
    for (const [id, click] of Object.entries(clicks)) byId(id).addEventListener("click", click);
    all("[data-tool]").forEach((element) => {
      element.addEventListener("click", () => this.map.choose(element.dataset.tool));
    });
    all("[data-size]").forEach((element) => {
      element.addEventListener("click", () => this.map.resizeBrush(Number(element.dataset.size)));
    });
    all("[data-tab]").forEach((element) => {
      element.addEventListener("click", () => this.showTab(element.dataset.tab));
      element.addEventListener("keydown", (event) => this.tabKey(event));
    });
    byId("battle-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.arena.play();
    });
    byId("files").addEventListener("change", async () => {
      await this.store.openFiles(byId("files").files);
      byId("files").value = "";
    });
    document.querySelector("main > aside").addEventListener("focusout", () => this.doc.settle());
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("beforeunload", (event) => !this.doc.isSaved && event.preventDefault());
    this.listenToDrops();
  }

  listenToDrops() {
    const drag = (isOver) => (event) => {
      event.preventDefault();
      document.body.classList.toggle("dropping", isOver);
    };
    addEventListener("dragover", drag(true));
    addEventListener("dragleave", drag(false));
    addEventListener("drop", (event) => {
      drag(false)(event);
      this.store.openFiles(event.dataTransfer.files);
    });
  }

  togglePaint() {
    this.map.brush.paintsBlocked = !this.map.brush.paintsBlocked;
    this.refresh();
  }

  fit() {
    this.map.camera = null;
    this.redraw();
  }

  async copyText() {
    try {
      await navigator.clipboard.writeText(this.panels.json.file.text);
      this.tell("Copied.");
    } catch {
      byId("text").select();
      this.tell("The browser refuses the clipboard; the text is selected, copy it with Ctrl+C.");
    }
  }

  tabKey(event) {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    const next = TABS[(TABS.indexOf(this.tab) + by + TABS.length) % TABS.length];
    this.showTab(next);
    all(`[data-tab="${next}"]`)[0].focus();
  }

  key(event) {
    if (!byId("arena").hidden) return event.key === "Escape" && this.arena.leave();
    if (document.querySelector("dialog[open]")) return;
    const isTyping = event.target.closest?.("input[type=text], textarea, select");
    const command =
      event.ctrlKey || event.metaKey
        ? this.controlCommand(event, isTyping)
        : this.plainCommand(event, isTyping);
    if (!command) return;
    event.preventDefault();
    command();
  }

  controlCommand(event, isTyping) {
    const key = event.key.toLowerCase();
    const commands = {
      s: () => this.store.save(),
      o: () => byId("files").click(),
      z: () => (event.shiftKey ? this.doc.redo() : this.doc.undo()),
      y: () => this.doc.redo(),
      enter: () => this.arena.play(),
      d: isTyping ? undefined : () => this.duplicateGroup(),
    };
    return commands[key];
  }

  plainCommand(event, isTyping) {
    if (isTyping || event.altKey) return undefined;
    const { map } = this;
    const next = (by) => () => {
      const n = this.doc.groups().length;
      if (n) this.selectGroup(this.group < 0 && by < 0 ? n - 1 : (this.group + by + n) % n);
    };
    const commands = {
      "?": () => byId("keys").showModal(),
      x: () => this.togglePaint(),
      m: () => this.fit(),
      n: next(1),
      p: next(-1),
      "[": () => map.resizeBrush(-1),
      "]": () => map.resizeBrush(1),
      Delete: () => this.deleteGroup(),
      Backspace: () => this.deleteGroup(),
      Escape: () => (map.corner || map.brush.tool !== "select" ? map.choose("select") : this.selectGroup(-1)),
    };
    const tool = TOOL_KEYS[event.key];
    return tool ? () => map.choose(tool) : commands[event.key];
  }
}

theme.start();
new EditorPage();
