// @ts-check
// A scenario as a document: undo and redo, and what must agree after an edit. The keys of files and what is
// built in are those of the program (builtins.json, written by a test of editor/builtins.rs).

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { ScenarioDocument } from "./document.js";

/** @type {import("../protocol.d.ts").Builtins} */
const builtins = JSON.parse(readFileSync(new URL("./builtins.json", import.meta.url), "utf8"));

const open = () => {
  const { text } = builtins.scenarios[0];
  return new ScenarioDocument(builtins, { source: "s.json", text, unit_files: [] });
};

test("while the text is no JSON, the last map and groups are shown and cannot be edited", () => {
  const doc = open();
  const [map, groups] = [doc.map(), doc.groups()];
  doc.setText(-1, `${doc.scenario.text},`, null);
  assert.deepEqual([doc.isStale, doc.map(), doc.groups()], [true, map, groups]);
  doc.moveGroup(0, 1, 2, null);
  doc.setMap({ ...map, blocked: map.blocked.map(() => 1) });
  doc.removeGroup(0);
  assert.ok(doc.scenario.text.endsWith(","));
  doc.setText(-1, '{ "width": 7 }', null);
  assert.deepEqual([doc.isStale, doc.map().width, doc.groups()], [false, 7, []]);
  doc.undo();
  assert.deepEqual([doc.isStale, doc.map(), doc.groups()], [true, map, groups], "those before that text");
});

test("unit files that only teams name have their keys, and teams the new name", () => {
  const teams = { distribution: "fixed", teams: [["units/scout", "MARINE"], ["units/scout"]] };
  const scout = { name: "scout", keys: [], text: "{}" };
  const text = JSON.stringify({ name: "drawn", teams });
  const doc = new ScenarioDocument(builtins, { source: "s.json", text, unit_files: [scout] });
  assert.deepEqual(doc.files().unit_files[0].keys, ["units/scout"]);
  doc.renameUnit(0, "spy");
  assert.deepEqual(doc.scenario.value(["teams", "teams"]), [["spy", "MARINE"], ["spy"]]);
  assert.deepEqual(doc.files().unit_files[0].keys, ["spy"]);
});

test("what is undone is redone, to the letter", () => {
  const doc = open();
  const texts = [doc.scenario.text];
  doc.setKey(["name"], "other");
  texts.push(doc.scenario.text);
  doc.addGroup("ENEMY", 1, 2, { MARINE: 3 });
  texts.push(doc.scenario.text);
  for (const text of [...texts].reverse().slice(1)) {
    doc.undo();
    assert.equal(doc.scenario.text, text);
  }
  assert.ok(doc.isSaved);
  doc.undo();
  assert.equal(doc.scenario.text, texts[0], "there is nothing before");
  for (const text of texts.slice(1)) {
    doc.redo();
    assert.equal(doc.scenario.text, text);
  }
  doc.undo();
  doc.setKey(["name"], "third");
  doc.redo();
  assert.equal(doc.scenario.value(["name"]), "third", "a change forgets what was undone");
});

test("changes in a row are undone as one, until they are settled", () => {
  const doc = open();
  for (const name of ["a", "ab", "abc"]) doc.setKey(["name"], name, "typing");
  doc.settle();
  doc.setKey(["name"], "abcd", "typing");
  doc.undo();
  assert.equal(doc.scenario.value(["name"]), "abc");
  doc.undo();
  assert.ok(doc.isSaved);
});

test("an edit of groups keeps the counts of units", () => {
  const doc = open();
  const before = doc.scenario.value(["num_enemy_units"]);
  doc.addGroup("ENEMY", 1, 2, { MARINE: 3 });
  assert.equal(doc.scenario.value(["num_enemy_units"]), before + 3);
  doc.setCount(doc.groups().length - 1, "MARINE", 5);
  assert.equal(doc.scenario.value(["num_enemy_units"]), before + 5);
  doc.removeGroup(doc.groups().length - 1);
  assert.equal(doc.scenario.value(["num_enemy_units"]), before);
});

test("a drawn map replaces a preset, and only rows that change", () => {
  const doc = open();
  const map = doc.map();
  assert.notEqual(map.preset, null);
  map.blocked[0] = 1;
  doc.setMap(map);
  assert.equal(doc.scenario.node(["terrain_preset"]), null);
  assert.equal(doc.scenario.value(["terrain"]).length, doc.formats.side.missing);
  const { text } = doc.scenario;
  const changed = { ...doc.map(), blocked: doc.map().blocked.slice() };
  changed.blocked[1] = 1 - changed.blocked[1];
  doc.setMap(changed);
  const lines = doc.scenario.text.split("\n").filter((line, i) => line !== text.split("\n")[i]);
  assert.equal(lines.length, 1);
});

test("a unit file replaces a standard type only if the program says so", () => {
  const doc = open();
  for (const { name, is_replaceable: isReplaceable } of builtins.units) {
    doc.addUnit(name, "{}");
    assert.equal(doc.unitOf(name) >= 0, isReplaceable, name);
    doc.undo();
  }
});
