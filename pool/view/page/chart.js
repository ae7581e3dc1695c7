// @ts-check
// HealthChart: the share of health that each team has left, over time, with a cursor.

import { FACTION_COLOURS } from "./effects.js";
import { clamp } from "./numbers.js";
import { fitCanvas, theme, traceCircle, traceLine } from "./theme.js";
import { TICKS_PER_SECOND, TICKS_PER_STEP } from "./transport.js";

/** @import { Track } from "./track.js" */

export class HealthChart {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {Track} track
   * @param {(tick: number) => void} seek
   */
  constructor(canvas, track, seek) {
    this.canvas = canvas;
    this.track = track;
    /** @param {PointerEvent} event */
    const go = (event) => {
      const { left, width } = canvas.getBoundingClientRect();
      seek(
        Math.round(clamp((event.clientX - left - this.inset) / (width - this.inset - 4)) * this.track.last),
      );
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      go(event);
    });
    canvas.addEventListener("pointermove", (event) => event.buttons && go(event));
    this.inset = 38;
  }

  /**
   * @param {number} time
   * @param {number} known the last tick that is drawn
   */
  draw(time, known) {
    const { context, width, height } = fitCanvas(this.canvas),
      { track, inset } = this,
      { colours } = theme;
    const [top, bottom] = [8, height - 18];
    /** @param {number} tick */
    const x = (tick) => inset + (track.last ? tick / track.last : 0) * (width - inset - 4);
    /** @param {number} share */
    const y = (share) => bottom - share * (bottom - top);
    context.clearRect(0, 0, width, height);
    context.font = '11px system-ui, "DejaVu Sans", sans-serif';
    context.fillStyle = colours.dim;
    context.textBaseline = "middle";
    context.textAlign = "right";
    context.lineWidth = 1;
    for (const share of [0, 0.5, 1]) {
      context.fillText(`${share * 100}%`, inset - 5, y(share));
      traceLine(context, [inset, Math.round(y(share)) + 0.5], [width - 4, Math.round(y(share)) + 0.5]);
      context.strokeStyle = colours.line;
      context.stroke();
    }
    for (const faction of [1, 0]) this.drawCurve(context, faction, x, y, bottom, known);
    this.drawSeconds(context, x, height);
    const now = x(Math.min(time, track.last)),
      moment = Math.min(Math.floor(time), track.last);
    traceLine(context, [now, top - 4], [now, bottom]);
    context.lineWidth = 1.4;
    context.strokeStyle = colours.text;
    context.stroke();
    for (const faction of [1, 0]) {
      traceCircle(context, now, y(track.health[faction][moment]), 3.6);
      context.fillStyle = colours[FACTION_COLOURS[faction]];
      context.fill();
      context.lineWidth = 1.5;
      context.strokeStyle = colours.panel;
      context.stroke();
    }
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number} faction
   * @param {(tick: number) => number} x
   * @param {(share: number) => number} y
   * @param {number} bottom
   * @param {number} known
   */
  drawCurve(context, faction, x, y, bottom, known) {
    const last = Math.min(Math.floor(known), this.track.last),
      values = this.track.health[faction].slice(0, last + 1),
      tone = FACTION_COLOURS[faction];
    // Long episodes have more ticks than the chart has pixels.
    const stride = Math.max(1, Math.floor(values.length / 600));
    context.beginPath();
    for (let tick = 0; tick < values.length; tick += stride) context.lineTo(x(tick), y(values[tick]));
    context.lineTo(x(last), y(values[last]));
    context.lineWidth = 1.8;
    context.lineJoin = "round";
    context.strokeStyle = theme.colours[tone];
    // The lines differ in more than colour.
    context.setLineDash(faction ? [5, 3] : []);
    context.stroke();
    context.setLineDash([]);
    context.lineTo(x(last), bottom);
    context.lineTo(x(0), bottom);
    context.closePath();
    context.fillStyle = theme.faint(tone, 0.1);
    context.fill();
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {(tick: number) => number} x
   * @param {number} height
   */
  drawSeconds(context, x, height) {
    const seconds = this.track.last / TICKS_PER_SECOND,
      first = (this.track.firstStep * TICKS_PER_STEP) / TICKS_PER_SECOND;
    const every = [1, 2, 5, 10, 20, 30, 60, 120, 300, 600].find((size) => seconds / size <= 6) ?? 3600;
    context.textAlign = "center";
    context.fillStyle = theme.colours.dim;
    for (let second = 0; second <= seconds; second += every) {
      const at = x(second * TICKS_PER_SECOND);
      if (at < x(this.track.last) - 8 || !second) context.fillText(`${first + second} s`, at, height - 6);
    }
  }
}
