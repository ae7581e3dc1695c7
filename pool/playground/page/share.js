// @ts-check
// What leaves the page: the link to a battle, and the battle as a replay file.

import { download } from "#view/dom.js";
import { linkOf, through } from "./link.js";

/** @import { Engine } from "./engine.js" */
/** @import { SharedBattle } from "./link.js" */
/** @import { BegunBattle, Choices, Source } from "./protocol.d.ts" */
/**
 * A battle, and the page that says what became of it.
 * @typedef {object} Shown
 * @property {Engine} engine
 * @property {Source} source
 * @property {Omit<SharedBattle, "actions" | "taken">} shared
 * @property {number[]} actions
 * @property {Set<number>} taken
 * @property {Set<string>} builtInTeams
 * @property {{ choices: Choices }} choices
 * @property {(text: string) => void} note
 * @property {(error: unknown) => void} fail
 */

/**
 * A battle without its actions, for links and choices.
 * @param {{ source: Source, team: string, begun: BegunBattle }} page
 */
export function sharedOf({ source, team, begun }) {
  // What plays the enemies of a replay, if no script does, cannot be asked to play.
  const { scenario, opponent, rules } =
    source.kind === "scenario"
      ? source
      : { scenario: begun.source, opponent: begun.is_playable ? begun.opponent : "", rules: "" };
  // Rules have the name that the choices have: `starcraft` is `starcraft-1`.
  return { scenario, seed: begun.seed, opponent, rules: rules && begun.rules, team };
}

/**
 * Whether another battle of a shown one is against other enemies without a choice of the user: a replay does
 * not have the team that played them.
 * @param {BegunBattle} shown
 * @param {{ scenario: string, opponent: string }} choice
 */
export const losesEnemies = (shown, { scenario, opponent }) =>
  !shown.is_playable && scenario === shown.source && !opponent;

/**
 * Copies the link to a battle.
 * @param {Shown} page
 */
export async function share(page) {
  if (page.source.kind !== "scenario") return page.note("Save this replay to share it.");
  const { opponent } = page.source,
    isScript = !opponent || page.choices.choices.opponents.includes(opponent);
  if (!isScript && !page.builtInTeams.has(opponent))
    return page.note(`Save this battle to share it: a link does not have the team "${opponent}".`);
  const taken = [...page.taken].sort((a, b) => a - b);
  const link = await linkOf({ ...page.shared, actions: page.actions, taken });
  history.replaceState(null, "", `#${link}`);
  try {
    await navigator.clipboard.writeText(location.href);
    page.note("The link to this battle is copied.");
  } catch {
    page.note("The link to this battle is in the address bar.");
  }
}

/**
 * Saves a battle as a file that `smaclite-pool replay` reads.
 * @param {Shown} page
 */
export async function save(page) {
  try {
    const { name, replay } = await page.engine.request({ type: "get_replay" });
    const file = await through(new TextEncoder().encode(replay), new CompressionStream("gzip"));
    download(name, file, "application/octet-stream");
  } catch (error) {
    page.fail(error);
  }
}
