// @ts-check
// ObservationCard: what the selected agent observed before the shown step, with the name of every feature.

import { make } from "./dom.js";

/** @import { Features, ScenarioInfo } from "./data.d.ts" */
/**
 * What is shown: a unit, or -1, before a step of an episode, and the step with which its track begins.
 * @typedef {{ info: ScenarioInfo, unit: number, episode: number, step: number, firstStep: number }} Shown
 */

/** Milliseconds between two requests for observations. */
const OBSERVE_EVERY = 250;

export class ObservationCard {
  /**
   * @param {HTMLElement} element
   * @param {(episode: number, step: number, agent: number) => Promise<number[]>} observe
   */
  constructor(element, observe) {
    this.element = element;
    this.observe = observe;
    this.shown = "";
    this.asked = -OBSERVE_EVERY;
    /** Counts the battles, so that a late answer about an earlier one is not shown. */
    this.battle = 0;
  }

  /** Shows nothing until the next update: another battle begins. */
  forget() {
    this.battle++;
    this.shown = "";
    this.element.replaceChildren();
  }

  /**
   * @param {Shown} shown
   * @param {Features[]} features
   * @param {boolean} isKnown Whether the step can be asked for.
   */
  update({ info, unit, episode, step, firstStep }, features, isKnown) {
    const { faction, id } = info.units[unit] ?? { faction: 1, id: 0 };
    this.element.hidden = faction !== 0;
    if (this.element.hidden) {
      this.shown = "";
      return;
    }
    const key = [this.battle, episode, step, id].join(),
      now = performance.now();
    if (key === this.shown || now - this.asked < OBSERVE_EVERY || !isKnown) return;
    [this.shown, this.asked] = [key, now];
    this.observe(episode, step, id)
      .then((obs) => this.shown === key && this.draw(features, firstStep + step, obs))
      .catch((error) => this.element.replaceChildren(make("p", { className: "hint" }, error.message)));
  }

  /**
   * @param {Features[]} blocks
   * @param {number} step
   * @param {number[]} obs
   */
  draw(blocks, step, obs) {
    const title = make("h2", {}, `Observation before step ${step}`);
    const shown = blocks.filter(({ rows, features }) => features.length && rows !== 0);
    const tables = shown.map((block) => this.table(block, obs));
    // The scroll positions of the tables stay.
    const tops = [...this.element.querySelectorAll(".obs")].map((table) => table.scrollTop);
    this.element.replaceChildren(title, ...tables);
    this.element.querySelectorAll(".obs").forEach((table, i) => (table.scrollTop = tops[i] ?? 0));
  }

  /**
   * @param {Features} block
   * @param {number[]} obs
   */
  table({ name, start, rows, features }, obs) {
    const width = features.length;
    /** @param {number} index */
    const cell = (index) =>
      make(
        "td",
        { title: `obs[${index}] = ${obs[index]}`, className: obs[index] ? "" : "zero" },
        short(obs[index]),
      );
    const lines = Array.from({ length: rows ?? 1 }, (_, row) => {
      const values = features.map((_, at) => cell(start + row * width + at));
      return make("tr", {}, [make("th", {}, rows === null ? "" : String(row)), ...values]);
    });
    const head = make("tr", {}, [
      make("th", {}, name),
      ...features.map((feature) => make("th", {}, feature)),
    ]);
    return make(
      "div",
      { className: "obs" },
      make("table", {}, [make("thead", {}, head), make("tbody", {}, lines)]),
    );
  }
}

/**
 * A number in few letters.
 * @param {number} value
 */
const short = (value) => (Number.isInteger(value) ? String(value) : value.toFixed(2));
