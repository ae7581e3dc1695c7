// @ts-check
// FollowPlayer: plays the episodes of one environment, tick by tick, as its log grows.

import { titleCase } from "#view/battle.js";
import { byId, download, episodeRow, messageOf, say, showFacts } from "#view/dom.js";
import { clamp, counted } from "#view/numbers.js";
import { ObservationCard } from "#view/observation.js";
import { BattlePlayer, RESULTS } from "#view/player.js";
import { Track, bytesOf } from "#view/track.js";
import { TICKS_PER_STEP } from "#view/transport.js";
import { ConnectionLost } from "../connection.js";

/** @import { Box } from "#view/camera.js" */
/** @import { EpisodeResult, Features, ScenarioInfo } from "#view/data.d.ts" */
/** @import { EpisodeInfo, Steps } from "../protocol.d.ts" */
/** @typedef {import("../connection.js").Connection["request"]} Request */
/**
 * What is known of an episode.
 * @typedef {{ track: Track, steps: number, isOver: boolean, result: EpisodeResult | null,
 *   episodeReturn: number, length: number }} Entry
 */

/** Ticks that are fetched ahead of the clock. */
const AHEAD = 1024;
/** Decoded episodes that are kept. */
const MOST_TRACKS = 24;
/** Milliseconds for which the end of an episode is shown before the newest one begins. */
const PAUSE_AT_END = 900;
/** Milliseconds to wait for an episode's start, if only the rest of one is known. */
const WAIT_FOR_START = 1500;
/** An episode that is shown no later than this many seconds is live. */
const LIVE_WITHIN = 2;

export class FollowPlayer extends BattlePlayer {
  /**
   * @param {ScenarioInfo} info
   * @param {Request} request
   */
  constructor(info, request) {
    super(info);
    this.request = request;
    /** The names of the features of an observation. */
    this.features = /** @type {Features[]} */ ([]);
    this.clock.isOpen = true;
    this.isFetching = false;
    this.observation = new ObservationCard(byId("obs"), async (number, step, agent) => {
      const { obs } = await request({ type: "get_observation", number, step, agent });
      return obs;
    });
    this.env = -1;
    /** @type {EpisodeInfo[]} The newest first. */
    this.listed = [];
    this.began = this.received = 0;
    /** @type {Map<number, Entry>} By the number of the episode. */
    this.tracks = new Map();
    /** @type {Map<number, HTMLElement> | null} The rows of the list. */
    this.rows = null;
    /** The number of the shown episode. */
    this.number = -1;
    /** Whether the last request of steps brought none; the next list of episodes allows another one. */
    this.isStalled = false;
    /** When the end of the shown episode was reached; 0 if it was not. */
    this.endedAt = 0;
    /** What `describe` showed last. */
    this.described = "";
  }

  /** Forgets the environment. */
  stop() {
    this.env = this.number = -1;
    this.listed = [];
    this.received = 0;
    this.tracks = new Map();
    this.rows = null;
    this.isStalled = false;
    this.endedAt = 0;
    this.clock.playing = false;
  }

  /**
   * Shows an environment, and at least these squares.
   * @param {number} env
   * @param {Box | null} area
   */
  begin(env, area) {
    this.stop();
    this.view.area = area;
    this.env = env;
    this.began = performance.now();
    this.view.track = this.chart.track = new Track(this.info);
    this.inspector.forget();
    this.observation.forget();
    this.clock.playing = true;
    byId("result").textContent = "Waiting";
    byId("result").className = "badge";
    showFacts({});
    byId("episode-list").replaceChildren();
    say("");
  }

  /**
   * Takes the list of episodes, the newest first.
   * @param {EpisodeInfo[]} episodes
   */
  take(episodes) {
    if (this.env < 0) return;
    this.listed = episodes;
    this.received = performance.now();
    this.isStalled = false;
    const isWhole = episodes[0]?.first_step === 0,
      waits = performance.now() - this.began < WAIT_FOR_START;
    if (this.number < 0 && episodes.length && (isWhole || !waits)) this.newest();
    this.listEpisodes();
    this.fetch();
  }

  get known() {
    return this.listed.find((episode) => episode.number === this.number);
  }

  get isNewest() {
    return this.listed.length > 0 && this.listed[0].number === this.number;
  }

  /** Plays the newest episode, or what is newest of it. */
  newest() {
    if (!this.listed.length) return;
    this.clock.playing = true;
    if (!this.isNewest) this.open(this.listed[0].number);
    else this.clock.seek(this.clock.end);
    this.redraw();
  }

  /** @param {number} number */
  open(number) {
    if (number === this.number) return;
    this.number = number;
    this.endedAt = 0;
    this.isStalled = false;
    this.show(this.entryOf(number).track);
    this.listEpisodes();
    this.fetch();
  }

  /**
   * What is known of an episode, which is little if it was not shown before.
   * @param {number} number
   * @returns {Entry}
   */
  entryOf(number) {
    const known = this.tracks.get(number);
    if (known) return known;
    const entry = {
      track: this.newTrack(number, this.listed.find((one) => one.number === number)?.first_step ?? 0),
      steps: 0,
      isOver: false,
      result: null,
      episodeReturn: 0,
      length: 0,
    };
    this.tracks.set(number, entry);
    const [oldest] = this.tracks.keys();
    if (this.tracks.size > MOST_TRACKS) this.tracks.delete(oldest);
    return entry;
  }

  /**
   * @param {number} serial
   * @param {number} firstStep
   */
  newTrack(serial, firstStep) {
    return Object.assign(new Track(this.info), { serial, firstStep });
  }

  /** @param {number} direction */
  openNext(direction) {
    const at = this.listed.findIndex((episode) => episode.number === this.number);
    const next = this.listed[at - direction];
    if (next) this.open(next.number);
  }

  /** What is known of the shown episode. */
  get entry() {
    return this.tracks.get(this.number);
  }

  /** Fetches steps of the shown episode until enough are there. One request at a time. */
  async fetch() {
    if (this.isFetching) return;
    this.isFetching = true;
    while (this.needsMore()) {
      const { entry, number } = this;
      if (!entry) break;
      try {
        this.append(entry, await this.request({ type: "get_steps", number, step: entry.steps }));
      } catch (error) {
        if (entry === this.entry) this.failed(error);
      }
    }
    this.isFetching = false;
  }

  needsMore() {
    const { entry, known, clock } = this;
    if (this.isStalled || !entry || !known || entry.isOver) return false;
    return !entry.track.length || (entry.steps < known.steps && entry.track.last <= clock.time + AHEAD);
  }

  /**
   * Without this a request that fails at once would be repeated without end, and block the page.
   * @param {unknown} error
   */
  failed(error) {
    this.isStalled = true;
    if (error instanceof ConnectionLost) return; // the page says so
    // An episode that the program has forgotten; the list says which ones there are.
    if (!this.isNewest) return this.newest();
    say(`Steps of this episode cannot be read: ${messageOf(error)}`);
  }

  /**
   * @param {Entry} entry
   * @param {Steps} response
   */
  append(entry, response) {
    say("");
    this.isStalled = response.steps === 0 && (response.n_moments === 0 || entry.track.length > 0);
    if (response.step !== entry.steps || this.tracks.get(response.number) !== entry) return;
    // The start comes with the first steps; while there are none it comes alone, and then again with them.
    if (response.step === 0 && entry.track.length) this.replaceTrack(entry);
    const { track } = entry;
    if (response.n_moments) track.append(bytesOf(response.moments), response.n_moments);
    track.appendDecisions(bytesOf(response.decisions));
    entry.steps += response.steps;
    Object.assign(entry, {
      isOver: response.is_over,
      result: response.result,
      episodeReturn: response.return,
      length: response.length,
    });
    if (response.number !== this.number) return;
    this.clock.end = track.last;
    // A view that the mouse has not changed follows the units.
    if (this.view.isFitted) this.view.camera = null;
    this.listEpisodes();
    this.redraw();
  }

  /**
   * Begins the track of an episode anew.
   * @param {Entry} entry
   */
  replaceTrack(entry) {
    const { serial, firstStep } = entry.track;
    entry.track = this.newTrack(serial, firstStep);
    if (entry === this.entry) this.view.track = this.chart.track = entry.track;
  }

  /** @param {number} tick */
  seek(tick) {
    this.endedAt = 0;
    super.seek(tick);
    this.fetch();
  }

  /** @param {number} now */
  frame(now) {
    const time = this.clock.time;
    super.frame(now);
    this.showObservation(Math.floor(this.clock.time / TICKS_PER_STEP));
    if (this.clock.time !== time) this.fetch();
    this.describe();
    const entry = this.tracks.get(this.number);
    if (!entry || !this.clock.playing || this.clock.time < this.clock.end) {
      this.endedAt = 0;
      return;
    }
    // An episode that was reset before its end has a newer one after it, and gets no more steps.
    const isComplete = entry.isOver || (!this.isNewest && entry.steps >= (this.known?.steps ?? 0));
    if (!isComplete || this.isNewest) return;
    this.endedAt ||= now;
    if (now - this.endedAt > PAUSE_AT_END) this.newest();
  }

  /** @param {number} step */
  showObservation(step) {
    const { info, view, number, entry } = this,
      isKnown = entry !== undefined && step <= entry.steps;
    const { firstStep } = view.track,
      shown = { info, unit: view.selected, episode: number, step, firstStep };
    this.observation.update(shown, this.features, isKnown);
  }

  /** Seconds since the shown moment happened. */
  get age() {
    const { known, clock } = this;
    if (!known) return 0;
    const part = known.steps ? clamp(clock.time / TICKS_PER_STEP / known.steps) : 1;
    const since = (performance.now() - this.received) / 1000;
    return known.newest_s + (known.began_s - known.newest_s) * (1 - part) + since;
  }

  describe() {
    const entry = this.tracks.get(this.number);
    if (!entry) return;
    const result = entry.isOver ? entry.result : null;
    const isLive = this.isNewest && !entry.isOver && this.clock.time >= this.clock.end - LIVE_WITHIN * 16;
    const waits = isLive && this.age > LIVE_WITHIN;
    const age = waits
      ? `waiting for the learner, ${seconds(this.age)}`
      : isLive
        ? "live"
        : `${seconds(this.age)} ago`;
    const first = this.known?.first_step;
    const key = [this.number, result ?? "", age, first, entry.episodeReturn, entry.length].join();
    if (key === this.described) return;
    this.described = key;
    byId("result").textContent = result ? RESULTS[result] : "Running";
    byId("result").className = `badge ${result ?? "running"}`;
    byId("age").textContent = age;
    byId("age").className = isLive && !waits ? "live" : "";
    const facts = {
      episode: first ? `${this.number}, from step ${first}` : this.number,
      return: entry.isOver ? entry.episodeReturn.toFixed(2) : `${entry.episodeReturn.toFixed(2)} so far`,
      steps: entry.length,
    };
    showFacts(facts);
  }

  listEpisodes() {
    /** @param {EpisodeInfo} episode */
    const row = ({ number, steps, first_step, is_over, result: ended, newest_s }) => {
      // One that was reset before its end has a newer one after it.
      const isRunning = !is_over && number === this.listed[0].number,
        known = ended ?? this.tracks.get(number)?.result ?? (is_over || isRunning ? null : "unfinished"),
        result = known ?? (is_over ? "over" : "running");
      const cells = [
        String(number),
        known ? RESULTS[known] : titleCase(result),
        counted(first_step + steps, "step"),
      ];
      cells.push(isRunning ? "now" : `${seconds(newest_s)} ago`);
      const open = () => {
        this.clock.playing = true;
        this.open(number);
      };
      return episodeRow(cells, result, open, { "aria-current": String(number === this.number) });
    };
    const list = byId("episode-list");
    // Rows that moved away from the pointer could not be clicked.
    if (list.matches(":hover, :focus-within") && this.rows) return this.markEpisode();
    this.rows = new Map(this.listed.map((episode) => [episode.number, row(episode)]));
    list.replaceChildren(...this.rows.values());
  }

  markEpisode() {
    for (const [number, item] of this.rows ?? [])
      item.firstElementChild?.setAttribute("aria-current", String(number === this.number));
  }

  /** Saves the state before the shown step as a file, from which battles can branch. */
  async branch() {
    const { entry, number } = this;
    if (!entry?.track.length) return;
    const step = Math.min(Math.floor(this.clock.time / TICKS_PER_STEP), entry.steps);
    try {
      const { name, record } = await this.request({ type: "get_snapshot", number, step });
      download(name, bytesOf(record), "application/octet-stream");
    } catch (error) {
      say(`The snapshot cannot be saved: ${messageOf(error)}`);
    }
  }

  /**
   * @param {string} key
   * @param {number} ticks
   */
  command(key, ticks) {
    /** @type {{ [key: string]: () => void }} */
    const commands = {
      b: () => this.branch(),
      n: () => this.newest(),
      PageUp: () => this.openNext(-1),
      PageDown: () => this.openNext(1),
    };
    return commands[key] ?? super.command(key, ticks);
  }
}

/** @param {number} value */
export const seconds = (value) => (value < 90 ? `${Math.round(value)} s` : `${Math.round(value / 60)} min`);
