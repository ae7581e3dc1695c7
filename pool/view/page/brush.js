// @ts-check
// Brush: tool and size with which a person draws on a map, the squares that they cover, and the drawn map.

import { all, byId } from "./dom.js";
import { clamp } from "./numbers.js";

/** @import { EditedMap } from "./squares.js" */
/** @typedef {[x: number, y: number]} Square */

/** Tools that draw on the map. */
const DRAWING = ["brush", "erase", "rectangle", "line", "fill"];
const LARGEST_BRUSH = 15;

/**
 * The squares on a line between two squares.
 * @param {Square} from
 * @param {Square} to
 * @returns {Square[]}
 */
function squaresBetween([x0, y0], [x1, y1]) {
  const steps = Math.max(Math.abs(x1 - x0), Math.abs(y1 - y0), 1);
  return Array.from({ length: steps + 1 }, (_, i) => [
    Math.round(x0 + ((x1 - x0) * i) / steps),
    Math.round(y0 + ((y1 - y0) * i) / steps),
  ]);
}

/**
 * The square so many squares away, as far as the map goes; without a square, away from the middle.
 * @param {Square | null} square
 * @param {[dx: number, dy: number]} direction
 * @param {number} by
 * @param {{ width: number, height: number }} map
 * @returns {Square}
 */
export function squareFrom(square, [dx, dy], by, { width, height }) {
  const [x, y] = square ?? [Math.floor(width / 2), Math.floor(height / 2)];
  return [clamp(x + dx * by, 0, width - 1), clamp(y + dy * by, 0, height - 1)];
}

export class Brush {
  constructor() {
    this.tool = "select";
    this.paintsBlocked = true;
    this.size = 1;
  }

  /**
   * Listens to the buttons of tools and sizes.
   * @param {{ choose: (tool: string) => void, resize: (by: number) => void }} page
   */
  static listen(page) {
    for (const button of all("[data-tool]"))
      button.addEventListener("click", () => page.choose(button.dataset.tool ?? "select"));
    for (const button of all("[data-size]"))
      button.addEventListener("click", () => page.resize(Number(button.dataset.size)));
  }

  /** Shows tool and size. */
  show() {
    for (const button of all("[data-tool]"))
      button.setAttribute("aria-pressed", String(button.dataset.tool === this.tool));
    byId("size").textContent = String(this.size);
  }

  /** @param {number} by */
  resize(by) {
    this.size = clamp(this.size + by, 1, LARGEST_BRUSH);
  }

  /** Whether the tool draws on the map. */
  get isDrawing() {
    return DRAWING.includes(this.tool);
  }

  /** Whether it makes squares blocked. */
  get paints() {
    return this.tool !== "erase" && this.paintsBlocked;
  }

  /**
   * The squares that it covers between two squares.
   * @param {Square} from
   * @param {Square} to
   * @returns {Square[]}
   */
  shape(from, to) {
    if (this.tool === "rectangle") {
      const [x0, x1] = [Math.min(from[0], to[0]), Math.max(from[0], to[0])];
      const [y0, y1] = [Math.min(from[1], to[1]), Math.max(from[1], to[1])];
      return Array.from({ length: (x1 - x0 + 1) * (y1 - y0 + 1) }, (_, i) => [
        x0 + (i % (x1 - x0 + 1)),
        y0 + Math.floor(i / (x1 - x0 + 1)),
      ]);
    }
    if (this.tool === "fill") return [to];
    const low = -Math.floor((this.size - 1) / 2);
    return squaresBetween(from, to).flatMap(([x, y]) =>
      Array.from({ length: this.size ** 2 }, (_, i) => [
        x + low + (i % this.size),
        y + low + Math.floor(i / this.size),
      ]),
    );
  }

  /**
   * Draws on a copy of the map.
   * @param {EditedMap} map
   * @param {Square} from
   * @param {Square} to
   * @param {boolean} isBlocked
   */
  drawn(map, from, to, isBlocked) {
    const { width, height } = map,
      blocked = map.blocked.slice();
    if (this.tool === "fill") this.flood(blocked, width, height, to, isBlocked);
    else
      for (const [x, y] of this.shape(from, to))
        if (x >= 0 && y >= 0 && x < width && y < height) blocked[y * width + x] = isBlocked ? 1 : 0;
    return { ...map, blocked };
  }

  /**
   * Fills the area of equal squares that are connected by their sides.
   * @param {Uint8Array} blocked
   * @param {number} width
   * @param {number} height
   * @param {Square} square
   * @param {boolean} isBlocked
   */
  flood(blocked, width, height, [x, y], isBlocked) {
    if (x < 0 || y < 0 || x >= width || y >= height) return;
    const from = blocked[y * width + x],
      to = isBlocked ? 1 : 0;
    /** @type {Square[]} */
    const open = [[x, y]];
    if (from === to) return;
    while (open.length) {
      const [cx, cy] = open.pop() ?? [-1, -1];
      if (cx < 0 || cy < 0 || cx >= width || cy >= height || blocked[cy * width + cx] !== from) continue;
      blocked[cy * width + cx] = to;
      open.push([cx + 1, cy], [cx - 1, cy], [cx, cy + 1], [cx, cy - 1]);
    }
  }
}
