// @ts-check
// What the editor begins with: what a link hands over.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { filesOfLink } from "./files.js";

/** @type {import("../protocol.d.ts").Builtins} */
const builtins = JSON.parse(readFileSync(new URL("./builtins.json", import.meta.url), "utf8"));

// The choice of the rules was blank, and so was it for rules that do not exist, without a word.
test("rules of a link have the name that the choices have, or are refused", async () => {
  /** @param {string} rules */
  const rulesOf = async (rules) =>
    (await filesOfLink(`scenario=${builtins.scenarios[0].name}${rules}`, builtins))?.rules;
  assert.equal(await rulesOf(""), "smaclite");
  assert.equal(await rulesOf("&rules=paper"), "paper");
  assert.equal(await rulesOf("&rules=starcraft"), "starcraft-1");
  assert.equal(await rulesOf("&rules=starcraft-1"), "starcraft-1");
  const refused = /^Error: `rules` must be smaclite, paper, starcraft-1, got `(bogus|starcraft-2)`$/;
  for (const rules of ["bogus", "starcraft-2"]) await assert.rejects(rulesOf(`&rules=${rules}`), refused);
});
