// @ts-check
// The engine in WebAssembly plays what the native one plays, to the bit, and the page is small. `just
// test-playground` builds what is tested here; without it the tests are skipped.

import assert from "node:assert/strict";
import { existsSync, readFileSync, readdirSync } from "node:fs";
import { test } from "node:test";
import { gunzipSync, gzipSync } from "node:zlib";
import { WasmEngine } from "./engine.js";

const BUILT = new URL("../../../target/playground/", import.meta.url);
const GOLDEN = new URL("golden/", BUILT);
/** Bytes of the page without teams, compressed by gzip. Its engine answers the editor, too. */
const LARGEST_PAGE = 460_000;

const file = new URL("engine.wasm", BUILT);
const skip = existsSync(file) ? false : "`just playground` has built no engine";
const load = () => WasmEngine.load(readFileSync(file));

/** @param {string} name */
const goldenText = (name) => gunzipSync(readFileSync(new URL(name, GOLDEN))).toString();

test("recorded battles are played to the bit, tick by tick", { skip }, async (t) => {
  if (!existsSync(GOLDEN)) return t.skip("`just test-playground` writes the replays");
  const engine = await load();
  const names = readdirSync(GOLDEN).filter((name) => name.endsWith(".smreplay"));
  assert.ok(names.length > 0);
  for (const name of names) {
    // It is an error if a checksum, which covers all units after every tick, differs.
    const { episodes } = await engine.request({ type: "open_replay", name, replay: goldenText(name) });
    const [{ checksum, steps }] = episodes;
    const { played } = await engine.request({
      type: "begin_battle",
      of: { kind: "episode", episode: 0 },
      team: "nearest",
      actions: null,
      taken: [],
    });
    assert.equal(played.steps, steps, name);
    assert.equal((await engine.request({ type: "get_replay" })).checksum, checksum, name);
  }
  t.diagnostic(`${names.length} recordings`);
});

test("a battle that is played otherwise than recorded is refused", { skip }, async (t) => {
  if (!existsSync(GOLDEN)) return t.skip("`just test-playground` writes the replays");
  const engine = await load();
  const [name] = readdirSync(GOLDEN);
  const replay = JSON.parse(goldenText(name));
  replay.episodes[0].step_checksums[1] ^= 1;
  await assert.rejects(
    () => engine.request({ type: "open_replay", name, replay: JSON.stringify(replay) }),
    /step 1/,
  );
});

/** @type {{ scenario: string, team: string, opponent: string, steps: number, result: string,
 *   checksum: string, obs: string }[]} */
const battles = JSON.parse(readFileSync(new URL("engine.test.json", import.meta.url), "utf8"));

// A Rust test of src/session.rs writes what the native engine does.
test("scripts, opponents and observations are those of the native engine", { skip }, async () => {
  const engine = await load();
  for (const battle of battles) assert.deepEqual(await play(engine, battle), battle);
});

/**
 * @param {WasmEngine} engine
 * @param {{ scenario: string, team: string, opponent: string }} battle
 */
async function play(engine, { scenario, team, opponent }) {
  const of = /** @type {const} */ ({ kind: "scenario", scenario, seed: "7", opponent, rules: "" });
  await engine.request({ type: "begin_battle", of, team, actions: [], taken: [] });
  const { steps, result } = await engine.request({ type: "play_steps", steps: 1000 });
  const { checksum } = await engine.request({ type: "get_replay" });
  const { obs } = await engine.request({ type: "get_observation", step: 3, agent: 1 });
  const bits = new Uint32Array(Float32Array.from(obs).buffer).reduce(
    (sum, word) => (sum * 31 + word) >>> 0,
    0,
  );
  return { scenario, team, opponent, steps, result, checksum, obs: bits.toString(16) };
}

test("a request that is refused says why, and the battle goes on", { skip }, async () => {
  const engine = await load();
  const refused = { name: "a", replay: "{}" };
  await assert.rejects(() => engine.request({ type: "open_replay", ...refused }), /not a replay|a: /);
  await assert.rejects(() => engine.request({ type: "play_steps", steps: 1 }), /begin a battle first/);
  const of = /** @type {const} */ ({ kind: "scenario", seed: "1", opponent: "", rules: "" });
  /** @param {string} scenario */
  const begin = (scenario) =>
    engine.request({
      type: "begin_battle",
      of: { ...of, scenario },
      team: "nearest",
      actions: [],
      taken: [],
    });
  await assert.rejects(() => begin("3n"), /did you mean/);
  await begin("3m");
  await assert.rejects(
    () => engine.request({ type: "take_agents", agents: [3] }),
    /agent must be below 3, got 3/,
  );
  assert.equal((await engine.request({ type: "play_steps", steps: 1 })).steps, 1);
});

test("a person reads that the engine has stopped, not that it met something unreachable", async () => {
  const memory = new WebAssembly.Memory({ initial: 1 });
  const respond = () => {
    throw new WebAssembly.RuntimeError("unreachable");
  };
  const engine = new WasmEngine({ memory, request: () => 0, respond, response: () => 0 });
  await assert.rejects(() => engine.request({ type: "get_choices" }), {
    message: "the engine has stopped; reload the page",
  });
});

test("the page is small", { skip }, (t) => {
  const page = readFileSync(new URL("battle.html", BUILT), "utf8");
  const bytes = gzipSync(page.replace(/"teams":\[.*?\](?=\}<)/s, '"teams":[]'), { level: 9 }).length;
  t.diagnostic(`${bytes} bytes`);
  assert.ok(bytes <= LARGEST_PAGE, `the page has ${bytes} bytes, compressed`);
});
