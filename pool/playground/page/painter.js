// @ts-check
// Painter: the mode in which a person draws on the map, with the brush of the scenario editor. The battle
// begins anew after every stroke.

import { Brush, squareFrom } from "#view/brush.js";
import { ARROWS } from "#view/commander.js";
import { byId } from "#view/dom.js";
import { rowsOf, squaresOf } from "#view/squares.js";

/** @import { Square } from "#view/brush.js" */
/** @import { At, Handlers } from "#view/controls.js" */
/** @import { EditedMap } from "#view/squares.js" */
/** @import { Playground } from "./playground.js" */
/**
 * The map before and after a stroke, and where that has come to.
 * @typedef {{ before: EditedMap, after: EditedMap, at: Square }} Stroke
 */

/** How many squares the brush moves at a time with shift. */
const FAR = 5;
const GUIDE =
  "Drag over squares to make them blocked or walkable. The battle begins anew after every stroke.";

export class Painter {
  /** @param {Playground} page */
  constructor(page) {
    this.page = page;
    this.isOn = false;
    this.brush = new Brush();
    this.brush.tool = "brush";
    /** @type {Square | null} Where the brush is, by pointer or keys. */
    this.square = null;
    /** @type {Stroke | null} The one that is drawn. */
    this.stroke = null;
    /** @type {Stroke[]} Those that the engine was asked for. */
    this.asked = [];
    /** @type {string[]} The scenarios before the strokes that led to the newest one. */
    this.past = [];
    this.newest = "";
    /** Whether the whole map is shown only to paint it. */
    this.hasFitted = false;
  }

  listen() {
    byId("paint").addEventListener("click", () => this.start());
    byId("painted").addEventListener("click", () => this.stop());
    byId("undo").addEventListener("click", () => this.undo());
    Brush.listen(this);
  }

  /** Goes back to the start of the battle, to draw on its map. */
  start() {
    const { page } = this;
    if (page.source.kind !== "scenario") return;
    page.clock.playing = false;
    page.seek(0);
    page.field.selection.clear();
    page.selected();
    this.isOn = true;
    this.hasFitted = !page.view.wholeMap;
    if (this.hasFitted) page.fit();
    this.show();
    page.note(GUIDE);
    page.view.canvas.focus({ preventScroll: true });
  }

  stop() {
    const { page } = this;
    const hasFocus = byId("brush").contains(document.activeElement);
    this.isOn = false;
    if (byId("note").textContent === GUIDE) byId("note").hidden = true;
    this.giveUp();
    this.square = null;
    if (this.hasFitted && page.view.wholeMap) page.fit();
    this.show();
    if (hasFocus) byId("paint").focus();
  }

  /** Ends the mode when the battle is played; called for every picture. */
  update() {
    byId("paint").disabled = this.page.source.kind !== "scenario";
    if (this.isOn && !this.page.isAtStart) this.stop();
  }

  /** Shows the mode, its tools, and the squares that the brush covers. */
  show() {
    const { brush, square, isOn, page } = this;
    document.body.classList.toggle("painting", isOn);
    brush.show();
    byId("undo").disabled = !this.canUndo;
    page.arena.marked =
      isOn && square ? { squares: brush.shape(square, square), isBlocked: brush.paints } : null;
    page.redraw();
  }

  /** @param {string} tool */
  choose(tool) {
    this.brush.tool = tool;
    this.show();
  }

  /** @param {number} by */
  resize(by) {
    this.brush.resize(by);
    this.show();
  }

  /**
   * What mouse and fingers do in this mode.
   * @returns {Partial<Handlers>}
   */
  handlers() {
    return {
      tap: (at) => this.finish(this.squareAt(at)),
      draw: ({ x0, y0, x1, y1 }) => this.extend(this.squareAt([x0, y0]), this.squareAt([x1, y1])),
      box: (box) => (box ? this.finish(this.squareAt([box.x1, box.y1])) : this.giveUp()),
      command: () => {},
      hover: (at) => this.point(this.squareAt(at)),
      leave: () => this.point(null),
    };
  }

  /**
   * @param {At} at
   * @returns {Square}
   */
  squareAt(at) {
    const { x, y } = this.page.view.toSquares(...at);
    return [Math.floor(x), Math.floor(y)];
  }

  /** @param {Square | null} square */
  point(square) {
    this.square = square;
    this.page.view.hovered = -1;
    this.show();
  }

  /**
   * Draws to a square: from where the stroke is, or else begins one.
   * @param {Square} from
   * @param {Square} to
   */
  extend(from, to) {
    const { brush } = this,
      { before, after, at } = this.stroke ?? this.begun(from);
    this.stroke = { before, after: brush.drawn(after, at, to, brush.paints), at: to };
    this.showMap();
    this.point(to);
  }

  /**
   * A stroke that has changed nothing yet.
   * @param {Square} at
   * @returns {Stroke}
   */
  begun(at) {
    const { map } = this;
    return { before: map, after: map, at };
  }

  /** The map of the battle with all strokes that it does not have yet. */
  get map() {
    const strokes = this.stroke ? [...this.asked, this.stroke] : this.asked;
    return strokes.reduce(withStroke, squaresOf(this.page.info));
  }

  showMap() {
    this.page.arena.showMap(this.map);
  }

  /**
   * Ends the stroke at a square, and begins the battle on the map that it has drawn.
   * @param {Square} to
   */
  finish(to) {
    this.extend(to, to);
    const { page, stroke } = this;
    if (!stroke?.after.blocked.some((square, i) => square !== stroke.before.blocked[i])) return this.giveUp();
    this.stroke = null;
    this.asked.push(stroke);
    page.enqueue(async () => {
      const past = [...(this.canUndo ? this.past : []), page.shared.scenario],
        // Strokes and others before it may have changed the map since it was drawn, or its size.
        map = squaresOf(page.info),
        drawn = withStroke(map, stroke),
        rows = rowsOf(drawn);
      if (
        drawn !== map &&
        (await page.change(async () => (await page.engine.request({ type: "paint_map", rows })).scenario))
      )
        Object.assign(this, { past, newest: page.shared.scenario });
      this.asked.shift();
      this.showMap();
      this.show();
    });
  }

  /** Forgets the stroke, if there is one. */
  giveUp() {
    this.stroke = null;
    this.showMap();
    this.show();
  }

  /** Whether the scenario is still the one that the last stroke made. */
  get canUndo() {
    return this.past.length > 0 && this.newest === this.page.shared.scenario;
  }

  undo() {
    this.page.enqueue(async () => {
      const before = this.canUndo ? this.past.at(-1) : undefined;
      if (before === undefined || !(await this.page.change(async () => before))) return;
      this.past.pop();
      this.newest = before;
      this.showMap(); // with the strokes that were drawn meanwhile
      this.show();
    });
  }

  /**
   * Does what a key does in this mode; says whether it does nothing else.
   * @param {KeyboardEvent} event
   */
  key(event) {
    const { key, shiftKey, ctrlKey, metaKey, altKey } = event;
    if (altKey || byId("keys").open) return false;
    const command = ctrlKey || metaKey ? this.shortcut(key) : this.command(key, shiftKey ? FAR : 1);
    if (command) {
      event.preventDefault();
      command();
    }
    // No agents are selected.
    return command !== undefined || (this.isOn && /^(Tab|[0-9])$/.test(key));
  }

  /** @param {string} key */
  shortcut(key) {
    return this.isOn && key === "z" ? () => this.undo() : undefined;
  }

  /**
   * @param {string} key
   * @param {number} by
   * @returns {(() => void) | undefined}
   */
  command(key, by) {
    if (!this.isOn) return key === "p" ? () => this.start() : undefined;
    /** @type {{ [key: string]: () => void }} */
    const commands = {
      b: () => this.choose("brush"),
      e: () => this.choose("erase"),
      "[": () => this.resize(-1),
      "]": () => this.resize(1),
      p: () => this.stop(),
      Escape: () => this.stop(),
    };
    for (const [arrow, way] of Object.entries(ARROWS))
      commands[arrow] = () => this.point(squareFrom(this.square, way, by, this.page.info));
    // Elsewhere it presses a button.
    if (document.activeElement === this.page.view.canvas)
      commands.Enter = () => this.finish(this.square ?? squareFrom(null, [0, 0], 0, this.page.info));
    return commands[key];
  }
}

/**
 * A map with the squares that a stroke changed; one of another size has no place for them.
 * @param {EditedMap} map
 * @param {Stroke} stroke
 * @returns {EditedMap}
 */
function withStroke(map, { before, after }) {
  if (map.width !== after.width || map.height !== after.height) return map;
  const changed = (/** @type {number} */ square, /** @type {number} */ i) =>
    after.blocked[i] === before.blocked[i] ? square : after.blocked[i];
  return { ...map, blocked: map.blocked.map(changed) };
}
