// @ts-check
// Effects: attacks, heals, explosions and deaths, as functions of the time since they happened.

import { clamp, easeOut } from "./numbers.js";
import { reducedMotion, theme, traceCircle, traceLine } from "./theme.js";

/** @import { BattleView } from "./battle.js" */
/** @import { Attack, Track } from "./track.js" */
/**
 * Where both units of an attack are on the canvas.
 * @typedef {{ by: Point, on: Point }} Ends
 * @typedef {{ x: number, y: number }} Point
 */

/** Ticks for which an effect is seen. */
const SHOT_TICKS = 3.2;
const BEAM_TICKS = 5;
const BLAST_TICKS = 8;
const HEAL_TICKS = 2;
const DEATH_TICKS = 12;
const FLASH_TICKS = 2;
/** Attacks from up to this distance between two units, in squares, are blows. */
const MELEE_RANGE = 1;

export const FACTION_COLOURS = ["ally", "enemy"];

/**
 * Calls `draw(attack, age, tick)` for the attacks that are still seen at `time`; age is in ticks.
 * @param {Track} track
 * @param {number} time
 * @param {(attack: Attack, age: number, tick: number) => void} draw
 */
function recentAttacks(track, time, draw) {
  const newest = Math.min(track.last, Math.ceil(time));
  const seen = Math.max(BLAST_TICKS, track.longestFlight + SHOT_TICKS);
  for (let tick = Math.max(0, newest - Math.ceil(seen)); tick <= newest; tick++) {
    const age = time - (tick - 1);
    if (age > 0) for (const attack of track.attacks[tick]) draw(attack, age, tick);
  }
}

/**
 * `view` draws at `time`: the effects below units, or those above them.
 * @param {BattleView} view
 * @param {number} time
 * @param {boolean} above
 */
export function drawEffects(view, time, above) {
  const { track } = view;
  recentAttacks(track, time, (attack, age, tick) => {
    if (!view.shows(attack.by) && !view.shows(attack.on)) return;
    const faction = track.info.units[attack.by].faction;
    const tone = FACTION_COLOURS[faction];
    const at = { by: view.place(attack.by, time), on: view.place(attack.on, time) };
    if (attack.kind === "explosion" && !above) drawBlast(view, attack, age, tick, tone);
    if (attack.kind === "beam")
      above ? drawRay(view, at, attack, age, tone) : drawBurn(view, attack, age, tick, tone);
    if (attack.kind === "shot" && above) drawShot(view, at, attack, age, tone);
    if (attack.kind === "heal" && above && age <= HEAL_TICKS) drawHeal(view, at, attack, age, time);
  });
}

/**
 * The points where the line between two units leaves the one and meets the other.
 * @param {BattleView} view
 * @param {Ends} at
 * @param {Attack} attack
 */
function edgePoints(view, at, attack) {
  const dx = at.on.x - at.by.x,
    dy = at.on.y - at.by.y,
    length = Math.hypot(dx, dy) || 1;
  const [r0, r1] = [attack.by, attack.on].map((unit) => view.radius(unit));
  const gap = length - r0 - r1;
  return {
    x0: at.by.x + (dx / length) * r0,
    y0: at.by.y + (dy / length) * r0,
    x1: at.on.x - (dx / length) * r1 * 0.7,
    y1: at.on.y - (dy / length) * r1 * 0.7,
    ux: dx / length,
    uy: dy / length,
    gap: gap / view.scale,
  };
}

/**
 * @param {BattleView} view
 * @param {Ends} at
 * @param {Attack} attack
 * @param {number} age
 * @param {string} tone
 */
function drawShot(view, at, attack, age, tone) {
  if (attack.flight > 0) return drawProjectile(view, at, attack, age, tone);
  if (age > SHOT_TICKS) return;
  const { context } = view,
    { x0, y0, x1, y1, ux, uy, gap } = edgePoints(view, at, attack);
  const fade = clamp(1 - (age - 1) / (SHOT_TICKS - 1)),
    size = view.scale;
  context.lineCap = "round";
  if (gap <= MELEE_RANGE) {
    // A blow: an arc across the point where the two meet.
    const centre = Math.atan2(uy, ux),
      reach = view.radius(attack.by) + size * 0.12,
      half = 0.25 + 0.5 * easeOut(age / 2);
    context.beginPath();
    context.arc(at.by.x, at.by.y, reach, centre - half, centre + half);
    context.lineWidth = Math.max(1.5, size * 0.09) * fade;
    context.strokeStyle = theme.faint(tone, 0.95 * fade);
    context.stroke();
    return;
  }
  const head = easeOut(age / 1.2),
    tail = clamp((age - 0.6) / 2.4);
  const [hx, hy] = [x0 + (x1 - x0) * head, y0 + (y1 - y0) * head];
  const [tx, ty] = [x0 + (x1 - x0) * tail, y0 + (y1 - y0) * tail];
  /**
   * @param {number} width
   * @param {number} opacity
   */
  const line = (width, opacity) => {
    traceLine(context, [tx, ty], [hx, hy]);
    context.lineWidth = width;
    context.strokeStyle = theme.faint(tone, opacity);
    context.stroke();
  };
  line(Math.max(2.5, size * 0.14), 0.22 * fade);
  line(Math.max(1.2, size * 0.05), 0.95 * fade);
  if (age > 0.9) spark(view, x1, y1, age - 0.9, tone, Math.atan2(uy, ux));
}

/**
 * What a unit fired, on its way; then where it lands.
 * @param {BattleView} view
 * @param {Ends} at
 * @param {Attack} attack
 * @param {number} age
 * @param {string} tone
 */
function drawProjectile(view, at, attack, age, tone) {
  const { context } = view,
    { x0, y0, x1, y1, ux, uy } = edgePoints(view, at, attack);
  // Age 1 is the tick in which it was fired.
  const part = clamp((age - 1) / attack.flight);
  if (part === 1) {
    const landed = age - 1 - attack.flight;
    if (landed < SHOT_TICKS - 1) spark(view, x1, y1, landed, tone, Math.atan2(uy, ux));
    return;
  }
  const [x, y] = [x0 + (x1 - x0) * part, y0 + (y1 - y0) * part];
  const tail = Math.min(view.scale * 0.35, Math.hypot(x - x0, y - y0));
  context.lineCap = "round";
  for (const [width, opacity] of [
    [0.24, 0.25],
    [0.11, 0.95],
  ]) {
    traceLine(context, [x - ux * tail, y - uy * tail], [x, y]);
    context.lineWidth = Math.max(1.5, view.scale * width);
    context.strokeStyle = theme.faint(tone, opacity);
    context.stroke();
  }
}

/**
 * Short lines that fly from where a hit lands.
 * @param {BattleView} view
 * @param {number} x
 * @param {number} y
 * @param {number} age
 * @param {string} tone
 * @param {number} direction
 */
function spark(view, x, y, age, tone, direction) {
  const part = clamp(age / 2),
    { context } = view;
  context.beginPath();
  for (let i = -1; i <= 1; i++) {
    const angle = direction + Math.PI + i * 0.8,
      near = view.scale * (0.06 + 0.2 * part),
      far = near + view.scale * 0.14;
    context.moveTo(x + Math.cos(angle) * near, y + Math.sin(angle) * near);
    context.lineTo(x + Math.cos(angle) * far, y + Math.sin(angle) * far);
  }
  context.lineWidth = Math.max(1, view.scale * 0.045);
  context.strokeStyle = theme.faint(tone, 0.9 * (1 - part));
  context.stroke();
}

/**
 * @param {BattleView} view
 * @param {Ends} at
 * @param {Attack} attack
 * @param {number} age
 * @param {string} tone
 */
function drawRay(view, at, attack, age, tone) {
  if (age > BEAM_TICKS) return;
  const { context } = view,
    { x0, y0, x1, y1 } = edgePoints(view, at, attack),
    fade = 1 - easeOut(age / BEAM_TICKS) * 0.9;
  for (const [width, opacity] of [
    [0.22, 0.25],
    [0.08, 0.95],
  ]) {
    traceLine(context, [x0, y0], [x1, y1]);
    context.lineWidth = Math.max(1, view.scale * width * fade);
    context.strokeStyle = theme.faint(tone, opacity * fade);
    context.stroke();
  }
}

/**
 * The rectangle that a beam hits.
 * @param {BattleView} view
 * @param {Attack} attack
 * @param {number} age
 * @param {number} tick
 * @param {string} tone
 */
function drawBurn(view, attack, age, tick, tone) {
  if (age > BEAM_TICKS + 3) return;
  const { context } = view,
    [width, height] = view.type(attack.by).attack_size;
  const at = { by: view.place(attack.by, tick), on: view.place(attack.on, tick) };
  const fade = 1 - clamp(age / (BEAM_TICKS + 3));
  context.save();
  context.translate(at.on.x, at.on.y);
  context.rotate(Math.atan2(at.on.y - at.by.y, at.on.x - at.by.x));
  const half = [(height * view.scale) / 2, (width * view.scale * easeOut(age / 2)) / 2];
  context.beginPath();
  context.roundRect(-half[0], -half[1], 2 * half[0], 2 * half[1], half[0]);
  context.fillStyle = theme.faint(tone, 0.55 * fade);
  context.shadowColor = theme.faint(tone, fade);
  context.shadowBlur = view.scale * 0.5 * view.ratio;
  context.fill();
  context.restore();
}

/**
 * @param {BattleView} view
 * @param {Attack} attack
 * @param {number} age
 * @param {number} tick
 * @param {string} tone
 */
function drawBlast(view, attack, age, tick, tone) {
  if (age > BLAST_TICKS) return;
  const { context } = view,
    at = view.place(attack.by, tick),
    radius = view.type(attack.by).attack_size[0] * view.scale;
  const size = reducedMotion.matches ? radius : radius * easeOut(age / 2.5),
    fade = 1 - clamp(age / BLAST_TICKS);
  const glow = context.createRadialGradient(at.x, at.y, 0, at.x, at.y, Math.max(1, size));
  glow.addColorStop(0, theme.faint(tone, 0.55 * fade));
  glow.addColorStop(0.7, theme.faint(tone, 0.25 * fade));
  glow.addColorStop(1, theme.faint(tone, 0.05 * fade));
  traceCircle(context, at.x, at.y, size);
  context.fillStyle = glow;
  context.fill();
  context.lineWidth = Math.max(1, view.scale * 0.09 * fade);
  context.strokeStyle = theme.faint(tone, 0.9 * fade);
  context.stroke();
}

/**
 * @param {BattleView} view
 * @param {Ends} at
 * @param {Attack} attack
 * @param {number} age
 * @param {number} time
 */
function drawHeal(view, at, attack, age, time) {
  const { context } = view,
    { x0, y0, x1, y1 } = edgePoints(view, at, attack),
    fade = 1 - clamp((age - 1) / (HEAL_TICKS - 1));
  traceLine(context, [x0, y0], [x1, y1]);
  context.lineWidth = Math.max(1.5, view.scale * 0.07);
  context.setLineDash([view.scale * 0.16, view.scale * 0.16]);
  context.lineDashOffset = reducedMotion.matches ? 0 : -time * view.scale * 0.12;
  context.strokeStyle = theme.faint("heal", 0.6 * fade);
  context.stroke();
  context.setLineDash([]);
  if (age > 1) return;
  // A cross above the healed unit.
  const size = Math.max(3, view.scale * 0.16),
    r = view.radius(attack.on) + size;
  const [x, y] = [at.on.x + r * 0.8, at.on.y - r * 0.8];
  context.beginPath();
  context.moveTo(x - size, y);
  context.lineTo(x + size, y);
  context.moveTo(x, y - size);
  context.lineTo(x, y + size);
  context.lineWidth = Math.max(1.5, size * 0.65);
  context.lineCap = "butt";
  context.strokeStyle = theme.colours.heal;
  context.stroke();
}

/**
 * The share of a flash that a unit that was just hit still has.
 * @param {Track} track
 * @param {number} time
 */
export function hitFlashes(track, time) {
  const flashes = new Map();
  if (reducedMotion.matches) return flashes;
  recentAttacks(track, time, (attack, age) => {
    if (attack.kind === "heal" || attack.kind === "explosion") return;
    const share = 1 - (age - 0.9) / FLASH_TICKS;
    if (age > 0.9 && share > 0) flashes.set(attack.on, Math.max(share, flashes.get(attack.on) ?? 0));
  });
  return flashes;
}

/**
 * Where units died: a ring at first, then a mark that stays.
 * @param {BattleView} view
 * @param {number} time
 */
export function drawDeaths(view, time) {
  const { context, track } = view;
  for (const { tick, unit } of track.deaths) {
    if (tick > time) break;
    const age = time - tick,
      at = view.place(unit, tick),
      tone = FACTION_COLOURS[track.info.units[unit].faction];
    const size = Math.max(2.5, view.radius(unit) * 0.42),
      part = reducedMotion.matches ? 1 : clamp(age / DEATH_TICKS);
    context.lineCap = "round";
    context.beginPath();
    context.moveTo(at.x - size, at.y - size);
    context.lineTo(at.x + size, at.y + size);
    context.moveTo(at.x + size, at.y - size);
    context.lineTo(at.x - size, at.y + size);
    context.lineWidth = Math.max(1.5, size * 0.32);
    context.strokeStyle = theme.faint(tone, 0.85 - 0.45 * part);
    context.stroke();
    if (part < 1) {
      traceCircle(context, at.x, at.y, view.radius(unit) * (1 + 0.8 * easeOut(part)));
      context.lineWidth = Math.max(1, view.scale * 0.1 * (1 - part));
      context.strokeStyle = theme.faint(tone, 0.9 * (1 - part));
      context.stroke();
    }
  }
}
