// @ts-check
// The map of a scenario as squares: how it is read from a file, written to one, and drawn.

/** @import { Preset } from "../protocol.d.ts" */
/** @import { JsonText } from "./json.js" */
/**
 * The map of a scenario file, as far as it can be read.
 * @typedef {{ width: number, height: number, preset?: string | null, blocked: Uint8Array }} EditedMap
 */

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

/**
 * The rows as files have them, the southernmost first.
 * @param {EditedMap} map
 */
export function rowsOf({ width, height, blocked }) {
  /**
   * @param {unknown} _
   * @param {number} y
   */
  const row = (_, y) =>
    Array.from(blocked.subarray(y * width, (y + 1) * width), (square) => "_X"[square]).join("");
  return Array.from({ length: height }, row);
}

/**
 * The blocked squares as rectangles, which cover them without overlapping.
 * @param {EditedMap} map
 */
export function rectanglesOf({ width, height, blocked }) {
  /** @type {[number, number, number, number][]} */
  const rectangles = [];
  /** @type {Map<number, [number, number, number, number]>} By west and east side: those that may grow. */
  let open = new Map();
  for (let y = 0; y < height; y++) {
    /** @type {typeof open} */
    const next = new Map();
    for (let x = 0; x < width; x++) {
      if (!blocked[y * width + x]) continue;
      const from = x;
      while (x < width && blocked[y * width + x]) x++;
      const key = from * (width + 1) + x;
      /** @type {[number, number, number, number]} */
      const rectangle = open.get(key) ?? [from, y, x, y];
      if (!open.has(key)) rectangles.push(rectangle);
      rectangle[3] = y + 1;
      next.set(key, rectangle);
    }
    open = next;
  }
  return rectangles;
}
