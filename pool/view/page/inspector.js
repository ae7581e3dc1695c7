// @ts-check
// Inspector: the rosters of both teams, and the card of the selected unit.

import { actionName } from "./actions.js";
import { titleCase, unitName } from "./battle.js";
import { all, byId, isTouch, make, pairsOf } from "./dom.js";
import { clamp } from "./numbers.js";
import { TICKS_PER_SECOND, TICKS_PER_STEP } from "./transport.js";

/** @import { ScenarioInfo, TypeInfo } from "./data.d.ts" */
/** @import { Track } from "./track.js" */
/**
 * A unit in the rosters, and what was shown of it last.
 * @typedef {{ button: HTMLElement, health: HTMLElement, shield: HTMLElement, last: string }} Chip
 */

/** Rosters of more units than this would only be noise. */
const LARGEST_ROSTER = 160;
/** Rosters of more units than these have smaller chips. */
const DENSE_ROSTER = 20;
const TINY_ROSTER = 36;

export class Inspector {
  /**
   * @param {ScenarioInfo} info
   * @param {(unit: number, add: boolean) => void} select
   */
  constructor(info, select) {
    this.info = info;
    this.select = select;
    /** @type {Chip[]} By unit. */
    this.chips = [];
    this.shown = "";
    /** What the card says while no unit is selected. */
    this.hint = isTouch()
      ? "Tap a unit to see its numbers."
      : "Click a unit, or press [ or ], to see its numbers.";
    /** @type {(unit: number) => boolean} Whether a unit is selected beside the one of the card. */
    this.isMarked = () => false;
    /** @type {(unit: number) => boolean} Whether the numbers of a unit are shown. */
    this.shows = () => true;
    this.use(info);
  }

  /**
   * Lists the units of an episode.
   * @param {ScenarioInfo} info
   */
  use(info) {
    Object.assign(this, { info, chips: [], shown: "" });
    for (const faction of [0, 1]) {
      const units = info.units.flatMap((unit, id) => (unit.faction === faction ? [id] : []));
      const roster = byId(`roster${faction}`);
      roster.hidden = units.length > LARGEST_ROSTER;
      roster.classList.toggle("dense", units.length > DENSE_ROSTER);
      roster.classList.toggle("tiny", units.length > TINY_ROSTER);
      roster.replaceChildren(...(roster.hidden ? [] : units.map((id) => this.makeChip(id))));
    }
  }

  /** Shows nothing until the next update: another battle begins. */
  forget() {
    this.use(this.info);
    byId("unit").replaceChildren();
    for (const faction of [0, 1]) byId(`alive${faction}`).replaceChildren();
  }

  /** @param {number} unit */
  makeChip(unit) {
    const type = this.info.types[this.info.units[unit].type];
    const health = make("i"),
      shield = make("i");
    const button = make(
      "button",
      { type: "button", className: "chip", title: unitName(this.info, unit), "aria-pressed": "false" },
      [type.label, health, ...(type.shield ? [shield] : [])],
    );
    button.addEventListener("click", (event) => this.select(unit, event.shiftKey));
    this.chips[unit] = { button, health, shield, last: "" };
    return button;
  }

  /**
   * @param {Track} track
   * @param {number} tick
   * @param {number} selected
   */
  update(track, tick, selected) {
    for (const faction of [0, 1]) {
      const share = track.health[faction][tick],
        all = this.info.units.filter((unit) => unit.faction === faction).length;
      byId(`bar${faction}`).style.transform = `scaleX(${share})`;
      const living = byId(`alive${faction}`);
      living.replaceChildren(String(track.living[faction][tick]), make("small", {}, ` of ${all}`));
    }
    this.chips.forEach((chip, unit) =>
      this.updateChip(chip, track, tick, unit, unit === selected || this.isMarked(unit)),
    );
    this.updateCard(track, tick, selected);
  }

  /**
   * @param {Chip} chip
   * @param {Track} track
   * @param {number} tick
   * @param {number} unit
   * @param {boolean} isSelected
   */
  updateChip(chip, track, tick, unit, isSelected) {
    const at = tick * track.units + unit,
      type = this.info.types[this.info.units[unit].type],
      alive = track.alive[at] > 0,
      isShown = !alive || this.shows(unit);
    const key = [track.hp[at], track.shield[at], alive, isShown, isSelected].join();
    if (key === chip.last) return;
    chip.last = key;
    chip.health.style.transform = `scaleX(${alive && isShown ? track.hp[at] / type.hp : 0})`;
    if (type.shield)
      chip.shield.style.transform = `scaleX(${alive && isShown ? track.shield[at] / type.shield : 0})`;
    chip.button.classList.toggle("dead", !alive);
    chip.button.classList.toggle("unseen", !isShown);
    chip.button.setAttribute("aria-pressed", String(isSelected));
    const health = !alive
      ? "dead"
      : isShown
        ? `${Math.ceil(track.hp[at])} of ${type.hp} health`
        : "out of sight";
    chip.button.setAttribute("aria-label", `${unitName(this.info, unit)}, ${health}`);
  }

  /**
   * @param {Track} track
   * @param {number} tick
   * @param {number} unit
   */
  updateCard(track, tick, unit) {
    const card = byId("unit"),
      key = [track.serial, tick, unit, unit < 0 ? this.hint : ""].join();
    if (key === this.shown) return;
    this.shown = key;
    if (unit < 0) {
      if (card.querySelector(".hint")?.textContent !== this.hint) {
        card.className = "card";
        card.replaceChildren(make("p", { className: "hint" }, this.hint));
      }
      return;
    }
    const { faction, type: typeId, id } = this.info.units[unit],
      type = this.info.types[typeId];
    const focused = card.contains(document.activeElement)
      ? /** @type {HTMLElement} */ (document.activeElement).dataset.name
      : null;
    card.className = `card ${faction ? "enemy" : "ally"}`;
    const close = make(
      "button",
      { type: "button", className: "close", "aria-label": "Close", "data-name": "close" },
      "\u00d7",
    );
    close.addEventListener("click", () => this.select(-1, false));
    card.replaceChildren(
      make("header", {}, [
        make("h2", {}, titleCase(type.name)),
        make("span", { className: "who" }, `${faction ? "enemy" : "agent"} ${id}`),
        close,
      ]),
      ...this.meters(track, tick, unit, type),
      this.pairs(track, tick, unit, type),
      ...(faction ? [] : this.decision(track, tick, id)),
    );
    if (focused) all(`[data-name="${focused}"]`, card)[0]?.focus();
  }

  /**
   * @param {Track} track
   * @param {number} tick
   * @param {number} unit
   * @param {TypeInfo} type
   */
  meters(track, tick, unit, type) {
    const at = tick * track.units + unit,
      alive = track.alive[at] > 0;
    /** @type {[string, number, number, string, number][]} */
    const rows = [
      ["Health", track.hp[at], type.hp, "", 0],
      ["Shield", track.shield[at], type.shield, "--shield", 0],
      ["Energy", track.energy[at], type.energy, "--energy", 0],
      ["Cooldown", track.cooldown[at], type.cooldown, "--dim", 2],
    ];
    return rows
      .filter(([, , most]) => most > 0)
      .map(([name, raw, most, tone, digits]) => {
        const value = alive ? raw : 0,
          bar = make("i");
        bar.style.transform = `scaleX(${clamp(value / most)})`;
        if (tone) bar.style.setProperty("--tone", `var(${tone})`);
        const text = digits ? `${value.toFixed(digits)} s` : `${Math.ceil(value)} / ${most}`;
        return make("div", { className: "meter" }, [
          make("span", {}, name),
          make("div", { className: "bar" }, bar),
          make("span", {}, text),
        ]);
      });
  }

  /**
   * @param {Track} track
   * @param {number} tick
   * @param {number} unit
   * @param {TypeInfo} type
   */
  pairs(track, tick, unit, type) {
    const at = tick * track.units + unit,
      target = track.target[at],
      alive = track.alive[at] > 0,
      first = track.firstStep * TICKS_PER_STEP;
    const wasAlive = track.alive[unit] > 0, // in the state in which the track begins
      died = wasAlive
        ? `died at ${((first + track.deathTick[unit]) / TICKS_PER_SECOND).toFixed(1)} s`
        : "dead at the start";
    /** @type {string | HTMLElement} */
    let aim = "none";
    if (alive && target >= 0) {
      aim = make(
        "button",
        { type: "button", className: "link", "data-name": "target" },
        unitName(this.info, target),
      );
      aim.addEventListener("click", () => this.select(target, false));
    }
    /** @type {[string, string | HTMLElement][]} */
    const rows = [
      ["Position", `${track.x[at].toFixed(2)}, ${track.y[at].toFixed(2)}`],
      ["Target", aim],
      ["Range", `${type.attack_range} squares, sight ${type.sight_range}`],
    ];
    if (!alive) rows.unshift(["State", died]);
    return make("dl", { className: "pairs" }, pairsOf(rows));
  }

  /**
   * The action that the agent carries out, and those that it could choose from.
   * @param {Track} track
   * @param {number} tick
   * @param {number} agent
   */
  decision(track, tick, agent) {
    // Tick 8k + 1 is the first of step k; the moment 8k shows the end of step k - 1.
    const step = clamp(Math.ceil(tick / TICKS_PER_STEP) - 1, 0, Math.max(0, track.decisions.length - 1));
    const decision = track.decisions[step]?.[agent];
    if (!decision) return [];
    const chosen = tick > 0 ? decision.action : -1;
    const options = decision.available.map((action) =>
      make("span", { className: action === chosen ? "chosen" : "" }, actionName(this.info, agent, action)),
    );
    const title =
      chosen < 0
        ? "Available at the start"
        : `Action of step ${track.firstStep + step}: ${actionName(this.info, agent, chosen)}`;
    return [make("h3", {}, title), make("div", { className: "actions" }, options)];
  }
}
