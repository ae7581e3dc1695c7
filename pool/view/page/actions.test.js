// @ts-check
// Actions of an agent that shoots and of one that heals.

import assert from "node:assert/strict";
import { test } from "node:test";
import { actionName } from "./actions.js";

/** @type {any} */
const info = {
  types: [{ attack: "shot" }, { attack: "heal" }],
  units: [
    { type: 0, faction: 0, id: 0 },
    { type: 1, faction: 0, id: 1 },
  ],
  first_target: 6,
};

/**
 * @param {any} info
 * @param {number} agent
 * @param {number[]} actions
 */
const names = (info, agent, actions) => actions.map((action) => actionName(info, agent, action));

test("agents move, attack and heal", () => {
  assert.deepEqual(names(info, 0, [-1, 0, 1, 2, 5, 6, 8]), [
    "none",
    "no-op",
    "stop",
    "north",
    "west",
    "attack enemy 0",
    "attack enemy 2",
  ]);
  assert.deepEqual(names(info, 1, [6]), ["heal agent 0"]);
});

// The first one was called an attack on enemy 0.
test("agents with a field of view look, and their attacks come after that", () => {
  const looking = { ...info, first_target: 6 + 4 };
  assert.deepEqual(names(looking, 0, [5, 6, 7, 9, 10, 11]), [
    "west",
    "look 0\u00b0",
    "look 90\u00b0",
    "look 270\u00b0",
    "attack enemy 0",
    "attack enemy 1",
  ]);
  assert.deepEqual(names(looking, 1, [12]), ["heal agent 2"]);
});
