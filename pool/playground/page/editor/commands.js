// @ts-check
// Commands: what the buttons and the keys of the editor do.

import { Brush } from "#view/brush.js";
import { all, byId, listenToDrops, listenToSkip, tell } from "#view/dom.js";
import { theme } from "#view/theme.js";
import { seedOfField } from "./arena.js";
import { TABS } from "./problems.js";
import { TOOL_KEYS } from "./tools.js";

/** @import { EditorPage } from "./editor.js" */
/** @import { Tab } from "./problems.js" */
/** @typedef {{ [name: string]: (() => void) | undefined }} CommandTable */

export class Commands {
  /** @param {EditorPage} page */
  constructor(page) {
    this.page = page;
  }

  listen() {
    /** @type {{ [id: string]: () => void }} */
    const clicks = {
      undo: () => this.page.doc.undo(),
      redo: () => this.page.doc.redo(),
      new: () => byId("begin").showModal(),
      open: () => byId("files").click(),
      save: () => this.page.store.save(),
      download: () => this.page.store.download(),
      theme: () => theme.toggle(),
      help: () => byId("keys").showModal(),
      leave: () => this.page.arena.leave(),
      state: () => this.page.checker.goToFirst(),
      paint: () => this.page.togglePaint(),
      fit: () => this.page.fit(),
      copy: () => this.copyText(),
    };
    for (const [id, click] of Object.entries(clicks)) byId(id).addEventListener("click", click);
    Brush.listen(this.page.map);
    all("[data-tab]").forEach((element) => {
      element.addEventListener("click", () => this.page.showTab(/** @type {Tab} */ (element.dataset.tab)));
      element.addEventListener("keydown", (event) => this.tabKey(event));
    });
    byId("battle-form").addEventListener("submit", (/** @type {SubmitEvent} */ event) => {
      event.preventDefault();
      this.page.arena.play();
    });
    byId("draw").addEventListener("click", () => {
      const seed = seedOfField(true);
      if (seed === null) return;
      byId("seed").value = String(BigInt.asUintN(64, seed + 1n));
      this.page.checker.check();
    });
    byId("seed").addEventListener("change", () => this.page.checker.check());
    byId("files").addEventListener("change", async () => {
      await this.page.store.openFiles(byId("files").files);
      byId("files").value = "";
    });
    all("main > aside")[0].addEventListener("focusout", () => this.page.doc.settle());
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("beforeunload", (event) => {
      if (!this.page.doc.isSaved) event.preventDefault();
    });
    listenToSkip();
    listenToDrops(({ files }) => this.page.store.openFiles(files));
  }

  async copyText() {
    try {
      await navigator.clipboard.writeText(this.page.panels.json.file.text);
      tell("Copied.");
    } catch {
      byId("text").select();
      tell("The browser refuses the clipboard; the text is selected, copy it with Ctrl+C.");
    }
  }

  /** @param {KeyboardEvent} event */
  tabKey(event) {
    const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    if (!by) return;
    const next = TABS[(TABS.indexOf(this.page.tab) + by + TABS.length) % TABS.length];
    this.page.showTab(next);
    all(`[data-tab="${next}"]`)[0].focus();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (!byId("arena").hidden) {
      if (event.key === "Escape") this.page.arena.leave();
      return;
    }
    if (document.querySelector("dialog[open]")) return;
    const on = event.target instanceof Element ? event.target : null;
    const isTyping = Boolean(on?.closest("input[type=text], textarea, select"));
    const command =
      event.ctrlKey || event.metaKey
        ? this.controlCommand(event, isTyping)
        : this.plainCommand(event, isTyping);
    if (!command) return;
    event.preventDefault();
    command();
  }

  /**
   * @param {KeyboardEvent} event
   * @param {boolean} isTyping
   */
  controlCommand(event, isTyping) {
    const key = event.key.toLowerCase();
    /** @type {CommandTable} */
    const commands = {
      s: () => this.page.store.save(),
      o: () => byId("files").click(),
      z: () => (event.shiftKey ? this.page.doc.redo() : this.page.doc.undo()),
      y: () => this.page.doc.redo(),
      enter: () => this.page.arena.play(),
      d: isTyping ? undefined : () => this.page.duplicateGroup(),
    };
    return commands[key];
  }

  /**
   * @param {KeyboardEvent} event
   * @param {boolean} isTyping
   */
  plainCommand(event, isTyping) {
    if (isTyping || event.altKey) return undefined;
    const { map } = this.page;
    /** @type {(by: number) => () => void} */
    const next = (by) => () => {
      const n = this.page.doc.groups().length;
      if (n) this.page.selectGroup(this.page.group < 0 && by < 0 ? n - 1 : (this.page.group + by + n) % n);
    };
    /** @type {CommandTable} */
    const commands = {
      "?": () => byId("keys").showModal(),
      x: () => this.page.togglePaint(),
      m: () => this.page.fit(),
      n: next(1),
      p: next(-1),
      "[": () => map.resize(-1),
      "]": () => map.resize(1),
      Delete: () => this.page.deleteGroup(),
      Backspace: () => this.page.deleteGroup(),
      Escape: () =>
        map.corner || map.brush.tool !== "select" ? map.choose("select") : this.page.selectGroup(-1),
    };
    const tool = TOOL_KEYS[event.key];
    return tool ? () => map.choose(tool) : commands[event.key];
  }
}
