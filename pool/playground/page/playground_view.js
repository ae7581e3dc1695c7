// @ts-check
// PlaygroundView: the whole battle, and which agents a person has taken over.

import { PlayView } from "#view/play_view.js";

/** @import { ScenarioInfo } from "#view/data.d.ts" */
/** @import { UnitState } from "#view/battle.js" */

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
