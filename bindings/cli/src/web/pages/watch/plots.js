// @ts-check
// LanePanel: what a lane does, as numbers and as curves over the last minutes.

import { make } from "#view/dom.js";
import { clamp } from "#view/numbers.js";
import { fitCanvas, theme, traceCircle, traceLine } from "#view/theme.js";

/** @import { Point } from "../protocol.d.ts" */

/** Seconds of the window of rates and means. */
const WINDOW = 15;
/** Seconds that the curves show, and the fewest. */
const LONGEST_PLOT = 600;
const SHORTEST_PLOT = 30;

/** @param {number} value */
export const compact = (value) =>
  value >= 1e6
    ? `${(value / 1e6).toFixed(2)} M`
    : value >= 1e4
      ? `${(value / 1e3).toFixed(0)} k`
      : value >= 1e3
        ? `${(value / 1e3).toFixed(1)} k`
        : value.toFixed(0);

/**
 * @typedef {{ id: string, title: string, from?: number, to?: number, text: (value: number) => string,
 *   value: (window: Window) => number | null }} Plot
 */
/**
 * The oldest and the newest point of a window.
 * @typedef {{ first: Point, last: Point }} Window
 */
/** @typedef {{ time: number, value: number | null }} Value */
/** @typedef {{ number: HTMLElement, canvas: HTMLCanvasElement, values: Value[] }} Drawn */
/** @typedef {{ [name in "left" | "right" | "top" | "bottom" | "height" | "span"]: number }} Frame */

/**
 * The curves: each a function of a window; null is a gap.
 * @type {Plot[]}
 */
const PLOTS = [
  {
    id: "steps",
    title: "Steps per second",
    from: 0,
    text: compact,
    value: ({ last }) => last.steps_per_s,
  },
  {
    id: "wins",
    title: "Win rate",
    from: 0,
    to: 1,
    text: (value) => `${(value * 100).toFixed(value > 0 && value < 0.1 ? 1 : 0)}%`,
    value: ({ first, last }) => ratio(last.wins - first.wins, last.episodes - first.episodes),
  },
  {
    id: "returns",
    title: "Return",
    text: (value) => value.toFixed(2),
    value: ({ first, last }) => ratio(last.returns - first.returns, last.episodes - first.episodes),
  },
  {
    id: "lengths",
    title: "Episode length",
    from: 0,
    text: (value) => value.toFixed(0),
    value: ({ first, last }) => ratio(last.lengths - first.lengths, last.episodes - first.episodes),
  },
];

/**
 * @param {number} part
 * @param {number} all
 */
const ratio = (part, all) => (all > 0 ? part / all : null);

export class LanePanel {
  /** @param {HTMLElement} element */
  constructor(element) {
    /** @type {Point[]} */
    this.points = [];
    this.plots = PLOTS.map((plot) => this.makePlot(element, plot));
    this.isDrawn = false;
    theme.listeners.push(() => (this.isDrawn = false));
    new ResizeObserver(() => (this.isDrawn = false)).observe(element);
  }

  /**
   * @param {HTMLElement} element
   * @param {Plot} plot
   * @returns {Plot & Drawn}
   */
  makePlot(element, plot) {
    const number = make("b", {}, "–"),
      canvas = make("canvas", { role: "img", "aria-label": `${plot.title} over the last minutes` });
    const title = make("h2", {}, plot.title);
    element.append(
      make("section", { className: "card plot", id: `plot-${plot.id}` }, [title, number, canvas]),
    );
    return { ...plot, number, canvas, values: [] };
  }

  clear() {
    this.points = [];
    for (const plot of this.plots) {
      plot.values = [];
      plot.number.textContent = "–";
    }
    this.isDrawn = false;
  }

  /**
   * Takes points of the history.
   * @param {Point[]} points
   */
  take(points) {
    for (const point of points) {
      const { time, pool } = point;
      this.points.push(point);
      // Counts of another pool begin again.
      const first = this.points.find((other) => other.pool === pool && other.time >= time - WINDOW) ?? point;
      for (const plot of this.plots) plot.values.push({ time, value: plot.value({ first, last: point }) });
    }
    const now = this.points.at(-1)?.time ?? 0;
    while (this.points.length && this.points[0].time < now - LONGEST_PLOT) {
      this.points.shift();
      for (const plot of this.plots) plot.values.shift();
    }
    for (const plot of this.plots) {
      const value = plot.values.at(-1)?.value ?? null;
      plot.number.textContent = value === null ? "–" : plot.text(value);
    }
    this.isDrawn = false;
  }

  draw() {
    if (this.isDrawn) return;
    this.isDrawn = true;
    for (const plot of this.plots) this.drawPlot(plot);
  }

  /** @param {Plot & Drawn} plot */
  drawPlot({ canvas, values, from, to, text }) {
    const { context, width, height } = fitCanvas(canvas),
      { colours } = theme;
    context.clearRect(0, 0, width, height);
    const all = values.flatMap(({ value }) => value ?? []);
    if (!all.length) return;
    let [low, high] = [from ?? Math.min(...all), to ?? Math.max(...all)];
    // Values with the same text are one line: their last digits would fill the plot.
    if (text(low) === text(high)) [low, high] = [from ?? low - 1, low + 1];
    if (to === undefined) high += (high - low) * 0.08;
    const last = values[values.length - 1],
      newest = last.time,
      span = clamp(newest - values[0].time, SHORTEST_PLOT, LONGEST_PLOT);
    const [left, right, top, bottom] = [38, width - 4, 8, height - 16];
    /** @param {number} time */
    const x = (time) => right - ((newest - time) / span) * (right - left);
    /** @param {number} value */
    const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    this.drawAxes(context, { left, right, bottom, height, span, top: y(high) }, text(high), text(low));
    context.beginPath();
    let isGap = true;
    for (const { time, value } of values) {
      if (value !== null) isGap ? context.moveTo(x(time), y(value)) : context.lineTo(x(time), y(value));
      isGap = value === null;
    }
    context.lineWidth = 1.8;
    context.lineJoin = "round";
    context.strokeStyle = colours.ally;
    context.stroke();
    if (last.value === null) return;
    traceCircle(context, x(last.time), y(last.value), 3);
    context.fillStyle = colours.ally;
    context.fill();
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {Frame} frame
   * @param {string} high
   * @param {string} low
   */
  drawAxes(context, { left, right, bottom, height, span, top }, high, low) {
    const { colours } = theme;
    context.font = '10.5px system-ui, "DejaVu Sans", sans-serif';
    context.fillStyle = colours.dim;
    context.strokeStyle = colours.line;
    context.lineWidth = 1;
    for (const at of [top, bottom]) {
      traceLine(context, [left, Math.round(at) + 0.5], [right, Math.round(at) + 0.5]);
      context.stroke();
    }
    context.textBaseline = "middle";
    context.textAlign = "right";
    context.fillText(high, left - 5, top);
    context.fillText(low, left - 5, bottom);
    context.textBaseline = "alphabetic";
    context.textAlign = "left";
    context.fillText(
      `\u2212${span >= 90 ? `${Math.round(span / 60)} min` : `${Math.round(span)} s`}`,
      left,
      height - 3,
    );
    context.textAlign = "right";
    context.fillText("now", right, height - 3);
  }
}
