// @ts-check
// The page of a running pool: the grid of a lane's battles with its panel, or one battle that is followed.

import { THEMES, readAddress } from "#view/address.js";
import { byId, make, messageOf, pairsOf, say } from "#view/dom.js";
import { everyFrame } from "#view/frames.js";
import { counted } from "#view/numbers.js";
import { askedTheme, theme } from "#view/theme.js";
import { Connection, ConnectionLost } from "../connection.js";
import { FollowPlayer, seconds } from "./follow.js";
import { Grid, MOST_CELLS } from "./grid.js";
import { LanePanel, compact } from "./plots.js";

/** @import { LaneInfo, LaneState, PageRequest, PoolState } from "../protocol.d.ts" */

/** @param {string} address */
const laneOf = (address) => new URLSearchParams(address).get("lane");

const NO_STATES =
  "The frames of this lane have no states: the field `state` is left out. Click a battle to follow it.";

class WatchPage {
  /** @param {{ pool: string, lane: string }} data */
  constructor(data) {
    /** What the address says, until its lane is shown. */
    this.address = location.hash.slice(1);
    /** Why the last address cannot be followed, until a person goes on. */
    this.ignored = "";
    this.lane = laneOf(this.address) ?? data.lane;
    this.env = -1;
    /** @type {FollowPlayer | null} */
    this.player = null;
    /** @type {LaneInfo | null} The lane that is shown, once it is connected. */
    this.info = null;
    this.visible = [0, 0];
    this.panel = new LanePanel(byId("panel"));
    this.grid = new Grid(
      byId("grid"),
      (env) => this.follow(env),
      (first, count) => this.setView(first, count),
    );
    this.pool = byId("name").textContent = data.pool;
    byId("edit").href = `edit/${location.search}`; // with the token
    this.listen();
    this.connection = new Connection({
      open: () => this.open(),
      close: () => this.lost(),
      refuse: (error) => this.state("Refused", "lost", `${error}.`),
      lost: (event) => this.lost(event.error),
      lane: (event) => this.showLane(event),
      grid: (event) => this.grid.take(event.cells, performance.now()),
      status: (event) => this.showStatus(event),
      episodes: (event) => this.player?.take(event.episodes),
    });
  }

  start() {
    everyFrame((now) => {
      if (this.env < 0) {
        this.grid.frame(now);
        this.panel.draw();
      } else if (this.player) {
        this.player.frame(now);
      }
    });
  }

  /**
   * Sends a request whose response says nothing.
   * @param {PageRequest} request
   */
  send(request) {
    this.connection.request(request).catch((error) => this.failed(error));
  }

  /**
   * A request was refused; if the connection is lost, the page already says so.
   * @param {unknown} error
   */
  failed(error) {
    if (!(error instanceof ConnectionLost)) console.warn(messageOf(error));
  }

  open() {
    this.panel.clear();
    this.send({ type: "select_lane", name: this.lane });
    this.sendView();
  }

  /**
   * The pool is gone, or with no error the program that serves this page.
   * @param {string} [error]
   */
  lost(error) {
    this.state(
      error ? "Pool gone" : "Disconnected",
      "lost",
      error
        ? `${error}. This page goes on when the pool runs again.`
        : "The connection to smaclite-pool watch is lost. Trying again.",
    );
  }

  /**
   * @param {string} text
   * @param {string} kind
   */
  state(text, kind, why = "") {
    const notice = [this.ignored, why].filter(Boolean).join(" ");
    byId("state").textContent = text;
    byId("state").className = `badge ${kind}`;
    if (byId("notice").textContent !== notice) byId("notice").textContent = notice;
    byId("notice").hidden = !notice;
  }

  /**
   * @param {string} name
   * @param {string} [address] what is shown of it
   */
  chooseLane(name, address = "") {
    this.lane = name;
    this.overview();
    this.address = address;
    this.panel.clear();
    this.grid.clear();
    this.send({ type: "select_lane", name });
    this.remember();
  }

  /**
   * The lane is connected, at first or again.
   * @param {LaneInfo} event
   */
  showLane(event) {
    this.info = event;
    const player = this.playerOf(event);
    player.features = event.features;
    byId("lane-facts").textContent =
      `${counted(event.num_envs, "battle")} of ${event.scenario.name}, ${event.rules} rules`;
    const notice = event.no_grid ?? (event.has_state ? "" : NO_STATES);
    byId("grid-notice").textContent = notice;
    byId("grid-notice").hidden = !notice;
    const keys = { lane: [event.lane], env: event.num_envs, theme: THEMES },
      { said, problem } = readAddress(this.address, keys);
    this.address = "";
    if (problem) this.ignored = `The address cannot be followed: ${problem}.`;
    const env = this.env >= 0 ? this.env : Number(said.get("env") ?? -1),
      isEnv = env >= 0 && env < event.num_envs;
    this.showCells(event, isEnv ? env : Math.min(this.grid.first, event.num_envs - 1));
    if (isEnv) this.follow(env);
    else this.overview();
    document.documentElement.dataset.ready = "";
  }

  /**
   * The player, with the scenario of a lane.
   * @param {LaneInfo} lane
   */
  playerOf({ scenario }) {
    if (this.player) this.player.use(scenario);
    else {
      this.player = new FollowPlayer(scenario, (request) => this.connection.request(request));
      this.player.listen();
    }
    return this.player;
  }

  /**
   * Shows the page of cells that has an environment.
   * @param {LaneInfo} lane
   * @param {number} env
   */
  showCells({ num_envs, scenario }, env) {
    const first = Math.floor(env / MOST_CELLS) * MOST_CELLS;
    this.grid.show(scenario, num_envs, first);
    byId("pager").hidden = num_envs <= MOST_CELLS;
    byId("range").textContent = `battles ${first} to ${first + this.grid.cells.length - 1} of ${num_envs}`;
    byId("previous").disabled = first === 0;
    byId("next").disabled = first + MOST_CELLS >= num_envs;
  }

  /** @param {number} direction */
  turn(direction) {
    const first = this.grid.first + direction * MOST_CELLS;
    if (this.info && first >= 0 && first < this.info.num_envs) this.showCells(this.info, first);
  }

  /** @param {number} env */
  follow(env) {
    this.env = env;
    document.body.dataset.mode = "battle";
    byId("name").textContent = `Battle ${env}`;
    this.player?.begin(env, this.grid.area);
    this.connection.request({ type: "follow", env }).catch((error) => {
      say(`Battle ${env} cannot be followed: ${error.message}`);
    });
    this.sendView();
    this.remember();
  }

  /** Back to the grid. */
  overview() {
    if (this.env >= 0) this.send({ type: "unfollow" });
    const cell = this.grid.cells[this.env - this.grid.first];
    this.env = -1;
    this.player?.stop();
    document.body.dataset.mode = "grid";
    document.body.classList.remove("playing");
    byId("name").textContent = this.pool;
    this.sendView();
    this.remember();
    this.grid.redraw();
    this.panel.isDrawn = false;
    cell?.button.focus();
  }

  remember() {
    const hash = new URLSearchParams({ lane: this.lane });
    if (this.env >= 0) hash.set("env", String(this.env));
    const asked = askedTheme();
    if (asked) hash.set("theme", asked);
    history.replaceState(null, "", `#${hash}`);
  }

  /**
   * @param {number} first
   * @param {number} count
   */
  setView(first, count) {
    this.visible = [first, count];
    this.sendView();
  }

  /** Says what is visible; the program sends nothing else. */
  sendView() {
    if (!this.connection?.isOpen) return;
    const [first, count] = this.env < 0 ? this.visible : [0, 0];
    this.send({ type: "set_view", first, count, visible: !document.hidden });
  }

  /** @param {PoolState} event */
  showStatus(event) {
    this.panel.take(event.points);
    if ("error" in event) return this.lost(event.error);
    const { lane, lanes, pid, threads, uptime_s } = event.pool;
    this.listLanes(lanes);
    if (!lane) return this.lacks(lanes);
    this.showFacts(lane, { pid, threads, uptime_s });
    const { failure, learner_pid } = lane;
    if (failure) this.state("Failed", "lost", `The lane failed: ${failure}`);
    else if (!learner_pid) this.state("No learner", "idle", "No learner is attached, so nothing moves.");
    else if (lane.steps_per_s === 0) {
      const idle = `The learner, process ${learner_pid}, made no step in the last second.`;
      this.state("Idle", "idle", idle);
    } else this.state("Live", "won");
  }

  /**
   * The pool does not have the lane: it was started again with others, or the address names none of it. Then
   * its only one is shown, or a person chooses.
   * @param {string[]} lanes
   */
  lacks(lanes) {
    if (lanes.includes(this.lane)) return; // a status from before the lane was chosen
    if (lanes.length === 1) return this.chooseLane(lanes[0], this.address);
    if (document.body.dataset.mode !== "grid") this.overview();
    this.grid.clear();
    this.panel.clear();
    for (const id of ["lane-facts", "lane-status"]) byId(id).textContent = "";
    const names = lanes.map((name) => `\`${name}\``).join(", ");
    this.state("No lane", "lost", `The pool has no lane \`${this.lane}\`: choose one of ${names}.`);
    document.documentElement.dataset.ready = "";
  }

  /**
   * @param {LaneState} lane
   * @param {{ pid: number, threads: number, uptime_s: number }} pool
   */
  showFacts(lane, { pid, threads, uptime_s }) {
    const facts = {
      learner: lane.learner_pid ? `process ${lane.learner_pid}` : "none",
      supervisor: `process ${pid}, ${counted(threads, "thread")}`,
      "running for": seconds(uptime_s),
      steps: compact(lane.stats.steps),
      episodes: compact(lane.stats.episodes),
      spectators: lane.spectators,
      "refused requests": lane.stats.rejected,
      "queue wait": `${lane.queue_wait_us.toFixed(0)} \u00b5s`,
    };
    byId("lane-status").replaceChildren(...pairsOf(Object.entries(facts)));
  }

  /** @param {string[]} names */
  listLanes(names) {
    /** @type {HTMLSelectElement} */
    const select = byId("lane");
    select.hidden = names.length < 2;
    if ([...select.options].map((option) => option.value).join() !== names.join())
      select.replaceChildren(...names.map((name) => make("option", { value: name }, name)));
    if (select.value !== this.lane) select.value = this.lane;
  }

  listen() {
    byId("back").addEventListener("click", () => this.overview());
    byId("newest").addEventListener("click", () => this.player?.newest());
    byId("branch").addEventListener("click", () => this.player?.branch());
    byId("previous").addEventListener("click", () => this.turn(-1));
    byId("next").addEventListener("click", () => this.turn(1));
    byId("lane").addEventListener("change", () => this.chooseLane(byId("lane").value));
    document.addEventListener("visibilitychange", () => this.sendView());
    for (const event of ["pointerdown", "keydown"]) addEventListener(event, () => (this.ignored = ""));
    addEventListener("hashchange", () => {
      const address = location.hash.slice(1);
      this.ignored = "";
      this.chooseLane(laneOf(address) ?? this.lane, address);
    });
    addEventListener("keydown", (event) => this.key(event), { capture: true });
  }

  /**
   * Keys that concern the page; the others go to the player.
   * @param {KeyboardEvent} event
   */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || byId("keys").open) return;
    if (event.target instanceof HTMLSelectElement) return event.stopImmediatePropagation();
    /** @type {{ [key: string]: (() => void) | undefined }} */
    const grid = {
      ArrowLeft: () => this.grid.focus(-1, 0),
      ArrowRight: () => this.grid.focus(1, 0),
      ArrowUp: () => this.grid.focus(0, -1),
      ArrowDown: () => this.grid.focus(0, 1),
      PageUp: () => this.turn(-1),
      PageDown: () => this.turn(1),
      t: () => theme.toggle(),
      "?": () => byId("keys").showModal(),
    };
    /** @type {{ [key: string]: (() => void) | undefined }} */
    const battle = { g: () => this.overview() };
    if (this.player && this.player.view.selected < 0) battle.Escape = battle.g;
    const command = (this.env < 0 ? grid : battle)[event.key];
    if (command) {
      event.preventDefault();
      command();
    }
    if (command || this.env < 0) event.stopImmediatePropagation();
  }
}

theme.start();
new WatchPage(JSON.parse(byId("data").textContent)).start();
