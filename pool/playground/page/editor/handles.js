// @ts-check
// Handles: what the pointer takes hold of on the map, the groups and the attack point, and the marks that
// show where: the box and the cross of the selected group, the flag, and a question mark for a group without
// units.

import { theme, traceCircle, traceLine } from "#view/theme.js";
import { isNumber } from "./document.js";

/** @import { MapEditor } from "./map.js" */
/** @typedef {{ kind: "group", index: number, x: number, y: number }} GroupHandle */
/** @typedef {{ kind: "goal", x: number, y: number }} GoalHandle */
/** @typedef {GroupHandle | GoalHandle} Handle */

/** How far from a group's centre, or the foot of the flag, a press still means it: squares, and pixels. */
const REACH = 0.6;
const REACH_PIXELS = 12;
/** Pixels between the units of the selected group and its box. */
const GAP = 9;

export class Handles {
  /** @param {MapEditor} map */
  constructor(map) {
    this.map = map;
  }

  /**
   * What is at a point of the canvas. A flag or unit that is seen there goes first; then the box of the
   * selected group; then centres, which may have no unit. The attack point and a group's centre may be the
   * same place, as in a new scenario: then the flag above it is the handle of the attack point.
   * @param {number} px
   * @param {number} py
   * @returns {Handle | null}
   */
  at(px, py) {
    const { map } = this,
      { page } = map,
      unit = map.unitAt(px, py);
    if (this.isOnFlag(px, py) || (page.goalSelected && this.isAtGoal(px, py))) return this.goal();
    if (unit >= 0 && map.groupOf[unit] >= 0) return this.group(map.groupOf[unit]);
    if (this.isInBox(page.group, px, py)) return this.group(page.group);
    const centre = this.centreAt(px, py);
    if (centre >= 0) return this.group(centre);
    return this.isAtGoal(px, py) ? this.goal() : null;
  }

  /** @returns {Handle | null} */
  goal() {
    const [x, y] = this.map.info.attack_point;
    return { kind: "goal", x, y };
  }

  /**
   * @param {number} index
   * @returns {Handle | null}
   */
  group(index) {
    const { x, y } = this.map.page.doc.groups()[index];
    return { kind: "group", index, x, y };
  }

  /** The nearest group whose centre is within reach, or -1. */
  centreAt(/** @type {number} */ px, /** @type {number} */ py) {
    let best = -1,
      nearest = this.reach;
    this.map.page.doc.groups().forEach(({ x, y }, index) => {
      const away = this.away(x, y, px, py);
      if (away < nearest) [best, nearest] = [index, away];
    });
    return best;
  }

  /** In pixels. */
  get reach() {
    return Math.max(REACH_PIXELS, REACH * this.map.scale);
  }

  /** Pixels between a point of the map and one of the canvas; NaN if the file has no such point. */
  away(
    /** @type {unknown} */ x,
    /** @type {unknown} */ y,
    /** @type {number} */ px,
    /** @type {number} */ py,
  ) {
    if (!isNumber(x) || !isNumber(y)) return NaN;
    const at = this.map.toCanvas(x, y);
    return Math.hypot(at.x - px, at.y - py);
  }

  isAtGoal(/** @type {number} */ px, /** @type {number} */ py) {
    const [x, y] = this.map.info.attack_point;
    return this.away(x, y, px, py) < this.reach;
  }

  isOnFlag(/** @type {number} */ px, /** @type {number} */ py) {
    const { x, y } = this.map.toCanvas(...this.map.info.attack_point);
    return px > x - 5 && px < x + 17 && py > y - 28 && py < y - 12;
  }

  isInBox(/** @type {number} */ index, /** @type {number} */ px, /** @type {number} */ py) {
    const box = this.box(index);
    return box !== null && px >= box.left && px <= box.right && py >= box.top && py <= box.bottom;
  }

  /** The box around the units and the centre of a group, on the canvas; null if there is no such group. */
  box(/** @type {number} */ index) {
    const { map } = this,
      group = map.page.doc.groups()[index];
    if (!group || !isNumber(group.x) || !isNumber(group.y)) return null;
    const xs = [group.x],
      ys = [group.y];
    for (const { unit, x, y } of map.states) {
      if (map.groupOf[unit] !== index) continue;
      const { radius } = map.type(unit);
      xs.push(x - radius, x + radius);
      ys.push(y - radius, y + radius);
    }
    const from = map.toCanvas(Math.min(...xs), Math.max(...ys)),
      to = map.toCanvas(Math.max(...xs), Math.min(...ys));
    return { left: from.x - GAP, top: from.y - GAP, right: to.x + GAP, bottom: to.y + GAP };
  }

  draw() {
    this.drawUnplaced();
    this.drawSelection();
    this.drawGoal();
  }

  /** Groups whose units are unknown, because their types are. */
  drawUnplaced() {
    const { context } = this.map;
    for (const index of this.map.unplaced) {
      const { x, y, faction } = this.map.page.doc.groups()[index];
      if (!isNumber(x) || !isNumber(y)) continue;
      const at = this.map.toCanvas(x, y);
      traceCircle(context, at.x, at.y, 13);
      context.setLineDash([4, 3]);
      context.lineWidth = 2;
      context.strokeStyle = theme.colours[faction === "ENEMY" ? "enemy" : "ally"];
      context.stroke();
      context.setLineDash([]);
      context.fillStyle = theme.colours.text;
      context.font = "700 14px system-ui, sans-serif";
      [context.textAlign, context.textBaseline] = ["center", "middle"];
      context.fillText("?", at.x, at.y + 1);
    }
  }

  drawSelection() {
    const { map } = this,
      box = this.box(map.page.group);
    if (!box) return;
    const { context } = map;
    context.beginPath();
    context.roundRect(box.left, box.top, box.right - box.left, box.bottom - box.top, 8);
    context.setLineDash([6, 4]);
    context.lineWidth = 2;
    context.strokeStyle = theme.colours.focus;
    context.stroke();
    context.setLineDash([]);
    const { x, y } = map.page.doc.groups()[map.page.group],
      at = map.toCanvas(x, y);
    context.beginPath();
    for (const [dx, dy] of [
      [1, 0],
      [0, 1],
    ]) {
      context.moveTo(at.x - 7 * dx, at.y - 7 * dy);
      context.lineTo(at.x + 7 * dx, at.y + 7 * dy);
    }
    context.lineWidth = 4;
    context.strokeStyle = theme.colours.bg;
    context.stroke();
    context.lineWidth = 2;
    context.strokeStyle = theme.colours.focus;
    context.stroke();
  }

  drawGoal() {
    const { map } = this,
      [x, y] = map.info.attack_point;
    if (Number.isNaN(x)) return;
    const { context } = map,
      at = map.toCanvas(x, y),
      isSelected = map.page.goalSelected || map.brush.tool === "goal";
    // A flag above the units, which may stand on the point.
    traceLine(context, [at.x, at.y], [at.x, at.y - 26], [at.x + 15, at.y - 20.5], [at.x, at.y - 15]);
    context.lineJoin = "round";
    context.lineWidth = 4;
    context.strokeStyle = theme.colours.panel;
    context.stroke();
    context.fillStyle = theme.colours[isSelected ? "focus" : "enemy"];
    context.fill();
    context.lineWidth = 2;
    context.strokeStyle = context.fillStyle;
    context.stroke();
  }
}
