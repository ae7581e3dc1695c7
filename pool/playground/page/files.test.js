// @ts-check
// Which of the files that a person opens or drops are read, and as what.

import assert from "node:assert/strict";
import { test } from "node:test";
import { TeamNames, openFiles, textOf } from "./files.js";

const RUN = JSON.stringify({ config: { seed: 3 }, files: { text: '{"name": "keep"}' } });
const SELF_PLAY = JSON.stringify({ config: { seed: 3, enemies: { self_play: {} } }, files: { text: "{}" } });

/**
 * What the page is told to open.
 * @param {{ [path: string]: string | Uint8Array<ArrayBuffer> }} files
 */
async function opened(files) {
  /** @type {unknown[]} */
  const calls = [];
  const list = Object.entries(files).map(([path, text]) => ({
    path,
    file: new File([text], path.split("/").at(-1) ?? ""),
  }));
  /** @type {any} */
  const openers = {
    replay: async (/** @type {string} */ name) => calls.push(["replay", name]),
    scenario: (/** @type {{ name: string }[]} */ texts) =>
      calls.push(["scenario", ...texts.map(({ name }) => name)]),
    team: (/** @type {string} */ name, /** @type {string} */ _, /** @type {Uint8Array} */ weights) =>
      calls.push(["team", name, new TextDecoder().decode(weights)]),
  };
  await openFiles(list, openers);
  return calls[0];
}

test("a run is a team with the weights that the program would play", async () => {
  const weights = { "best.safetensors": "best", "weights.safetensors": "last" };
  assert.deepEqual(await opened({ "run.json": RUN, ...weights }), ["team", "keep, seed 3", "best"]);
  assert.deepEqual(await opened({ "run.json": SELF_PLAY, ...weights }), ["team", "team, seed 3", "last"]);
  assert.deepEqual(await opened({ "run.json": RUN, "a.safetensors": "a" }), ["team", "keep, seed 3", "a"]);
});

test("of a folder that was dropped, what is in it is opened, not what is below", async () => {
  const run = { "keep/run.json": RUN, "keep/weights.safetensors": "last" };
  const below = {
    "keep/opponent/run.json": RUN,
    "keep/opponent/best.safetensors": "another",
    "keep/a/b.smreplay": "",
  };
  assert.deepEqual(await opened({ ...below, ...run }), ["team", "keep, seed 3", "last"]);
  const scenario = { "maps/keep.json": "{}", "maps/units/scout.json": "{}" };
  assert.deepEqual(await opened(scenario), ["scenario", "keep.json", "scout.json"]);
  assert.deepEqual(await opened({ ...run, "keep/one.smreplay": "" }), ["replay", "one.smreplay"]);
});

test("a part of what belongs together is refused with what is missing", async () => {
  await assert.rejects(
    opened({ "run.json": RUN }),
    /open best.safetensors or weights.safetensors together with it/,
  );
  await assert.rejects(
    opened({ "best.safetensors": "" }),
    /open the run.json of the team together with best/,
  );
  await assert.rejects(opened({ "a/1/run.json": RUN, "a/2/run.json": RUN }), /these are several teams/);
  await assert.rejects(opened({ "a.snapshot": "" }), /open a replay \(.smreplay\), a scenario/);
  await assert.rejects(opened({}), /open a replay/);
});

// Two runs of a map with the same seed, as with other hyperparameters, replaced each other.
test("a team with other weights does not replace one of the same name", () => {
  const names = new TeamNames([{ name: "all-maps", weights: "zoo" }]);
  /** @param {string} weights */
  const opened = (weights, name = "3m, seed 1") => {
    const given = names.nameOf(name, weights);
    names.take(given, weights);
    return given;
  };
  assert.equal(opened("one"), "3m, seed 1");
  assert.equal(opened("two"), "3m, seed 1 (2)");
  assert.equal(opened("three"), "3m, seed 1 (3)");
  assert.equal(opened("two"), "3m, seed 1 (2)", "the same one is opened again");
  assert.equal(opened("one", "all-maps"), "all-maps (2)");
});

// What was no UTF-8 was silently replaced.
test("a file that is no UTF-8 text is refused", async () => {
  const refused = /^Error: a.json: cannot be read: it is not UTF-8 text$/;
  const latin1 = Uint8Array.of(0x7b, 0x22, 0xe9, 0x22, 0x3a, 0x31, 0x7d);
  const utf16 = Uint8Array.of(0xff, 0xfe, 0x7b, 0, 0x7d, 0);
  for (const bytes of [latin1, utf16]) {
    await assert.rejects(opened({ "a.json": bytes }), refused);
    await assert.rejects(opened({ "run.json": bytes, "best.safetensors": "" }), /run.json: cannot be read/);
    const packed = new Response(new Blob([bytes]).stream().pipeThrough(new CompressionStream("gzip")));
    await assert.rejects(textOf("a.json", new Uint8Array(await packed.arrayBuffer())), refused);
  }
});

// The page said "Failed to fetch".
test("a replay that is damaged is named, and what is wrong with it", async () => {
  const whole = new Response(new Blob(["{}"]).stream().pipeThrough(new CompressionStream("gzip")));
  const bytes = new Uint8Array(await whole.arrayBuffer());
  assert.equal(await textOf("a", bytes), "{}");
  await assert.rejects(
    textOf("a.smreplay", bytes.slice(0, -3)),
    /^Error: a.smreplay is damaged or incomplete/,
  );
  await assert.rejects(textOf("a.smreplay", bytes.slice(2)), /^Error: a.smreplay is not a replay/);
});

// The page took all the memory that it needed, and crashed.
test("a small replay with more text than any has is refused", async () => {
  const text = new Blob(Array(65).fill(" ".repeat(2 ** 20)));
  const long = new Response(text.stream().pipeThrough(new CompressionStream("gzip")));
  await assert.rejects(
    textOf("a.smreplay", new Uint8Array(await long.arrayBuffer())),
    /^Error: a.smreplay is damaged or incomplete: it has more than 64 MiB after decompression/,
  );
});
