// @ts-check
// Maps that are drawn on: between rectangles, squares and rows, and what the brush covers.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Brush, squareFrom } from "./brush.js";
import { rectanglesOf, rowsOf, squaresOf } from "./squares.js";

/** @import { Square } from "./brush.js" */

/**
 * A map from its rows, the southernmost first.
 * @param {string[]} rows
 */
const mapOf = (...rows) => ({
  width: rows[0].length,
  height: rows.length,
  blocked: Uint8Array.from(rows.join(""), (square) => (square === "X" ? 1 : 0)),
});
const empty = mapOf("_____", "_____", "_____", "_____");

test("rectangles, squares and rows are the same map", () => {
  for (const rows of [["_"], ["X"], ["XX__", "XX_X", "_X_X"], ["X_X", "_X_", "X_X"]]) {
    const map = mapOf(...rows);
    assert.deepEqual(rowsOf(map), rows);
    assert.deepEqual(squaresOf({ ...map, obstacles: rectanglesOf(map) }), map);
  }
});

test("rectangles of a battle may overlap", () => {
  const map = squaresOf({
    width: 4,
    height: 2,
    obstacles: [
      [0, 0, 3, 1],
      [2, 0, 4, 2],
    ],
  });
  assert.deepEqual(rowsOf(map), ["XXXX", "__XX"]);
});

/** @type {{ name: string, tool?: string, size?: number, from: Square, to: Square, rows: string[] }[]} */
const strokes = [
  { name: "a square", from: [1, 2], to: [1, 2], rows: ["_____", "_____", "_X___", "_____"] },
  { name: "a line without gaps", from: [0, 0], to: [4, 2], rows: ["X____", "_XX__", "___XX", "_____"] },
  { name: "a large brush", size: 3, from: [1, 1], to: [2, 1], rows: ["XXXX_", "XXXX_", "XXXX_", "_____"] },
  { name: "over the edge", size: 2, from: [4, 3], to: [9, 9], rows: ["_____", "_____", "_____", "____X"] },
  {
    name: "a rectangle",
    tool: "rectangle",
    from: [3, 2],
    to: [2, 1],
    rows: ["_____", "__XX_", "__XX_", "_____"],
  },
];
for (const { name, tool = "brush", size = 1, from, to, rows } of strokes) {
  test(`the brush draws and erases ${name}`, () => {
    const brush = Object.assign(new Brush(), { tool, size });
    const drawn = brush.drawn(empty, from, to, true);
    assert.deepEqual(rowsOf(drawn), rows);
    assert.deepEqual(brush.drawn(drawn, from, to, false), empty);
    assert.ok(!empty.blocked.includes(1), "a drawn map is another one");
  });
}

test("an area is filled up to its walls", () => {
  const map = mapOf("__X__", "__X__", "XXX__");
  const brush = Object.assign(new Brush(), { tool: "fill" });
  assert.deepEqual(rowsOf(brush.drawn(map, [0, 0], [0, 0], true)), ["XXX__", "XXX__", "XXX__"]);
  assert.deepEqual(rowsOf(brush.drawn(map, [0, 0], [4, 0], true)), ["__XXX", "__XXX", "XXXXX"]);
});

test("keys move the brush from the middle to the edge, and not over it", () => {
  assert.deepEqual(squareFrom(null, [0, 0], 0, empty), [2, 2]);
  assert.deepEqual(squareFrom([2, 2], [1, 0], 1, empty), [3, 2]);
  assert.deepEqual(squareFrom([3, 2], [1, 0], 5, empty), [4, 2]);
  assert.deepEqual(squareFrom([4, 2], [0, -1], 5, empty), [4, 0]);
});
