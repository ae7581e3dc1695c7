// @ts-check
// Strokes on the map, while the engine still works on those before them.

import assert from "node:assert/strict";
import { test } from "node:test";
import { rectanglesOf, squaresOf } from "#view/squares.js";

const element = { classList: { toggle() {} }, contains: () => false };
Object.assign(globalThis, {
  matchMedia: () => ({}),
  document: { body: element, querySelectorAll: () => [], getElementById: () => element },
});
const { Painter } = await import("./painter.js");

/** Squares of the map, which has one row: a text of `_` and `X`. */
const width = 5;

/** A page whose engine answers when the test lets it. */
class SlowPage {
  constructor() {
    this.info = { width, height: 1, obstacles: [] };
    this.shared = { scenario: "_____" };
    this.queue = Promise.resolve();
    this.shown = "";
    /** @type {(() => void)[]} */
    this.answers = [];
    this.view = { hovered: -1, toSquares: (/** @type {number} */ x, /** @type {number} */ y) => ({ x, y }) };
    this.arena = {
      showMap: (/** @type {any} */ { blocked }) => (this.shown = [...blocked].map((x) => "_X"[x]).join("")),
    };
    this.engine = {
      request: async (/** @type {{ rows: string[] }} */ { rows: [row] }) => {
        await new Promise((done) => this.answers.push(() => done(null)));
        if (row.startsWith("X")) throw new Error("refused");
        return { scenario: row };
      },
    };
  }

  redraw() {}

  enqueue(/** @type {() => Promise<void>} */ action) {
    this.queue = this.queue.then(action);
  }

  async change(/** @type {() => Promise<string>} */ changed) {
    try {
      const row = (this.shared.scenario = await changed());
      const blocked = Uint8Array.from(row, (square) => "_X".indexOf(square));
      const obstacles = /** @type {any} */ (rectanglesOf({ width, height: 1, blocked }));
      this.info = { ...this.info, obstacles };
      this.shown = row; // as a new battle shows its map
      return true;
    } catch {
      return false;
    }
  }

  async answer() {
    while (!this.answers.length) await new Promise((done) => setTimeout(done));
    this.answers.shift()?.();
    await new Promise((done) => setTimeout(done));
  }

  get map() {
    return [...squaresOf(this.info).blocked].map((square) => "_X"[square]).join("");
  }
}

// It began on the map from before the first one, which then was lost.
test("a stroke that begins while the engine works on another one keeps that", async () => {
  const page = new SlowPage(),
    painter = new Painter(/** @type {any} */ (page));
  painter.finish([1, 0]);
  painter.extend([3, 0], [3, 0]);
  assert.equal(page.shown, "_X_X_");
  await page.answer();
  assert.equal(page.map, "_X___");
  painter.finish([4, 0]);
  assert.equal(page.shown, "_X_XX", "it goes on where it was");
  painter.finish([0, 0]); // which is refused
  await page.answer();
  assert.deepEqual([page.map, page.shown], ["_X_XX", "XX_XX"]);
  painter.brush.tool = "erase";
  painter.finish([1, 0]);
  await page.answer();
  await page.answer();
  assert.deepEqual([page.map, page.shown, painter.past.length], ["___XX", "___XX", 3]);
});

test("after an undo, the map has the strokes that came after it", async () => {
  const page = new SlowPage(),
    painter = new Painter(/** @type {any} */ (page));
  painter.finish([1, 0]);
  painter.undo();
  painter.finish([4, 0]);
  await page.answer();
  assert.deepEqual([page.map, page.shown], ["_____", "____X"]);
  await page.answer();
  assert.deepEqual([page.map, page.shown, painter.past], ["____X", "____X", ["_____"]]);
});

// The map without the stroke was sent, and its battle began anew.
test("a stroke on a map of another size than the new one is forgotten", async () => {
  const page = new SlowPage(),
    painter = new Painter(/** @type {any} */ (page));
  painter.extend([1, 0], [2, 0]);
  page.info = { ...page.info, width: width + 1 };
  painter.finish([3, 0]);
  await page.queue;
  assert.deepEqual([page.answers.length, page.shown, painter.past], [0, "______", []]);
});
