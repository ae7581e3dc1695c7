// @ts-check
// What becomes of a page when a picture fails.

import assert from "node:assert/strict";
import { test } from "node:test";
import { everyFrame } from "./frames.js";

// The loop ended, and replay, followed battle and editor stood still until they were loaded again.
test("a picture that fails does not stop the page", () => {
  /** @type {((now: number) => void)[]} */
  const asked = [];
  Object.assign(globalThis, {
    requestAnimationFrame: (/** @type {(now: number) => void} */ draw) => asked.push(draw),
  });
  /** @type {number[]} */
  const drawn = [];
  everyFrame((now) => {
    drawn.push(now);
    if (now === 1) throw new Error("a picture that fails");
  });
  assert.throws(() => asked.shift()?.(1), /a picture that fails/);
  asked.shift()?.(2);
  assert.deepEqual([drawn, asked.length], [[1, 2], 1]);
});
