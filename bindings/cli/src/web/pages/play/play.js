// @ts-check
// The page of a person who plays: it gives orders and says when a step is played; the program plays it.

import { titleCase } from "#view/battle.js";
import { byId, download, make } from "#view/dom.js";
import { clamp } from "#view/numbers.js";
import { BattlePlayer, RESULTS } from "#view/player.js";
import { theme } from "#view/theme.js";
import { Track, bytesOf } from "#view/track.js";
import { TICKS_PER_SECOND, TICKS_PER_STEP } from "#view/transport.js";
import { Connection, ConnectionLost, messageOf } from "../connection.js";
import { Controls } from "./controls.js";
import { PlayView } from "./view.js";

/** @import { ScenarioInfo } from "#view/data.d.ts" */
/** @import { AgentOrder, EpisodeResult, GameInfo, Order, PlayedSteps } from "../protocol.d.ts" */
/** @import { At } from "./controls.js" */

/** Seconds before the end of a step is shown, when the next one is requested. */
const LEAD = 0.06;
/** Squares around the first places of all units that the map shows at least. */
const MARGIN = 4;
/** Length of a move, in squares. */
const MOVE = 2;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

const GUIDES = {
  mouse:
    "Drag a box around your units (blue). Right click where they go, or the enemy to attack. Space starts.",
  touch: "Tap a unit (blue), or drag a box. Then tap where it goes, or the enemy to attack. \u25b6 starts.",
};

class PlayPage extends BattlePlayer {
  /** @param {GameInfo} data */
  constructor(data) {
    super(data.scenario);
    this.data = data;
    this.seed = data.seed;
    /** Counts battles, so that responses of an earlier one are known. */
    this.battle = 0;
    /** Steps that the page has. */
    this.steps = 0;
    this.episodeReturn = 0;
    /** @type {EpisodeResult | null} */
    this.outcome = null;
    this.isFetching = false;
    /** Whether only one step is played. */
    this.isSingle = false;
    /** Whether the end was not shown yet. */
    this.isEndNew = false;
    /** What `describe` showed last. */
    this.described = "";
    this.inspector.isMarked = (unit) => this.field.selection.units.has(unit);
    this.inspector.shows = (unit) => this.field.shows(unit);
    this.connection = new Connection({
      open: () => this.begin(this.seed, this.played),
      close: () => this.say("The connection to smaclite-pool play is lost. Trying again."),
      refuse: (error) => this.say(error),
    });
  }

  /** @param {ScenarioInfo} info */
  viewOf(info) {
    return new PlayView(byId("battle"), info);
  }

  get field() {
    return /** @type {PlayView} */ (this.view);
  }

  get isOver() {
    return this.outcome !== null;
  }

  /** The actions of the steps that the page has, agent by agent. */
  get played() {
    return this.view.track.decisions.flatMap((step) => step.map(({ action }) => action));
  }

  start() {
    byId("name").textContent = this.info.name;
    byId("guide").textContent = GUIDES[matchMedia("(pointer: coarse)").matches ? "touch" : "mouse"];
    this.listen();
    /** @param {number} now */
    const frame = (now) => {
      this.frame(now);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /**
   * Begins the battle of a seed, after these actions, which a page has from a connection that was lost.
   * @param {string} seed
   * @param {number[]} actions
   */
  async begin(seed, actions) {
    const battle = ++this.battle;
    this.seed = seed;
    this.clock.playing = false;
    try {
      const response = await this.connection.request({ type: "begin_battle", seed, actions });
      if (battle !== this.battle) return;
      byId("message").hidden = true;
      this.isFetching = this.isSingle = this.isEndNew = false;
      this.outcome = null;
      this.steps = 0;
      this.field.selection.clear();
      this.selected();
      this.clock.isOpen = true;
      this.show(new Track(this.info));
      this.append(response);
      if (actions.length) this.clock.seek(this.clock.end);
      this.view.area ??= this.startArea();
      document.documentElement.dataset.ready = "";
    } catch (error) {
      this.failed(error);
    }
  }

  /** A new battle. */
  again() {
    this.begin(String(BigInt.asUintN(64, BigInt(this.seed) + 1n)), []);
  }

  /** The squares around the first places of all units. */
  startArea() {
    const states = this.info.units.map((_, unit) => this.view.track.unitAt(unit, 0));
    const [xs, ys] = [states.map(({ x }) => x), states.map(({ y }) => y)];
    const [x0, y0] = [Math.min(...xs) - MARGIN, Math.min(...ys) - MARGIN];
    return { x0, y0, x1: Math.max(...xs) + MARGIN, y1: Math.max(...ys) + MARGIN };
  }

  /** @param {PlayedSteps} played */
  append(played) {
    const { step, steps, n_moments, moments, decisions } = played;
    // The start comes alone, and then again with the first step.
    if (step === 0) this.view.track = this.chart.track = new Track(this.info);
    const { track } = this.view;
    track.serial = this.battle;
    track.append(bytesOf(moments), n_moments);
    track.appendDecisions(bytesOf(decisions));
    this.steps = step + steps;
    this.episodeReturn = played.return;
    this.outcome = played.is_over ? (played.result ?? "truncated") : null;
    this.field.orders = played.orders;
    this.clock.end = track.last;
    if (this.isOver) {
      this.clock.isOpen = false;
      this.isEndNew = true;
    }
    this.redraw();
  }

  /** Has the next step played. One request at a time. */
  async fetch() {
    if (this.isFetching || this.isOver) return;
    const { battle } = this;
    this.isFetching = true;
    try {
      const played = await this.connection.request({ type: "play_step" });
      if (battle === this.battle) this.append(played);
    } catch (error) {
      if (battle === this.battle) this.failed(error);
    }
    if (battle === this.battle) this.isFetching = false;
  }

  /** @param {unknown} error */
  failed(error) {
    this.clock.playing = false;
    if (!(error instanceof ConnectionLost)) this.say(messageOf(error)); // else the page says so already
  }

  /** @param {string} text */
  say(text) {
    this.clock.playing = false;
    byId("message").hidden = false;
    byId("message").textContent = text;
    this.redraw();
  }

  /** @param {number} now */
  frame(now) {
    super.frame(now);
    const { clock } = this,
      left = (clock.end - clock.time) / (TICKS_PER_SECOND * clock.speed);
    if (clock.playing && !this.isOver) {
      if (!this.isSingle && left < LEAD) this.fetch();
      else if (this.isSingle && left === 0 && !this.isFetching) {
        clock.playing = this.isSingle = false;
        this.redraw();
      }
    }
    this.forget();
    if (this.isEndNew && clock.time >= clock.end) this.showEnd();
    this.describe();
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
    for (const id of ["attack", "stop"]) byId(id).disabled = size === 0;
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

  /** @param {AgentOrder[]} orders */
  async send(orders) {
    if (!orders.length) return;
    const { battle } = this;
    try {
      const response = await this.connection.request({ type: "give_orders", orders });
      if (battle !== this.battle) return;
      this.field.orders = response.orders;
      this.redraw();
    } catch (error) {
      this.failed(error);
    }
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
      /** @param {import("#view/battle.js").UnitState} state */
      const rank = (state) =>
        heals ? state.hp / field.type(state.unit).hp : Math.hypot(state.x - x, state.y - y);
      const others = heals
        ? field.agents.filter((other) => info.types[info.units[other.unit].type].attack !== "heal")
        : field.enemies;
      const best = others.reduce(
        (found, other) => (found && rank(found) <= rank(other) ? found : other),
        /** @type {import("#view/battle.js").UnitState | null} */ (null),
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

  toggle() {
    this.isSingle = false;
    super.toggle();
    byId("end").hidden = true;
  }

  /** @param {number} ticks */
  step(ticks) {
    if (this.isOver) return super.step(ticks);
    // A step that is still shown ends at once.
    this.clock.seek(this.clock.end);
    this.isSingle = this.clock.playing = true;
    this.fetch();
    this.redraw();
  }

  reveal() {
    this.field.hasFog = !this.field.hasFog;
    byId("reveal").setAttribute("aria-pressed", String(!this.field.hasFog));
    this.redraw();
  }

  async save() {
    if (!this.steps) return;
    try {
      const { name, replay } = await this.connection.request({ type: "get_replay" });
      download(name, bytesOf(replay), "application/octet-stream");
    } catch (error) {
      this.failed(error);
    }
  }

  /** Of the whole battle, if it has a limit.
   * @param {Track} track
   */
  stepsOf(track) {
    return (!this.isOver && this.info.episode_limit) || super.stepsOf(track);
  }

  showEnd() {
    this.isEndNew = false;
    const card = byId("end"),
      { living } = this.view.track,
      lost = living.map((counts) => counts[0] - counts[counts.length - 1]);
    const outcome = this.outcome ?? "truncated";
    card.className = `card ${outcome}`;
    card.querySelector("h2").textContent = RESULTS[outcome];
    card.querySelector("p").textContent =
      `Return ${this.episodeReturn.toFixed(2)} in ${this.steps} steps. ` +
      `You lost ${lost[0]} of ${living[0][0]} units, the enemies ${lost[1]} of ${living[1][0]}.`;
    card.hidden = false;
  }

  describe() {
    const { clock, outcome } = this;
    const isShown = this.isOver && !this.isEndNew;
    const state = isShown && outcome ? outcome : clock.playing ? "running" : "paused";
    const key = [this.battle, this.steps, state, this.field.selection.units.size].join();
    if (key === this.described) return;
    this.described = key;
    document.body.dataset.mode = isShown ? "review" : "battle";
    this.field.isOver = isShown;
    this.redraw(); // the timeline comes or goes
    const names = { ...RESULTS, running: "Running", paused: "Paused" };
    byId("result").textContent = names[state];
    byId("result").className = `badge ${state}`;
    byId("guide").hidden = this.steps > 0;
    byId("save").disabled = this.steps === 0;
    if (!isShown) byId("end").hidden = true;
    const facts = {
      against: titleCase(this.data.against),
      return: this.episodeReturn.toFixed(2),
      seed: this.seed,
      rules: this.data.rules,
    };
    byId("facts").replaceChildren(
      ...Object.entries(facts).map(([name, value]) =>
        make("div", {}, [make("dt", {}, name), make("dd", {}, value)]),
      ),
    );
  }

  listen() {
    super.listen();
    /** @type {{ [id: string]: () => void }} */
    const buttons = {
      again: () => this.again(),
      "end-again": () => this.again(),
      save: () => this.save(),
      "end-save": () => this.save(),
      "end-close": () => (byId("end").hidden = true),
      reveal: () => this.reveal(),
      all: () => this.selectAll(),
      attack: () => this.attack(),
      stop: () => this.give(() => ({ type: "stop" })),
    };
    for (const [id, act] of Object.entries(buttons)) byId(id).addEventListener("click", act);
  }

  /** @param {HTMLCanvasElement} canvas */
  listenToPointer(canvas) {
    new Controls(canvas, {
      tap: (at, how) => this.tap(at, how),
      draw: (box) => this.drawBox(box),
      box: (box, add) => {
        if (box) this.field.selection.take(this.field.agentsIn(box), add);
        this.drawBox(null);
        this.selected();
      },
      command: (at) => this.commandAt(at),
      move: (dx, dy) => {
        this.view.move(dx, dy);
        this.redraw();
      },
      zoom: (factor, at) => {
        this.view.zoom(factor, ...at);
        this.redraw();
      },
      hover: (at) => this.hover(...at),
      leave: () => this.hover(-1e6, -1e6),
    });
  }

  /** @param {import("./selection.js").Rectangle | null} box */
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

  /** @param {string} key */
  shortcut(key) {
    if (key === "a") this.selectAll();
    else if (key === "s") this.save();
    else return false;
    return true;
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
   */
  command(key, ticks) {
    /** @type {{ [key: string]: () => void }} */
    const commands = {
      n: () => this.again(),
      f: () => this.reveal(),
      ".": () => this.step(TICKS_PER_STEP),
    };
    if (!this.isOver) {
      for (const [arrow, [dx, dy]] of Object.entries(ARROWS)) commands[arrow] = () => this.moveBy(dx, dy);
      commands.a = () => this.attack();
      commands.s = () => this.give(() => ({ type: "stop" }));
      commands.Home = commands.End = () => {};
    }
    return commands[key] ?? super.command(key, ticks);
  }
}

theme.start();
new PlayPage(JSON.parse(byId("data").textContent)).start();
