// @ts-check
// ScenarioDocument: a scenario as the texts of its files, with undo, and what the editor does to them.

import { rowsOf } from "#view/squares.js";
import { agreed, withTypeIds } from "./agreement.js";
import { Formats } from "./formats.js";
import { History } from "./history.js";
import { JsonText, Raw, linesOf } from "./json.js";
import { readMap } from "./squares.js";

/** @import { Builtins, ScenarioFiles } from "../protocol.d.ts" */
/** @import { Merge, State, UnitText } from "./history.js" */
/** @import { Path } from "./json.js" */
/** @import { EditedMap } from "#view/squares.js" */
/**
 * A group as the file has it, which may be invalid: the units are keys and their counts.
 * @typedef {{ x: any, y: any, faction: any, units: [string, any][] }} ReadGroup
 */
/** @typedef {(file: JsonText) => JsonText} Change */

/**
 * Whether a value is a number that a battle can have: texts may have larger ones, such as 1e999.
 * @param {unknown} value
 * @returns {value is number}
 */
export const isNumber = (value) => Number.isFinite(value);
/** Names of unit types: those that target.rs saves, but for names of files; and the same in words. */
export const UNIT_NAME = /^(?!.*\.json$)[\w-][\w.-]{0,99}$/i;
export const NAME_RULE =
  "use 1 to 100 letters, digits, `_`, `-` and `.`; it must not begin with `.` or end with `.json`";
/** @param {string} key */
export const stemOf = (key) => key.replace(/^.*\//, "").replace(/\.json$/, "");

/**
 * @param {ScenarioFiles} files
 * @param {Formats} formats
 * @returns {State}
 */
function stateOf({ source, text, unit_files: units }, formats) {
  const scenario = new JsonText(text, formats.scenario.order);
  const files = units.map((unit) => ({
    name: unit.name,
    keys: unit.keys,
    file: new JsonText(unit.text, formats.unit.order),
  }));
  return { source, scenario, shown: scenario, units: files };
}

export class ScenarioDocument extends History {
  /**
   * @param {Builtins} builtins
   * @param {ScenarioFiles} files
   */
  constructor(builtins, files) {
    const formats = new Formats(builtins);
    super(stateOf(files, formats));
    this.builtins = builtins;
    this.formats = formats;
    /** @type {JsonText | null} The file whose groups were read last. */
    this.groupsOf = null;
    /** @type {ReadGroup[]} */
    this.groupsRead = [];
    /** @type {{ of: JsonText, map: EditedMap } | null} The map that was read last. */
    this.mapRead = null;
  }

  /**
   * Begins with the texts of other files.
   * @param {ScenarioFiles} files
   */
  load(files) {
    this.begin(stateOf(files, this.formats));
  }

  get scenario() {
    return this.state.scenario;
  }

  /** The scenario file as map and forms show it: its newest text that was JSON. */
  get shown() {
    return this.state.shown;
  }

  /** Whether the text of the scenario file is no JSON, so that map and forms show an older one. */
  get isStale() {
    return !this.scenario.isObject;
  }

  get units() {
    return this.state.units;
  }

  /**
   * Makes a new state. Changes in a row with the same `merge` are undone as one.
   * @param {{ scenario?: JsonText, units?: UnitText[] }} next
   * @param {Merge} merge
   */
  change(next, merge = null) {
    const state = { ...this.state, ...next };
    if (state.scenario === this.scenario && state.units === this.units) return;
    if (state.scenario.isObject) state.shown = state.scenario;
    this.push(state, merge);
  }

  /**
   * Changes the scenario file.
   * @param {Change} change
   * @param {Merge} [merge]
   */
  edit(change, merge) {
    if (!this.isStale) this.change({ scenario: change(this.scenario) }, merge);
  }

  /** The files as the program takes them. */
  files() {
    const { scenario, units, source } = this.state;
    const named = this.unitKeys();
    const owned = new Set(units.flatMap((unit) => unit.keys));
    return {
      source,
      text: scenario.text,
      unit_files: units.map(({ name, keys, file }) => ({
        name,
        keys: [...new Set([...keys, ...named.filter((key) => stemOf(key) === name && !owned.has(key))])],
        text: file.text,
      })),
    };
  }

  /** Every key of the scenario file that names a unit type. */
  unitKeys() {
    const ids = this.shown.value(["unit_type_ids"]);
    const keys = this.groups().flatMap((group) => group.units.map(([key]) => key));
    const ofTeams = this.teamEntries().map((path) => this.shown.value(path));
    return [...new Set([...keys, ...ofTeams, ...(ids instanceof Map ? ids.keys() : [])])];
  }

  /**
   * The entries of `teams` that name a unit type.
   * @returns {Path[]}
   */
  teamEntries() {
    /** @param {Path} path */
    const entriesOf = (path) => {
      const list = this.shown.value(path);
      return Array.isArray(list) ? list.map((_, i) => [...path, i]) : [];
    };
    const lists = [
      ["teams", "unit_types"],
      ["teams", "exception_unit_types"],
      ...entriesOf(["teams", "teams"]),
    ];
    return lists.flatMap(entriesOf).filter((path) => typeof this.shown.value(path) === "string");
  }

  /**
   * The index of the unit file that a key of the scenario names, or -1.
   * @param {string} key
   */
  unitOf(key) {
    const owner = this.units.findIndex((unit) => unit.keys.includes(key));
    if (this.standard(key)?.is_replaceable === false) return -1;
    return owner >= 0 ? owner : this.units.findIndex((unit) => unit.name === stemOf(key));
  }

  /**
   * The standard type of a name.
   * @param {string} key
   */
  standard(key) {
    return this.builtins.units.find(({ name }) => name === key);
  }

  /** @param {string} text */
  scenarioText(text) {
    return new JsonText(text, this.formats.scenario.order);
  }

  /** @param {string} text */
  unitText(text) {
    return new JsonText(text, this.formats.unit.order);
  }

  /**
   * Sets a key of the scenario file; undefined removes it.
   * @param {Path} path
   * @param {unknown} value
   * @param {Merge} [merge]
   */
  setKey(path, value, merge) {
    this.edit((file) => (value === undefined ? file.remove(path) : file.set(path, value)), merge);
  }

  /**
   * Replaces the text of a file: unit file `unit`, or the scenario file if that is -1.
   * @param {number} unit
   * @param {string} text
   * @param {Merge} [merge]
   */
  setText(unit, text, merge) {
    if (unit < 0) this.change({ scenario: this.scenarioText(text) }, merge);
    else this.setUnit(unit, () => this.unitText(text), merge);
  }

  // Groups

  /**
   * The groups as far as they can be read: { x, y, faction, units: [[key, count]] }.
   * @returns {ReadGroup[]}
   */
  groups() {
    const { shown } = this;
    if (this.groupsOf !== shown) {
      const list = shown.value(["groups"]);
      /** @param {unknown} group */
      const read = (group) => {
        /** @param {string} key */
        const get = (key) => (group instanceof Map ? group.get(key) : undefined);
        const units = get("units") instanceof Map ? [...get("units")] : [];
        return { x: get("x"), y: get("y"), faction: get("faction"), units };
      };
      [this.groupsOf, this.groupsRead] = [shown, Array.isArray(list) ? list.map(read) : []];
    }
    return this.groupsRead;
  }

  /**
   * Changes the groups, and what must agree with them: the counts of units and the ids of their types.
   * @param {Change} change
   * @param {Merge} [merge]
   */
  editGroups(change, merge) {
    this.edit((file) => agreed(change(file), (key) => this.unitOf(key)), merge);
  }

  /**
   * Gives an id to each type that has none.
   * @param {JsonText} file
   * @param {Set<string>} types
   */
  withTypeIds(file, types) {
    return withTypeIds(file, types, (key) => this.unitOf(key));
  }

  /**
   * @param {string} faction
   * @param {number} x
   * @param {number} y
   * @param {{ [type: string]: number }} units
   */
  addGroup(faction, x, y, units) {
    const group = { x, y, faction, units };
    this.editGroups((file) =>
      file.node(["groups"])
        ? file.insertItem(["groups"], this.groups().length, group)
        : file.set(["groups"], [group]),
    );
  }

  /** @param {number} index */
  removeGroup(index) {
    this.editGroups((file) => file.remove(["groups", index]));
  }

  /**
   * @param {number} index
   * @param {number} x
   * @param {number} y
   * @param {Merge} [merge]
   */
  moveGroup(index, x, y, merge) {
    /** @param {number} value */
    const tidy = (value) => Math.round(value * 1000) / 1000;
    this.edit(
      (file) => file.set(["groups", index, "x"], tidy(x)).set(["groups", index, "y"], tidy(y)),
      merge,
    );
  }

  /**
   * @param {number} index
   * @param {string} key
   * @param {number | undefined} count
   * @param {Merge} [merge]
   */
  setCount(index, key, count, merge) {
    /** @type {Path} */
    const path = ["groups", index, "units", key];
    this.editGroups((file) => {
      if (count === undefined) return file.remove(path);
      return file.node(path.slice(0, 3))
        ? file.set(path, count)
        : file.set(path.slice(0, 3), { [key]: count });
    }, merge);
  }

  /**
   * Replaces the type of some units of a group.
   * @param {number} index
   * @param {string} key
   * @param {string} type
   */
  setType(index, key, type) {
    this.editGroups((file) => file.rename(["groups", index, "units", key], type));
  }

  // The map

  map() {
    const { shown } = this;
    if (this.mapRead?.of !== shown)
      this.mapRead = { of: shown, map: readMap(shown, this.builtins.presets, this.formats.side) };
    return this.mapRead.map;
  }

  /**
   * Replaces the map by drawn rows; rows that do not change keep their text.
   * @param {EditedMap} map
   * @param {Merge} [merge]
   */
  setMap(map, merge) {
    this.edit((file) => {
      const texts = rowsOf(map);
      /** @param {string} indent */
      const rows = (indent) => linesOf(texts, indent);
      let next = file;
      for (const key of /** @type {const} */ (["width", "height"])) {
        const isDefault = map[key] === this.formats.side.missing && next.node([key]) === null;
        if (!isDefault && next.value([key]) !== map[key]) next = next.set([key], map[key]);
      }
      const list = next.node(["terrain"]);
      if (list?.items?.length === map.height) {
        /** @type {[number, number, string][]} */
        const pieces = list.items.flatMap(({ value, start, end }, y) =>
          value === texts[y] ? [] : [[start, end, JSON.stringify(texts[y])]],
        );
        return pieces.length ? next.replaced(...pieces) : next;
      }
      if (list) return next.set(["terrain"], new Raw(rows));
      if (next.node(["terrain_preset"])) return next.rename(["terrain_preset"], "terrain", new Raw(rows));
      return next.set(["terrain"], new Raw(rows));
    }, merge);
  }

  /**
   * Chooses a preset, or turns it into rows that can be drawn on.
   * @param {string} [name]
   */
  setPreset(name) {
    if (!name) return this.setMap(this.map());
    const { missing } = this.formats.side;
    this.edit((file) => {
      let next = file;
      for (const key of ["width", "height"])
        if (next.node([key]) && next.value([key]) !== missing) next = next.set([key], missing);
      if (!next.node(["terrain"])) return next.set(["terrain_preset"], name);
      if (next.node(["terrain_preset"])) return next.remove(["terrain"]).set(["terrain_preset"], name);
      return next.rename(["terrain"], "terrain_preset", name);
    });
  }

  // Unit types

  /**
   * @param {number} index
   * @param {Change} change
   * @param {Merge} [merge]
   */
  setUnit(index, change, merge) {
    const units = this.units.map((unit, i) => (i === index ? { ...unit, file: change(unit.file) } : unit));
    if (units[index].file !== this.units[index].file) this.change({ units }, merge);
  }

  /**
   * @param {string} name
   * @param {string} text
   */
  addUnit(name, text) {
    this.change({ units: [...this.units, { name, keys: [], file: this.unitText(text) }] });
  }

  /** @param {number} index */
  removeUnit(index) {
    this.change({ units: this.units.filter((_, i) => i !== index) });
  }

  /**
   * Renames a unit type here and wherever the scenario file names it.
   * @param {number} index
   * @param {string} name
   */
  renameUnit(index, name) {
    const { keys } = this.files().unit_files[index];
    const units = this.units.map((unit, i) => (i === index ? { ...unit, name, keys: [] } : unit));
    let { scenario } = this.state;
    for (const key of keys) {
      this.groups().forEach((_, i) => (scenario = scenario.rename(["groups", i, "units", key], name)));
      for (const path of this.teamEntries())
        if (this.shown.value(path) === key) scenario = scenario.set(path, name);
      scenario = scenario.rename(["unit_type_ids", key], name);
    }
    this.change({ units, scenario });
  }

  /**
   * A name that no unit type has yet.
   * @param {string} wish
   */
  freeName(wish) {
    const names = new Set([...this.units, ...this.builtins.units].map((unit) => unit.name));
    for (let i = 1; ; i++) {
      const name = i === 1 ? wish : `${wish}_${i}`;
      if (!names.has(name)) return name;
    }
  }
}
