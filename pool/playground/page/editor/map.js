// @ts-check
// MapEditor: the map and the groups on the canvas, and what the pointer and the keys do to them.

import { BattleView } from "#view/battle.js";
import { Brush, squareFrom } from "#view/brush.js";
import { moveMap, placeOn, wheelFactor } from "#view/controls.js";
import { clamp } from "#view/numbers.js";
import { rectanglesOf } from "#view/squares.js";
import { isNumber } from "./document.js";
import { Handles } from "./handles.js";
import { StartTrack, infoOf } from "./start.js";

/** @import { EditorPage } from "./editor.js" */

/** @import { UnitInfo } from "#view/data.d.ts" */
/** @import { EditedMap } from "#view/squares.js" */
/** @import { ScenarioDocument } from "./document.js" */
/** @import { Layout } from "./problems.js" */
/** @typedef {[number, number]} Point */
/**
 * What the pointer does while it is down; `from` is where it went down, until it has moved.
 * @typedef {{ kind: "pan", last: Point, clears?: boolean }} PanDrag
 * @typedef {{ kind: "draw", from: Point, map: EditedMap, blocked: boolean }} DrawDrag
 * @typedef {{ kind: "group", index: number, dx: number, dy: number, from: Point | null }} GroupDrag
 * @typedef {{ kind: "goal", dx: number, dy: number, from: Point | null }} GoalDrag
 */

/** Points snap to multiples of this, in squares, unless Alt is held. */
export const SNAP = 0.5;

export class MapEditor extends BattleView {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {EditorPage} page
   */
  constructor(canvas, page) {
    const empty = { width: 1, height: 1, obstacles: [], types: [], units: [] };
    super(canvas, infoOf({ ...empty, attack_point: [NaN, NaN] }));
    this.page = page;
    this.wholeMap = true;
    this.brush = new Brush();
    this.handles = new Handles(this);
    /** @type {Point | null} The square that the keyboard draws at; the pointer moves it too. */
    this.square = null;
    /** @type {Point | null} The first corner of a rectangle or line. */
    this.corner = null;
    /** @type {EditedMap | null} The map while it is drawn on. */
    this.draft = null;
    /** @type {PanDrag | DrawDrag | GroupDrag | GoalDrag | null} */
    this.drag = null;
    /** @type {Map<number, Point>} Where each pressed pointer is. */
    this.pressed = new Map();
    /** Whether fingers move the map, until all are released. */
    this.moves = false;
    /** What a second finger goes back to. */
    this.before = { state: page.doc.state, tool: this.brush.tool };
    /** Tells one drag from the next. */
    this.serial = 0;
    /** @type {number[]} The group of each unit. */
    this.groupOf = [];
    /** @type {number[]} Groups whose units are unknown. */
    this.unplaced = [];
    this.listen();
  }

  /**
   * Shows the document; `layout` is the program's last answer about the units of its groups.
   * @param {ScenarioDocument} doc
   * @param {Layout | null} layout
   */
  update(doc, layout) {
    const map = this.draft ?? doc.map();
    const goal = doc.shown.value(["attack_point"]);
    const isPoint = Array.isArray(goal) && goal.length === 2 && goal.every(isNumber);
    if (map.width !== this.info.width || map.height !== this.info.height) this.camera = null;
    /** @type {UnitInfo[]} */
    const units = [];
    /** @type {Point[]} */
    const places = [];
    this.groupOf = [];
    this.unplaced = [];
    for (const [type, faction, x, y] of layout?.drawn ?? []) {
      units.push({ type, faction, id: 0 });
      places.push([x, y]);
      this.groupOf.push(-1);
    }
    const groups = layout?.drawn ? [] : doc.groups();
    groups.forEach((group, index) => {
      const known = layout?.find(group, index);
      if (!known) return this.unplaced.push(index);
      for (const [type, x, y] of known.units) {
        units.push({ type, faction: doc.formats.factions.indexOf(group.faction), id: 0 });
        places.push([x + group.x - known.x, y + group.y - known.y]);
        this.groupOf.push(index);
      }
    });
    const counts = [0, 0];
    for (const unit of units) unit.id = counts[unit.faction]++;
    const info = infoOf({
      width: map.width,
      height: map.height,
      obstacles: rectanglesOf(map),
      attack_point: isPoint ? /** @type {[number, number]} */ (goal) : [NaN, NaN],
      types: layout?.types ?? [],
      units,
    });
    Object.assign(this, { info, track: new StartTrack(info, places) });
    this.hovered = this.selected = -1;
    this.terrain.key = "";
  }

  draw() {
    const box = this.canvas.getBoundingClientRect();
    if (this.isFitted && (box.width !== this.width || box.height !== this.height)) this.camera = null;
    super.draw(0);
    this.handles.draw();
    this.drawBrush();
  }

  drawBrush() {
    if (!this.square || !this.brush.isDrawing) return;
    this.terrain.mark(this.brush.shape(this.corner ?? this.square, this.square), this.brush.paints);
  }

  /** @param {string} tool */
  choose(tool) {
    this.brush.tool = tool;
    this.corner = null;
    this.page.refresh();
  }

  /** @param {number} by */
  resize(by) {
    this.brush.resize(by);
    this.page.refresh();
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"]))
      canvas.addEventListener(name, (event) => this.release(event));
    canvas.addEventListener("pointerleave", () => {
      this.hovered = -1;
      this.square = null;
      this.page.showPointer();
      this.page.redraw();
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", (event) => this.doubleClick(this.local(event)));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {MouseEvent} event */
  local(event) {
    return placeOn(this.canvas, event);
  }

  /** @param {Point} at */
  doubleClick([x, y]) {
    const unit = this.unitAt(x, y);
    if (unit >= 0 || !this.handles.at(x, y)) this.page.doubleClick(unit);
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    this.zoom(wheelFactor(event), ...this.local(event));
    this.page.redraw();
  }

  /**
   * The point of the map under the pointer, and its square.
   * @param {MouseEvent} event
   * @returns {{ x: number, y: number, square: Point }}
   */
  point(event) {
    const { x, y } = this.toSquares(...this.local(event));
    return { x, y, square: [Math.floor(x), Math.floor(y)] };
  }

  /** @param {PointerEvent} event */
  press(event) {
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.pressed.set(event.pointerId, this.local(event));
    this.moves ||= this.pressed.size > 1;
    if (this.moves) return this.giveUp();
    this.before = { state: this.page.doc.state, tool: this.brush.tool };
    const at = this.point(event);
    this.serial++;
    const isPan = event.button === 1 || event.shiftKey || this.page.doc.isStale;
    const { x, y } = at;
    if (isPan) this.drag = { kind: "pan", last: this.local(event) };
    else if (this.brush.isDrawing) this.beginDrawing(at, event.button === 2);
    else if (event.button !== 0) this.drag = null;
    else if (this.brush.tool === "goal") this.drag = { kind: "goal", dx: 0, dy: 0, from: null };
    else if (this.brush.tool !== "select")
      this.page.addGroup(this.brush.tool.toUpperCase(), ...this.snap(x, y, event));
    else this.pick(event, at);
    this.moved(event);
  }

  /** A second finger moves the map: what the first one did is undone. */
  giveUp() {
    this.drag = this.draft = null;
    if (this.before.state !== this.page.doc.state) this.page.doc.undo();
    this.choose(this.before.tool);
  }

  /**
   * Begins to move what is under the pointer, or else the map.
   * @param {PointerEvent} event
   * @param {{ x: number, y: number }} at
   */
  pick(event, { x, y }) {
    const here = this.local(event),
      handle = this.handles.at(...here);
    if (!handle) {
      this.drag = { kind: "pan", last: here, clears: true };
      return;
    }
    if (handle.kind === "group") this.page.selectGroup(handle.index);
    else this.page.selectGoal();
    this.drag = { ...handle, dx: handle.x - x, dy: handle.y - y, from: here };
  }

  /**
   * @param {{ square: Point }} at
   * @param {boolean} isRight
   */
  beginDrawing({ square }, isRight) {
    const map = this.page.doc.map(),
      blocked = isRight ? !this.brush.paints : this.brush.paints;
    /** @type {DrawDrag} */
    const drag = { kind: "draw", from: square, map, blocked };
    this.drag = drag;
    this.corner = ["rectangle", "line"].includes(this.brush.tool) ? square : null;
    this.draft = map;
    if (!this.corner) this.extend(drag, square);
  }

  /**
   * @param {DrawDrag} drag
   * @param {Point} square
   */
  extend(drag, square) {
    this.draft = this.brush.drawn(this.draft ?? drag.map, drag.from, square, drag.blocked);
    drag.from = square;
    this.page.showMap();
  }

  /**
   * A point on the grid of half squares, or with Alt anywhere, at whole hundredths.
   * @param {number} x
   * @param {number} y
   * @param {MouseEvent} event
   */
  snap(x, y, event) {
    const step = event.altKey ? 0.01 : SNAP;
    const { width, height } = this.info;
    /** @type {(value: number, most: number) => number} */
    const tidy = (value, most) => clamp(Math.round(Math.round(value / step) * step * 100) / 100, 0, most);
    return [tidy(x, width), tidy(y, height)];
  }

  /** @param {PointerEvent} event */
  moved(event) {
    const at = this.point(event);
    this.square = at.square;
    if (this.moves) this.moveFinger(event);
    else if (this.drag) this.dragged(this.drag, at, event);
    else this.hover(this.local(event));
    this.page.showPointer();
  }

  /** @param {PointerEvent} event */
  moveFinger(event) {
    if (!this.pressed.has(event.pointerId)) return;
    const here = this.local(event);
    moveMap(this.pressed, event.pointerId, here, {
      move: (dx, dy) => this.move(dx, dy),
      zoom: (factor, at) => this.zoom(factor, ...at),
    });
    this.pressed.set(event.pointerId, here);
    this.page.redraw();
  }

  /** @param {Point} here */
  hover(here) {
    const selects = this.brush.tool === "select",
      isHandle = selects && !this.page.doc.isStale && this.handles.at(...here) !== null;
    this.hovered = selects ? this.unitAt(...here) : -1;
    this.canvas.classList.toggle("over", isHandle);
    this.page.redraw();
  }

  /**
   * @param {PanDrag | DrawDrag | GroupDrag | GoalDrag} drag
   * @param {{ x: number, y: number, square: Point }} at
   * @param {PointerEvent} event
   */
  dragged(drag, at, event) {
    const here = this.local(event);
    if (drag.kind === "pan") return this.pan(drag, here);
    if (drag.kind === "draw") {
      if (!this.corner && this.brush.tool !== "fill") this.extend(drag, at.square);
      return this.page.redraw();
    }
    // A click that trembles moves nothing.
    if (drag.from && Math.hypot(here[0] - drag.from[0], here[1] - drag.from[1]) < 4) return;
    drag.from = null;
    const [x, y] = this.snap(at.x + drag.dx, at.y + drag.dy, event);
    const merge = `drag ${this.serial}`;
    if (drag.kind === "group") this.page.doc.moveGroup(drag.index, x, y, merge);
    else this.page.doc.setKey(["attack_point"], [x, y], merge);
  }

  /**
   * @param {PanDrag} drag
   * @param {Point} here
   */
  pan(drag, here) {
    const [dx, dy] = [here[0] - drag.last[0], here[1] - drag.last[1]];
    if (drag.clears && Math.hypot(dx, dy) < 4) return;
    drag.clears = false;
    this.move(dx, dy);
    drag.last = here;
    this.page.redraw();
  }

  /** @param {PointerEvent} event */
  release(event) {
    const { drag } = this;
    this.drag = null;
    this.pressed.delete(event.pointerId);
    this.moves &&= this.pressed.size > 0;
    if (drag?.kind === "draw") {
      if (event.type === "pointerup") {
        const { corner, square, draft } = this;
        this.draft = null;
        this.commit(
          corner ? this.brush.drawn(drag.map, corner, square ?? corner, drag.blocked) : (draft ?? drag.map),
        );
      }
      this.draft = this.corner = null;
      this.page.showMap();
    }
    if (drag?.kind === "pan" && drag.clears) this.page.selectGroup(-1);
    this.page.doc.settle();
    this.page.redraw();
  }

  /**
   * Makes a drawn map the document's, if it differs.
   * @param {EditedMap} map
   */
  commit(map) {
    const before = this.page.doc.map();
    if (map.blocked.some((square, i) => square !== before.blocked[i])) this.page.doc.setMap(map);
  }

  /**
   * Keys of the focused map: arrows move what is selected, or the square at which Space draws.
   * @param {KeyboardEvent} event
   */
  key(event) {
    /** @type {{ [key: string]: [number, number] | undefined }} */
    const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const move = moves[event.key];
    if (event.ctrlKey || event.metaKey) return;
    if (move) {
      event.preventDefault();
      if (this.brush.isDrawing) this.moveSquare(move, event.shiftKey ? 5 : 1);
      else this.page.nudge(move[0], move[1], event.altKey ? 0.01 : event.shiftKey ? 5 : SNAP);
    } else if ((event.key === " " || event.key === "Enter") && this.brush.isDrawing) {
      event.preventDefault();
      this.stamp();
    }
  }

  /**
   * @param {Point} direction
   * @param {number} by
   */
  moveSquare(direction, by) {
    this.square = squareFrom(this.square, direction, by, this.info);
    this.page.showPointer();
    this.page.redraw();
  }

  /** Draws at the square: of rectangles and lines first the one end, then the other. */
  stamp() {
    if (!this.square) return this.moveSquare([0, 0], 0);
    if (["rectangle", "line"].includes(this.brush.tool) && !this.corner) this.corner = this.square;
    else {
      this.commit(
        this.brush.drawn(this.page.doc.map(), this.corner ?? this.square, this.square, this.brush.paints),
      );
      this.corner = null;
    }
    this.page.redraw();
  }
}
