// @ts-check
// Theme: the colours of the style sheet for canvases, and the choice between light and dark.

import { THEMES } from "./address.js";
import { byId } from "./dom.js";

export const theme = {
  /** @type {{ [name: string]: string }} */
  colours: {},
  /** @type {(() => void)[]} Called after the colours have changed. */
  listeners: [],
  dark: false,
  toggle() {},

  start() {
    const dark = matchMedia("(prefers-color-scheme: dark)");
    let chosen = [askedTheme(), stored("theme")].find(isTheme) ?? null;
    const apply = () => {
      const name = chosen ?? (dark.matches ? "dark" : "light");
      document.documentElement.dataset.theme = name;
      this.read();
      this.listeners.forEach((listener) => listener());
    };
    dark.addEventListener("change", apply);
    addEventListener("hashchange", () => {
      const asked = askedTheme();
      if (!asked) return;
      chosen = asked;
      apply();
    });
    // Another page of this origin, or one in a frame of this page, changed the choice.
    addEventListener("storage", (event) => {
      if (event.key !== "theme") return;
      chosen = event.newValue;
      apply();
    });
    this.toggle = () => {
      chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
      try {
        localStorage.setItem("theme", chosen);
      } catch {
        // A browser may refuse storage to files; then the choice lasts as long as the page.
      }
      apply();
    };
    apply();
  },

  read() {
    const style = getComputedStyle(document.documentElement),
      [rule] = byId("style").sheet.cssRules; // that of the root, with all names
    for (const name of rule.style)
      if (name.startsWith("--")) this.colours[name.slice(2)] = style.getPropertyValue(name).trim();
    this.dark = document.documentElement.dataset.theme === "dark";
  },

  /**
   * A colour of the style sheet with an opacity.
   * @param {string} name
   * @param {number} opacity
   */
  faint(name, opacity) {
    const hex = this.colours[name].slice(1);
    const [r, g, b] = [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16));
    return `rgba(${r}, ${g}, ${b}, ${opacity})`;
  },
};

/** @param {string | null} name */
const isTheme = (name) => THEMES.includes(name ?? "");

/** The theme that the address says, or null. */
export function askedTheme() {
  const name = new URLSearchParams(location.hash.slice(1)).get("theme");
  return isTheme(name) ? name : null;
}

/** @param {string} key */
function stored(key) {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}

export const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");

/**
 * What draws on a canvas.
 * @param {HTMLCanvasElement} canvas
 */
export function contextOf(canvas) {
  const context = canvas.getContext("2d");
  if (!context) throw new Error("this browser draws no canvas");
  return context;
}

/**
 * Fits the pixels of a canvas to its size on the screen; its context then measures in CSS pixels.
 * @param {HTMLCanvasElement} canvas
 */
export function fitCanvas(canvas) {
  const ratio = devicePixelRatio || 1,
    { width, height } = canvas.getBoundingClientRect();
  const [w, h] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
  if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
  const context = contextOf(canvas);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { context, width, height, ratio };
}

/**
 * Begins a path that is a line through points.
 * @param {CanvasRenderingContext2D} context
 * @param {[x: number, y: number][]} points
 */
export function traceLine(context, ...points) {
  context.beginPath();
  for (const point of points) context.lineTo(...point);
}

/**
 * Begins a path that is a circle.
 * @param {CanvasRenderingContext2D} context
 * @param {number} x
 * @param {number} y
 * @param {number} radius
 */
export function traceCircle(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
}
