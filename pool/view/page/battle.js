// @ts-check
// BattleView: draws a battle on a canvas at any time between two ticks, and finds units under the pointer.

import { MapView } from "./camera.js";
import { FACTION_COLOURS, drawDeaths, drawEffects, hitFlashes } from "./effects.js";
import { clamp } from "./numbers.js";
import { TerrainLayer } from "./terrain.js";
import { theme, traceCircle, traceLine } from "./theme.js";
import { Track } from "./track.js";

/** @import { Box, Point } from "./camera.js" */
/** @import { ScenarioInfo } from "./data.d.ts" */

/** @typedef {ReturnType<Track["unitAt"]>} UnitState */

/** Space around the units when the view is fitted to the battle, in squares. */
const FIT_MARGIN = 2.2;
/** From the lowest to the highest. */
const PLANES = ["GROUND", "COLOSSUS", "AIR"];
/**
 * Radius in pixels from which a unit has its letter, and the least size of that: on a phone most are small.
 */
const LABELLED = 4;
const LEAST_LABEL = 7;
/** Corner radius of the hexagon that looks as large as a disc of radius 1. */
const HEXAGON = 1.1;

export class BattleView extends MapView {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {ScenarioInfo} info
   */
  constructor(canvas, info) {
    super(canvas, info);
    this.track = new Track(info);
    /** @type {Box | null} The rectangle of squares that fitting shows at least, if there is one. */
    this.area = null;
    this.selected = -1;
    this.hovered = -1;
    this.terrain = new TerrainLayer(this);
    /** @type {UnitState[]} What was drawn last, by unit. */
    this.states = [];
  }

  /** @param {number} unit */
  type(unit) {
    const { info } = this.track;
    return info.types[info.units[unit].type];
  }

  /**
   * The radius of a unit in pixels.
   * @param {number} unit
   */
  radius(unit) {
    return this.type(unit).radius * this.scale;
  }

  /**
   * Where a unit is on the canvas.
   * @param {number} unit
   * @param {number} time
   */
  place(unit, time) {
    const { x, y } = this.track.unitAt(unit, time);
    return this.toCanvas(x, y);
  }

  /** The rectangle in which units are at any time of the track. */
  fitBox() {
    const { track, info } = this;
    if (this.wholeMap || !track.length) return this.mapBox();
    const box = { x0: Infinity, y0: Infinity, x1: -Infinity, y1: -Infinity, ...this.area };
    for (let at = 0; at < track.length * track.units; at++) {
      if (!track.alive[at]) continue;
      const radius = this.type(at % track.units).radius + FIT_MARGIN;
      box.x0 = Math.min(box.x0, track.x[at] - radius);
      box.x1 = Math.max(box.x1, track.x[at] + radius);
      box.y0 = Math.min(box.y0, track.y[at] - radius);
      box.y1 = Math.max(box.y1, track.y[at] + radius);
    }
    if (box.x1 < box.x0) return this.mapBox();
    return {
      x0: Math.max(0, box.x0),
      y0: Math.max(0, box.y0),
      x1: Math.min(info.width, box.x1),
      y1: Math.min(info.height, box.y1),
    };
  }

  /** @param {number} time */
  draw(time) {
    this.measure();
    this.aim();
    this.states = this.info.units.map((_, unit) => this.track.unitAt(unit, time));
    this.terrain.draw();
    this.drawGround();
    drawDeaths(this, time);
    drawEffects(this, time, false);
    if (this.selected >= 0) this.drawRanges(this.states[this.selected]);
    const flashes = hitFlashes(this.track, time);
    const living = this.states.filter((state) => state.alive && this.shows(state.unit));
    /** @param {UnitState} state */
    const height = ({ unit }) => PLANES.indexOf(this.type(unit).plane);
    living.sort((a, b) => height(a) - height(b));
    for (const state of living) this.drawUnit(state, flashes.get(state.unit) ?? 0);
    drawEffects(this, time, true);
    for (const unit of [this.hovered, this.selected])
      if (unit >= 0 && this.shows(unit)) this.drawName(this.states[unit]);
  }

  /** Draws what is between the map and the units. */
  drawGround() {}

  /**
   * Whether a living unit is drawn.
   * @param {number} _unit
   */
  shows(_unit) {
    return true;
  }

  /**
   * @param {UnitState} state
   * @param {number} flash
   */
  drawUnit(state, flash) {
    const type = this.type(state.unit),
      faction = this.info.units[state.unit].faction;
    const at = this.toCanvas(state.x, state.y),
      r = Math.max(3, type.radius * this.scale),
      ring = clamp(r * 0.17, 1.6, 5),
      body = r - ring - 0.5;
    if (type.plane === "AIR") this.drawShadow(at, r);
    this.drawPointer(at, r, state.facing, FACTION_COLOURS[faction]);
    this.drawBody(at, r, body, faction, flash);
    this.drawCooldown(at, body, type.cooldown > 0 ? clamp(state.cooldown / type.cooldown) : 0);
    this.drawGauges(state, at, r, ring);
    if (r >= LABELLED) this.drawLabel(at, body, type.label);
    if (state.unit === this.selected || state.unit === this.hovered)
      this.drawMark(at, r + ring * 1.6, state.unit === this.selected);
  }

  /**
   * The shadow of a unit that flies.
   * @param {Point} at
   * @param {number} r
   */
  drawShadow(at, r) {
    const { context, scale } = this;
    context.beginPath();
    context.ellipse(at.x + scale * 0.12, at.y + scale * 0.35, r * 0.95, r * 0.8, 0, 0, 2 * Math.PI);
    context.fillStyle = theme.dark ? "rgba(0, 0, 0, 0.45)" : "rgba(20, 30, 45, 0.16)";
    context.fill();
  }

  /**
   * The disc or hexagon of a unit, bright if it was just hit.
   * @param {Point} at
   * @param {number} r
   * @param {number} body
   * @param {number} faction
   * @param {number} flash
   */
  drawBody(at, r, body, faction, flash) {
    const { context } = this;
    // The backing keeps units apart in a crowd.
    this.outline(at, r, faction);
    context.fillStyle = theme.dark ? "#0b1016" : "#ffffff";
    context.fill();
    this.outline(at, body, faction);
    context.fillStyle = theme.colours[`${FACTION_COLOURS[faction]}-deep`];
    context.fill();
    if (flash > 0) {
      context.fillStyle = `rgba(255, 255, 255, ${0.55 * flash})`;
      context.fill();
    }
  }

  /**
   * The share of the cooldown that is left, as a sector.
   * @param {Point} at
   * @param {number} body
   * @param {number} share
   */
  drawCooldown(at, body, share) {
    if (share <= 0.01) return;
    const { context } = this;
    context.beginPath();
    context.moveTo(at.x, at.y);
    context.arc(at.x, at.y, body * 0.86, -Math.PI / 2, -Math.PI / 2 + 2 * Math.PI * share);
    context.closePath();
    context.fillStyle = "rgba(4, 8, 14, 0.42)";
    context.fill();
  }

  /**
   * Health on the rim; shield or energy around it.
   * @param {UnitState} state
   * @param {Point} at
   * @param {number} r
   * @param {number} ring
   */
  drawGauges(state, at, r, ring) {
    const { colours } = theme,
      type = this.type(state.unit),
      faction = this.info.units[state.unit].faction;
    const empty = theme.dark ? "rgba(255, 255, 255, 0.13)" : "rgba(20, 30, 45, 0.14)";
    this.drawGauge(at, r - ring / 2, ring, 1, empty, faction);
    this.drawGauge(at, r - ring / 2, ring, state.hp / type.hp, colours[FACTION_COLOURS[faction]], faction);
    /**
     * @param {number} share
     * @param {string} colour
     */
    const gauge = (share, colour) => this.drawGauge(at, r + ring * 0.55, ring * 0.6, share, colour, faction);
    if (type.shield > 0) gauge(state.shield / type.shield, colours.shield);
    if (type.energy > 0) gauge(state.energy / type.energy, colours.energy);
  }

  /**
   * The ring of the selected unit, or of the one under the pointer.
   * @param {Point} at
   * @param {number} r
   * @param {boolean} isSelected
   */
  drawMark(at, r, isSelected) {
    const { context } = this;
    traceCircle(context, at.x, at.y, r);
    context.lineWidth = isSelected ? 2.2 : 1.2;
    context.strokeStyle = isSelected ? theme.colours.focus : theme.faint("text", 0.6);
    context.stroke();
  }

  /** Makes the outline of a unit, from its top, clockwise: a disc for allies, a hexagon for enemies.
   *  Gives its length.
   * @param {Point} at
   * @param {number} r
   * @param {number} faction
   */
  outline(at, r, faction) {
    const { context } = this;
    context.beginPath();
    if (faction === 0) {
      context.arc(at.x, at.y, r, -Math.PI / 2, 1.5 * Math.PI);
      return 2 * Math.PI * r;
    }
    const side = r * HEXAGON;
    for (let corner = 0; corner < 6; corner++) {
      const angle = -Math.PI / 2 + (corner * Math.PI) / 3;
      context.lineTo(at.x + Math.cos(angle) * side, at.y + Math.sin(angle) * side);
    }
    context.closePath();
    return 6 * side;
  }

  /**
   * A wedge at the rim that shows where the unit faces.
   * @param {Point} at
   * @param {number} r
   * @param {number} facing
   * @param {string} tone
   */
  drawPointer(at, r, facing, tone) {
    const { context } = this,
      tip = r + Math.max(3, r * 0.34),
      width = 0.36;
    context.beginPath();
    context.moveTo(at.x + Math.cos(facing) * tip, at.y - Math.sin(facing) * tip);
    for (const side of [width, -width]) {
      context.lineTo(at.x + Math.cos(facing + side) * r * 0.96, at.y - Math.sin(facing + side) * r * 0.96);
    }
    context.closePath();
    context.fillStyle = theme.colours[tone];
    context.fill();
  }

  /**
   * A part of the outline, from the top, as long as the share.
   * @param {Point} at
   * @param {number} r
   * @param {number} width
   * @param {number} share
   * @param {string} colour
   * @param {number} faction
   */
  drawGauge(at, r, width, share, colour, faction) {
    if (!(share > 0)) return;
    const { context } = this,
      length = this.outline(at, r, faction);
    context.lineCap = "butt";
    context.lineJoin = "miter";
    context.lineWidth = width;
    context.strokeStyle = colour;
    if (share < 1) context.setLineDash([length * share, length]);
    context.stroke();
    context.setLineDash([]);
  }

  /**
   * @param {Point} at
   * @param {number} r
   * @param {string} label
   */
  drawLabel(at, r, label) {
    const { context } = this;
    const size = Math.max(LEAST_LABEL, Math.round(r * 12) / 10);
    context.font = `700 ${size}px system-ui, "DejaVu Sans", sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    const { actualBoundingBoxAscent: up, actualBoundingBoxDescent: down } = context.measureText(label[0]);
    context.fillStyle = "#ffffff";
    context.fillText(label, at.x, at.y + (up - down) / 2);
  }

  /**
   * Sight and attack range of the selected unit, and its target.
   * @param {UnitState} state
   */
  drawRanges(state) {
    if (!state.alive) return;
    const { context, scale } = this,
      type = this.type(state.unit),
      at = this.toCanvas(state.x, state.y);
    const tone = FACTION_COLOURS[this.info.units[state.unit].faction];
    /**
     * @param {number} radius
     * @param {number[]} dash
     * @param {number} opacity
     * @param {number} fill
     */
    const circle = (radius, dash, opacity, fill) => {
      traceCircle(context, at.x, at.y, radius * scale);
      context.setLineDash(dash);
      context.lineWidth = 1.2;
      context.strokeStyle = theme.faint("focus", opacity);
      context.stroke();
      context.fillStyle = theme.faint("focus", fill);
      context.fill();
      context.setLineDash([]);
    };
    circle(type.sight_range, [6, 5], 0.75, 0.04);
    circle(type.radius + type.attack_range, [], 0.5, 0.05);
    if (state.target < 0 || !this.states[state.target].alive) return;
    const target = this.states[state.target],
      on = this.toCanvas(target.x, target.y);
    traceLine(context, [at.x, at.y], [on.x, on.y]);
    context.setLineDash([4, 4]);
    context.lineWidth = 1.6;
    context.strokeStyle = theme.colours[tone];
    context.stroke();
    context.setLineDash([]);
    traceCircle(context, on.x, on.y, this.radius(state.target) + 5);
    context.stroke();
  }

  /** @param {UnitState} state */
  drawName(state) {
    if (!state.alive) return;
    const { context } = this,
      at = this.toCanvas(state.x, state.y),
      r = this.radius(state.unit);
    const text = unitName(this.track.info, state.unit);
    context.font = '600 12px system-ui, "DejaVu Sans", sans-serif';
    const width = context.measureText(text).width + 14,
      y = at.y - r - 30 < 4 ? at.y + r + 10 : at.y - r - 32;
    context.beginPath();
    context.roundRect(at.x - width / 2, y, width, 21, 6);
    context.fillStyle = theme.faint("panel", 0.94);
    context.fill();
    context.strokeStyle = theme.colours.line;
    context.lineWidth = 1;
    context.stroke();
    context.fillStyle = theme.colours.text;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(text, at.x, y + 11);
  }

  /**
   * The living unit at a point of the canvas, or -1.
   * @param {number} x
   * @param {number} y
   */
  unitAt(x, y) {
    let best = -1,
      nearest = Infinity;
    for (const state of this.states) {
      if (!state.alive || !this.shows(state.unit)) continue;
      const at = this.toCanvas(state.x, state.y),
        away = Math.hypot(at.x - x, at.y - y);
      if (away < Math.max(9, this.radius(state.unit) + 3) && away < nearest)
        [best, nearest] = [state.unit, away];
    }
    return best;
  }
}

/** @param {string} name */
export const titleCase = (name) =>
  name
    .toLowerCase()
    .replaceAll("_", " ")
    .replace(/^./, (letter) => letter.toUpperCase());

/**
 * A unit as text: its type, faction and number in it.
 * @param {ScenarioInfo} info
 * @param {number} unit
 */
export function unitName(info, unit) {
  const { type, faction, id } = info.units[unit];
  return `${titleCase(info.types[type].name)}, ${faction ? "enemy" : "agent"} ${id}`;
}
