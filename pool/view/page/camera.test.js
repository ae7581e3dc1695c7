// @ts-check
// How large a map is where there is hardly room.

import assert from "node:assert/strict";
import { test } from "node:test";

// What browsers have, and the modules ask for when they are loaded.
Object.assign(globalThis, { matchMedia: () => ({ matches: false }), devicePixelRatio: 1 });
const { MapView } = await import("./camera.js");

// Radii were negative, which canvases refuse.
test("a window that is lower or narrower than the margin shows a map very small", () => {
  const info = /** @type {any} */ ({ width: 32, height: 32 });
  /** @param {[width: number, height: number]} size */
  const scaleOf = ([width, height]) => {
    const canvas = {
      getContext: () => ({ setTransform() {} }),
      getBoundingClientRect: () => ({ width, height }),
    };
    const view = new MapView(/** @type {any} */ (canvas), info);
    view.aim();
    return view.scale;
  };
  assert.equal(scaleOf([800, 80]), 2);
  for (const height of [0, 15, 16, 17]) assert.equal(scaleOf([800, height]), 1 / 32, `${height} pixels high`);
  assert.equal(scaleOf([9, 600]), 1 / 32);
});
