// @ts-check
// What must agree with the groups of a scenario file: the counts of units, and the ids of their types.

/** @import { JsonText } from "./json.js" */
/**
 * The index of the unit file that a key names, or -1.
 * @typedef {(key: string) => number} UnitOf
 */

/**
 * The file with the counts and ids of its groups.
 * @param {JsonText} file
 * @param {UnitOf} unitOf
 * @returns {JsonText}
 */
export function agreed(file, unitOf) {
  const groups = file.value(["groups"]);
  if (!Array.isArray(groups)) return file;
  /** @type {{ [faction: string]: number }} */
  const counts = { ALLY: 0, ENEMY: 0 },
    /** @type {Set<string>} */
    types = new Set();
  for (const group of groups) {
    const units = group instanceof Map ? group.get("units") : null;
    if (!(units instanceof Map)) continue;
    for (const [type, count] of units) {
      types.add(type);
      if (typeof count === "number") counts[group.get("faction")] += count;
    }
  }
  let next = file.set(["num_allied_units"], counts.ALLY);
  next = next.set(["num_enemy_units"], counts.ENEMY);
  return next.value(["num_unit_types"]) >= 1 ? withTypeIds(next, types, unitOf) : next;
}

/**
 * Gives an id to each type that has none.
 * @param {JsonText} file
 * @param {Set<string>} types
 * @param {UnitOf} unitOf
 * @returns {JsonText}
 */
export function withTypeIds(file, types, unitOf) {
  const ids = file.value(["unit_type_ids"]);
  if (ids !== undefined && !(ids instanceof Map)) return file;
  /** @type {string[]} */
  const names = [...(ids?.keys() ?? [])];
  /** @param {string} type */
  const isKnown = (type) =>
    names.some((name) => name === type || (unitOf(type) >= 0 && unitOf(type) === unitOf(name)));
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
