// @ts-check
// The page of the playground: starts the engine that is inside the page, with the teams that are there too,
// and begins the battle of the link.

import { titleCase } from "#view/battle.js";
import { byId, isTouch } from "#view/dom.js";
import { theme } from "#view/theme.js";
import { inflate } from "#view/track.js";
import { DEFAULT_TEAM, teamFor } from "./choices.js";
import { Engine } from "./engine.js";
import { listenToFiles } from "./files.js";
import { base64, battleOf } from "./link.js";
import { Playground } from "./playground.js";

/** @import { TeamFiles } from "./protocol.d.ts" */
/**
 * What is in the page: the engine's code, compressed by deflate, in base64; and teams.
 * @typedef {{ engine: string, teams: TeamFiles[] }} PageData
 */

/** The battle of a page without a link. */
const FIRST = { scenario: "2s3z", seed: "1", opponent: "", team: "", actions: [], taken: [] };
/** What the person can do, in the words of mouse or finger. */
const GUIDES = {
  mouse:
    "Press play, or take over: select blue agents, and right click where they go or the enemy to attack.",
  touch: "Press play, or take over: tap a blue agent, then where it goes or the enemy to attack.",
};

/**
 * The battle of the address, as the engine begins it. The team of a link may have been added to another page;
 * then a script plays on.
 * @param {Engine} engine
 * @param {string} link
 */
async function battleOfLink(engine, link) {
  const battle = await battleOf(link, FIRST),
    { scenario, seed, opponent } = battle,
    { teams, policies } = engine.request({ type: "get_choices" });
  const names = [...policies, ...teams.map(({ name }) => name)];
  const asked = battle.team || teamFor(teams, scenario),
    team = names.includes(asked) ? asked : DEFAULT_TEAM;
  const note =
    team === asked ? null : `This page has no team "${asked}"; ${titleCase(team)} plays on instead.`;
  return {
    ...battle,
    team,
    note,
    source: /** @type {const} */ ({ kind: "scenario", scenario, seed, opponent }),
  };
}

/** @param {PageData} data */
async function start(data) {
  const engine = await Engine.load(await inflate(data.engine));
  for (const team of data.teams) engine.request({ type: "add_team", ...team });
  const { page, note } = await firstPage(engine);
  page.note(note ?? GUIDES[isTouch() ? "touch" : "mouse"]);
  page.warn();
  listenToFiles({
    replay: (name, bytes) => page.openReplay(name, bytes),
    scenario: (files) => {
      const { scenario } = engine.request({ type: "open_scenario", files });
      const opened = { ...page.shared, scenario, opponent: "" },
        team = teamFor(page.choices.choices.teams, scenario);
      // A team that plays every map does not know all that the observations of a scenario may have.
      if (!page.choose({ ...opened, team })) page.choose({ ...opened, team: DEFAULT_TEAM });
    },
    team: (name, run, weights) => {
      const { teams } = engine.request({ type: "add_team", name, run, weights: base64(weights) });
      page.choices.take(teams);
      const scenario = teams.find((team) => team.name === name)?.source ?? "";
      page.choose({ ...page.shared, scenario, team: name, opponent: "" });
    },
    fail: (error) => page.fail(error),
  });
  addEventListener("hashchange", async () => {
    try {
      const { source, team, actions, taken, note } = await battleOfLink(engine, location.hash.slice(1));
      page.begin(source, team, actions, taken);
      if (note) page.note(note);
    } catch (error) {
      page.fail(refusal(error));
    }
  });
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
 */
async function firstPage(engine) {
  /** @param {string} link */
  const open = async (link) => {
    const { source, team, actions, taken, note } = await battleOfLink(engine, link);
    const begun = engine.request({ type: "begin_battle", of: source, team, actions, taken });
    const page = new Playground(engine, source, team, begun);
    page.start(taken);
    return { page, note };
  };
  try {
    return await open(location.hash.slice(1));
  } catch (error) {
    const first = await open("");
    first.page.fail(refusal(error));
    return first;
  }
}

theme.start();
start(JSON.parse(byId("data").textContent)).catch((error) => {
  byId("message").hidden = false;
  const browsers = "Firefox 113, Chrome 103, Safari 16.4, or newer";
  byId("message").textContent = `The page cannot start: ${error.message}. It needs ${browsers}.`;
  console.error(error);
});
