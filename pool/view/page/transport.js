// @ts-check
// Clock: the time that is shown, and how fast it runs. Timeline: the scrub bar with its marks.

import { clamp } from "./numbers.js";
import { fitCanvas, theme, traceCircle, traceLine } from "./theme.js";

/** @import { Track } from "./track.js" */

export const TICKS_PER_SECOND = 16;
export const TICKS_PER_STEP = 8;
export const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
/** The longest time between two pictures that counts, in seconds: a hidden tab does not jump ahead. */
const LONGEST_FRAME = 0.1;

export class Clock {
  constructor() {
    this.time = 0;
    this.end = 0;
    this.playing = false;
    this.speed = 1;
    this.before = 0;
    /** Whether more may follow the end, so that the clock waits there. */
    this.isOpen = false;
  }

  /**
   * Moves on to now, in milliseconds.
   * @param {number} now
   */
  advance(now) {
    const elapsed = Math.min(LONGEST_FRAME, (now - this.before) / 1000);
    this.before = now;
    if (!this.playing) return;
    this.time = Math.min(this.end, this.time + elapsed * TICKS_PER_SECOND * this.speed);
    if (this.time >= this.end && !this.isOpen) this.playing = false;
  }

  toggle() {
    if (!this.playing && this.time >= this.end && !this.isOpen) this.time = 0;
    this.playing = !this.playing;
  }

  /** @param {number} time */
  seek(time) {
    this.time = clamp(time, 0, this.end);
  }

  /**
   * Goes by whole ticks, from a time between two to the next one.
   * @param {number} ticks
   */
  stepTicks(ticks) {
    this.playing = false;
    const from = ticks > 0 ? Math.floor(this.time) : Math.ceil(this.time);
    this.seek(Math.abs(ticks) === 1 ? from + ticks : this.stepTime(Math.sign(ticks)));
  }

  /** @param {number} direction */
  stepTime(direction) {
    const step = this.time / TICKS_PER_STEP;
    return (direction > 0 ? Math.floor(step) + 1 : Math.ceil(step) - 1) * TICKS_PER_STEP;
  }

  /** @param {number} direction */
  changeSpeed(direction) {
    this.speed = SPEEDS[clamp(SPEEDS.indexOf(this.speed) + direction, 0, SPEEDS.length - 1)];
  }
}

export class Timeline {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {HTMLInputElement} input
   * @param {(tick: number) => void} seek
   */
  constructor(canvas, input, seek) {
    this.canvas = canvas;
    this.input = input;
    input.addEventListener("input", () => seek(Number(input.value)));
  }

  /**
   * @param {Track} track
   * @param {number} time
   * @param {number} known the last tick that is marked
   */
  draw(track, time, known) {
    const { context, width, height } = fitCanvas(this.canvas),
      { colours } = theme,
      middle = height / 2;
    // The thumb of the input moves within the track by half its width.
    /** @param {number} tick */
    const x = (tick) => 7 + (track.last ? tick / track.last : 0) * (width - 14);
    context.clearRect(0, 0, width, height);
    /**
     * @param {number} to
     * @param {string} colour
     */
    const bar = (to, colour) => {
      context.beginPath();
      context.roundRect(5, middle - 2.5, Math.max(4, to - 5), 5, 2.5);
      context.fillStyle = colour;
      context.fill();
    };
    bar(width - 5, colours.line);
    bar(x(time), colours.dim);
    for (const { tick, unit } of track.deaths) {
      if (tick > known) break; // they are in order
      const enemy = track.info.units[unit].faction === 1,
        y = enemy ? middle + 12 : middle - 12;
      context.fillStyle = theme.faint(enemy ? "enemy" : "ally", tick <= time ? 1 : 0.45);
      const at = x(tick);
      if (enemy) traceLine(context, [at, y - 4], [at + 4, y], [at, y + 4], [at - 4, y]);
      else traceCircle(context, at, y, 3.3);
      context.fill();
    }
    this.input.max = String(track.last);
    const value = String(Math.round(time));
    if (this.input.value !== value) this.input.value = value;
    const first = track.firstStep * TICKS_PER_STEP,
      now = first + Math.floor(time);
    const text = `step ${Math.floor(now / TICKS_PER_STEP)}, tick ${now} of ${first + track.last}`;
    if (this.input.getAttribute("aria-valuetext") !== text) this.input.setAttribute("aria-valuetext", text);
  }
}
