// @ts-check
// Files that are opened or dropped on the page: a replay, a scenario with its unit files, or those of a
// trained team.

import { byId, listenToDrops } from "#view/dom.js";
import { through } from "./link.js";
import { nameOf, textOfBytes, textOfFile } from "./scenario.js";

/** @import { TextFile } from "./protocol.d.ts" */
/**
 * A file, and its path in the folder that was dropped.
 * @typedef {{ path: string, file: File }} Opened
 */
/**
 * What the page does with files.
 * @typedef {object} Openers
 * @property {(name: string, bytes: Uint8Array<ArrayBuffer>) => Promise<void>} replay
 * @property {(files: TextFile[]) => Promise<void>} scenario
 * @property {(name: string, run: string, weights: Uint8Array) => Promise<void>} team
 * @property {(error: unknown) => void} fail
 */

const SUFFIXES = [".smreplay", ".json", ".safetensors"];
/** Folders in folders that are looked into: unit files may be in one of their own. */
const DEEPEST = 3;

/** What teams are called: another team of the same name, such as a second run, has a number behind it. */
export class TeamNames {
  /** @param {{ name: string, weights: string }[]} teams */
  constructor(teams) {
    this.weights = new Map(teams.map(({ name, weights }) => [name, weights]));
  }

  /**
   * The name of a team of this name with these weights, which it has already if it was opened before.
   * @param {string} name
   * @param {string} weights
   */
  nameOf(name, weights) {
    for (let count = 1; ; count++) {
      const numbered = count === 1 ? name : `${name} (${count})`;
      if ((this.weights.get(numbered) ?? weights) === weights) return numbered;
    }
  }

  /**
   * @param {string} name
   * @param {string} weights
   */
  take(name, weights) {
    this.weights.set(name, weights);
  }
}

/** @param {Openers} openers */
export function listenToFiles(openers) {
  /** @param {Promise<Opened[]>} files */
  const open = (files) => files.then((list) => openFiles(list, openers)).catch(openers.fail);
  byId("open").addEventListener("click", () => byId("files").click());
  byId("files").addEventListener("change", () => {
    open(Promise.resolve([...byId("files").files].map((file) => ({ path: file.name, file }))));
    byId("files").value = ""; // the same file can be opened again
  });
  listenToDrops((data) => open(droppedFiles(data)));
}

/**
 * The files that were dropped, and those in folders that were.
 * @param {DataTransfer} data
 * @returns {Promise<Opened[]>}
 */
async function droppedFiles(data) {
  const entries = [...data.items].map((item) => item.webkitGetAsEntry?.());
  if (entries.some((entry) => !entry)) return [...data.files].map((file) => ({ path: file.name, file }));
  const all = entries.map((entry) => filesIn(/** @type {FileSystemEntry} */ (entry), "", DEEPEST));
  return (await Promise.all(all)).flat();
}

/**
 * The files of an entry that the page may read.
 * @param {FileSystemEntry} entry
 * @param {string} folder
 * @param {number} depth
 * @returns {Promise<Opened[]>}
 */
async function filesIn(entry, folder, depth) {
  const path = folder + entry.name;
  if (entry.isFile) {
    /** @type {File} */
    const file = await new Promise((done, fail) => /** @type {any} */ (entry).file(done, fail));
    return [{ path, file }];
  }
  if (!depth) return [];
  const reader = /** @type {FileSystemDirectoryEntry} */ (entry).createReader();
  /** @type {FileSystemEntry[]} */
  const entries = [];
  for (;;) {
    /** @type {FileSystemEntry[]} */
    const some = await new Promise((done, fail) => reader.readEntries(done, fail));
    if (!some.length) break; // browsers give a hundred at a time
    entries.push(...some);
  }
  const kept = entries.filter(
    ({ isFile, name }) => !isFile || SUFFIXES.some((suffix) => name.endsWith(suffix)),
  );
  return (await Promise.all(kept.map((one) => filesIn(one, `${path}/`, depth - 1)))).flat();
}

/**
 * Opens a replay, a team or a scenario: of a folder what is in it, not what is in folders below.
 * @param {Opened[]} files
 * @param {Openers} openers
 */
export async function openFiles(files, openers) {
  /** @param {Opened} opened */
  const depth = ({ path }) => path.split("/").length;
  const readable = files.filter(({ path }) => SUFFIXES.some((suffix) => path.endsWith(suffix)));
  const least = Math.min(...readable.map(depth)),
    first = readable.filter((opened) => depth(opened) === least);
  const [replay, another] = first.filter(({ path }) => path.endsWith(".smreplay"));
  if (another) throw new Error("these are several replays; open one");
  if (replay) return openers.replay(replay.file.name, await bytesOfFile(replay.file));
  const runs = first.filter(({ file }) => file.name === "run.json"),
    weights = first.filter(({ path }) => path.endsWith(".safetensors"));
  if (runs.length > 1) throw new Error("these are several teams; open the folder of one");
  if (runs.length) return openTeam(await textOfFile(runs[0].file), weights, openers);
  if (weights.length) throw new Error(`open the run.json of the team together with ${weights[0].file.name}`);
  const texts = readable.filter(({ path }) => path.endsWith(".json"));
  if (!texts.length)
    throw new Error(
      "open a replay (.smreplay), a scenario (.json) and its unit files, or run.json and weights of a team",
    );
  const read = texts.map(async ({ file }) => ({ name: file.name, text: await textOfFile(file) }));
  return openers.scenario(await Promise.all(read));
}

/**
 * @param {string} run
 * @param {Opened[]} weights
 * @param {Openers} openers
 */
async function openTeam(run, weights, openers) {
  const { name, seed, plays } = describe(run),
    named = plays.map((best) => weights.find(({ file }) => file.name === best)),
    file = (named.find(Boolean) ?? weights[0])?.file;
  if (!file) throw new Error(`run.json is that of a team; open ${plays.join(" or ")} together with it`);
  return openers.team(`${name}, seed ${seed}`, run, await bytesOfFile(file));
}

/**
 * What a run is called, and which of its weights play, as `Weights::of` in bindings/learn/src/description.rs
 * has it: in self-play the last ones. What is damaged, the engine finds out.
 * @param {string} run
 */
function describe(run) {
  /** @type {any} */
  let file = {};
  try {
    file = JSON.parse(run) ?? {};
  } catch {
    // The engine says where.
  }
  const plays = ["best.safetensors", "weights.safetensors"];
  if (file.config?.enemies?.self_play) plays.reverse();
  return { name: nameOf(run) ?? "team", seed: file.config?.seed, plays };
}

/** @param {File} file */
const bytesOfFile = async (file) => new Uint8Array(await file.arrayBuffer());

/**
 * The text in a replay file.
 * @param {string} name
 * @param {Uint8Array<ArrayBuffer>} bytes
 */
export async function textOf(name, bytes) {
  if (bytes[0] !== 0x1f || bytes[1] !== 0x8b)
    throw new Error(`${name} is not a replay: it must be JSON compressed by gzip`);
  const text = through(bytes, new DecompressionStream("gzip")).catch((cause) => {
    // What the browser says names neither the file nor the reason.
    const why = cause instanceof RangeError ? cause.message : "it cannot be decompressed";
    throw new Error(`${name} is damaged or incomplete: ${why}`, { cause });
  });
  return textOfBytes(name, await text);
}
