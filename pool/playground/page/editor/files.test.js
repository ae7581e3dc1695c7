// @ts-check
// What the editor begins with: what a link hands over, and files that are opened.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { ScenarioDocument } from "./document.js";
import { linkOf } from "../link.js";
import { FileStore, filesOfLink } from "./files.js";

/** @type {import("../protocol.d.ts").Builtins} */
const builtins = JSON.parse(readFileSync(new URL("./builtins.json", import.meta.url), "utf8"));

// The choice of the rules was blank, and so was it for rules that do not exist, without a message.
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

// The playground refused such links, and the editor opened them.
test("a link that is not whole is refused, whatever else the editor begins with", async () => {
  const battle = { seed: "1", opponent: "", rules: "", team: "kite", actions: [], taken: [] };
  const [{ name }] = builtins.scenarios,
    link = await linkOf({ scenario: name, ...battle });
  assert.equal((await filesOfLink(`${link}&tab=json&group=1`, builtins))?.files.source, `${name}.json`);
  const changed = link.replace("seed=1", "seed=2");
  await assert.rejects(filesOfLink(changed, builtins), /the link is incomplete or was changed/);
});

/**
 * What becomes of files that are opened.
 * @param {{ [name: string]: string }} files
 */
async function opened(files) {
  const text = builtins.new,
    doc = new ScenarioDocument(builtins, { source: "s.json", text, unit_files: [] });
  /** @type {any} */
  const page = {
    doc,
    panels: { types: {} },
    showTab() {},
    load: (/** @type {any} */ file) => doc.load(file),
  };
  const store = new FileStore(page, /** @type {any} */ ({ target: null, exists: false }));
  await store.openFiles(Object.entries(files).map(([name, text]) => new File([text], name)));
  return { scenario: doc.state.source, units: doc.units.map(({ name }) => name) };
}

// It was a unit type `mine`, and the scenario stayed another one.
test("a scenario whose teams are drawn is opened as a scenario", async () => {
  const teams = '{ "name": "mine", "teams": { "num_allies": 5 } }';
  assert.deepEqual(await opened({ "mine.json": teams }), { scenario: "mine.json", units: [] });
  assert.deepEqual(await opened({ "mine.json": `${teams},` }), { scenario: "mine.json", units: [] });
  const both = { "mine.json": '{ "groups": [] }', "guard.json": '{ "hp": 1 }' };
  assert.deepEqual(await opened(both), { scenario: "mine.json", units: ["guard"] });
  assert.deepEqual(await opened({ "guard.json": both["guard.json"] }), {
    scenario: "s.json",
    units: ["guard"],
  });
});
