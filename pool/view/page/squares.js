// @ts-check
// The map of a scenario as squares: of rectangles, as battles have it, and of rows, as files do.

/** @import { ScenarioInfo } from "./data.d.ts" */
/**
 * A map that can be drawn on: 1 for a blocked square, row by row from the south. A preset has a name.
 * @typedef {{ width: number, height: number, preset?: string | null, blocked: Uint8Array }} EditedMap
 */

/**
 * The map of a battle.
 * @param {Pick<ScenarioInfo, "width" | "height" | "obstacles">} info
 * @returns {EditedMap}
 */
export function squaresOf({ width, height, obstacles }) {
  const blocked = new Uint8Array(width * height);
  for (const [x0, y0, x1, y1] of obstacles)
    for (let y = y0; y < y1; y++) blocked.fill(1, y * width + x0, y * width + x1);
  return { width, height, blocked };
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
