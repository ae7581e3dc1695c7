// @ts-check
// Headline: the name of the map, how the battle stands, and what it is played with.

import { titleCase } from "#view/battle.js";
import { byId, showFacts } from "#view/dom.js";
import { RESULTS } from "#view/player.js";

/** @import { EpisodeResult } from "#view/data.d.ts" */
/** @import { BegunBattle } from "./protocol.d.ts" */
/**
 * What the headline says of a battle.
 * @typedef {object} Described
 * @property {number} serial
 * @property {number} steps
 * @property {number} episodeReturn
 * @property {EpisodeResult | null} result
 * @property {boolean} isAtEnd
 * @property {Set<number>} taken
 * @property {BegunBattle} begun
 * @property {{ playing: boolean }} clock
 */

const STATES = { ...RESULTS, running: "Running", paused: "Paused" };

export class Headline {
  constructor() {
    this.shown = "";
  }

  /** @param {Described} battle */
  update({ serial, steps, episodeReturn, result, isAtEnd, taken, begun, clock }) {
    const state = isAtEnd && result ? result : clock.playing ? "running" : "paused";
    const key = [serial, state, taken.size, steps > 0].join();
    if (key === this.shown) return;
    this.shown = key;
    byId("name").textContent = begun.scenario.name;
    const own = taken.size ? `, you play ${taken.size} of ${begun.scenario.n_agents}` : "";
    byId("result").textContent = STATES[state] + own;
    byId("result").className = `badge ${isAtEnd ? state : taken.size ? "yours" : ""}`;
    byId("save").disabled = steps === 0;
    byId("again").disabled = !begun.is_playable;
    const facts = {
      enemies: titleCase(begun.opponent),
      rules: begun.rules,
      seed: begun.seed,
      ...(isAtEnd ? { return: episodeReturn.toFixed(2) } : {}),
    };
    showFacts(facts);
  }
}
