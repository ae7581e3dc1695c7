// @ts-check
// Brush: the squares that a drawing tool covers, and maps that are drawn on.

/** The keys that choose tools, and what the page says about them. */
/** @type {{ [key: string]: string | undefined }} */
export const TOOL_KEYS = {
  v: "select",
  b: "brush",
  e: "erase",
  r: "rectangle",
  l: "line",
  f: "fill",
  a: "goal",
  g: "ally",
  h: "enemy",
};
/** @type {{ [tool: string]: string }} */
export const TOOL_HINTS = {
  select: "Click a group to edit it, drag it to move it; drag the map to move the view",
  brush: "Drag to draw; the right button draws the opposite",
  erase: "Drag to make squares walkable",
  rectangle: "Drag from corner to corner",
  line: "Drag from end to end",
  fill: "Click an area to fill it",
  goal: "Click or drag to where the enemies march",
  ally: "Click where the new group starts",
  enemy: "Click where the new group starts",
};

/** @import { EditedMap } from "./squares.js" */
/** @typedef {[x: number, y: number]} Square */

/** Tools that draw on the map. */
const DRAWING = ["brush", "erase", "rectangle", "line", "fill"];
export const LARGEST_BRUSH = 15;

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

export class Brush {
  constructor() {
    this.tool = "select";
    this.paintsBlocked = true;
    this.size = 1;
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
