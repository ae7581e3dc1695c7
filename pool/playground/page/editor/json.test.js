// @ts-check
// The reader of JSON at its edges, and edits that leave the rest of a text as it is.

import assert from "node:assert/strict";
import { test } from "node:test";
import { JsonText, Raw, linesOf, numberText } from "./json.js";

test("texts that JSON.parse takes are read with the same values, and no others", () => {
  const texts = [
    "",
    " ",
    "null",
    "true",
    "[]",
    "{}",
    "[1,]",
    "[,1]",
    '{"a":1,}',
    '{"a" 1}',
    "{a:1}",
    "01",
    "-",
    "-0",
    "1.",
    ".5",
    "1e5",
    "1E-2",
    "1e",
    "+1",
    "NaN",
    "1 2",
    '"a\\u00e9\\n"',
    '"a\\x"',
    '"a\nb"',
    '"a\tb"',
    '"open',
    "[[[[]]]]",
    "[1, [2, {}], null, false]",
    "\u00a01",
  ];
  for (const text of texts) {
    const read = new JsonText(text);
    let expected;
    try {
      expected = JSON.parse(text);
    } catch {
      assert.ok(read.error, `${JSON.stringify(text)} must be refused`);
      continue;
    }
    assert.equal(read.error, null, text);
    const value = read.value();
    assert.deepEqual(value instanceof Map ? Object.fromEntries(value) : nested(value), expected, text);
  }
});

/**
 * Maps as objects.
 * @param {any} value
 * @returns {any}
 */
const nested = (value) =>
  Array.isArray(value)
    ? value.map(nested)
    : value instanceof Map
      ? Object.fromEntries([...value].map(([key, inner]) => [key, nested(inner)]))
      : value;

test("what the program refuses too is an error at its place", () => {
  /** @type {[string, string, number][]} */
  const cases = [
    ['{"a": 1, "a": 2}', "a duplicate key", 12],
    [`${"[".repeat(128)}${"]".repeat(128)}`, "nested too deeply", 127],
    ["[1] 2", "characters after the end", 4],
    ["[1 2]", "`,` or `]` is expected", 3],
  ];
  for (const [text, message, offset] of cases) {
    const { error } = new JsonText(text);
    assert.deepEqual([error?.message, error?.offset], [message, offset], text);
  }
  assert.equal(new JsonText(`${"[".repeat(127)}${"]".repeat(127)}`).error, null);
  assert.deepEqual(new JsonText("\ufeff[1]").value(), [1], "a byte order mark");
});

const KEYS = ["name", "groups", "width", "terrain"];
/** @param {string} text */
const file = (text) => new JsonText(text, KEYS);

test("an edit replaces only the value that it changes", () => {
  const text = '{\n  "name":"a",   "other" : [1,2 , 3]\n}';
  assert.equal(file(text).set(["other", 1], 7).text, text.replace("2 ,", "7 ,"));
  assert.equal(file(text).set(["name"], "a").text, text, "the same value");
  assert.equal(file("{").set(["name"], "a").text, "{", "a text with an error stays");
});

test("a new key goes where files have it, and unknown ones to the end", () => {
  const text = '{\n    "name": "a",\n    "width": 3\n}';
  const groups = file(text).set(["groups"], []);
  assert.equal(groups.text, '{\n    "name": "a",\n    "groups": [],\n    "width": 3\n}');
  assert.equal(file(text).set(["other"], 1).text, text.replace("3\n", '3,\n    "other": 1\n'));
  assert.equal(file("{}").set(["name"], "a").text, '{\n    "name": "a"\n}');
  // The order stays known after an edit.
  assert.ok(groups.set(["terrain"], 1).text.endsWith('"terrain": 1\n}'));
});

test("items and entries are removed with their commas", () => {
  for (const [path, expected] of /** @type {[import("./json.js").Path, string][]} */ ([
    [["a", 0], '{"a": [2, 3], "b": {"c": 1}}'],
    [["a", 1], '{"a": [1, 3], "b": {"c": 1}}'],
    [["a", 2], '{"a": [1, 2], "b": {"c": 1}}'],
    [["b", "c"], '{"a": [1, 2, 3], "b": {}}'],
    [["a"], '{"b": {"c": 1}}'],
    [["none"], '{"a": [1, 2, 3], "b": {"c": 1}}'],
  ]))
    assert.equal(file('{"a": [1, 2, 3], "b": {"c": 1}}').remove(path).text, expected, String(path));
});

test("entries get other keys, and neighbours exchange their places", () => {
  const text = '{"a": 1, "b": 2}';
  assert.equal(file(text).rename(["a"], "c").text, '{"c": 1, "b": 2}');
  assert.equal(file(text).rename(["a"], "b").text, text, "the key is taken");
  assert.equal(file(text).rename(["a"], "c", [0]).text, '{"c": [0], "b": 2}');
  assert.equal(file(text).exchange([], 0).text, '{"b": 2, "a": 1}');
  assert.equal(file(text).exchange([], 1).text, text, "there is no next one");
});

test("paths of messages lead to the values that exist", () => {
  const text = file('{"groups": [{"units": {"a.b": 1}}]}');
  assert.deepEqual(text.locate("groups[0].units.a.b"), ["groups", 0, "units", "a.b"]);
  assert.deepEqual(text.locate("groups[0].x"), ["groups", 0]);
  assert.deepEqual(text.locate("groups[7]"), ["groups"]);
  assert.deepEqual(text.position(text.span(["groups", 0])[0]), { line: 1, column: 13 });
});

// Every such number became null.
test("a number that is too large stays one", () => {
  const text = '{"a": 1, "b": [1e999, -1e999]}';
  const { a, b } = Object.fromEntries(file(text).value());
  assert.deepEqual([a, ...b], [1, Infinity, -Infinity]);
  assert.equal(file(text).set(["a"], Infinity).text, '{"a": 1e999, "b": [1e999, -1e999]}');
  assert.equal(file(text).set(["a"], b).text, '{"a": [1e999, -1e999], "b": [1e999, -1e999]}');
  assert.deepEqual([1.5, -0, 1e21, -Infinity].map(numberText), ["1.5", "0", "1e+21", "-1e999"]);
});

test("formatting is stable and keeps the values", () => {
  const text = file('{"terrain":["_X","X_"],"name":"a","groups":[{"x":1}]}');
  const formatted = text.formatted();
  assert.deepEqual(nested(formatted.value()), nested(text.value()));
  assert.ok(formatted.text.includes('"terrain": [\n        "_X",\n        "X_"\n    ]'), formatted.text);
  assert.equal(formatted.formatted(), formatted);
  const rows = new Raw((indent) => linesOf(["_", "X"], indent));
  assert.equal(
    file("{}").set(["terrain"], rows).text,
    '{\n    "terrain": [\n        "_",\n        "X"\n    ]\n}',
  );
});

test("what is added to a text with CR and LF has them too", () => {
  const file = new JsonText('{\r\n    "a": [1,\r\n        2]\r\n}\r\n', ["a", "b"]);
  const edited = file.set(["b"], { c: [1, { d: 2 }] }).set(["a"], [1, 2, 3]);
  assert.deepEqual(JSON.parse(edited.text), { a: [1, 2, 3], b: { c: [1, { d: 2 }] } });
  assert.doesNotMatch(edited.text, /[^\r]\n/);
  assert.equal(file.withLineEnds("a\nb\r\n"), "a\r\nb\r\n");
  assert.equal(new JsonText("{\n}").withLineEnds("a\nb"), "a\nb");
});
