// @ts-check
// Commander: a player in which a person selects agents and gives them orders. Pages say what becomes of
// orders.

import { byId } from "./dom.js";
import { clamp } from "./numbers.js";
import { PlayView } from "./play_view.js";
import { BattlePlayer } from "./player.js";

/** @import { At, Handlers } from "./controls.js" */
/** @import { AgentOrder, Order, ScenarioInfo } from "./data.d.ts" */
/** @import { Rectangle } from "./selection.js" */

/** Squares around the first places of all units that the map shows at least. */
const MARGIN = 4;
/** Length of a move, in squares. */
const MOVE = 2;
/** @type {{ [key: string]: [dx: number, dy: number] }} In squares: y grows north. */
export const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class Commander extends BattlePlayer {
  /** @param {ScenarioInfo} info */
  constructor(info) {
    super(info);
    this.mark();
  }

  /** @param {ScenarioInfo} info */
  use(info) {
    super.use(info);
    this.mark();
  }

  /** Lets the inspector show what is selected and what is seen. */
  mark() {
    this.inspector.isMarked = (unit) => this.field.selection.units.has(unit);
    this.inspector.shows = (unit) => this.field.shows(unit);
  }

  /** @param {ScenarioInfo} info */
  viewOf(info) {
    return new PlayView(byId("battle"), info);
  }

  get field() {
    return /** @type {PlayView} */ (this.view);
  }

  /** Whether no more orders can be given. */
  get isOver() {
    return false;
  }

  /**
   * Gives agents orders.
   * @param {AgentOrder[]} _orders
   */
  send(_orders) {}

  /** The squares around the first places of all units. */
  startArea() {
    const states = this.info.units.map((_, unit) => this.view.track.unitAt(unit, 0));
    const [xs, ys] = [states.map(({ x }) => x), states.map(({ y }) => y)];
    const [x0, y0] = [Math.min(...xs) - MARGIN, Math.min(...ys) - MARGIN];
    return { x0, y0, x1: Math.max(...xs) + MARGIN, y1: Math.max(...ys) + MARGIN };
  }

  /** Selects the dead no more, nor an enemy that went out of sight. */
  forget() {
    const { field } = this;
    if (!field.states.length) return;
    const hasDead = field.selection.keep(this.living);
    const isGone =
      field.selected >= 0 && !field.selection.isAgent(field.selected) && !field.shows(field.selected);
    if (hasDead || isGone) this.selected();
  }

  /** Whether agents can be given orders at all. */
  get takesOrders() {
    return true;
  }

  get living() {
    return this.field.agents.map(({ unit }) => unit);
  }

  /** Shows what is selected: one agent, or an enemy, with its numbers. */
  selected(enemy = -1) {
    const { selection } = this.field;
    this.view.selected = enemy >= 0 ? enemy : selection.only;
    const { size } = selection.units;
    this.inspector.hint = size
      ? `${size} units: ${selection.summary()}.`
      : "Select a unit to see its numbers.";
    for (const id of ["attack", "stop"]) byId(id).disabled = size === 0 || !this.takesOrders;
    this.redraw();
  }

  /**
   * @param {number} unit
   * @param {boolean} [add]
   */
  select(unit, add = false) {
    const { selection } = this.field;
    if (unit >= 0 && !selection.isAgent(unit)) {
      if (this.view.shows(unit)) this.selected(unit);
      return;
    }
    if (unit < 0 || (unit === selection.only && this.view.selected === unit)) selection.clear();
    else if (this.living.includes(unit) || !this.view.states.length) selection.pick(unit, add);
    this.selected();
  }

  /** @param {number} direction */
  selectNext(direction) {
    const { selection } = this.field,
      way = direction < 0 ? -1 : 1;
    if (!selection.next(this.living, way)) {
      selection.clear();
      selection.next(this.living, way);
    }
    this.selected();
  }

  selectAll() {
    this.field.selection.take(this.living, false);
    this.selected();
  }

  /**
   * Gives the selected agents an order each.
   * @param {(unit: number) => Order | null} orderOf
   */
  give(orderOf) {
    if (!this.isOver) this.send(this.field.selection.orders(orderOf));
  }

  /**
   * An order for what is at a point of the canvas: to go there, or to attack or heal that unit.
   * @param {At} at
   */
  commandAt([x, y]) {
    const unit = this.view.unitAt(x, y);
    if (unit >= 0 && !this.field.selection.units.has(unit))
      return this.give(() => ({ type: "target", unit }));
    const to = this.view.toSquares(x, y);
    this.give(() => this.moveTo(to.x, to.y));
  }

  /**
   * @param {number} x
   * @param {number} y
   * @returns {Order}
   */
  moveTo(x, y) {
    return { type: "move", x: clamp(x, 0, this.info.width), y: clamp(y, 0, this.info.height) };
  }

  /** Attacks the nearest enemy that is seen; a healer heals the ally with the least share of its health. */
  attack() {
    const { field, info } = this;
    this.give((unit) => {
      const { x, y } = field.states[unit],
        heals = field.type(unit).attack === "heal";
      /** @param {import("./battle.js").UnitState} state */
      const rank = (state) =>
        heals ? state.hp / field.type(state.unit).hp : Math.hypot(state.x - x, state.y - y);
      const others = heals
        ? field.agents.filter((other) => info.types[info.units[other.unit].type].attack !== "heal")
        : field.enemies;
      const best = others.reduce(
        (found, other) => (found && rank(found) <= rank(other) ? found : other),
        /** @type {import("./battle.js").UnitState | null} */ (null),
      );
      return best && { type: "target", unit: best.unit };
    });
  }

  /**
   * Moves the selected agents by squares.
   * @param {number} dx
   * @param {number} dy
   */
  moveBy(dx, dy) {
    const { states } = this.view;
    this.give((unit) => this.moveTo(states[unit].x + MOVE * dx, states[unit].y + MOVE * dy));
  }

  listen() {
    super.listen();
    byId("all").addEventListener("click", () => this.selectAll());
    byId("attack").addEventListener("click", () => this.attack());
    byId("stop").addEventListener("click", () => this.give(() => ({ type: "stop" })));
  }

  /**
   * What mouse and fingers do now: they select agents and command them.
   * @returns {Handlers}
   */
  handlers() {
    return {
      ...super.handlers(),
      tap: (at, how) => this.tap(at, how),
      draw: (box) => this.drawBox(box),
      box: (box, add) => this.boxed(box, add),
      command: (at) => this.commandAt(at),
    };
  }

  /**
   * Selects the agents in a box.
   * @param {Rectangle | null} box
   * @param {boolean} add
   */
  boxed(box, add) {
    if (box) this.field.selection.take(this.field.agentsIn(box), add);
    this.drawBox(null);
    this.selected();
  }

  /** @param {Rectangle | null} box */
  drawBox(box) {
    this.field.box = box;
    this.redraw();
  }

  /**
   * Selects; on a touch screen a tap that selects no agent commands those that are selected.
   * @param {At} at
   * @param {{ add: boolean, isDouble: boolean, isTouch: boolean }} how
   */
  tap(at, { add, isDouble, isTouch }) {
    const { selection } = this.field,
      unit = this.view.unitAt(...at),
      isAgent = unit >= 0 && selection.isAgent(unit);
    if (isAgent && isDouble) {
      selection.takeType(unit, this.living, add);
      return this.selected();
    }
    if (isTouch && selection.units.size && (!isAgent || this.heals(unit))) return this.commandAt(at);
    if (unit >= 0 || !add) this.select(unit, add);
  }

  /**
   * Whether all selected agents are healers, and this unit is not.
   * @param {number} unit
   */
  heals(unit) {
    /** @param {number} other */
    const isHealer = (other) => this.view.type(other).attack === "heal";
    return !isHealer(unit) && [...this.field.selection.units].every(isHealer);
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  hover(x, y) {
    super.hover(x, y);
    const { view, field } = this,
      isEnemy = view.hovered >= 0 && !field.selection.isAgent(view.hovered);
    view.canvas.classList.toggle("attack", isEnemy && field.selection.units.size > 0);
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (byId("keys").open) return;
    const done = event.ctrlKey || event.metaKey ? this.shortcut(event.key) : this.selectByKey(event);
    if (done) event.preventDefault();
    else super.key(event);
  }

  /**
   * @param {string} key
   * @returns {boolean}
   */
  shortcut(key) {
    if (key === "a") this.selectAll();
    return key === "a";
  }

  /**
   * Digits select agents, and with shift more of them. Tab selects one after the other, and leaves the map
   * after the last.
   * @param {KeyboardEvent} event
   */
  selectByKey({ code, key, shiftKey, altKey, target }) {
    const { selection } = this.field;
    const digit = /^(?:Digit|Numpad)(\d)$/.exec(code)?.[1];
    if (digit && !altKey) {
      const unit = selection.numbered(Number(digit), this.living);
      if (unit >= 0) this.select(unit, shiftKey);
      return true;
    }
    if (key !== "Tab" || target !== this.view.canvas) return false;
    const isDone = selection.next(this.living, shiftKey ? -1 : 1);
    this.selected();
    return isDone;
  }

  /**
   * @param {string} key
   * @param {number} ticks
   * @returns {(() => void) | undefined}
   */
  command(key, ticks) {
    /** @type {{ [key: string]: () => void }} */
    const commands = {
      a: () => this.attack(),
      s: () => this.give(() => ({ type: "stop" })),
    };
    for (const [arrow, [dx, dy]] of Object.entries(ARROWS)) commands[arrow] = () => this.moveBy(dx, dy);
    return (this.isOver ? undefined : commands[key]) ?? super.command(key, ticks);
  }
}
