// @ts-check
// TerrainLayer: the map of a battle, painted once for each camera and then copied.

import { contextOf, theme, traceCircle } from "./theme.js";

/** @import { BattleView } from "./battle.js" */
/** @typedef {[x: number, y: number, width: number, height: number]} Rect */

/** Maps of more obstacles than this are painted without hatching, which is slow then. */
const MOST_HATCHED = 5000;

export class TerrainLayer {
  /** @param {BattleView} view */
  constructor(view) {
    this.view = view;
    this.picture = document.createElement("canvas");
    this.context = contextOf(this.picture);
    this.key = "";
  }

  draw() {
    const { canvas, context, ratio, left, top, scale } = this.view;
    const key = [canvas.width, canvas.height, left, top, scale, theme.dark].join();
    if (key !== this.key) {
      this.key = key;
      [this.picture.width, this.picture.height] = [canvas.width, canvas.height];
      this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
      this.paint();
    }
    context.save();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(this.picture, 0, 0);
    context.restore();
  }

  /**
   * A coordinate at a whole pixel, so that lines are crisp.
   * @param {number} value
   */
  snap(value) {
    return Math.round(value * this.view.ratio) / this.view.ratio;
  }

  /**
   * A rectangle of squares on the canvas: left, top, width, height.
   * @param {number} x0
   * @param {number} y0
   * @param {number} x1
   * @param {number} y1
   * @returns {Rect}
   */
  rect(x0, y0, x1, y1) {
    const a = this.view.toCanvas(x0, y1);
    const b = this.view.toCanvas(x1, y0);
    const [x, y] = [this.snap(a.x), this.snap(a.y)];
    return [x, y, this.snap(b.x) - x, this.snap(b.y) - y];
  }

  paint() {
    const { context } = this;
    const { info, width, height } = this.view;
    const map = this.rect(0, 0, info.width, info.height);
    context.fillStyle = theme.colours.outside;
    context.fillRect(0, 0, width, height);
    context.fillStyle = theme.colours.floor;
    context.fillRect(...map);
    this.paintGrid();
    this.paintWalls(map);
    context.strokeStyle = theme.colours["wall-edge"];
    context.lineWidth = 1;
    context.strokeRect(map[0] + 0.5, map[1] + 0.5, map[2] - 1, map[3] - 1);
    this.paintGoal();
  }

  paintGrid() {
    const { context } = this;
    const { info, scale, ratio } = this.view;
    if (scale < 9) return;
    /**
     * @param {number} x0
     * @param {number} y0
     * @param {number} x1
     * @param {number} y1
     */
    const line = (x0, y0, x1, y1) => {
      const a = this.view.toCanvas(x0, y0);
      const b = this.view.toCanvas(x1, y1);
      const half = 0.5 / ratio;
      context.moveTo(this.snap(a.x) + half, this.snap(a.y) + half);
      context.lineTo(this.snap(b.x) + half, this.snap(b.y) + half);
    };
    context.beginPath();
    for (let x = 1; x < info.width; x++) line(x, 0, x, info.height);
    for (let y = 1; y < info.height; y++) line(0, y, info.width, y);
    context.lineWidth = 1 / ratio;
    context.strokeStyle = theme.colours.grid;
    context.stroke();
  }

  /** The obstacles as one shape: each is stroked first, then all are filled over the inner lines. */
  paintWalls(/** @type {Rect} */ map) {
    const { context } = this;
    const { info, scale } = this.view;
    context.strokeStyle = theme.colours["wall-edge"];
    context.lineWidth = 2 * Math.max(1, Math.round(scale * 0.06));
    context.lineJoin = "round";
    context.save();
    context.beginPath();
    context.rect(...map);
    context.clip();
    for (const box of info.obstacles) context.strokeRect(...this.rect(...box));
    context.restore();
    context.beginPath();
    for (const box of info.obstacles) context.rect(...this.rect(...box));
    context.fillStyle = theme.colours.wall;
    context.fill();
    if (info.obstacles.length <= MOST_HATCHED) this.hatch(map);
  }

  /**
   * Slanted lines over the current path, so that walls differ from floor in more than colour.
   * @param {Rect} area
   */
  hatch([x, y, width, height]) {
    const { context } = this;
    const gap = Math.max(6, this.view.scale * 0.5);
    context.save();
    context.clip();
    context.beginPath();
    for (let at = -height; at < width; at += gap) {
      context.moveTo(x + at, y + height);
      context.lineTo(x + at + height, y);
    }
    context.lineWidth = 1;
    context.strokeStyle = theme.faint("wall-edge", 0.32);
    context.stroke();
    context.restore();
  }

  /**
   * Marks squares of the map that are drawn next, over what is drawn there.
   * @param {[x: number, y: number][]} squares
   * @param {boolean} isBlocked whether they are made blocked
   */
  mark(squares, isBlocked) {
    const { context, info, scale } = this.view;
    context.save();
    context.beginPath();
    for (const [x, y] of squares)
      if (x >= 0 && y >= 0 && x < info.width && y < info.height)
        context.rect(...this.rect(x, y, x + 1, y + 1));
    context.fillStyle = theme.faint(isBlocked ? "text" : "focus", 0.28);
    context.fill();
    context.lineWidth = 1.2;
    context.strokeStyle = theme.colours.focus;
    if (scale > 6) context.stroke();
    context.restore();
  }

  /** The point that the enemies march to. */
  paintGoal() {
    const { context } = this;
    const { x, y } = this.view.toCanvas(...this.view.info.attack_point);
    const size = this.view.scale * 0.5;
    context.strokeStyle = theme.faint("enemy", 0.45);
    context.lineWidth = Math.max(1, this.view.scale * 0.05);
    context.setLineDash([size * 0.3, size * 0.2]);
    traceCircle(context, x, y, size);
    context.stroke();
    context.setLineDash([]);
    traceCircle(context, x, y, size * 0.18);
    context.fillStyle = theme.faint("enemy", 0.45);
    context.fill();
  }
}
