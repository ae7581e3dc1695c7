// @ts-check
// Links: a battle as the part of an address after `#`, as `scenario=2s3z&seed=1&team=nearest&actions=...`. It
// is all that is needed to play the battle again, to the bit. A link that the page made begins with a
// checksum, because chat programs cut links; one that a person wrote has none.

import { PLAY, THEMES, readAddress } from "#view/address.js";
import { isText } from "./scenario.js";

/**
 * A battle: its scenario (as `Source` in src/protocol.rs has it), who plays, and the joint actions of its
 * steps. @typedef {{ scenario: string, seed: string, opponent: string, rules: string, team: string,
 *   actions: number[], taken: number[] }} SharedBattle
 */

/** @import { Keys } from "#view/address.js" */
/** @type {Keys} What a link says of the battle. */
const BATTLE = {
  scenario: null,
  file: null,
  seed: null,
  opponent: null,
  rules: null,
  team: null,
  actions: null,
  taken: null,
};
/** @type {Keys} What a link can have; main.js reads `play`, which starts the battle at once. */
export const LINK = { check: null, ...BATTLE, play: PLAY, theme: THEMES };
/** Bytes of what is decompressed, as the program takes them of replays. */
const LONGEST = 2 ** 26;

const INCOMPLETE = "the link is incomplete or was changed; copy all of it";

/**
 * Passes bytes through a stream that compresses or decompresses.
 * @param {Uint8Array<ArrayBuffer>} bytes
 * @param {CompressionStream | DecompressionStream} stream
 */
export async function through(bytes, stream) {
  let length = 0;
  /** @type {RangeError | null} */
  let tooLong = null; // browsers replace what a stream throws
  /** @type {TransformStream<Uint8Array, Uint8Array>} */
  const counted = new TransformStream({
    transform(part, out) {
      // A small file can be much longer than any memory.
      if ((length += part.length) > LONGEST)
        throw (tooLong = new RangeError("it has more than 64 MiB after decompression"));
      out.enqueue(part);
    },
  });
  const readable = new Blob([bytes]).stream().pipeThrough(stream).pipeThrough(counted);
  try {
    return new Uint8Array(await new Response(readable).arrayBuffer());
  } catch (cause) {
    throw tooLong ?? cause;
  }
}

/**
 * Bytes as base64 text.
 * @param {Uint8Array} bytes
 */
export const base64 = (bytes) => btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));

/**
 * Bytes as text for an address.
 * @param {Uint8Array<ArrayBuffer>} bytes
 */
async function packed(bytes) {
  const text = base64(await through(bytes, new CompressionStream("deflate-raw")));
  return text.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** @param {string} text */
async function unpacked(text) {
  try {
    const binary = atob(text.replaceAll("-", "+").replaceAll("_", "/"));
    const bytes = Uint8Array.from(binary, (letter) => letter.charCodeAt(0));
    return await through(bytes, new DecompressionStream("deflate-raw"));
  } catch (cause) {
    throw new Error(INCOMPLETE, { cause }); // what the browser says names neither link nor reason
  }
}

/**
 * A checksum of what a link says of a battle: FNV-1a, 32 bits.
 * @param {URLSearchParams} link
 */
function checkOf(link) {
  const said = new URLSearchParams([...link].filter(([key]) => Object.hasOwn(BATTLE, key)));
  let sum = 0x811c9dc5;
  for (const byte of new TextEncoder().encode(said.toString())) sum = Math.imul(sum ^ byte, 0x01000193);
  return (sum >>> 0).toString(16).padStart(8, "0");
}

/**
 * What a link says; an error if it is not whole, or cannot be followed.
 * @param {string} text
 * @param {Keys} [more] what the page accepts besides
 */
export function linkParts(text, more) {
  const link = new URLSearchParams(text),
    check = link.get("check"),
    { said, problem } = readAddress(text, { ...LINK, ...more });
  if (check !== null && check !== checkOf(link)) throw new Error(INCOMPLETE);
  if (problem) throw new Error(problem);
  return said;
}

/**
 * A battle as text: what stands behind `#`.
 * @param {SharedBattle} battle
 */
export async function linkOf({ scenario, seed, opponent, rules, team, actions, taken }) {
  const link = new URLSearchParams();
  if (isText(scenario)) link.set("file", await packed(new TextEncoder().encode(scenario)));
  else link.set("scenario", scenario);
  link.set("seed", seed);
  if (opponent) link.set("opponent", opponent);
  if (rules) link.set("rules", rules);
  link.set("team", team);
  // Two bytes per action, little-endian.
  const bytes = Uint8Array.from(actions.flatMap((action) => [action & 255, action >> 8]));
  if (actions.length) link.set("actions", await packed(bytes));
  if (taken.length) link.set("taken", taken.join("."));
  return `check=${checkOf(link)}&${link}`;
}

/**
 * The scenario of a link, if it has one: a name or a text.
 * @param {URLSearchParams} link
 */
export async function scenarioOf(link) {
  const file = link.get("file");
  return file ? new TextDecoder().decode(await unpacked(file)) : link.get("scenario");
}

/**
 * The battle of a link; what it leaves out is that of `defaults`.
 * @param {string} text
 * @param {SharedBattle} defaults
 * @returns {Promise<SharedBattle>}
 */
export async function battleOf(text, defaults) {
  const link = linkParts(text);
  const [actions, taken] = ["actions", "taken"].map((key) => link.get(key));
  const bytes = actions ? await unpacked(actions) : new Uint8Array();
  if (bytes.length % 2) throw new Error(INCOMPLETE);
  if (taken && !/^\d+(\.\d+)*$/.test(taken))
    throw new Error(`\`taken\` must be numbers of agents with a dot between them, got \`${taken}\``);
  const scenario = await scenarioOf(link);
  // Who plays in the scenario of the page says nothing of another one.
  const rest = scenario ? { ...defaults, opponent: "", rules: "", taken: [] } : defaults;
  return {
    scenario: scenario ?? defaults.scenario,
    seed: link.get("seed") ?? rest.seed,
    opponent: link.get("opponent") ?? rest.opponent,
    rules: link.get("rules") ?? rest.rules,
    team: link.get("team") ?? rest.team,
    actions: Array.from({ length: bytes.length >> 1 }, (_, i) => bytes[2 * i] | (bytes[2 * i + 1] << 8)),
    taken: taken ? taken.split(".").map(Number) : rest.taken,
  };
}
