// @ts-check
// The page of a person who plays: it gives orders and says when a step is played; the program plays it.

import { titleCase } from "#view/battle.js";
import { Commander } from "#view/commander.js";
import { byId, download, isTouch, make } from "#view/dom.js";
import { counted } from "#view/numbers.js";
import { RESULTS } from "#view/player.js";
import { theme } from "#view/theme.js";
import { Track, bytesOf } from "#view/track.js";
import { TICKS_PER_SECOND, TICKS_PER_STEP } from "#view/transport.js";
import { Connection, ConnectionLost, messageOf } from "../connection.js";

/** @import { AgentOrder, EpisodeResult } from "#view/data.d.ts" */
/** @import { GameInfo, PlayedSteps } from "../protocol.d.ts" */

/** Seconds before the end of a step is shown, when the next one is requested. */
const LEAD = 0.06;

const GUIDES = {
  mouse:
    "Drag a box around your units (blue). Right click where they go, or the enemy to attack. Space starts.",
  touch: "Tap a unit (blue), or drag a box. Then tap where it goes, or the enemy to attack. \u25b6 starts.",
};

class PlayPage extends Commander {
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
    this.connection = new Connection({
      open: () => this.begin(this.seed, this.played),
      close: () => this.say("The connection to smaclite-pool play is lost. Trying again."),
      refuse: (error) => this.say(error),
    });
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
    byId("guide").textContent = GUIDES[isTouch() ? "touch" : "mouse"];
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
      `Return ${this.episodeReturn.toFixed(2)} in ${counted(this.steps, "step")}. ` +
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
    };
    for (const [id, act] of Object.entries(buttons)) byId(id).addEventListener("click", act);
  }

  /** @param {string} key */
  shortcut(key) {
    if (key !== "s") return super.shortcut(key);
    this.save();
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
      f: () => this.reveal(),
      ".": () => this.step(TICKS_PER_STEP),
    };
    if (!this.isOver) commands.Home = commands.End = () => {};
    return commands[key] ?? super.command(key, ticks);
  }
}

theme.start();
new PlayPage(JSON.parse(byId("data").textContent)).start();
