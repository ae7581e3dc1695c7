// @ts-check
// Files that are opened or dropped on the page: a replay, a scenario, or those of a trained team.

import { byId } from "#view/dom.js";

/**
 * What the page does with files.
 * @typedef {object} Openers
 * @property {(name: string, bytes: Uint8Array<ArrayBuffer>) => Promise<void>} replay
 * @property {(text: string) => void} scenario
 * @property {(name: string, run: string, weights: Uint8Array) => void} team
 * @property {(error: unknown) => void} fail
 */

/** The weights of a run that play, the best ones first. */
const WEIGHTS = ["best.safetensors", "weights.safetensors"];

/** @param {Openers} openers */
export function listenToFiles(openers) {
  /** @param {Promise<File[]>} files */
  const open = (files) => files.then((list) => openFiles(list, openers)).catch(openers.fail);
  byId("open").addEventListener("click", () => byId("files").click());
  byId("files").addEventListener("change", () => {
    open(Promise.resolve([...byId("files").files]));
    byId("files").value = ""; // the same file can be opened again
  });
  addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  addEventListener("dragleave", () => document.body.classList.remove("dropping"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dropping");
    if (event.dataTransfer) open(droppedFiles(event.dataTransfer));
  });
}

/**
 * The files that were dropped, and those in folders that were.
 * @param {DataTransfer} data
 * @returns {Promise<File[]>}
 */
async function droppedFiles(data) {
  const entries = [...data.items].map((item) => item.webkitGetAsEntry?.()).filter((entry) => entry !== null);
  if (!entries.some((entry) => entry?.isDirectory)) return [...data.files];
  const lists = await Promise.all(
    entries.map((entry) => (entry?.isDirectory ? filesIn(/** @type {any} */ (entry)) : [])),
  );
  return [...data.files].filter((file) => file.size && file.name.includes(".")).concat(lists.flat());
}

/**
 * The files of a folder.
 * @param {FileSystemDirectoryEntry} folder
 * @returns {Promise<File[]>}
 */
async function filesIn(folder) {
  /** @type {FileSystemEntry[]} */
  const entries = await new Promise((done, fail) => folder.createReader().readEntries(done, fail));
  const files = entries.filter((entry) => entry.isFile).map((entry) => fileOf(/** @type {any} */ (entry)));
  return Promise.all(files);
}

/**
 * @param {FileSystemFileEntry} entry
 * @returns {Promise<File>}
 */
const fileOf = (entry) => new Promise((done, fail) => entry.file(done, fail));

/**
 * Opens a replay, a team or a scenario, whichever is there first.
 * @param {File[]} files
 * @param {Openers} openers
 */
export async function openFiles(files, openers) {
  const named = (/** @type {string} */ name) => files.find((file) => file.name === name);
  const replay = files.find((file) => file.name.endsWith(".smreplay"));
  if (replay) return openers.replay(replay.name, await bytesOfFile(replay));
  const run = named("run.json"),
    weights = WEIGHTS.map(named).find(Boolean) ?? files.find((file) => file.name.endsWith(".safetensors"));
  if (run && weights) {
    const { config, files: scenario } = JSON.parse(await run.text());
    const trainedIn = /([^/]+)\.json$/.exec(scenario?.source ?? "")?.[1] ?? "team";
    return openers.team(`${trainedIn}, seed ${config?.seed}`, await run.text(), await bytesOfFile(weights));
  }
  const scenario = files.find((file) => file.name.endsWith(".json") && file !== run);
  if (scenario) return openers.scenario(await scenario.text());
  throw new Error(
    "open a replay (.smreplay), a scenario (.json), or run.json and weights of a trained team together",
  );
}

/** @param {File} file */
const bytesOfFile = async (file) => new Uint8Array(await file.arrayBuffer());
