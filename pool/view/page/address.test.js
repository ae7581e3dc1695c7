// @ts-check
// The address of a page of a replay: what it shows first, and that it says what it cannot show.

import assert from "node:assert/strict";
import { test } from "node:test";
import { readAddress } from "./address.js";

const counts = { moments: [81, 161, 241], units: 10, speeds: [0.25, 0.5, 1, 2, 4, 8, 16] };
const nothing = { episode: 0, tick: 0, unit: -1, speed: 1, plays: false, showsMap: false, problem: "" };

test("an address says what is shown first", () => {
  assert.deepEqual(readAddress("", counts), nothing);
  const address = "episode=2&tick=120&unit=9&speed=0.5&play=1&fit=map&theme=dark";
  const shown = { episode: 2, tick: 120, unit: 9, speed: 0.5, plays: true, showsMap: true, problem: "" };
  assert.deepEqual(readAddress(address, counts), shown);
});

// A page with `#nonsense`, or of an episode or theme that there is not, said nothing.
test("what cannot be shown is named, and the rest is shown", () => {
  for (const [address, problem] of [
    ["nonsense", "it has no `nonsense`, but episode, tick, unit, speed, play, fit, theme"],
    ["episode=3&tick=8", "`episode` must be a whole number from 0 to 2, got `3`"],
    ["tick=-1", "`tick` must be a whole number from 0 to 80, got `-1`"],
    ["episode=1&tick=161", "`tick` must be a whole number from 0 to 160, got `161`"],
    ["unit=1&unit=1&unit=2", "it must have `unit` once, got it 3 times"],
    ["unit=a", "`unit` must be a whole number from 0 to 9, got `a`"],
    ["fit=zz", "`fit` must be map, got `zz`"],
    ["play=yes", "`play` must be 1 or 0, got `yes`"],
    ["theme=zz", "`theme` must be dark or light, got `zz`"],
    ["speed=3", "`speed` must be one of 0.25, 0.5, 1, 2, 4, 8, 16, got `3`"],
  ])
    assert.equal(readAddress(address, counts).problem, problem);
  assert.equal(readAddress("episode=3&tick=8", counts).tick, 8);
});
