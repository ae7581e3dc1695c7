// @ts-check
// ObservationCard: what the selected agent observed before the shown step, with the name of every feature.

import { make } from "#view/dom.js";
import { TICKS_PER_STEP } from "#view/transport.js";
import { messageOf } from "../connection.js";

/** @import { Features } from "../protocol.d.ts" */
/** @import { FollowPlayer, Request } from "./follow.js" */

/** Milliseconds between two requests for observations. */
const OBSERVE_EVERY = 250;

export class ObservationCard {
  /**
   * @param {HTMLElement} element
   * @param {Request} request
   */
  constructor(element, request) {
    this.element = element;
    this.request = request;
    this.shown = "";
    this.asked = -OBSERVE_EVERY;
  }

  /**
   * @param {FollowPlayer} player
   * @param {number} tick
   */
  update(player, tick) {
    const unit = player.info.units[player.view.selected],
      isAgent = unit?.faction === 0;
    this.element.hidden = !isAgent;
    if (!isAgent) {
      this.shown = "";
      return;
    }
    const entry = player.tracks.get(player.number),
      step = Math.floor(tick / TICKS_PER_STEP),
      key = [player.number, step, unit.id].join();
    const now = performance.now();
    if (!entry || key === this.shown || now - this.asked < OBSERVE_EVERY || step > entry.steps) return;
    [this.shown, this.asked] = [key, now];
    this.request({ type: "get_observation", number: player.number, step, agent: unit.id })
      .then(({ obs }) => this.shown === key && this.draw(player.features, step, obs))
      .catch((error) => this.element.replaceChildren(make("p", { className: "hint" }, messageOf(error))));
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
