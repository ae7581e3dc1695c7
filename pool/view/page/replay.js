// @ts-check
// The page of a replay: reads the data in the document, and lists its episodes.

import { PLAY, THEMES, readAddress } from "./address.js";
import { BROWSERS, byId, episodeRow, markEpisode, say, showFacts, showMessage } from "./dom.js";
import { everyFrame } from "./frames.js";
import { counted } from "./numbers.js";
import { BattlePlayer, RESULTS } from "./player.js";
import { theme } from "./theme.js";
import { Track, inflate } from "./track.js";
import { SPEEDS, TICKS_PER_STEP } from "./transport.js";

/** @import { EpisodeData, ReplayData } from "./data.d.ts" */

class ReplayPage extends BattlePlayer {
  /** @param {ReplayData} data */
  constructor(data) {
    super(data.scenario);
    this.data = data;
    /** @type {Map<number, Track>} */
    this.tracks = new Map();
    this.episode = -1;
  }

  async start() {
    byId("name").textContent = this.info.name;
    this.listEpisodes();
    this.listen();
    await this.follow();
    // One address after the other: each may wait for an episode, and then says which moment is shown.
    let followed = Promise.resolve();
    addEventListener("hashchange", () => (followed = followed.then(() => this.follow()).catch(fail)));
    everyFrame((now) => this.frame(now));
    document.documentElement.dataset.ready = "";
  }

  /** Shows what the address says. What it does not say stays, but for the tick. */
  async follow() {
    const { episodes } = this.data;
    /** @param {URLSearchParams} said */
    const episodeOf = (said) => Number(said.get("episode") ?? Math.max(0, this.episode));
    /** @param {URLSearchParams} said */
    const firstTick = (said) => episodes[episodeOf(said)].first_step * TICKS_PER_STEP;
    const { said, problem } = readAddress(location.hash.slice(1), {
      episode: episodes.length,
      tick: (said) => ({
        from: firstTick(said),
        below: firstTick(said) + episodes[episodeOf(said)].n_moments,
      }),
      unit: this.info.units.length,
      speed: SPEEDS,
      play: PLAY,
      fit: ["map"],
      theme: THEMES,
    });
    if (said.has("fit") && !this.view.wholeMap) this.fit();
    this.clock.speed = Number(said.get("speed") ?? this.clock.speed);
    const episode = episodeOf(said);
    await this.open(episode);
    showMessage(problem && `The address cannot be followed: ${problem}.`);
    if (this.episode !== episode) return; // a person chose another one meanwhile
    this.seek(said.has("tick") ? Number(said.get("tick")) - firstTick(said) : 0);
    if (said.has("unit")) this.view.selected = Number(said.get("unit"));
    if (said.has("play") && this.clock.playing !== (said.get("play") === "1")) this.toggle();
  }

  /**
   * Shows an episode from its start.
   * @param {number} index
   */
  async open(index) {
    const episode = this.data.episodes[index];
    if (!episode || index === this.episode) return;
    this.episode = index;
    const track = this.tracks.get(index) ?? (await this.decode(episode, index));
    this.tracks.set(index, track);
    if (this.episode !== index) return;
    this.show(track);
    this.describe(episode);
  }

  /**
   * @param {EpisodeData} episode
   * @param {number} index
   */
  async decode(episode, index) {
    const track = new Track(this.info);
    Object.assign(track, { serial: index, firstStep: episode.first_step });
    track.append(await inflate(episode.moments), episode.n_moments);
    track.appendDecisions(await inflate(episode.decisions));
    return track;
  }

  /** @param {EpisodeData} episode */
  describe(episode) {
    byId("result").textContent = RESULTS[episode.result];
    byId("result").className = `badge ${episode.result}`;
    const facts = {
      return: episode.episode_return.toFixed(2),
      steps: episode.steps,
      seed: episode.seed,
      rules: this.data.rules,
    };
    showFacts(facts);
    byId("facts").title = `Recorded by ${this.data.program}`;
    markEpisode(this.episode);
  }

  listEpisodes() {
    byId("episodes").hidden = this.data.episodes.length < 2;
    byId("episodes")
      .querySelector("ol")
      .replaceChildren(
        ...this.data.episodes.map((episode, i) => {
          const cells = [
            String(i + 1),
            RESULTS[episode.result],
            counted(episode.steps, "step"),
            episode.episode_return.toFixed(2),
          ];
          return episodeRow(cells, episode.result, () => this.open(i));
        }),
      );
  }

  /**
   * @param {string} key
   * @param {number} ticks
   */
  command(key, ticks) {
    return /^[1-9]$/.test(key) ? () => this.open(Number(key) - 1) : super.command(key, ticks);
  }
}

/** @param {Error} error */
function fail(error) {
  say(`The replay cannot be shown: ${error.message}. The page needs ${BROWSERS}.`);
  console.error(error);
}

theme.start();
new ReplayPage(JSON.parse(byId("data").textContent)).start().catch(fail);
