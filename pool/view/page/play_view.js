// @ts-check
// PlayView: the battle as a person sees it who plays: what agents see, what is selected, what was ordered.

import { BattleView } from "./battle.js";
import { clamp } from "./numbers.js";
import { contextOf, theme, traceCircle, traceLine } from "./theme.js";
import { Selection, seenBy, unitsIn } from "./selection.js";

/** @import { Order, ScenarioInfo } from "./data.d.ts" */
/** @import { UnitState } from "./battle.js" */
/** @import { Rectangle } from "./selection.js" */

export class PlayView extends BattleView {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {ScenarioInfo} info
   */
  constructor(canvas, info) {
    super(canvas, info);
    this.selection = new Selection(this);
    /** @type {Order[]} The orders that hold, by agent. */
    this.orders = [];
    /** Whether what no agent sees is hidden, while the battle is not over. */
    this.hasFog = true;
    this.isOver = false;
    /** @type {Set<number>} The units that agents see, and the agents. */
    this.seen = new Set();
    /** @type {Rectangle | null} The box that is drawn around units. */
    this.box = null;
    this.fog = document.createElement("canvas");
  }

  /** @param {number} unit */
  shows(unit) {
    return !this.hasFog || this.isOver || this.seen.has(unit);
  }

  /** The living agents, by what was drawn last. */
  get agents() {
    return this.states.filter(({ unit, alive }) => alive && this.selection.isAgent(unit));
  }

  /** The living enemies that are shown. */
  get enemies() {
    return this.states.filter(
      ({ unit, alive }) => alive && !this.selection.isAgent(unit) && this.shows(unit),
    );
  }

  /**
   * The agents in a box.
   * @param {Rectangle} box
   */
  agentsIn(box) {
    return unitsIn(
      this.agents.map(({ unit, x, y }) => ({ unit, ...this.toCanvas(x, y) })),
      box,
    );
  }

  /** @param {number} time */
  draw(time) {
    super.draw(time);
    if (!this.box) return;
    const { context } = this,
      { x0, y0, x1, y1 } = this.box;
    context.fillStyle = theme.faint("focus", 0.12);
    context.fillRect(x0, y0, x1 - x0, y1 - y0);
    context.lineWidth = 1.2;
    context.strokeStyle = theme.colours.focus;
    context.strokeRect(x0, y0, x1 - x0, y1 - y0);
  }

  drawGround() {
    const { agents } = this;
    const eyes = agents.map(({ unit, x, y }) => ({ x, y, sight: this.type(unit).sight_range }));
    this.seen = seenBy(this.states, eyes);
    if (this.hasFog && !this.isOver) this.drawFog(eyes);
    for (const agent of agents)
      if (this.selection.units.has(agent.unit))
        this.drawOrder(agent, this.orders[this.info.units[agent.unit].id]);
  }

  /**
   * Darkens what no agent sees.
   * @param {{ x: number, y: number, sight: number }[]} eyes
   */
  drawFog(eyes) {
    const { fog, canvas, ratio } = this,
      context = contextOf(fog);
    // Setting the size clears it.
    [fog.width, fog.height] = [canvas.width, canvas.height];
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = theme.dark ? "rgba(0, 0, 0, 0.5)" : "rgba(40, 55, 75, 0.2)";
    context.fillRect(0, 0, this.width, this.height);
    context.globalCompositeOperation = "destination-out";
    context.fillStyle = "#000000";
    for (const { x, y, sight } of eyes) {
      const at = this.toCanvas(x, y);
      traceCircle(context, at.x, at.y, sight * this.scale);
      context.fill();
    }
    this.context.drawImage(fog, 0, 0, this.width, this.height);
  }

  /**
   * A line from an agent to where its order leads it.
   * @param {UnitState} agent
   * @param {Order | undefined} order
   */
  drawOrder(agent, order) {
    if (!order || order.type === "none" || order.type === "stop") return;
    const target = order.type === "target" ? this.states[order.unit] : null;
    if (target && (!target.alive || !this.shows(target.unit))) return;
    const { context } = this,
      from = this.toCanvas(agent.x, agent.y),
      to =
        order.type === "move"
          ? this.toCanvas(order.x, order.y)
          : this.toCanvas(target?.x ?? 0, target?.y ?? 0);
    const tone = !target ? "focus" : this.selection.isAgent(target.unit) ? "heal" : "enemy";
    context.strokeStyle = theme.faint(tone, 0.85);
    context.lineWidth = 1.6;
    context.setLineDash([5, 4]);
    traceLine(context, [from.x, from.y], [to.x, to.y]);
    context.stroke();
    context.setLineDash([]);
    traceCircle(context, to.x, to.y, target ? this.radius(target.unit) + 6 : 5);
    context.lineWidth = 2;
    context.stroke();
  }

  /**
   * @param {UnitState} state
   * @param {number} flash
   */
  drawUnit(state, flash) {
    super.drawUnit(state, flash);
    if (!this.selection.units.has(state.unit) || state.unit === this.selected) return;
    const r = Math.max(3, this.radius(state.unit));
    this.drawMark(this.toCanvas(state.x, state.y), r + clamp(r * 0.17, 1.6, 5) * 1.6, true);
  }
}
