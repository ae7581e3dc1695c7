// @ts-check
// A battle survives its way through a link.

import assert from "node:assert/strict";
import { test } from "node:test";
import { battleOf, linkOf } from "./link.js";

const defaults = { scenario: "2s3z", seed: "1", opponent: "", team: "nearest", actions: [], taken: [] };

for (const [name, battle] of Object.entries({
  defaults,
  "a battle of a person": { ...defaults, seed: "18446744073709551615", actions: [1, 6, 1005], taken: [0, 2] },
  "a scenario of its own": { ...defaults, scenario: '{"name": "größer & + =#"}', opponent: "kite" },
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

test("a long battle is a short link", async () => {
  const actions = Array.from({ length: 5 * 60 }, (_, i) => (i % 5 === 0 ? 6 + (i % 3) : 2));
  assert.ok((await linkOf({ ...defaults, actions })).length < 200);
});

test("actions that are damaged are an error", async () => {
  await assert.rejects(battleOf("scenario=3m&actions=AAAA", defaults));
});
