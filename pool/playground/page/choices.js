// @ts-check
// ChoiceBar: which map is played, who plays it, and the seed.

import { titleCase } from "#view/battle.js";
import { byId, make } from "#view/dom.js";

/** @import { Choices } from "./protocol.d.ts" */
/** @import { SharedBattle } from "./link.js" */

/** What plays the agents if the chosen team cannot. */
export const DEFAULT_TEAM = "nearest";

export class ChoiceBar {
  /**
   * @param {Choices} choices
   * @param {(battle: Pick<SharedBattle, "scenario" | "team" | "opponent" | "seed">) => void} choose
   */
  constructor(choices, choose) {
    this.choices = choices;
    /** @type {string | null} The text of a scenario that was opened. */
    this.opened = null;
    this.fill();
    byId("choices").addEventListener("submit", (/** @type {Event} */ event) => event.preventDefault());
    for (const id of ["scenario", "opponent", "seed", "team"])
      byId(id).addEventListener("change", () => choose(this.chosen(id)));
  }

  fill() {
    const { scenarios, generated, opponents, policies, teams } = this.choices;
    const maps = [group("Maps", scenarios), group("Drawn teams", generated)];
    if (this.opened !== null)
      maps.unshift(group("Opened", [this.opened], (text) => nameOf(text) ?? "your scenario"));
    byId("scenario").replaceChildren(...maps);
    byId("opponent").replaceChildren(
      make("option", { value: "" }, "as the map says"),
      ...opponents.map((name) => make("option", { value: name }, titleCase(name))),
    );
    byId("team").replaceChildren(
      ...(teams.length ? [group("Trained teams", teams, ({ name }) => name)] : []),
      group("Scripts", policies, titleCase),
    );
  }

  /**
   * What is chosen after a change of one choice, which another one may have to follow.
   * @param {string} changed
   */
  chosen(changed) {
    const [scenario, team, opponent, seed] = ["scenario", "team", "opponent", "seed"].map(
      (id) => byId(id).value,
    );
    const trained = this.choices.teams.find(({ name }) => name === team);
    if (!trained || trained.scenario === (nameOf(scenario) ?? scenario))
      return { scenario, team, opponent, seed: seed.trim() };
    // A trained team plays the units that it was trained with.
    return changed === "team" && this.choices.scenarios.includes(trained.scenario)
      ? { scenario: trained.scenario, team, opponent, seed: seed.trim() }
      : { scenario, team: DEFAULT_TEAM, opponent, seed: seed.trim() };
  }

  /** @param {Pick<SharedBattle, "scenario" | "team" | "opponent" | "seed">} battle */
  show(battle) {
    const isText = battle.scenario.trimStart().startsWith("{");
    if (isText && battle.scenario !== this.opened) {
      this.opened = battle.scenario;
      this.fill();
    }
    Object.assign(byId("scenario"), { value: battle.scenario });
    Object.assign(byId("team"), { value: battle.team });
    Object.assign(byId("opponent"), { value: battle.opponent });
    Object.assign(byId("seed"), { value: battle.seed });
  }
}

/**
 * Choices under a heading.
 * @template T
 * @param {string} label
 * @param {T[]} values
 * @param {(value: T) => string} [text]
 */
function group(label, values, text = String) {
  const options = values.map((value) => {
    const name = /** @type {any} */ (value)?.name ?? value;
    return make("option", { value: name }, text(value));
  });
  return make("optgroup", { label }, options);
}

/**
 * The name in the text of a scenario file.
 * @param {string} text
 * @returns {string | null}
 */
function nameOf(text) {
  try {
    return JSON.parse(text).name ?? null;
  } catch {
    return null;
  }
}
