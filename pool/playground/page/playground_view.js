// @ts-check
// PlaygroundView: the whole battle, which agents a person has taken over, and what is changed at the start.

import { PlayView } from "#view/play_view.js";
import { rectanglesOf } from "#view/squares.js";
import { traceLine } from "#view/theme.js";

/** @import { ScenarioInfo } from "#view/data.d.ts" */
/** @import { Square } from "#view/brush.js" */
/** @import { Point } from "#view/camera.js" */
/** @import { UnitState } from "#view/battle.js" */
/** @import { EditedMap } from "#view/squares.js" */

export class PlaygroundView extends PlayView {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {ScenarioInfo} info
   */
  constructor(canvas, info) {
    super(canvas, info);
    this.hasFog = false;
    /** @type {Set<number>} The agents that are the person's, by number. */
    this.taken = new Set();
    /** @type {{ unit: number, at: Point } | null} A unit that is dragged, and where it is on the canvas. */
    this.dragged = null;
    /** @type {{ squares: Square[], isBlocked: boolean } | null} What the brush covers and makes of it. */
    this.marked = null;
  }

  /**
   * Shows a map while it is drawn on.
   * @param {EditedMap} map
   */
  showMap(map) {
    Object.assign(this, { info: { ...this.info, obstacles: rectanglesOf(map) } });
    this.terrain.key = "";
  }

  /**
   * The place at a point of the canvas, as a person would write it into a scenario file.
   * @param {number} x
   * @param {number} y
   */
  placeAt(x, y) {
    const at = this.toSquares(x, y);
    return { x: Math.round(at.x * 20) / 20, y: Math.round(at.y * 20) / 20 };
  }

  /** @param {number} time */
  draw(time) {
    super.draw(time);
    if (this.marked) this.terrain.mark(this.marked.squares, this.marked.isBlocked);
    if (!this.dragged) return;
    const { unit, at } = this.dragged,
      { x, y } = this.states[unit],
      from = this.toCanvas(x, y),
      { context } = this;
    this.drawMark(at, Math.max(3, this.radius(unit)), true);
    traceLine(context, [from.x, from.y], [at.x, at.y]);
    context.stroke();
  }

  /**
   * @param {UnitState} state
   * @param {number} flash
   */
  drawUnit(state, flash) {
    super.drawUnit(state, flash);
    const { faction, id } = this.info.units[state.unit];
    if (faction || !this.taken.has(id)) return;
    const { context } = this;
    context.setLineDash([3, 4]);
    this.drawMark(this.toCanvas(state.x, state.y), Math.max(3, this.radius(state.unit)) * 1.45, true);
    context.setLineDash([]);
  }
}
