// @ts-check
// MapView: which part of the map a canvas shows, and where each square is on it.

import { clamp } from "./numbers.js";
import { fitCanvas } from "./theme.js";

/** @import { ScenarioInfo } from "./data.d.ts" */
/** @typedef {{ x: number, y: number }} Point */
/** @typedef {{ x0: number, y0: number, x1: number, y1: number }} Box */
/**
 * The square in the middle of the canvas, and pixels per square.
 * @typedef {Point & { scale: number }} Camera
 */

/** The largest scale that fitting chooses, in pixels per square. */
const LARGEST_FIT = 62;

export class MapView {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {ScenarioInfo} info
   */
  constructor(canvas, info) {
    this.canvas = canvas;
    this.info = info;
    this.wholeMap = false;
    /** @type {Camera | null} Null if it is to be fitted. */
    this.camera = null;
    /** Whether the camera is the one of `fit`. */
    this.isFitted = false;
    const { context, width, height, ratio } = fitCanvas(canvas);
    this.context = context;
    this.width = width;
    this.height = height;
    this.ratio = ratio;
    /** Pixels per square, and the pixels at the north-west corner of the map. */
    this.scale = 1;
    this.left = this.top = 0;
  }

  /** Takes the size of the canvas; its context then measures in CSS pixels. */
  measure() {
    Object.assign(this, fitCanvas(this.canvas));
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  toCanvas(x, y) {
    return { x: this.left + x * this.scale, y: this.top + (this.info.height - y) * this.scale };
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  toSquares(x, y) {
    return { x: (x - this.left) / this.scale, y: this.info.height - (y - this.top) / this.scale };
  }

  /** @returns {Box} */
  mapBox() {
    return { x0: 0, y0: 0, x1: this.info.width, y1: this.info.height };
  }

  /**
   * The rectangle of squares that fitting shows.
   * @returns {Box}
   */
  fitBox() {
    return this.mapBox();
  }

  /** Shows the rectangle of `fitBox`, in the middle of the canvas. */
  fit() {
    const { x0, y0, x1, y1 } = this.fitBox();
    // A low window leaves the canvas less than the margin: nothing is drawn with a negative radius.
    const scale = Math.min(
      Math.max(1, this.width - 16) / (x1 - x0),
      Math.max(1, this.height - 16) / (y1 - y0),
      this.wholeMap ? Infinity : LARGEST_FIT,
    );
    this.isFitted = true;
    return { x: (x0 + x1) / 2, y: (y0 + y1) / 2, scale };
  }

  /** The camera, which is fitted first if there is none. */
  aimed() {
    return (this.camera ??= this.fit());
  }

  /**
   * Changes the scale; a point of the canvas stays where it is.
   * @param {number} factor
   * @param {number} x
   * @param {number} y
   */
  zoom(factor, x, y) {
    const fixed = this.toSquares(x, y),
      camera = this.aimed();
    this.isFitted = false;
    // The whole of a large map is smaller than the least scale.
    camera.scale = clamp(camera.scale * factor, Math.min(4, camera.scale), 200);
    this.aim();
    const now = this.toSquares(x, y);
    camera.x += fixed.x - now.x;
    camera.y += fixed.y - now.y;
  }

  /**
   * Moves the map by pixels.
   * @param {number} dx
   * @param {number} dy
   */
  move(dx, dy) {
    const camera = this.aimed();
    this.isFitted = false;
    camera.x -= dx / this.scale;
    camera.y += dy / this.scale;
  }

  aim() {
    const { x, y, scale } = this.aimed();
    this.scale = scale;
    this.left = this.width / 2 - x * scale;
    this.top = this.height / 2 - (this.info.height - y) * scale;
  }
}
