// @ts-check
// The playground: battles that the engine plays in this page. A team plays the agents; who gives one an order
// takes it over, and the battle goes on from the step that is shown.

import { titleCase } from "#view/battle.js";
import { Commander } from "#view/commander.js";
import { byId, markEpisode, messageOf, showMessage } from "#view/dom.js";
import { everyFrame } from "#view/frames.js";
import { ObservationCard } from "#view/observation.js";
import { Track, bytesOf } from "#view/track.js";
import { TICKS_PER_SECOND, TICKS_PER_STEP } from "#view/transport.js";
import { ChoiceBar, DEFAULT_TEAM } from "./choices.js";
import { EngineLost } from "./engine.js";
import { EpisodeList } from "./episodes.js";
import { Headline } from "./headline.js";
import { Mover } from "./mover.js";
import { Painter } from "./painter.js";
import { PlaygroundView } from "./playground_view.js";
import { losesEnemies, save, share, sharedOf } from "./share.js";

/** @import { AgentOrder, EpisodeResult, Order, ScenarioInfo } from "#view/data.d.ts" */
/** @import { Engine } from "./engine.js" */
/** @import { SharedBattle } from "./link.js" */
/** @import { BegunBattle, Choices, PlayedSteps, Source } from "./protocol.d.ts" */

/** Seconds before the end of a step is shown, when the next one is played. */
const LEAD = 0.06;
/** Steps that are played between two pictures, if nobody waits for them. */
const AHEAD = 12;
/** Ticks by which the battle is played ahead of what is shown, so that one without an end fills no memory. */
const FARTHEST_AHEAD = 240 * TICKS_PER_STEP;
const NO_ENEMIES = "The team that played the enemies of the replay is not in it";

export class Playground extends Commander {
  /**
   * @param {Engine} engine
   * @param {Choices} choices
   * @param {Source} source
   * @param {string} team
   * @param {BegunBattle} begun
   */
  constructor(engine, choices, source, team, begun) {
    super(begun.scenario);
    this.engine = engine;
    /** What is carried out now, and how much waits for it. */
    this.queue = Promise.resolve();
    this.pending = 0;
    /** Whether what no agent sees is hidden until the end. */
    this.hasFog = false;
    /** @type {Set<string>} The teams that the page began with, which every such page has. */
    this.builtInTeams = new Set();
    /** @type {Map<number, Order[]>} The orders that held after a step. */
    this.ordersAfter = new Map();
    this.source = source;
    this.team = team;
    this.begun = begun;
    /** Counts battles. */
    this.serial = 0;
    /**
     * The last tick that was shown. What follows is played already, and not to be known before it is seen.
     */
    this.seen = 0;
    this.steps = 0;
    this.episodeReturn = 0;
    /** @type {EpisodeResult | null} */
    this.result = null;
    /** Whether the team goes on where the battle ends; not in a replay, until somebody plays. */
    this.goesOn = true;
    /** Whether nothing is played until the engine is back. */
    this.isWaiting = false;
    this.mover = new Mover(this);
    this.painter = new Painter(this);
    this.headline = new Headline();
    this.observation = new ObservationCard(
      byId("obs"),
      async (_, step, agent) => (await engine.request({ type: "get_observation", step, agent })).obs,
    );
    this.choices = new ChoiceBar(choices, (choice) => this.enqueue(() => this.choose(choice)));
    this.episodes = new EpisodeList((episode) => this.enqueue(() => this.openEpisode(episode)));
  }

  /**
   * Carries out what a person or the clock asks for, when all that was asked before is done: so it finds the
   * battle as that left it.
   * @param {() => Promise<unknown>} action
   */
  enqueue(action) {
    this.pending++;
    this.queue = this.queue
      .then(action)
      .then(
        () => {},
        (error) => this.fail(error),
      )
      .finally(() => this.pending--);
    return this.queue;
  }

  /** @param {ScenarioInfo} info */
  viewOf(info) {
    return new PlaygroundView(byId("battle"), info);
  }

  get arena() {
    return /** @type {PlaygroundView} */ (this.view);
  }

  /** The agents that the person has taken over. */
  get taken() {
    return this.arena.taken;
  }

  /** No orders are given while no agent is selected, or after the end. */
  get isOver() {
    return !this.field.selection.units.size || !this.takesOrders || this.isAtEnd;
  }

  get takesOrders() {
    return this.begun.is_playable;
  }

  /** Whether the end of the battle is shown. */
  get isAtEnd() {
    return this.result !== null && this.clock.time >= this.clock.end;
  }

  /** Whether the battle waits for a person at its end. */
  get isLive() {
    return this.taken.size > 0 && this.result === null;
  }

  /** What chart and timeline may show: of a recording all. */
  get knownUntil() {
    return this.source.kind === "scenario" ? Math.max(this.seen, this.clock.time) : Infinity;
  }

  /** Whether the team plays on by itself. */
  get isPlayedAhead() {
    return !this.taken.size && this.result === null && this.goesOn && this.begun.is_playable;
  }

  /** The actions of all steps, agent by agent. */
  get actions() {
    return this.view.track.decisions.flatMap((step) => step.map(({ action }) => action));
  }

  /**
   * Shows the battle with which the page begins.
   * @param {number[]} taken
   */
  start(taken) {
    this.listen();
    this.accept(this.begun, taken);
    everyFrame((now) => this.frame(now));
    document.documentElement.dataset.ready = "";
  }

  /**
   * Begins another battle after actions (`null`: those recorded). If it is refused, nothing changes.
   * @param {Source} source
   * @param {string} team
   * @param {number[] | null} [actions]
   * @param {number[]} [taken]
   */
  async begin(source, team, actions = [], taken = []) {
    const begun = await this.engine.request({ type: "begin_battle", of: source, team, actions, taken });
    Object.assign(this, { source, team, goesOn: source.kind === "scenario", isWaiting: false });
    this.accept(begun, taken);
    byId("message").hidden = byId("note").hidden = true;
    this.warn();
  }

  /**
   * Begins a battle of a scenario.
   * @param {Omit<SharedBattle, "actions" | "taken">} battle
   * @param {Iterable<number>} taken
   */
  beginScenario({ team, ...battle }, taken) {
    return this.begin({ kind: "scenario", ...battle }, team, [], [...taken]);
  }

  /**
   * Shows a battle that has begun, from its start.
   * @param {BegunBattle} begun
   * @param {number[]} taken
   */
  accept(begun, taken) {
    const isOther = JSON.stringify(begun.scenario) !== JSON.stringify(this.begun.scenario);
    this.begun = begun;
    this.ordersAfter.clear();
    const { wholeMap } = this.view;
    if (isOther) this.use(begun.scenario);
    this.arena.hasFog = this.hasFog;
    this.view.wholeMap = wholeMap;
    this.field.selection.clear();
    this.restart(taken);
    this.clock.playing = false;
    this.choices.show(this.shared);
  }

  /**
   * Shows the begun battle as far as it was played.
   * @param {Iterable<number>} taken
   */
  restart(taken) {
    this.serial++;
    this.seen = 0;
    this.result = null;
    this.arena.taken = new Set(taken);
    const track = new Track(this.begun.scenario);
    track.firstStep = this.begun.first_step;
    this.show(track);
    this.append(this.begun.played);
    this.view.area = this.taken.size ? this.startArea() : null;
    this.selected();
  }

  /** The battle without its actions, for links and choices. */
  get shared() {
    return sharedOf(this);
  }

  /** @param {PlayedSteps} played */
  append(played) {
    const { step, steps, n_moments, moments, decisions } = played;
    const { track } = this.view;
    track.serial = this.serial;
    track.append(bytesOf(moments), n_moments);
    track.appendDecisions(bytesOf(decisions));
    this.steps = step + steps;
    this.episodeReturn = played.return;
    this.result = played.result;
    this.holdOrders(played.orders);
    this.clock.end = track.last;
    this.clock.isOpen = this.isLive || this.isPlayedAhead;
    // The map shows wherever the team will go, unless a person has moved it.
    if (!this.taken.size && this.view.isFitted) this.view.camera = null;
    this.redraw();
  }

  /**
   * The orders that hold after the last step.
   * @param {Order[]} orders
   */
  holdOrders(orders) {
    this.field.orders = orders;
    this.ordersAfter.set(this.steps, orders);
  }

  /**
   * Of the whole battle, if it has a limit and is not played ahead.
   * @param {Track} track
   */
  stepsOf(track) {
    return (this.isLive && this.info.episode_limit) || super.stepsOf(track);
  }

  /** @param {number} steps */
  async play(steps) {
    try {
      this.append(await this.engine.request({ type: "play_steps", steps }));
    } catch (error) {
      if (error instanceof EngineLost) this.isWaiting = true;
      else this.goesOn = false;
      this.fail(error);
    }
  }

  /**
   * Begins a battle; false if it is refused.
   * @param {Omit<SharedBattle, "actions" | "taken">} choice
   */
  async choose(choice) {
    const isSame = choice.scenario === this.shared.scenario,
      hadAll = this.taken.size === this.info.n_agents,
      hasOthers = losesEnemies(this.begun, choice);
    try {
      await this.beginScenario(choice, isSame ? this.taken : []);
      this.episodes.clear();
      if (hasOthers) this.note(`${NO_ENEMIES}; ${titleCase(this.begun.opponent)} plays them here.`);
      // Who plays all agents plays all of another map.
      if (hadAll && !isSame) await this.take(Array.from({ length: this.info.n_agents }, (_, agent) => agent));
      return true;
    } catch (error) {
      this.fail(error);
      this.choices.show(this.shared);
      return false;
    }
  }

  noteNoEnemies() {
    this.note(`${NO_ENEMIES}: choose an opponent for a new battle, or another seed.`);
  }

  /** @param {Parameters<Commander["give"]>[0]} orderOf */
  give(orderOf) {
    if (this.takesOrders) super.give(orderOf);
    else if (this.field.selection.units.size) this.noteNoEnemies();
  }

  /** A new battle, in which the person has the same agents. */
  again() {
    this.enqueue(async () => {
      if (!this.takesOrders) return this.noteNoEnemies();
      const seed = String(BigInt.asUintN(64, BigInt(this.begun.seed) + 1n));
      await this.beginScenario({ ...this.shared, seed }, this.taken);
      this.episodes.clear();
    });
  }

  /** Begins the battle again in an engine that does not know it, and shows what was shown. */
  resume() {
    this.enqueue(async () => {
      const { time } = this.clock,
        { source, team, goesOn } = this,
        orders = this.ordersAfter.get(this.steps) ?? [];
      // The page does not know what played the enemies of a replay that is only shown.
      const actions = this.begun.is_playable ? this.actions : null;
      await this.begin(source, team, actions, [...this.taken]);
      this.goesOn = goesOn;
      await this.giveAgain(orders);
      this.seek(time);
    });
  }

  /**
   * Gives agents orders, and takes them over. What followed the shown step is forgotten.
   * @param {AgentOrder[]} orders
   */
  send(orders) {
    if (!orders.length) return;
    byId("note").hidden = true;
    this.enqueue(async () => {
      await this.cut();
      await this.take([...this.taken, ...orders.map(({ agent }) => agent)]);
      this.holdOrders((await this.engine.request({ type: "give_orders", orders })).orders);
      this.redraw();
    });
  }

  /**
   * Gives the orders that held, in a battle that was begun again.
   * @param {Order[]} held
   */
  async giveAgain(held) {
    const all = held.map((order, agent) => ({ agent, order })),
      orders = all.filter(({ agent, order }) => this.taken.has(agent) && order.type !== "none");
    if (orders.length) this.holdOrders((await this.engine.request({ type: "give_orders", orders })).orders);
  }

  handlers() {
    const own = super.handlers();
    return { ...own, ...(this.painter.isOn ? this.painter.handlers() : this.mover.handlers(own)) };
  }

  /** Whether the scenario can be changed: before the first step, if it is no episode of a replay. */
  get isAtStart() {
    return this.source.kind === "scenario" && !this.clock.playing && this.clock.time === 0;
  }

  /**
   * Begins the battle anew with another text of its scenario; says whether that was possible.
   * @param {() => Promise<string>} changed
   */
  async change(changed) {
    const { camera, isFitted } = this.view;
    try {
      await this.beginScenario({ ...this.shared, scenario: await changed() }, this.taken);
      if (!isFitted) Object.assign(this.view, { camera, isFitted });
      return true;
    } catch (error) {
      this.fail(error);
      return false;
    }
  }

  /** Ends the battle after the step that is shown. */
  async cut() {
    const step = Math.ceil(this.clock.time / TICKS_PER_STEP);
    this.goesOn = true;
    if (step >= this.steps) return;
    const { source, team, clock, view } = this,
      { camera, isFitted } = view,
      actions = this.actions.slice(0, step * this.info.n_agents),
      taken = [...this.taken],
      orders = this.ordersAfter.get(step) ?? [];
    for (const later of [...this.ordersAfter.keys()]) if (later > step) this.ordersAfter.delete(later);
    this.begun = await this.engine.request({ type: "begin_battle", of: source, team, actions, taken });
    const selected = [...this.field.selection.units],
      { time } = clock;
    this.restart(taken);
    Object.assign(this.view, { camera, isFitted });
    this.field.selection.take(selected, false);
    clock.seek(time);
    await this.giveAgain(orders);
  }

  /** @param {number[]} agents */
  async take(agents) {
    const taken = [...new Set(agents)];
    await this.engine.request({ type: "take_agents", agents: taken });
    this.arena.taken = new Set(taken);
    this.clock.isOpen = this.isLive || this.isPlayedAhead;
    this.selected();
  }

  /** Lets the team play the selected agents again; if none is selected, all. */
  release() {
    const selected = new Set([...this.field.selection.units].map((unit) => this.info.units[unit].id));
    this.enqueue(async () => {
      if (!this.taken.size) return;
      await this.cut();
      await this.take([...this.taken].filter((agent) => selected.size > 0 && !selected.has(agent)));
    });
  }

  /** @param {number} [enemy] */
  selected(enemy) {
    super.selected(enemy);
    byId("release").disabled = !this.taken.size;
  }

  /** @param {number} ticks */
  step(ticks) {
    if (ticks <= 1 || !this.isLive) return super.step(ticks);
    this.enqueue(async () => {
      if (this.isLive && this.clock.time >= this.clock.end) await this.play(1);
      super.step(ticks);
    });
  }

  reveal(hasFog = !this.hasFog) {
    this.hasFog = this.arena.hasFog = hasFog;
    byId("reveal").setAttribute("aria-pressed", String(!hasFog));
    this.redraw();
  }

  /** @param {number} now */
  frame(now) {
    super.frame(now);
    this.seen = Math.max(this.seen, this.clock.time);
    const { clock } = this,
      left = (clock.end - clock.time) / (TICKS_PER_SECOND * clock.speed);
    const isFarAhead = clock.end - clock.time > FARTHEST_AHEAD;
    if (!this.pending && !this.isWaiting) {
      if (this.isPlayedAhead && !isFarAhead) this.enqueue(() => this.play(AHEAD));
      else if (this.isLive && this.goesOn && clock.playing && left < LEAD) this.enqueue(() => this.play(1));
    }
    if (this.field.isOver !== this.isAtEnd) {
      this.field.isOver = this.isAtEnd; // then the fog lifts
      this.redraw();
    }
    this.forget();
    const step = Math.floor(clock.time / TICKS_PER_STEP);
    const { selected: unit, track } = this.view,
      shown = { info: this.info, unit, episode: this.serial, step, firstStep: track.firstStep };
    this.painter.update();
    this.observation.update(shown, this.begun.features, step <= this.steps);
    this.headline.update(this);
  }

  /**
   * @param {string} name
   * @param {Uint8Array<ArrayBuffer>} bytes
   */
  async openReplay(name, bytes) {
    const verified = await this.episodes.read(this.engine, name, bytes);
    await this.openEpisode(0);
    this.note(verified);
  }

  /** @param {number} episode */
  async openEpisode(episode) {
    await this.begin({ kind: "episode", episode }, DEFAULT_TEAM, null);
    markEpisode(episode);
  }

  /** @param {string} text */
  note(text) {
    byId("note").textContent = text;
    byId("note").hidden = false;
  }

  /** Says what is probably a mistake in the scenario, as `check` does. */
  warn() {
    const [first, ...others] = this.begun.warnings;
    if (first) this.note(`Warning${others.length ? ` 1 of ${others.length + 1}` : ""}: ${first}`);
  }

  /** @param {unknown} error */
  fail(error) {
    this.clock.playing = false;
    showMessage(messageOf(error));
    this.redraw();
  }

  listen() {
    super.listen();
    this.painter.listen();
    byId("again").addEventListener("click", () => this.again());
    byId("share").addEventListener("click", () => share(this));
    byId("save").addEventListener("click", () => save(this));
    byId("reveal").addEventListener("click", () => this.reveal());
    byId("release").addEventListener("click", () => this.release());
    byId("battle").addEventListener("pointerdown", () => (byId("note").hidden = true));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    // What is chosen or typed is no command.
    const { target } = event,
      isOfSlider = target instanceof HTMLInputElement && target.type === "range";
    if (isOfSlider && event.key.startsWith("Arrow")) return; // the slider moves by itself
    const isChoice = target instanceof HTMLElement && target.closest("#choices");
    // The editor, which shows this page in a frame, sees nothing else of one from a folder.
    if (event.key === "Escape" && this.isIdle && parent !== window) parent.postMessage("leave", "*");
    if (!isChoice && !this.painter.key(event)) super.key(event);
  }

  /** Whether there is nothing that a key could end. */
  get isIdle() {
    const isSelected = this.field.selection.units.size > 0 || this.view.selected >= 0;
    return !isSelected && !this.painter.isOn && !byId("keys").open;
  }

  /** @param {string} key */
  shortcut(key) {
    if (key !== "s") return super.shortcut(key);
    save(this);
    return true;
  }

  /**
   * @param {string} key
   * @param {number} ticks
   */
  command(key, ticks) {
    /** @type {{ [key: string]: () => void }} */
    const commands = {
      n: () => this.again(),
      r: () => this.release(),
      f: () => this.reveal(),
      ".": () => this.step(TICKS_PER_STEP),
    };
    return commands[key] ?? super.command(key, ticks);
  }
}
