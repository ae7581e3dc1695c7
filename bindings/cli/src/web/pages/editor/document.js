// @ts-check
// ScenarioDocument: a scenario as the texts of its files, with undo, and what the editor does to them.

import { Formats } from "./formats.js";
import { JsonText, Raw, linesOf } from "./json.js";

/** @import { Builtins, ScenarioFiles } from "../protocol.d.ts" */

/** Limits of the history: states, and characters of text in them. */
const MOST_STATES = 400;
const MOST_CHARACTERS = 60e6;

export const isNumber = (value) => typeof value === "number";
export const stemOf = (key) => key.replace(/^.*\//, "").replace(/\.json$/, "");

/**
 * The map of a scenario file, as far as it can be read.
 * @typedef {{ width: number, height: number, preset?: string | null, blocked: Uint8Array }} EditedMap
 */

/** Reads the map of a scenario file. */
function readMap(file, presets, { missing, longest }) {
  const side = (key) => {
    const value = file.value([key]);
    return Number.isInteger(value) && value >= 1 && value <= longest ? value : missing;
  };
  const preset = file.value(["terrain"]) === undefined ? file.value(["terrain_preset"]) : undefined;
  const known = presets.find(({ name }) => name === preset);
  const rows = known ? known.rows : file.value(["terrain"]);
  const width = known ? missing : side("width"),
    height = known ? missing : side("height");
  const blocked = new Uint8Array(width * height);
  if (Array.isArray(rows))
    rows.slice(0, height).forEach((row, y) => {
      const text = Array.isArray(row) ? row.join("") : String(row);
      for (let x = 0; x < width; x++) blocked[y * width + x] = text[x] === "X" ? 1 : 0;
    });
  return { width, height, preset: known?.name ?? null, blocked };
}

const rowText = (map, y) =>
  Array.from(map.blocked.subarray(y * map.width, (y + 1) * map.width), (square) => "_X"[square]).join("");

/** The blocked squares as rectangles, which cover them without overlapping. */
export function rectanglesOf({ width, height, blocked }) {
  const rectangles = [];
  let open = new Map();
  for (let y = 0; y < height; y++) {
    const next = new Map();
    for (let x = 0; x < width; x++) {
      if (!blocked[y * width + x]) continue;
      const from = x;
      while (x < width && blocked[y * width + x]) x++;
      const key = from * (width + 1) + x;
      const rectangle = open.get(key) ?? [from, y, x, y];
      if (!open.has(key)) rectangles.push(rectangle);
      rectangle[3] = y + 1;
      next.set(key, rectangle);
    }
    open = next;
  }
  return rectangles;
}

export class ScenarioDocument {
  /**
   * @param {Builtins} builtins
   * @param {ScenarioFiles} files
   */
  constructor(builtins, files) {
    this.builtins = builtins;
    this.formats = new Formats(builtins);
    this.listeners = [];
    /** Files that were read last, and what was read. */
    this.groupsOf = this.mapOf = null;
    this.groupsRead = [];
    this.mapRead = null;
    this.load(files);
  }

  /** Begins with the texts of other files: { source, text, unit_files: [{ name, keys, text }] }. */
  load({ source, text, unit_files: units }) {
    const scenario = this.scenarioText(text);
    this.state = {
      source,
      scenario,
      shown: scenario,
      units: units.map(({ name, keys, text: unitText }) => ({ name, keys, file: this.unitText(unitText) })),
    };
    this.past = [];
    this.future = [];
    this.saved = this.state;
    this.merge = null;
    this.changed();
  }

  changed() {
    this.listeners.forEach((listener) => listener());
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

  get isSaved() {
    return this.saved === this.state;
  }

  /** Makes a new state. Changes in a row with the same `merge` are undone as one. */
  change(next, merge = null) {
    const state = { ...this.state, ...next };
    if (Object.keys(next).every((key) => next[key] === this.state[key])) return;
    if (state.scenario.isObject) state.shown = state.scenario;
    if (merge === null || merge !== this.merge) this.past.push(this.state);
    this.merge = merge;
    this.future = [];
    this.state = state;
    const size = ({ scenario }) => scenario.text.length;
    let total = this.past.reduce((sum, past) => sum + size(past), 0);
    while (this.past.length > MOST_STATES || (this.past.length > 1 && total > MOST_CHARACTERS))
      total -= size(this.past.shift());
    this.changed();
  }

  undo() {
    this.go(this.past, this.future);
  }

  redo() {
    this.go(this.future, this.past);
  }

  go(from, to) {
    const state = from.pop();
    if (!state) return;
    to.push(this.state);
    this.state = state;
    this.merge = null;
    this.changed();
  }

  /** Ends a row of changes that are undone as one. */
  settle() {
    this.merge = null;
  }

  /** Changes the scenario file. */
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
    return [...new Set([...keys, ...(ids instanceof Map ? ids.keys() : [])])];
  }

  /** The index of the unit file that a key of the scenario names, or -1. */
  unitOf(key) {
    const owner = this.units.findIndex((unit) => unit.keys.includes(key));
    if (this.standard(key) && !this.standard(key).is_replaceable) return -1;
    return owner >= 0 ? owner : this.units.findIndex((unit) => unit.name === stemOf(key));
  }

  /** The standard type of a name. */
  standard(key) {
    return this.builtins.units.find(({ name }) => name === key);
  }

  scenarioText(text) {
    return new JsonText(text, this.formats.scenario.order);
  }

  unitText(text) {
    return new JsonText(text, this.formats.unit.order);
  }

  /** Sets a key of the scenario file; undefined removes it. */
  setKey(path, value, merge) {
    this.edit((file) => (value === undefined ? file.remove(path) : file.set(path, value)), merge);
  }

  /** Replaces the text of a file: unit file `unit`, or the scenario file if that is -1. */
  setText(unit, text, merge) {
    if (unit < 0) this.change({ scenario: this.scenarioText(text) }, merge);
    else this.setUnit(unit, () => this.unitText(text), merge);
  }

  // Groups

  /** The groups as far as they can be read: { x, y, faction, units: [[key, count]] }. */
  groups() {
    const { shown } = this;
    if (this.groupsOf !== shown) {
      const list = shown.value(["groups"]);
      const read = (group) => {
        const get = (key) => (group instanceof Map ? group.get(key) : undefined);
        const units = get("units") instanceof Map ? [...get("units")] : [];
        return { x: get("x"), y: get("y"), faction: get("faction"), units };
      };
      [this.groupsOf, this.groupsRead] = [shown, Array.isArray(list) ? list.map(read) : []];
    }
    return this.groupsRead;
  }

  /** Changes the groups, and what must agree with them: the counts of units and the ids of their types. */
  editGroups(change, merge) {
    this.edit((file) => this.agree(change(file)), merge);
  }

  agree(file) {
    const groups = file.value(["groups"]);
    if (!Array.isArray(groups)) return file;
    const counts = { ALLY: 0, ENEMY: 0 },
      types = new Set();
    for (const group of groups) {
      const units = group instanceof Map ? group.get("units") : null;
      if (!(units instanceof Map)) continue;
      for (const [type, count] of units) {
        types.add(type);
        if (isNumber(count)) counts[group.get("faction")] += count;
      }
    }
    let next = file.set(["num_allied_units"], counts.ALLY);
    next = next.set(["num_enemy_units"], counts.ENEMY);
    return next.value(["num_unit_types"]) >= 1 ? this.withTypeIds(next, types) : next;
  }

  /** Gives an id to each type that has none. */
  withTypeIds(file, types) {
    const ids = file.value(["unit_type_ids"]);
    if (ids !== undefined && !(ids instanceof Map)) return file;
    const unit = (key) => this.unitOf(key);
    const names = [...(ids?.keys() ?? [])];
    const isKnown = (type) =>
      names.some((name) => name === type || (unit(type) >= 0 && unit(type) === unit(name)));
    let next = file;
    for (const type of types) {
      if (isKnown(type)) continue;
      if (!names.length && next.node(["unit_type_ids"]) === null)
        next = next.set(["unit_type_ids"], { [type]: 0 });
      else next = next.set(["unit_type_ids", type], names.length);
      names.push(type);
    }
    return next.set(["num_unit_types"], names.length);
  }

  addGroup(faction, x, y, units) {
    const group = { x, y, faction, units };
    this.editGroups((file) =>
      file.node(["groups"])
        ? file.insertItem(["groups"], this.groups().length, group)
        : file.set(["groups"], [group]),
    );
  }

  removeGroup(index) {
    this.editGroups((file) => file.remove(["groups", index]));
  }

  moveGroup(index, x, y, merge) {
    const tidy = (value) => Math.round(value * 1000) / 1000;
    this.edit(
      (file) => file.set(["groups", index, "x"], tidy(x)).set(["groups", index, "y"], tidy(y)),
      merge,
    );
  }

  setCount(index, key, count, merge) {
    const path = ["groups", index, "units", key];
    this.editGroups((file) => {
      if (count === undefined) return file.remove(path);
      return file.node(path.slice(0, 3))
        ? file.set(path, count)
        : file.set(path.slice(0, 3), { [key]: count });
    }, merge);
  }

  /** Replaces the type of some units of a group. */
  setType(index, key, type) {
    this.editGroups((file) => file.rename(["groups", index, "units", key], type));
  }

  // The map

  map() {
    const { shown } = this;
    if (this.mapOf !== shown)
      [this.mapOf, this.mapRead] = [shown, readMap(shown, this.builtins.presets, this.formats.side)];
    return this.mapRead;
  }

  /** Replaces the map by drawn rows; rows that do not change keep their text. */
  setMap(map, merge) {
    this.edit((file) => {
      const rows = (indent) =>
        linesOf(
          Array.from({ length: map.height }, (_, y) => rowText(map, y)),
          indent,
        );
      let next = file;
      for (const key of ["width", "height"]) {
        const isDefault = map[key] === this.formats.side.missing && next.node([key]) === null;
        if (!isDefault && next.value([key]) !== map[key]) next = next.set([key], map[key]);
      }
      const list = next.node(["terrain"]);
      if (list?.kind === "array" && list.items.length === map.height) {
        const pieces = list.items.flatMap((item, y) => {
          const text = rowText(map, y);
          return item.value === text ? [] : [[item.start, item.end, JSON.stringify(text)]];
        });
        return pieces.length ? next.replaced(...pieces) : next;
      }
      if (list) return next.set(["terrain"], new Raw(rows));
      if (next.node(["terrain_preset"])) return next.rename(["terrain_preset"], "terrain", new Raw(rows));
      return next.set(["terrain"], new Raw(rows));
    }, merge);
  }

  /** Chooses a preset, or turns it into rows that can be drawn on. */
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

  setUnit(index, change, merge) {
    const units = this.units.map((unit, i) => (i === index ? { ...unit, file: change(unit.file) } : unit));
    if (units[index].file !== this.units[index].file) this.change({ units }, merge);
  }

  addUnit(name, text) {
    this.change({ units: [...this.units, { name, keys: [], file: this.unitText(text) }] });
  }

  removeUnit(index) {
    this.change({ units: this.units.filter((_, i) => i !== index) });
  }

  /** Renames a unit type here and wherever the scenario file names it. */
  renameUnit(index, name) {
    const { keys } = this.files().unit_files[index];
    const units = this.units.map((unit, i) => (i === index ? { ...unit, name, keys: [] } : unit));
    let { scenario } = this.state;
    for (const key of keys) {
      this.groups().forEach((_, i) => (scenario = scenario.rename(["groups", i, "units", key], name)));
      scenario = scenario.rename(["unit_type_ids", key], name);
    }
    this.change({ units, scenario });
  }

  /** A name that no unit type has yet. */
  freeName(wish) {
    const names = new Set([...this.units, ...this.builtins.units].map((unit) => unit.name));
    for (let i = 1; ; i++) {
      const name = i === 1 ? wish : `${wish}_${i}`;
      if (!names.has(name)) return name;
    }
  }
}
