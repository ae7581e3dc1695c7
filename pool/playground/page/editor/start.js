// @ts-check
// StartTrack: the moment before a battle.

import { Track } from "#view/track.js";

/** @import { ScenarioInfo } from "#view/data.d.ts" */

/**
 * What the view draws, of a scenario that may be invalid.
 * @param {Partial<ScenarioInfo>} known
 */
export const infoOf = (known) => /** @type {ScenarioInfo} */ (known);

/** The moment before a battle: every unit at its start. */
export class StartTrack extends Track {
  /**
   * @param {ScenarioInfo} info
   * @param {[x: number, y: number][]} places
   */
  constructor(info, places) {
    super(info);
    this.places = places;
    this.length = this.units ? 1 : 0;
    this.attacks = [[]];
  }

  /** @param {number} unit */
  unitAt(unit) {
    const { type, faction } = this.info.units[unit],
      { hp, shield, energy, initial_energy: initial } = this.info.types[type],
      [x, y] = this.places[unit];
    const state = { unit, x, y, hp, shield, cooldown: 0, target: -1, alive: true };
    return { ...state, energy: energy ? initial : 0, facing: faction ? Math.PI : 0 };
  }
}
