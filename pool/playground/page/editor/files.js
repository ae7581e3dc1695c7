// @ts-check
// FileStore: opens files of the browser's user, and saves: in place through the program, or by download.

import { download, messageOf, tell } from "#view/dom.js";
import { stemOf } from "./document.js";
import { linkParts, scenarioOf } from "../link.js";
import { isText, nameOf, textOfFile } from "../scenario.js";
import { JsonText } from "./json.js";

/** @import { EditorPage } from "./editor.js" */
/** @import { Builtins, ScenarioFiles } from "../protocol.d.ts" */
/**
 * What the editor begins with. A page without a program has no target, and saves by download.
 * @typedef {object} Opened
 * @property {ScenarioFiles} files
 * @property {string | null} target The file that is saved.
 * @property {boolean} exists Whether it exists.
 * @property {Base} base
 * @property {(files: ScenarioFiles, base: Base, replace: boolean) =>
 *   Promise<{ saved: { files: string[], base: Base } } | { conflicts: string[] }>} save
 */
/**
 * Checksums of the files that the program opened or saved last for this page; it compares the disk with them.
 * @typedef {{ [file: string]: string }} Base
 */

/**
 * The files of the scenario that a link hands over, if it does, and the seed and rules of its battle.
 * @param {string} link
 * @param {Builtins} builtins
 * @returns {Promise<{ files: ScenarioFiles, seed: string, rules: string } | null>}
 */
export async function filesOfLink(link, builtins) {
  const keys = linkParts(link, { tab: null, group: null }),
    scenario = await scenarioOf(keys);
  if (!scenario) return null;
  const known = builtins.scenarios.find(({ name }) => name === scenario),
    text = known?.text ?? scenario;
  if (!isText(text)) throw new Error(`there is no scenario \`${scenario}\``);
  const setup = new JsonText(text).isObject ? JSON.parse(text) : {},
    alone = { source: `${nameOf(text) ?? "scenario"}.json`, text, unit_files: [] };
  const rules = keys.get("rules") || (setup.files && setup.rules) || builtins.rules[0];
  return {
    files: setup.files ?? alone,
    seed: keys.get("seed") ?? "0",
    rules: rulesOf(rules, builtins.rules),
  };
}

/**
 * The rules of a name as the choices have it. Without its version it means the newest one, as `Rules` of the
 * engine has it: `starcraft` is `starcraft-1`.
 * @param {string} name
 * @param {string[]} all
 */
function rulesOf(name, all) {
  const known = all.find((rules) => rules === name || rules.replace(/-\d+$/, "") === name);
  if (known === undefined) throw new Error(`\`rules\` must be ${all.join(", ")}, got \`${name}\``);
  return known;
}

/**
 * Whether a file is a scenario, which has groups, or teams that are drawn; otherwise it is a unit file.
 * @param {{ text: string }} file
 */
function isScenario({ text }) {
  const file = new JsonText(text);
  return ["groups", "teams"].some((key) =>
    file.error ? text.includes(`"${key}"`) : file.isObject && file.node([key]) !== null,
  );
}

export class FileStore {
  /**
   * @param {EditorPage} page
   * @param {Opened} opened
   */
  constructor(page, { target, exists, base, save }) {
    this.page = page;
    /** The file that the program writes, or null. */
    this.target = target;
    this.base = base;
    this.write = save;
    /** Whether the document is the target's, and whether the target exists. */
    this.isTargets = target !== null;
    this.exists = exists;
    /** The last save, for which the next one waits: it needs the checksums of what that wrote. */
    this.saving = Promise.resolve();
  }

  /** @param {Iterable<File>} list */
  async openFiles(list) {
    const files = [...list].filter(({ name }) => name.toLowerCase().endsWith(".json"));
    let read;
    try {
      read = await Promise.all(
        files.map(async (file) => ({ name: file.name, text: await textOfFile(file) })),
      );
    } catch (error) {
      return tell(messageOf(error), true);
    }
    /** @type {string[]} */
    const noKeys = [];
    const scenarios = read.filter(isScenario);
    const units = read
      .filter((file) => !isScenario(file))
      .map(({ name, text }) => ({ name: stemOf(name), keys: noKeys, text }));
    const standard = units.find(({ name }) => this.page.doc.standard(name)?.is_replaceable === false);
    if (standard)
      return tell(
        `${standard.name}.json is not opened: ${standard.name} is always the standard type; rename the file`,
        true,
      );
    if (!read.length || scenarios.length > 1)
      return tell("Open one scenario file and its unit files, or unit files to add; all end in .json.");
    if (scenarios.length)
      return this.page.load({ source: scenarios[0].name, text: scenarios[0].text, unit_files: units });
    const names = new Set(units.map(({ name }) => name));
    const kept = this.page.doc.units.filter(({ name }) => !names.has(name));
    this.page.doc.change({
      units: [...kept, ...units.map((unit) => ({ ...unit, file: this.page.doc.unitText(unit.text) }))],
    });
    this.page.panels.types.name = units[0].name;
    this.page.showTab("types");
  }

  save() {
    const begin = () => this.saveNow(false);
    this.saving = this.saving.then(begin, begin);
    return this.saving;
  }

  /** @param {boolean} replace Whatever the files hold now. */
  async saveNow(replace) {
    if (this.target === null) return this.download();
    const name = `${stemOf(this.target)}.json`;
    if (
      !this.isTargets &&
      this.exists &&
      !replace &&
      !confirm(`Replace the content of ${name} by this scenario?`)
    )
      return;
    const { state } = this.page.doc;
    try {
      const isReplaced = replace || (!this.isTargets && this.exists);
      const response = await this.write(this.page.doc.files(), this.base, isReplaced);
      if ("conflicts" in response) {
        const files = response.conflicts.join(", ");
        if (confirm(`Changed elsewhere, or not of this scenario: ${files}. Replace?`))
          await this.saveNow(true);
        return;
      }
      this.base = response.saved.base;
      this.isTargets = this.exists = true;
      this.page.doc.saved = state;
      const saved = response.saved.files.map((file) => `${stemOf(file)}.json`);
      tell(saved.length ? `Saved ${saved.join(", ")}.` : "Nothing has changed since the last save.");
      this.page.refresh();
    } catch (error) {
      tell(`Not saved: ${messageOf(error)}`, true);
    }
  }

  download() {
    const { source, text, unit_files: units } = this.page.doc.files();
    const files = [[stemOf(source), text], ...units.map((unit) => [unit.name, unit.text])];
    const clash = files.find(([name], i) => files.findIndex(([other]) => other === name) < i);
    if (clash) {
      const message = `Not downloaded: two files would have the name ${clash[0]}.json; rename the unit type.`;
      tell(message, true);
      return;
    }
    for (const [name, content] of files) download(`${name}.json`, content, "application/json");
    if (this.target !== null) return; // what the program saves has still changed
    this.page.doc.saved = this.page.doc.state;
    this.page.refresh();
  }
}
