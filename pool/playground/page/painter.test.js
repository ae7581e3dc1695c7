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

/** A map as a text: rows of `_` and `X`, the southernmost first. */
const width = 5;

/** A page whose engine answers when the test lets it. */
class SlowPage {
  constructor() {
    this.info = { width, height: 1, obstacles: [] };
    this.shared = { scenario: "0" };
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
      this.info = {
        ...this.info,
        obstacles: /** @type {any} */ (rectanglesOf({ width, height: 1, blocked })),
      };
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
