// @ts-check
// ChoiceBar: which map is played, who plays it, and the seed.

import { titleCase } from "#view/battle.js";
import { byId, make } from "#view/dom.js";
import { isText, nameOf } from "./scenario.js";

/** @import { Choices, TeamInfo } from "./protocol.d.ts" */
/** @import { SharedBattle } from "./link.js" */

/** What can be chosen, by the names of its fields. */
const CHOICES = /** @type {const} */ (["scenario", "team", "opponent", "rules", "seed"]);
/** What plays the agents if the chosen team cannot. */
export const DEFAULT_TEAM = "nearest";

/**
 * Who plays the agents of a map by default: the team that was trained on it, one that plays every map, or a
 * script.
 * @param {TeamInfo[]} teams
 * @param {string} scenario
 */
export function teamFor(teams, scenario) {
  const map = nameOf(scenario) ?? scenario,
    own = teams.find((team) => team.scenario === map && !team.is_universal),
    any = teams.find((team) => team.is_universal);
  return (own ?? any)?.name ?? DEFAULT_TEAM;
}

export class ChoiceBar {
  /**
   * @param {Choices} choices
   * @param {(battle: Omit<SharedBattle, "actions" | "taken">) => void} choose
   */
  constructor(choices, choose) {
    this.choices = choices;
    /** @type {string | null} The text of a scenario that was opened. */
    this.opened = null;
    /** Whether the team of a map plays there, if there is one: until the person chooses a script. */
    this.wantsTrained = true;
    this.fill();
    byId("choices").addEventListener("submit", (/** @type {Event} */ event) => event.preventDefault());
    for (const id of CHOICES) byId(id).addEventListener("change", () => choose(this.chosen(id)));
  }

  fill() {
    const { scenarios, generated, opponents, policies, rules, teams } = this.choices;
    const maps = [group("Maps", scenarios), group("Drawn teams", generated)];
    const own = new Set([this.opened ?? "", ...teams.map(({ source }) => source)].filter(isText));
    if (own.size) maps.unshift(group("Opened", [...own], (text) => nameOf(text) ?? "your scenario"));
    byId("scenario").replaceChildren(...maps);
    byId("opponent").replaceChildren(
      make("option", { value: "" }, "The map's own"),
      group("Scripts", opponents, titleCase),
      ...(teams.length ? [group("Trained teams", teams, labelOf)] : []),
    );
    byId("rules").replaceChildren(
      make("option", { value: "" }, "The map's own"),
      ...rules.map((name) => make("option", { value: name }, name)),
    );
    byId("team").replaceChildren(
      ...(teams.length ? [group("Trained teams", teams, labelOf)] : []),
      group("Scripts", policies, titleCase),
    );
  }

  /**
   * What is chosen after a change of one choice, which another one may have to follow.
   * @param {string} changed
   */
  chosen(changed) {
    const [scenario, team, opponent, rules, seed] = CHOICES.map((id) => byId(id).value);
    const chosen = { scenario, team, opponent, rules, seed: seed.trim() };
    const { teams } = this.choices,
      trained = teams.find(({ name }) => name === team),
      map = nameOf(scenario) ?? scenario;
    if (changed === "team") {
      this.wantsTrained = trained !== undefined;
      // Most trained teams play the units that they were trained with.
      const moves = trained && !trained.is_universal && trained.scenario !== map;
      return moves ? { ...chosen, scenario: trained.source } : chosen;
    }
    if (changed !== "scenario" || !this.wantsTrained) return chosen;
    return { ...chosen, team: teamFor(teams, scenario) };
  }

  /**
   * Takes in the teams after one was opened.
   * @param {TeamInfo[]} teams
   */
  take(teams) {
    this.choices.teams = teams;
    this.wantsTrained = true;
    this.fill();
  }

  /** @param {Omit<SharedBattle, "actions" | "taken">} battle */
  show(battle) {
    if (isText(battle.scenario) && battle.scenario !== this.opened) {
      this.opened = battle.scenario;
      this.fill();
    }
    for (const id of CHOICES) Object.assign(byId(id), { value: battle[id] });
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
 * What a team is called in the list: those of the page have the names of their maps.
 * @param {TeamInfo} team
 */
const labelOf = ({ name, scenario }) => (name === scenario ? `${name} team` : name);
