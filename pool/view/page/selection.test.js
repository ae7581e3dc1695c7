// @ts-check
// Which agents are selected, and what is seen, in a battle of five agents against two enemies.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Selection, seenBy, unitsIn } from "./selection.js";

/** @type {any} */
const info = {
  types: [{ name: "STALKER" }, { name: "ZEALOT" }],
  units: [
    ...[0, 0, 1, 1, 1].map((type, id) => ({ type, faction: 0, id })),
    ...[0, 1].map((type, id) => ({ type, faction: 1, id })),
  ],
};
const view = { track: { info } };
const ALL = [0, 1, 2, 3, 4, 5, 6];

/** @param {Selection} selection */
const selected = (selection) => [...selection.units].sort();

test("only agents are selected, and one more at a time with shift", () => {
  const selection = new Selection(view);
  selection.pick(2, false);
  assert.deepEqual([selected(selection), selection.only], [[2], 2]);
  selection.pick(4, true);
  selection.pick(5, true);
  assert.deepEqual([selected(selection), selection.only], [[2, 4], -1]);
  selection.pick(2, true);
  assert.deepEqual(selected(selection), [4]);
  selection.pick(0, false);
  assert.deepEqual(selected(selection), [0]);
  selection.take(ALL, false);
  assert.deepEqual(selected(selection), [0, 1, 2, 3, 4]);
  assert.equal(selection.summary(), "2 stalker, 3 zealot");
});

test("a double click selects the living of a type", () => {
  const selection = new Selection(view);
  selection.takeType(3, [0, 1, 2, 3, 5, 6], false);
  assert.deepEqual(selected(selection), [2, 3]);
  selection.takeType(0, ALL, true);
  assert.deepEqual(selected(selection), [0, 1, 2, 3]);
});

// They were those of the sample, whatever the episode had drawn.
test("the types of a generated scenario are those of the episode", () => {
  const units = info.units.map((/** @type {any} */ unit) => ({ ...unit, type: 1 - unit.type }));
  const drawn = { track: { info } },
    selection = new Selection(drawn);
  drawn.track = { info: { ...info, units } };
  selection.takeType(0, ALL, false);
  assert.equal(selection.summary(), "2 zealot");
  selection.take(ALL, false);
  assert.equal(selection.summary(), "2 zealot, 3 stalker");
});

test("Tab goes from the first to the last living agent, and then leaves the map", () => {
  const selection = new Selection(view),
    living = [0, 2, 4, 5, 6];
  const seen = [];
  while (selection.next(living, 1)) seen.push(selection.only);
  assert.deepEqual(seen, [0, 2, 4]);
  assert.ok(selection.next(living, -1));
  assert.equal(selection.only, 2);
  selection.clear();
  assert.ok(selection.next(living, -1));
  assert.equal(selection.only, 4, "backwards from the last one");
});

test("numbers are those of the agents", () => {
  const selection = new Selection(view);
  assert.deepEqual([selection.numbered(1, ALL), selection.numbered(1, [0, 2, 5, 6])], [1, -1]);
  assert.equal(selection.numbered(7, ALL), -1);
});

test("the dead are selected no more", () => {
  const selection = new Selection(view);
  selection.take([0, 1], false);
  assert.ok(!selection.keep(ALL));
  assert.ok(selection.keep([1, 2]));
  assert.deepEqual(selected(selection), [1]);
});

test("every selected agent gets an order, but for those that have none", () => {
  const selection = new Selection(view);
  selection.take([1, 3], false);
  assert.deepEqual(
    selection.orders(() => ({ type: "stop" })),
    [
      { agent: 1, order: { type: "stop" } },
      { agent: 3, order: { type: "stop" } },
    ],
  );
  assert.equal(selection.orders((unit) => (unit === 1 ? { type: "stop" } : null)).length, 1);
});

test("a box has the units whose centre is in it, from whichever corner it was drawn", () => {
  const places = [
    { unit: 0, x: 10, y: 10 },
    { unit: 1, x: 20, y: 30 },
    { unit: 2, x: 50, y: 30 },
  ];
  assert.deepEqual(unitsIn(places, { x0: 5, y0: 5, x1: 25, y1: 35 }), [0, 1]);
  assert.deepEqual(unitsIn(places, { x0: 55, y0: 35, x1: 15, y1: 25 }), [1, 2]);
});

test("units are seen that are nearer than the sight range to an agent", () => {
  const enemies = [
    { unit: 5, x: 9, y: 0 },
    { unit: 6, x: 8.9, y: 0 },
  ];
  assert.deepEqual([...seenBy(enemies, [{ x: 0, y: 0, sight: 9 }])], [6]);
  assert.deepEqual([...seenBy(enemies, [{ x: 0, y: 0, sight: 9.1 }])], [5, 6]);
  assert.deepEqual([...seenBy(enemies, [])], []);
});
