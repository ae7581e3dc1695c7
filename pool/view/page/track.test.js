// @ts-check
// A battle that Rust encoded (track.test.json, written by a test of src/page/data.rs) is decoded as it was.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { Track, bytesOf, inflate } from "./track.js";

const { info, episode, actions, moments } = JSON.parse(
  readFileSync(new URL("./track.test.json", import.meta.url), "utf8"),
);
/** Ticks between two moments of the file. */
const STRIDE = 40;

const decoded = async () => {
  const track = new Track(info);
  track.append(await inflate(episode.moments), episode.n_moments);
  track.appendDecisions(await inflate(episode.decisions));
  return track;
};

test("every unit is where it was, to what can be seen", async () => {
  const track = await decoded();
  assert.equal(track.length, episode.n_moments);
  assert.equal(moments.length, Math.ceil(track.length / STRIDE));
  for (const [i, moment] of moments.entries()) {
    for (const [unit, expected] of moment.units.entries()) {
      const state = track.unitAt(unit, i * STRIDE);
      assert.ok(Math.abs(state.x - expected.x) <= 0.51 / info.units_per.position, `x of ${unit} at ${i}`);
      assert.ok(Math.abs(state.y - expected.y) <= 0.51 / info.units_per.position, `y of ${unit} at ${i}`);
      // Health is rounded up, so that a unit that lives has some.
      assert.ok(Math.abs(state.hp - expected.hp) <= 1.01 / info.units_per.points, `hp of ${unit} at ${i}`);
      assert.deepEqual([state.alive, state.target], [expected.alive, expected.target], `${unit} at ${i}`);
    }
    assert.equal(track.attacks[i * STRIDE].length, moment.attacks);
  }
});

test("no moments change nothing", async () => {
  const track = await decoded(),
    { length, info: known } = track;
  track.append(new Uint8Array(), 0);
  assert.equal(track.length, length);
  assert.equal(track.info, known, "not even the types of the units");
});

test("decisions have the actions, and those that were available", async () => {
  const track = await decoded();
  assert.equal(track.decisions.length, episode.steps + 1, "the end has no actions, but some are available");
  assert.deepEqual(
    track.decisions[0].map(({ action }) => action),
    actions,
  );
  for (const { action, available } of track.decisions.slice(0, -1).flat())
    assert.ok(available.includes(action) && available.every((other) => other < info.n_actions));
  assert.ok(track.decisions[episode.steps].every(({ action }) => action === -1));
});

test("deaths, and the shares of health, follow from the moments", async () => {
  const track = await decoded();
  assert.deepEqual([track.health[0][0], track.health[1][0]], [1, 1]);
  const dead = [0, 1].map(
    (faction) => track.deaths.filter(({ unit }) => info.units[unit].faction === faction).length,
  );
  assert.deepEqual(dead, episode.dead);
  for (const { tick, unit } of track.deaths) {
    assert.ok(track.unitAt(unit, tick - 1).alive && !track.unitAt(unit, tick).alive);
    assert.equal(track.deathTick[unit], tick);
  }
});

test("a track grows by parts", async () => {
  const bytes = await inflate(episode.moments);
  const [whole, twice] = [new Track(info), new Track(info)];
  whole.append(bytes, episode.n_moments);
  for (let part = 0; part < 2; part++) twice.append(bytes, episode.n_moments);
  assert.equal(twice.length, 2 * whole.length);
  assert.deepEqual(twice.unitAt(3, whole.length), whole.unitAt(3, 0));
});

test("a position between two ticks lies between them, and a turn goes the short way", async () => {
  const track = await decoded();
  const [before, middle, after] = [10, 10.5, 11].map((time) => track.unitAt(0, time));
  assert.ok(Math.abs(middle.x - (before.x + after.x) / 2) < 1e-6);
  track.facing[10 * track.units] = 0.1;
  track.facing[11 * track.units] = 2 * Math.PI - 0.1;
  assert.ok(Math.abs(track.unitAt(0, 10.5).facing) < 1e-6);
});

test("base64 becomes bytes", () => assert.deepEqual([...bytesOf("AP8Q")], [0, 255, 16]));
