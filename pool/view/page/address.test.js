// @ts-check
// Addresses of pages: what is shown first, and that a page says what it cannot show.

import assert from "node:assert/strict";
import { test } from "node:test";
import { THEMES, readAddress } from "./address.js";

const moments = [81, 161, 241];
/** @type {import("./address.js").Keys} */
const KEYS = {
  episode: moments.length,
  tick: (said) => moments[Number(said.get("episode"))],
  speed: [0.5, 1, 2],
  start: { from: 8, below: 16 },
  group: 0,
  fit: ["map"],
  theme: THEMES,
  lane: null,
};
const NAMES = Object.keys(KEYS).join(", ");

// A page with `#nonsense`, or of an episode, an environment or a theme that there is not, said nothing.
test("what cannot be shown is named, and the rest is shown", () => {
  for (const [address, problem, shown] of [
    ["", "", ""],
    ["lane=&tick=120&episode=2&theme=dark", "", "lane=&tick=120&episode=2&theme=dark"],
    ["nonsense&fit=map", `it has no \`nonsense\`, but ${NAMES}`, "fit=map"],
    ["constructor", `it has no \`constructor\`, but ${NAMES}`, ""],
    ["__proto__=1&lane=", `it has no \`__proto__\`, but ${NAMES}`, "lane="],
    ["tick=8&episode=3", "`episode` must be a whole number from 0 to 2, got `3`", "tick=8"],
    ["tick=-1", "`tick` must be a whole number from 0 to 80, got `-1`", ""],
    ["tick=161&episode=1", "`tick` must be a whole number from 0 to 160, got `161`", "episode=1"],
    ["episode=", "`episode` must be a whole number from 0 to 2, got ``", ""],
    ["episode=a", "`episode` must be a whole number from 0 to 2, got `a`", ""],
    ["episode=1&episode=1&episode=2", "it must have `episode` once, got it 3 times", ""],
    ["fit=zz", "`fit` must be map, got `zz`", ""],
    ["theme=zz", "`theme` must be dark or light, got `zz`", ""],
    ["speed=3&x=1", `\`speed\` must be one of 0.5, 1, 2, got \`3\`; it has no \`x\`, but ${NAMES}`, ""],
    ["speed=", "`speed` must be one of 0.5, 1, 2, got ``", ""],
    ["speed=1x", "`speed` must be one of 0.5, 1, 2, got `1x`", ""],
    ["speed=0.50", "", "speed=0.50"],
    ["start=8", "", "start=8"],
    ["start=7", "`start` must be a whole number from 8 to 15, got `7`", ""],
    ["start=16", "`start` must be a whole number from 8 to 15, got `16`", ""],
    ["group=0", "`group` must be left out, as there is none, got `0`", ""],
  ]) {
    const read = readAddress(address, KEYS);
    assert.deepEqual([read.problem, String(read.said)], [problem, shown], address);
  }
});
