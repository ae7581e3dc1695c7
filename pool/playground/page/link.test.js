// @ts-check
// A battle survives its way through a link.

import assert from "node:assert/strict";
import { test } from "node:test";
import { battleOf, linkOf } from "./link.js";

const defaults = {
  scenario: "2s3z",
  seed: "1",
  opponent: "",
  rules: "",
  team: "nearest",
  actions: [],
  taken: [],
};

for (const [name, battle] of Object.entries({
  defaults,
  "a battle of a person": { ...defaults, seed: "18446744073709551615", actions: [1, 6, 1005], taken: [0, 2] },
  "a scenario of its own": {
    ...defaults,
    scenario: '{"name": "größer & + =#"}',
    opponent: "kite",
    rules: "paper",
  },
})) {
  test(`${name}: the link has the same battle`, async () => {
    const link = await linkOf(battle);
    assert.match(link, /^[\w=&.%+-]*$/);
    assert.deepEqual(
      await battleOf(link, { ...defaults, scenario: "other", seed: "other", team: "other" }),
      battle,
    );
  });
}

test("a link that is only a scenario has the defaults of the page", async () => {
  assert.deepEqual(await battleOf("scenario=3m", defaults), { ...defaults, scenario: "3m" });
});

test("without a link, the battle is the one that the page was made for", async () => {
  const own = { ...defaults, scenario: "3m", opponent: "kite", rules: "paper", taken: [0, 1, 2] };
  assert.deepEqual(await battleOf("", own), own);
  assert.deepEqual(await battleOf("scenario=8m", own), { ...defaults, scenario: "8m" });
});

test("a long battle is a short link", async () => {
  const actions = Array.from({ length: 5 * 60 }, (_, i) => (i % 5 === 0 ? 6 + (i % 3) : 2));
  assert.ok((await linkOf({ ...defaults, actions })).length < 200);
});

const INCOMPLETE = { message: "the link is incomplete or was changed; copy all of it" };

// The page said "Failed to fetch", or "Failed to execute 'atob'".
test("actions and files that are damaged are a link that is incomplete", async () => {
  for (const link of ["actions=AAAA", "actions=A", "actions=%25", "file=abc", "actions=YwAAAAD__w"])
    await assert.rejects(battleOf(`scenario=3m&${link}`, defaults), INCOMPLETE, link);
});

// Most cuts left a link that was one of another battle, such as seed 1 of seed 12.
test("a link that is cut anywhere is not played as another battle", async () => {
  const battle = {
    ...defaults,
    scenario: "3m",
    seed: "12",
    opponent: "kite",
    actions: [1, 2, 6],
    taken: [0, 2],
  };
  const link = await linkOf(battle);
  for (let length = "check=0123abcd".length; length < link.length; length++)
    await assert.rejects(battleOf(link.slice(0, length), defaults), INCOMPLETE, link.slice(0, length));
  await assert.rejects(battleOf(`${link}.`, defaults), INCOMPLETE);
  assert.deepEqual(await battleOf(`${link}&theme=dark`, defaults), battle);
});

test("what a link does not have is named", async () => {
  for (const [link, problem] of /** @type {const} */ ([
    ["nonsense", /^it has no `nonsense`, but check, scenario, file/],
    ["seed=1&seed=2", /^it must have `seed` once, got it 2 times$/],
    ["play=yes", /^`play` must be 1 or 0, got `yes`$/],
    ["theme=pink", /^`theme` must be dark or light, got `pink`$/],
  ]))
    await assert.rejects(battleOf(link, defaults), { message: problem });
  await assert.rejects(
    battleOf("scenario=3m&taken=a", defaults),
    /`taken` must be numbers of agents .*, got `a`/,
  );
});
