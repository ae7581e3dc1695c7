// @ts-check
// Selection: the agents that the next order is for.

/** @import { AgentOrder, Order, ScenarioInfo } from "./data.d.ts" */

/** A rectangle of the canvas, by two opposite corners.
 * @typedef {{ x0: number, y0: number, x1: number, y1: number }} Rectangle
 */

export class Selection {
  /** @param {{ track: { info: ScenarioInfo } }} view What is shown: an episode may have drawn its types. */
  constructor(view) {
    this.view = view;
    /** @type {Set<number>} By battle-wide id. */
    this.units = new Set();
  }

  get info() {
    return this.view.track.info;
  }

  /** The selected agent, if it is one; else -1. */
  get only() {
    return this.units.size === 1 ? [...this.units][0] : -1;
  }

  /** @param {number} unit */
  isAgent(unit) {
    return this.info.units[unit]?.faction === 0;
  }

  clear() {
    this.units.clear();
  }

  /**
   * Selects these agents, or these too.
   * @param {number[]} units
   * @param {boolean} add
   */
  take(units, add) {
    if (!add) this.units.clear();
    for (const unit of units) if (this.isAgent(unit)) this.units.add(unit);
  }

  /**
   * Selects an agent, or with `add` changes whether it is selected.
   * @param {number} unit
   * @param {boolean} add
   */
  pick(unit, add) {
    if (add && this.units.has(unit)) this.units.delete(unit);
    else this.take([unit], add);
  }

  /**
   * Selects the living agents of the type of one of them.
   * @param {number} unit
   * @param {number[]} living
   * @param {boolean} add
   */
  takeType(unit, living, add) {
    const { units } = this.info;
    this.take(
      living.filter((other) => units[other].type === units[unit].type),
      add,
    );
  }

  /**
   * Selects the next living agent in a direction. At the last one it selects nothing, and says so.
   * @param {number[]} living In ascending order.
   * @param {1 | -1} direction
   */
  next(living, direction) {
    const agents = living.filter((unit) => this.isAgent(unit));
    if (direction < 0) agents.reverse();
    const from = this.only;
    const unit = agents.find((agent) => from < 0 || (agent - from) * direction > 0);
    if (unit === undefined) return false;
    this.take([unit], false);
    return true;
  }

  /**
   * The living agent with a number, or -1.
   * @param {number} number
   * @param {number[]} living
   */
  numbered(number, living) {
    return living.find((unit) => this.isAgent(unit) && this.info.units[unit].id === number) ?? -1;
  }

  /**
   * Forgets the agents that have died; says whether there were any.
   * @param {number[]} living
   */
  keep(living) {
    const before = this.units.size;
    for (const unit of [...this.units]) if (!living.includes(unit)) this.units.delete(unit);
    return this.units.size < before;
  }

  /**
   * An order for each selected agent; `orderOf` gives null for none.
   * @param {(unit: number) => Order | null} orderOf
   * @returns {AgentOrder[]}
   */
  orders(orderOf) {
    return [...this.units].flatMap((unit) => {
      const order = orderOf(unit);
      return order ? [{ agent: this.info.units[unit].id, order }] : [];
    });
  }

  /** The selected types, such as "2 Stalker, 3 Zealot". */
  summary() {
    /** @type {Map<string, number>} */
    const counts = new Map();
    for (const unit of this.units) {
      const { name } = this.info.types[this.info.units[unit].type];
      counts.set(name, (counts.get(name) ?? 0) + 1);
    }
    return [...counts].map(([name, count]) => `${count} ${name.toLowerCase()}`).join(", ");
  }
}

/**
 * The units whose centre is in a rectangle.
 * @param {{ unit: number, x: number, y: number }[]} places
 * @param {Rectangle} box
 */
export function unitsIn(places, { x0, y0, x1, y1 }) {
  const [west, east] = [Math.min(x0, x1), Math.max(x0, x1)],
    [top, bottom] = [Math.min(y0, y1), Math.max(y0, y1)];
  const isIn = ({ x = 0, y = 0 }) => x >= west && x <= east && y >= top && y <= bottom;
  return places.filter(isIn).map(({ unit }) => unit);
}

/**
 * Which units are seen by one of these: nearer than its sight range.
 * @param {{ unit: number, x: number, y: number }[]} units
 * @param {{ x: number, y: number, sight: number }[]} eyes
 */
export function seenBy(units, eyes) {
  const isSeen = ({ x = 0, y = 0 }) => eyes.some((eye) => Math.hypot(eye.x - x, eye.y - y) < eye.sight);
  return new Set(units.filter(isSeen).map(({ unit }) => unit));
}
