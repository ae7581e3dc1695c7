// @ts-check
// What a link, the choices and a new battle take from the battle that is shown.

import assert from "node:assert/strict";
import { test } from "node:test";
import { losesEnemies, sharedOf } from "./share.js";

/** @type {any} */
const begun = {
  source: '{"name": "2s3z"}',
  rules: "starcraft-1",
  seed: "7",
  opponent: "kite",
  is_playable: true,
};

test("a battle of a scenario is what was chosen", () => {
  const source = /** @type {const} */ ({
    kind: "scenario",
    scenario: "2s3z",
    seed: "7",
    opponent: "",
    rules: "",
  });
  const battle = { scenario: "2s3z", seed: "7", opponent: "", rules: "", team: "hold" };
  assert.deepEqual(sharedOf({ source, team: "hold", begun }), battle);
});

// The choice of the rules was blank, and the next battle was played by the map's own.
test("rules have the name that the choices have, if any were chosen", () => {
  const source = /** @type {const} */ ({ kind: "scenario", scenario: "3m", seed: "7", opponent: "" });
  const rules = ["starcraft", "starcraft-1", ""].map(
    (rules) => sharedOf({ source: { ...source, rules }, team: "hold", begun }).rules,
  );
  assert.deepEqual(rules, ["starcraft-1", "starcraft-1", ""]);
});

test("an episode of a replay is that of its scenario, against a script if one played the enemies", () => {
  const source = /** @type {const} */ ({ kind: "episode", episode: 1 });
  const battle = { scenario: begun.source, seed: "7", opponent: "kite", rules: "", team: "nearest" };
  assert.deepEqual(sharedOf({ source, team: "nearest", begun }), battle);
  // The engine knows no opponent that is called so, and every choice was refused.
  const both = { ...begun, opponent: "learner", is_playable: false };
  assert.deepEqual(sharedOf({ source, team: "nearest", begun: both }), {
    ...battle,
    opponent: "",
    rules: "",
  });
});

// After another seed a script played the enemies, and nothing was said.
test("a battle after a replay is against other enemies if the replay does not have those it had", () => {
  const both = { ...begun, opponent: "learner", is_playable: false },
    same = { scenario: begun.source, opponent: "" };
  assert.equal(losesEnemies(both, same), true);
  assert.equal(losesEnemies(begun, same), false, "a script plays again");
  assert.equal(losesEnemies(both, { ...same, opponent: "kite" }), false, "these were chosen");
  assert.equal(losesEnemies(both, { ...same, scenario: "3m" }), false, "another map has its own");
});
