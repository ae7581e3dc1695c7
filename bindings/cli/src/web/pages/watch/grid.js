// @ts-check
// Grid: many battles of a lane, each from the newest frame that showed it, and moving between two frames.

import { BattleView } from "#view/battle.js";
import { make } from "#view/dom.js";
import { clamp } from "#view/numbers.js";
import { RESULTS } from "#view/player.js";
import { theme } from "#view/theme.js";
import { Track, bytesOf } from "#view/track.js";

/** @import { Box } from "#view/camera.js" */
/** @import { EpisodeResult, ScenarioInfo } from "#view/data.d.ts" */
/** @import { GridCell } from "../protocol.d.ts" */

/** Milliseconds per picture that the grid may draw; cells that do not fit wait for the next picture. */
const GRID_BUDGET = 8;
/** The shortest and the longest time in which a cell moves from one frame to the next, in milliseconds. */
const SHORTEST_MOVE = 60;
const LONGEST_MOVE = 600;
/** Cells of one page. */
export const MOST_CELLS = 64;

/** The last two moments of an environment. */
class CellTrack extends Track {
  /** @param {ScenarioInfo} info */
  constructor(info) {
    super(info);
    this.attacks = [[], []];
  }

  /**
   * Takes the next moment; a jump forgets the one before.
   * @param {Uint8Array} bytes
   * @param {boolean} jumps
   */
  push(bytes, jumps) {
    this.keepLast(jumps ? 0 : 1);
    this.append(bytes, 1);
    this.attacks = [[], []];
  }

  summarise() {
    // A cell has no curves and no marks.
  }
}

/** A battle in a cell. Its units are drawn larger than they are, so those at the edge stay within the map. */
class CellView extends BattleView {
  /** @param {number} time */
  draw(time) {
    this.context.save();
    super.draw(time);
    this.context.restore();
  }

  drawGround() {
    const { context, info } = this,
      { x, y } = this.toCanvas(0, info.height);
    context.beginPath();
    context.rect(x, y, info.width * this.scale, info.height * this.scale);
    context.clip();
  }
}

class Cell {
  /**
   * @param {number} env
   * @param {ScenarioInfo} info
   * @param {(env: number) => void} follow
   */
  constructor(env, info, follow) {
    this.env = env;
    this.canvas = make("canvas", { "aria-hidden": "true" });
    this.label = make("span", { className: "steps" });
    this.score = make("span", { className: "score" });
    this.dot = make("i", { className: "dot" });
    this.button = make("button", { type: "button", className: "cell" }, [
      this.canvas,
      make("span", { className: "row" }, [this.dot, make("b", {}, String(env)), this.label, this.score]),
    ]);
    this.button.addEventListener("click", () => follow(env));
    this.view = new CellView(this.canvas, info);
    this.view.track = this.track = new CellTrack(info);
    this.length = -1;
    this.arrived = 0;
    this.move = SHORTEST_MOVE;
    this.isVisible = false;
    this.isDrawn = false;
    /** @type {EpisodeResult | null} How the episode ended that is shown, if it did. */
    this.outcome = null;
  }

  /**
   * Takes the environment's row of a frame.
   * @param {GridCell} row
   * @param {number} now
   */
  take(row, now) {
    const jumps = row.length === null || row.length < this.length || this.outcome !== null;
    this.length = row.length ?? 0;
    this.outcome = row.outcome;
    if (row.moment) {
      this.move = clamp(now - this.arrived, SHORTEST_MOVE, LONGEST_MOVE);
      this.arrived = now;
      this.track.push(bytesOf(row.moment), jumps);
      this.isDrawn = false;
    }
    this.label.textContent = row.length === null ? "" : `step ${row.length}`;
    this.score.textContent = row.return === null ? "" : row.return.toFixed(1);
    const result = row.outcome ?? row.last;
    this.dot.className = `dot ${result ?? ""}`;
    this.button.classList.toggle("over", Boolean(row.outcome));
    const outcome = result ? `, last episode: ${RESULTS[result].toLowerCase()}` : "";
    this.button.title = `Battle ${this.env}${outcome}`;
    this.button.setAttribute(
      "aria-label",
      `Follow battle ${this.env}, ${this.label.textContent}, return ${this.score.textContent}${outcome}`,
    );
  }

  /** @param {number} now */
  draw(now) {
    const { track } = this.view;
    if (!track.length) return;
    const part = clamp((now - this.arrived) / this.move);
    this.view.draw(part * track.last);
    this.isDrawn = part === 1;
  }
}

export class Grid {
  /**
   * `setView` is called with the first environment that is visible and the number of them.
   * @param {HTMLElement} element
   * @param {(env: number) => void} follow
   * @param {(first: number, count: number) => void} setView
   */
  constructor(element, follow, setView) {
    this.element = element;
    this.follow = follow;
    this.setView = setView;
    /** @type {Cell[]} */
    this.cells = [];
    this.first = 0;
    this.cursor = 0;
    /** @type {Box | null} The squares where units were. */
    this.area = null;
    this.observer = new IntersectionObserver((entries) => this.notice(entries), { rootMargin: "80px" });
    new ResizeObserver(() => this.redraw()).observe(element);
    theme.listeners.push(() => this.redraw());
  }

  /** Shows nothing. */
  clear() {
    this.cells = [];
    this.area = null;
    this.observer.disconnect();
    this.element.replaceChildren();
  }

  /**
   * Shows the environments of a lane from one on.
   * @param {ScenarioInfo} info
   * @param {number} numEnvs
   * @param {number} first
   */
  show(info, numEnvs, first = 0) {
    this.clear();
    this.first = first;
    const n = Math.min(MOST_CELLS, numEnvs - first);
    this.cells = Array.from({ length: n }, (_, i) => new Cell(first + i, info, this.follow));
    this.element.replaceChildren(...this.cells.map((cell) => cell.button));
    for (const cell of this.cells) this.observer.observe(cell.button);
  }

  /** @param {IntersectionObserverEntry[]} entries */
  notice(entries) {
    /** @type {Map<Element, Cell>} */
    const cells = new Map(this.cells.map((cell) => [cell.button, cell]));
    for (const { target, isIntersecting } of entries) {
      const cell = cells.get(target);
      if (cell) cell.isVisible = isIntersecting;
    }
    const visible = this.cells.filter((cell) => cell.isVisible);
    if (!visible.length) return this.setView(0, 0);
    const from = visible[0].env,
      to = visible[visible.length - 1].env;
    this.setView(from, to - from + 1);
  }

  redraw() {
    for (const cell of this.cells) {
      cell.view.camera = null;
      cell.isDrawn = false;
    }
  }

  /**
   * @param {GridCell[]} rows
   * @param {number} now
   */
  take(rows, now) {
    for (const row of rows) {
      const cell = this.cells[row.env - this.first];
      cell?.take(row, now);
      if (cell) this.widen(cell.view.track);
    }
  }

  /**
   * All cells show the same part of the map: the one where units were.
   * @param {Track} track
   */
  widen(track) {
    const margin = 1.5,
      { info } = track,
      old = this.area,
      area = old ? { ...old } : { x0: Infinity, y0: Infinity, x1: -Infinity, y1: -Infinity };
    for (let at = 0; at < track.length * track.units; at++) {
      if (!track.alive[at]) continue;
      area.x0 = Math.min(area.x0, Math.max(0, Math.floor(track.x[at] - margin)));
      area.x1 = Math.max(area.x1, Math.min(info.width, Math.ceil(track.x[at] + margin)));
      area.y0 = Math.min(area.y0, Math.max(0, Math.floor(track.y[at] - margin)));
      area.y1 = Math.max(area.y1, Math.min(info.height, Math.ceil(track.y[at] + margin)));
    }
    if (!(area.x1 > area.x0)) return;
    const isSame = old?.x0 === area.x0 && old.x1 === area.x1 && old.y0 === area.y0 && old.y1 === area.y1;
    if (isSame) return;
    this.area = area;
    const aspect = clamp((area.x1 - area.x0) / (area.y1 - area.y0), 1, 2);
    this.element.style.setProperty("--aspect", aspect.toFixed(2));
    for (const cell of this.cells) cell.view.area = area;
    this.redraw();
  }

  /**
   * Draws the cells that moved, as many as there is time for.
   * @param {number} now
   */
  frame(now) {
    const end = performance.now() + GRID_BUDGET;
    for (let i = 0; i < this.cells.length; i++) {
      this.cursor = (this.cursor + 1) % this.cells.length;
      const cell = this.cells[this.cursor];
      if (!cell.isVisible || cell.isDrawn) continue;
      cell.draw(now);
      if (performance.now() > end) return;
    }
  }

  /**
   * Moves the focus from cell to cell.
   * @param {number} dx
   * @param {number} dy
   */
  focus(dx, dy) {
    const at = this.cells.findIndex((cell) => cell.button === document.activeElement);
    const columns = getComputedStyle(this.element).gridTemplateColumns.split(" ").length;
    const next = at < 0 ? 0 : clamp(at + dx + dy * columns, 0, this.cells.length - 1);
    this.cells[next]?.button.focus();
  }
}
