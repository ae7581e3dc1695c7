// @ts-check
// The page of the playground: begins the battle of the address, or the one that the page was made for.

import { titleCase } from "#view/battle.js";
import { byId, isTouch } from "#view/dom.js";
import { theme } from "#view/theme.js";
import { DEFAULT_TEAM, teamFor } from "./choices.js";
import { EngineLost } from "./engine.js";
import { TeamNames, listenToFiles } from "./files.js";
import { base64, battleOf, linkOf } from "./link.js";
import { Playground } from "./playground.js";

/** @import { Engine } from "./engine.js" */
/** @import { SharedBattle } from "./link.js" */
/** @import { Choices, TeamFiles } from "./protocol.d.ts" */
/**
 * What is in the page.
 * @typedef {object} PageData
 * @property {TeamFiles[]} teams
 * @property {Partial<SharedBattle>} first What a battle is played with, where no link says it.
 * @property {boolean} has_fog Whether what no agent sees is hidden.
 * @property {boolean} can_share Whether a link to a battle opens in other browsers.
 * @property {string} other The address of the editor.
 */

/** The battle of a page without a link. */
const FIRST = { scenario: "2s3z", seed: "1", opponent: "", rules: "", team: "", actions: [], taken: [] };
/** What the person can do, in the words of mouse or finger. */
const GUIDES = {
  mouse:
    "Press play, or take over: select blue agents, and right click where they go or the enemy to attack.",
  touch: "Press play, or take over: tap a blue agent, then where it goes or the enemy to attack.",
};

/**
 * The battle of a link, as the engine begins it. The team of a link may have been added to another page; then
 * a script plays on.
 * @param {Choices} choices
 * @param {SharedBattle} defaults
 * @param {string} link
 */
async function battleOfLink({ teams, policies }, defaults, link) {
  const battle = await battleOf(link, defaults),
    { scenario, seed, opponent, rules } = battle;
  const names = [...policies, ...teams.map(({ name }) => name)];
  const asked = battle.team || teamFor(teams, scenario),
    team = names.includes(asked) ? asked : DEFAULT_TEAM,
    isAsked = battle.team !== "";
  const note =
    team === asked ? null : `This page has no team "${asked}"; ${titleCase(team)} plays on instead.`;
  return {
    ...battle,
    team,
    isAsked,
    note,
    source: /** @type {const} */ ({ kind: "scenario", scenario, seed, opponent, rules }),
  };
}

/**
 * Starts the page.
 * @param {Engine} engine
 * @param {PageData} data
 */
export async function startPlayground(engine, { teams, first, other, has_fog: hasFog, can_share: canShare }) {
  theme.start();
  for (const team of teams) await engine.request({ type: "add_team", ...team });
  const names = new TeamNames(teams),
    choices = await engine.request({ type: "get_choices" }),
    defaults = { ...FIRST, ...first };
  const { page, note, isRefused } = await firstPage(engine, choices, defaults);
  page.reveal(hasFog);
  page.builtInTeams = new Set(teams.map(({ name }) => name));
  byId("share").hidden = !canShare;
  byId("edit").addEventListener("click", () => page.enqueue(() => edit(page, other)));
  const plays = new URLSearchParams(location.hash.slice(1)).get("play") === "1" && !isRefused;
  if (plays) page.toggle();
  if (note || !plays) page.note(note ?? GUIDES[isTouch() ? "touch" : "mouse"]);
  page.warn();
  listenToFiles({
    replay: (name, bytes) => page.enqueue(() => page.openReplay(name, bytes)),
    scenario: (files) =>
      page.enqueue(async () => {
        const { scenario } = await engine.request({ type: "open_scenario", files });
        const opened = { ...page.shared, scenario, opponent: "", rules: "" },
          team = teamFor(page.choices.choices.teams, scenario);
        // A team that plays every map does not know all that the observations of a scenario may have.
        if (!(await page.choose({ ...opened, team }))) await page.choose({ ...opened, team: DEFAULT_TEAM });
      }),
    team: (called, run, bytes) =>
      page.enqueue(async () => {
        const weights = base64(bytes),
          name = names.nameOf(called, weights);
        const { teams } = await engine.request({ type: "add_team", name, run, weights });
        names.take(name, weights);
        page.choices.take(teams);
        const scenario = teams.find((team) => team.name === name)?.source ?? "";
        await page.choose({ ...page.shared, scenario, team: name, opponent: "", rules: "" });
      }),
    fail: (error) => page.fail(error),
  });
  addEventListener("hashchange", () =>
    page.enqueue(async () => {
      try {
        const link = location.hash.slice(1);
        const battle = await battleOfLink(choices, defaults, link);
        await byTeamThatCan(battle, (team) => page.begin(battle.source, team, battle.actions, battle.taken));
        page.episodes.clear();
        if (battle.note) page.note(battle.note);
      } catch (error) {
        throw error instanceof EngineLost ? error : refusal(error);
      }
    }),
  );
  return page;
}

/**
 * Opens the scenario of the battle in the editor.
 * @param {Playground} page
 * @param {string} editor
 */
async function edit(page, editor) {
  const link = await linkOf({ ...page.shared, actions: [], taken: [] });
  if (!open(`${editor}${location.search}#${link}`))
    page.note("The browser opens no other tab from here; allow it for this page.");
}

/**
 * Begins a battle with its team; if nobody asked for that one and it cannot play the scenario, with a script.
 * @template T
 * @param {{ team: string, isAsked: boolean }} battle
 * @param {(team: string) => Promise<T>} begin
 */
async function byTeamThatCan({ team, isAsked }, begin) {
  try {
    return await begin(team);
  } catch (error) {
    if (isAsked || team === DEFAULT_TEAM) throw error;
    return await begin(DEFAULT_TEAM).catch(() => Promise.reject(error));
  }
}

/**
 * Why the battle of the address is not shown.
 * @param {unknown} error
 */
const refusal = (error) =>
  new Error(`The battle of this link cannot be played: ${/** @type {Error} */ (error).message}`);

/**
 * The page with the battle of its address, or if that is refused, with the first one and the reason.
 * @param {Engine} engine
 * @param {Choices} choices
 * @param {SharedBattle} defaults
 */
async function firstPage(engine, choices, defaults) {
  /** @param {string} link */
  const open = async (link) => {
    const battle = await battleOfLink(choices, defaults, link),
      { source, actions, taken, note } = battle;
    return await byTeamThatCan(battle, async (team) => {
      const begun = await engine.request({ type: "begin_battle", of: source, team, actions, taken });
      const page = new Playground(engine, choices, source, team, begun);
      page.start(taken);
      return { page, note, isRefused: false };
    });
  };
  try {
    return await open(location.hash.slice(1));
  } catch (error) {
    const first = await open("");
    first.page.fail(refusal(error));
    return { ...first, isRefused: true };
  }
}
