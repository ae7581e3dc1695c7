// @ts-check
// BattlePlayer: shows a track, with clock and controls. Pages say which tracks there are.

import { BattleView } from "./battle.js";
import { HealthChart } from "./chart.js";
import { Controls } from "./controls.js";
import { all, byId, listenToSkip, make } from "./dom.js";
import { Inspector } from "./inspector.js";
import { theme } from "./theme.js";
import { Clock, TICKS_PER_SECOND, TICKS_PER_STEP, Timeline } from "./transport.js";

/** @import { At, Handlers } from "./controls.js" */
/** @import { ScenarioInfo } from "./data.d.ts" */
/** @import { Track } from "./track.js" */

export const RESULTS = { won: "Won", lost: "Lost", truncated: "Time limit", unfinished: "Unfinished" };

export class BattlePlayer {
  /** @param {ScenarioInfo} info */
  constructor(info) {
    this.info = info;
    this.clock = new Clock();
    /** What is drawn; empty if something else is to be. */
    this.drawn = "";
    /** @type {At | null} Where the pointer was last that moves the map. */
    this.panned = null;
    this.view = this.viewOf(info);
    this.inspector = new Inspector(info, (unit, add) => this.select(unit, add));
    this.timeline = new Timeline(byId("marks"), byId("scrub"), (tick) => this.seek(tick));
    this.chart = new HealthChart(byId("chart"), this.view.track, (tick) => this.seek(tick));
    this.showLegend();
  }

  /**
   * Shows battles of a scenario from now on.
   * @param {ScenarioInfo} info
   */
  use(info) {
    this.info = info;
    this.view = this.viewOf(info);
    this.inspector = new Inspector(info, (unit, add) => this.select(unit, add));
    this.chart.track = this.view.track;
    this.showLegend();
    this.redraw();
  }

  /**
   * What draws battles of a scenario.
   * @param {ScenarioInfo} info
   */
  viewOf(info) {
    return new BattleView(byId("battle"), info);
  }

  showLegend() {
    const { types } = this.info;
    byId("legend").querySelector(".shield").hidden = !types.some((type) => type.shield > 0);
    byId("legend").querySelector(".energy").hidden = !types.some((type) => type.energy > 0);
  }

  /**
   * Shows a track from its start.
   * @param {Track} track
   */
  show(track) {
    this.view.track = this.chart.track = track;
    this.view.camera = null;
    this.clock.end = track.last;
    this.clock.seek(0);
    this.redraw();
  }

  /** The last tick of which chart and timeline tell. */
  get knownUntil() {
    return Infinity;
  }

  /** @param {number} tick */
  seek(tick) {
    this.clock.seek(tick);
    this.redraw();
  }

  toggle() {
    this.clock.toggle();
    this.redraw();
  }

  /**
   * @param {number} unit
   * @param {boolean} [_add] Whether other units stay selected, where several can be.
   */
  select(unit, _add) {
    this.view.selected = unit === this.view.selected ? -1 : unit;
    this.redraw();
  }

  /**
   * Selects the next living unit in a direction.
   * @param {number} direction
   */
  selectNext(direction) {
    const { view, clock } = this,
      n = this.info.units.length;
    let unit = view.selected < 0 && direction < 0 ? 0 : view.selected;
    for (let tries = 0; tries < n; tries++) {
      unit = (unit + direction + n) % n;
      if (view.track.unitAt(unit, clock.time).alive) {
        view.selected = unit;
        return this.redraw();
      }
    }
  }

  fit() {
    this.view.wholeMap = !this.view.wholeMap;
    byId("fit").setAttribute("aria-pressed", String(this.view.wholeMap));
    this.view.camera = null;
    this.redraw();
  }

  redraw() {
    this.drawn = "";
  }

  /** @param {number} now */
  frame(now) {
    const { clock, view } = this;
    clock.advance(now);
    const { track } = view,
      time = clock.time;
    const box = view.canvas.getBoundingClientRect();
    const key = [time, box.width, box.height, devicePixelRatio].join();
    if (key === this.drawn || !track.length) return;
    if (view.width !== undefined && (box.width !== view.width || box.height !== view.height))
      view.camera = null;
    this.drawn = key;
    if (track.info !== this.info) {
      this.info = track.info;
      this.inspector.use(track.info);
    }
    view.draw(time);
    this.chart.draw(time, this.knownUntil);
    this.timeline.draw(track, time, this.knownUntil);
    const tick = Math.floor(time);
    this.inspector.update(track, tick, view.selected);
    this.showControls(track, tick);
  }

  /**
   * @param {Track} track
   * @param {number} tick
   */
  showControls(track, tick) {
    const { clock } = this;
    document.body.classList.toggle("playing", clock.playing);
    byId("play").setAttribute("aria-label", clock.playing ? "Pause" : "Play");
    byId("start").hidden = clock.playing || clock.time > 0;
    byId("speed").textContent = `${clock.speed}\u00d7`;
    const now = track.firstStep * TICKS_PER_STEP + tick;
    const text = [
      ["step ", `${Math.floor(now / TICKS_PER_STEP)}`, ` / ${this.stepsOf(track)}`],
      ["tick ", `${now}`, ""],
      ["", (now / TICKS_PER_SECOND).toFixed(1), " s"],
    ];
    byId("time").replaceChildren(
      ...text.flatMap(([before, value, after], i) => [
        i ? " \u00b7 " : "",
        before,
        make("b", {}, value),
        after,
      ]),
    );
  }

  /**
   * The number of steps that the step is shown with.
   * @param {Track} track
   */
  stepsOf(track) {
    return track.firstStep + Math.floor(track.last / TICKS_PER_STEP);
  }

  listen() {
    byId("play").addEventListener("click", () => this.toggle());
    byId("start").addEventListener("click", () => this.toggle());
    byId("fit").addEventListener("click", () => this.fit());
    byId("theme").addEventListener("click", () => theme.toggle());
    byId("help").addEventListener("click", () => byId("keys").showModal());
    listenToSkip();
    theme.listeners.push(() => this.redraw());
    /** @type {{ [name: string]: () => void }} */
    const moves = {
      home: () => this.seek(0),
      end: () => this.seek(this.clock.end),
      back: () => this.step(-TICKS_PER_STEP),
      forward: () => this.step(TICKS_PER_STEP),
    };
    all("[data-go]").forEach((button) => button.addEventListener("click", moves[button.dataset.go ?? ""]));
    all("[data-speed]").forEach((button) =>
      button.addEventListener("click", () => this.changeSpeed(Number(button.dataset.speed))),
    );
    addEventListener("keydown", (event) => this.key(event), { capture: true });
    // After a click the space bar plays again; with the keyboard (detail 0) a button keeps the focus.
    addEventListener(
      "click",
      (event) => event.detail > 0 && /** @type {Element} */ (event.target).closest?.("button")?.blur(),
    );
    new Controls(byId("battle"), () => this.handlers());
  }

  /** @param {number} ticks */
  step(ticks) {
    this.clock.stepTicks(ticks);
    this.redraw();
  }

  /** @param {number} direction */
  changeSpeed(direction) {
    this.clock.changeSpeed(direction);
    this.redraw();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || byId("keys").open) return;
    const on = event.target instanceof HTMLElement ? event.target.closest("button") : null;
    // A focused button takes the space bar itself.
    if (event.key === " " && on) return;
    const command = this.command(event.key, event.shiftKey ? TICKS_PER_STEP : 1);
    if (!command) return;
    event.preventDefault();
    command();
  }

  /**
   * What a key does.
   * @param {string} key
   * @param {number} ticks
   * @returns {(() => void) | undefined}
   */
  command(key, ticks) {
    /** @type {{ [key: string]: () => void }} */
    const commands = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.step(-ticks),
      ArrowRight: () => this.step(ticks),
      "+": () => this.changeSpeed(1),
      "=": () => this.changeSpeed(1),
      "-": () => this.changeSpeed(-1),
      Home: () => this.seek(0),
      End: () => this.seek(this.clock.end),
      Escape: () => this.select(-1),
      "[": () => this.selectNext(-1),
      "]": () => this.selectNext(1),
      m: () => this.fit(),
      t: () => theme.toggle(),
      "?": () => byId("keys").showModal(),
    };
    return commands[key];
  }

  /**
   * What mouse and fingers do now.
   * @returns {Handlers}
   */
  handlers() {
    return {
      tap: (at, { isDouble }) => {
        this.click(...at);
        if (isDouble) this.view.camera = null;
        this.redraw();
      },
      draw: ({ x0, y0, x1, y1 }) => {
        const [x, y] = this.panned ?? [x0, y0];
        this.pan([x1, y1]);
        this.handlers().move(x1 - x, y1 - y);
      },
      box: () => this.pan(null),
      move: (dx, dy) => {
        this.view.move(dx, dy);
        this.redraw();
      },
      zoom: (factor, at) => {
        this.view.zoom(factor, ...at);
        this.redraw();
      },
      hover: (at) => this.hover(...at),
      leave: () => this.hover(-1e6, -1e6),
    };
  }

  /** @param {At | null} at Where the map is moved to; null at the end. */
  pan(at) {
    this.panned = at;
    this.view.canvas.classList.toggle("moving", at !== null);
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  hover(x, y) {
    const { view } = this,
      unit = view.unitAt(x, y);
    if (unit !== view.hovered) this.redraw();
    view.hovered = unit;
    view.canvas.classList.toggle("over", unit >= 0);
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  click(x, y) {
    const unit = this.view.unitAt(x, y);
    if (unit >= 0 || this.view.selected >= 0) this.select(unit);
  }
}
