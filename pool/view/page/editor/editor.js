// EditorPage: connects the document, the map, the forms and the program that serves the page.

/** Milliseconds without a change after which the files are checked. */
const CHECK_AFTER = 120;
const TABS = ["groups", "scenario", "types", "json"];
const TOOL_KEYS = { v: "select", b: "brush", e: "erase", r: "rectangle", l: "line", f: "fill", a: "goal", g: "ally", h: "enemy" };
const TOOL_HINTS = {
  select: "Click a group to edit it, drag it to move it; drag the map to move the view",
  brush: "Drag to draw; the right button draws the opposite",
  erase: "Drag to make squares walkable",
  rectangle: "Drag from corner to corner",
  line: "Drag from end to end",
  fill: "Click an area to fill it",
  goal: "Click or drag to where the enemies march",
  ally: "Click where the new group starts",
  enemy: "Click where the new group starts",
};

/** The program's answer about the units of groups. */
class Layout {
  constructor(groups, answer) {
    this.types = answer.types;
    this.sight = answer.sight;
    this.entries = groups.map((group, i) => ({
      key: Layout.key(group),
      x: group.x,
      y: group.y,
      units: answer.groups[i],
    }));
  }

  static key({ faction, units }) {
    return JSON.stringify([faction, units]);
  }

  /** The units of a group as it was then, though it may have moved since. */
  find(group, index) {
    const key = Layout.key(group);
    const isSame = (entry) => entry?.key === key && entry.units !== null;
    if (!isNumber(group.x) || !isNumber(group.y)) return null;
    return isSame(this.entries[index]) ? this.entries[index] : this.entries.find(isSame);
  }
}

class EditorPage {
  constructor() {
    this.group = -1;
    this.goalSelected = false;
    this.layout = null;
    this.problems = [];
    this.target = null;
    this.lastUnits = { MARINE: 1 };
    this.connection = new Connection({
      open: () => this.connected(),
      lost: () => this.say("The connection to smaclite-pool is lost; edits stay here. Trying again\u2026"),
    });
  }

  async connected() {
    this.say("");
    if (this.doc) return this.check();
    try {
      this.standard = await this.connection.ask("standard");
      this.start(await this.connection.ask("open"));
    } catch (error) {
      this.say(`The files cannot be opened: ${error.message}`);
    }
  }

  start({ files, target, exists }) {
    this.doc = new ScenarioDocument(this.standard, files);
    this.target = target;
    /** Whether the document is the target's, and whether the target exists. */
    this.isTargets = target !== null;
    this.exists = exists;
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
    this.check();
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
    byId("policy").replaceChildren(...this.standard.policies.map(option));
    byId("policy").value = "nearest";
    byId("rules").replaceChildren(...this.standard.rules.map((name) => make("option", { value: name }, `${name} rules`)));
    const choose = (name, text) =>
      button(name, `Begin with ${name}`, () => {
        byId("begin").close();
        this.load({ source: `${name.replaceAll(" ", "_")}.json`, text, unit_files: [] });
      });
    byId("choices").replaceChildren(
      choose("new scenario", this.standard.new),
      ...this.standard.scenarios.map(({ name, text }) => choose(name, text)),
    );
  }

  /** Begins with other files; saving in place then asks first. */
  load(files) {
    this.isTargets = false;
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
    const name = doc.scenario.value(["name"]);
    byId("name").textContent = typeof name === "string" && name ? name : stemOf(doc.state.source);
    document.title = `${doc.isSaved ? "" : "\u2022 "}${byId("name").textContent} - scenario editor`;
    byId("undo").disabled = !doc.past.length;
    byId("redo").disabled = !doc.future.length;
    byId("save").classList.toggle("unsaved", !doc.isSaved);
    byId("save").title = this.target ? `Save to ${this.target} (Ctrl+S)` : "Download the files (Ctrl+S)";
    document.querySelectorAll("[data-tool]").forEach((element) => {
      element.setAttribute("aria-pressed", String(element.dataset.tool === this.map.tool));
    });
    byId("paint").setAttribute("aria-pressed", String(this.map.paintsBlocked));
    byId("size").textContent = String(this.map.size);
    byId("hint").textContent = TOOL_HINTS[this.map.tool];
    byId("map").classList.toggle("drawing", this.map.tool !== "select");
    this.panels[this.tab].refresh();
    this.showProblems();
    this.showMap();
    if (doc.state !== this.checked) this.checkSoon();
  }

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
      const button = document.querySelector(`[data-tab="${name}"]`);
      button.setAttribute("aria-selected", String(name === tab));
      button.tabIndex = name === tab ? 0 : -1;
    }
    this.panels[tab].refresh();
    this.showProblems();
  }

  // Checking

  checkSoon() {
    clearTimeout(this.soon);
    this.soon = setTimeout(() => this.check(), CHECK_AFTER);
  }

  async check() {
    const { state } = this.doc,
      groups = this.doc.groups();
    const isReadable = ({ x, y, faction, units }) =>
      isNumber(x) && isNumber(y) && typeof faction === "string" && units.every(([, n]) => Number.isInteger(n) && n >= 0 && n < 2 ** 32);
    const unknown = { x: 0, y: 0, faction: "", units: [] };
    const asked = groups.map((group) => (isReadable(group) ? group : unknown));
    try {
      const answer = await this.connection.ask("check", { files: this.doc.files(), groups: asked });
      if (state !== this.doc.state) return;
      this.checked = state;
      this.layout = new Layout(groups, answer);
      this.problems = answer.problems.map((problem) => this.placed(problem));
      this.summary = answer.summary;
    } catch (error) {
      if (this.connection.socket.readyState === WebSocket.OPEN) this.tell(`The files cannot be checked: ${error.message}`, true);
      return;
    }
    this.showProblems();
    this.showMap();
  }

  /** A problem with the file, path and offsets that it is about. `unit` is null for the scenario file. */
  placed(problem) {
    const unit = this.doc.units.find(({ name }) => problem.file === `${name}.json`);
    const isScenario = problem.file === this.doc.state.source || !unit;
    const file = isScenario ? this.doc.scenario : unit.file;
    const path = file.locate(problem.path);
    let [start, end] = file.span(path);
    let { line, column } = problem;
    if (line && !problem.path) start = end = file.offset(line, column);
    else if (!line) ({ line, column } = file.position(start));
    return { ...problem, unit: isScenario ? null : unit.name, path: problem.path, steps: path, start, end, line, column };
  }

  showProblems() {
    const { problems } = this,
      n = problems.length;
    const state = byId("state");
    const isCurrent = this.checked === this.doc.state;
    state.className = `badge ${n ? "invalid" : isCurrent ? "valid" : ""}`;
    state.textContent = n ? `${n} problem${n > 1 ? "s" : ""}` : isCurrent ? "Valid" : "checking\u2026";
    byId("play").disabled = n > 0;
    byId("problems").classList.toggle("invalid", n > 0);
    byId("problems").querySelector("h2").textContent = n ? `${n} problem${n > 1 ? "s" : ""}` : "No problems";
    const key = JSON.stringify(problems);
    if (key !== this.listed) {
      this.listed = key;
      const item = (problem) => {
        const where = make("small", {}, `${stemOf(problem.file)}.json:${problem.line}:${problem.column}`);
        const title = "Show where this is";
        return make("li", {}, button([where, problem.message], title, () => this.goTo(problem)));
      };
      byId("problems").querySelector("ol").replaceChildren(...problems.map(item));
    }
    const { summary } = this;
    byId("summary").textContent =
      isCurrent && summary
        ? `${summary.n_agents} agents, ${summary.n_enemies} enemies, ${summary.n_actions} actions, ` +
          `obs ${summary.obs_size}, state ${summary.state_size}`
        : "";
    const tabs = new Set(problems.map((problem) => this.tabOf(problem)));
    for (const tab of TABS)
      document.querySelector(`[data-tab="${tab}"]`).classList.toggle("wrong", tabs.has(tab));
    this.markFields();
    this.panels.json.mark(problems);
  }

  /** Marks the fields that have problems. */
  markFields() {
    const panel = byId(this.tab);
    panel.querySelectorAll("[aria-invalid]").forEach((element) => element.removeAttribute("aria-invalid"));
    panel.querySelectorAll(".why").forEach((element) => element.remove());
    for (const problem of this.problems) {
      const element = this.fieldOf(problem, panel);
      if (!element) continue;
      element.setAttribute("aria-invalid", "true");
      if (element.classList.contains("group")) continue;
      const why = make("p", { className: "why" }, problem.message);
      (element.closest(".unit-row, .field") ?? element).append(why);
    }
  }

  /** The element of a panel for a problem: that of its key, or of the nearest key around it. */
  fieldOf({ unit, path, steps }, panel) {
    // A key that is missing has a path too.
    const written = path.match(/[^.[\]]+/g) ?? [];
    const paths = [written.map((step) => (/^\d+$/.test(step) ? Number(step) : step))];
    paths.push(...steps.map((_, i) => steps.slice(0, steps.length - i)));
    if (path.startsWith("terrain")) paths.push(["terrain_preset"]);
    for (const candidate of paths) {
      const key = fieldKey(unit ?? -1, candidate);
      const found = [...panel.querySelectorAll("[data-key]")].find((element) => element.dataset.key === key);
      if (found) return found;
    }
    return null;
  }

  tabOf({ unit, path, steps }) {
    if (unit !== null) return path ? "types" : "json";
    if (!path) return "json";
    if (path.startsWith("groups")) return steps.length ? "groups" : "json";
    return "scenario";
  }

  /** Selects what a problem is about. */
  goTo(problem) {
    const { unit, steps } = problem;
    let tab = this.tab === "json" ? "json" : this.tabOf(problem);
    if (tab === "groups" && isNumber(steps[1])) this.selectGroup(steps[1]);
    if (tab === "types") this.panels.types.name = unit;
    if (tab !== "json") {
      this.showTab(tab);
      const element = this.fieldOf(problem, byId(tab));
      if (element) {
        element.focus();
        element.scrollIntoView({ block: "center" });
        return;
      }
      // A key without a field.
      tab = "json";
    }
    this.panels.json.name = unit;
    this.showTab("json");
    this.panels.json.select(problem.start, problem.end);
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
    this.map.tool = "select";
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
      return doc.moveGroup(this.group, tidy(group.x + dx * by), tidy(group.y + dy * by), `nudge ${this.group}`);
    const [x, y] = this.map.info.attack_point;
    if (!this.goalSelected || Number.isNaN(x)) return;
    const { width, height } = doc.map();
    const point = [clamp(tidy(x + dx * by), 0, width), clamp(tidy(y + dy * by), 0, height)];
    doc.setKey(["attack_point"], point, "nudge goal");
  }

  /** Opens the type of a unit. */
  doubleClick(unit) {
    if (this.map.tool !== "select") return;
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

  // Files

  async openFiles(list) {
    const files = [...list].filter(({ name }) => name.toLowerCase().endsWith(".json"));
    const read = await Promise.all(files.map(async (file) => ({ name: file.name, text: await file.text() })));
    const isScenario = ({ text }) => {
      const file = new JsonText(text);
      return file.error ? text.includes('"groups"') : file.isObject && file.node(["groups"]) !== null;
    };
    const scenarios = read.filter(isScenario);
    const units = read
      .filter((file) => !isScenario(file))
      .map(({ name, text }) => ({ name: stemOf(name), keys: [], text }));
    if (!read.length || scenarios.length > 1)
      return this.tell("Open one scenario file and its unit files, or unit files to add; all end in .json.");
    if (scenarios.length) return this.load({ source: scenarios[0].name, text: scenarios[0].text, unit_files: units });
    const names = new Set(units.map(({ name }) => name));
    const kept = this.doc.units.filter(({ name }) => !names.has(name));
    this.doc.change({ units: [...kept, ...units.map((unit) => ({ ...unit, file: new JsonText(unit.text) }))] });
    this.panels.types.name = units[0].name;
    this.showTab("types");
  }

  async save(replace = false) {
    if (this.target === null) return this.download();
    const name = `${stemOf(this.target)}.json`;
    if (!this.isTargets && this.exists && !replace && !confirm(`Replace the content of ${name} by this scenario?`)) return;
    const { state } = this.doc;
    try {
      const answer = await this.connection.ask("save", {
        files: this.doc.files(),
        replace: replace || (!this.isTargets && this.exists),
      });
      if (answer.conflicts) {
        const files = answer.conflicts.join(", ");
        if (confirm(`Changed by another program, or not of this scenario: ${files}. Replace?`)) await this.save(true);
        return;
      }
      this.isTargets = this.exists = true;
      this.doc.saved = state;
      const saved = answer.saved.map((file) => `${stemOf(file)}.json`);
      this.tell(saved.length ? `Saved ${saved.join(", ")}.` : "Nothing has changed since the last save.");
      this.refresh();
    } catch (error) {
      this.tell(`Not saved: ${error.message}`, true);
    }
  }

  download() {
    const { source, text, unit_files: units } = this.doc.files();
    const files = [[stemOf(source), text], ...units.map((unit) => [unit.name, unit.text])];
    for (const [name, content] of files) {
      const url = URL.createObjectURL(new Blob([content], { type: "application/json" }));
      make("a", { href: url, download: `${name}.json` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 10_000);
    }
    this.doc.saved = this.doc.state;
    this.refresh();
  }

  // Battles

  async playBattle() {
    if (this.problems.length || byId("play").disabled) return;
    byId("play").disabled = true;
    const seed = byId("seed").value.trim() || "0";
    const choice = { policy: byId("policy").value, rules: byId("rules").value, seed };
    try {
      const answer = await this.connection.ask("play", { files: this.doc.files(), ...choice });
      this.enter(answer);
    } catch (error) {
      this.tell(`Not played: ${error.message}`, true);
    } finally {
      byId("play").disabled = this.problems.length > 0;
    }
  }

  /** Shows the page of a replay, and starts it. */
  enter({ page, cut_at: cutAt }) {
    const frame = make("iframe", { title: "Battle", srcdoc: page });
    byId("cut").hidden = !cutAt;
    byId("cut").textContent = `The editor shows the first ${cutAt} steps.`;
    frame.addEventListener("load", () => {
      const inner = frame.contentDocument;
      inner.addEventListener("keydown", (event) => event.key === "Escape" && !inner.querySelector("dialog[open]") && this.leave());
      const begin = () =>
        inner.documentElement.dataset.ready === undefined ? setTimeout(begin, 20) : inner.getElementById("start")?.click();
      begin();
      frame.contentWindow.focus();
    });
    byId("arena").append(frame);
    byId("arena").hidden = false;
  }

  leave() {
    byId("arena").querySelector("iframe")?.remove();
    byId("arena").hidden = true;
    byId("play").focus();
  }

  // Events

  listen() {
    const clicks = {
      undo: () => this.doc.undo(),
      redo: () => this.doc.redo(),
      new: () => byId("begin").showModal(),
      open: () => byId("files").click(),
      save: () => this.save(),
      download: () => this.download(),
      theme: () => theme.toggle(),
      help: () => byId("keys").showModal(),
      leave: () => this.leave(),
      state: () => this.problems.length && this.goTo(this.problems[0]),
      paint: () => this.togglePaint(),
      fit: () => this.fit(),
      copy: () => this.copyText(),
    };
    for (const [id, click] of Object.entries(clicks)) byId(id).addEventListener("click", click);
    document.querySelectorAll("[data-tool]").forEach((element) => {
      element.addEventListener("click", () => this.map.choose(element.dataset.tool));
    });
    document.querySelectorAll("[data-size]").forEach((element) => {
      element.addEventListener("click", () => this.map.resizeBrush(Number(element.dataset.size)));
    });
    document.querySelectorAll("[data-tab]").forEach((element) => {
      element.addEventListener("click", () => this.showTab(element.dataset.tab));
      element.addEventListener("keydown", (event) => this.tabKey(event));
    });
    byId("battle-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.playBattle();
    });
    byId("files").addEventListener("change", async () => {
      await this.openFiles(byId("files").files);
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
      this.openFiles(event.dataTransfer.files);
    });
  }

  togglePaint() {
    this.map.paintsBlocked = !this.map.paintsBlocked;
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
    document.querySelector(`[data-tab="${next}"]`).focus();
  }

  key(event) {
    if (!byId("arena").hidden) return event.key === "Escape" && this.leave();
    if (document.querySelector("dialog[open]")) return;
    const isTyping = event.target.closest?.("input[type=text], textarea, select");
    const command = event.ctrlKey || event.metaKey ? this.controlCommand(event, isTyping) : this.plainCommand(event, isTyping);
    if (!command) return;
    event.preventDefault();
    command();
  }

  controlCommand(event, isTyping) {
    const key = event.key.toLowerCase();
    const commands = {
      s: () => this.save(),
      o: () => byId("files").click(),
      z: () => (event.shiftKey ? this.doc.redo() : this.doc.undo()),
      y: () => this.doc.redo(),
      enter: () => this.playBattle(),
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
      Escape: () => (map.corner || map.tool !== "select" ? map.choose("select") : this.selectGroup(-1)),
    };
    const tool = TOOL_KEYS[event.key];
    return tool ? () => map.choose(tool) : commands[event.key];
  }
}

theme.start();
const page = new EditorPage();
