// @ts-check
// The map of a scenario file as squares, as far as it can be read.

/** @import { EditedMap } from "#view/squares.js" */
/** @import { Preset } from "../protocol.d.ts" */
/** @import { JsonText } from "./json.js" */

/**
 * Reads the map of a scenario file.
 * @param {JsonText} file
 * @param {Preset[]} presets
 * @param {{ missing: number, longest: number }} side the side of a map without one, and the longest
 * @returns {EditedMap}
 */
export function readMap(file, presets, { missing, longest }) {
  /** @param {string} key */
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
