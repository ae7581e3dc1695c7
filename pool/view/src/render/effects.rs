//! What happened in the last ticks: attacks, heals, explosions and deaths. They fade with their age.

use glam::Vec2;

use super::canvas::Canvas;
use super::{Look, RECENT_TICKS, Renderer};
use crate::{Attack, AttackKind, Moment};

/// Ticks after which a mark has faded.
const ATTACK: usize = 5;
const EXPLOSION: usize = 8;
const DEATH: usize = 24;

/// What is left of the opacity of a mark after `age` of `ticks`.
fn fading(age: usize, ticks: usize) -> f32 {
    (1.0 - age as f32 / ticks as f32).max(0.0)
}

/// An attack and where both units were.
struct Strike<'a> {
    attack: &'a Attack,
    by: &'a Look,
    on: &'a Look,
    from: Vec2,
    to: Vec2,
    age: usize,
}

impl Strike<'_> {
    /// The direction from attacker to target.
    fn direction(&self) -> Vec2 {
        (self.to - self.from).normalize_or_zero()
    }

    /// The points where the line between the two units leaves their bodies; `None` if they touch.
    fn between(&self) -> Option<(Vec2, Vec2)> {
        let direction = self.direction();
        let (start, end) = (self.from + direction * self.by.radius, self.to - direction * self.on.radius);
        ((end - start).dot(direction) > 1.0).then_some((start, end))
    }
}

/// The attacks of the last moments, oldest first; `moments` ends with the newest.
fn strikes<'a>(
    renderer: &'a Renderer,
    moments: &'a [Moment],
    ticks: usize,
) -> impl Iterator<Item = Strike<'a>> {
    let recent = moments.iter().rev().take(ticks).enumerate().rev();
    recent.flat_map(move |(age, moment)| {
        moment.attacks.iter().filter_map(move |attack| {
            let (by, on) = (attack.by as usize, attack.on as usize);
            let at = |id: usize| moment.units.get(id).map(|unit| renderer.camera.pixel(unit.pos));
            let (by, on, from, to) = (renderer.looks.get(by)?, renderer.looks.get(on)?, at(by)?, at(on)?);
            Some(Strike { attack, by, on, from, to, age })
        })
    })
}

/// Draws what lies on the floor, below all units: places of death, and the areas and lines of attacks.
pub(super) fn draw_below(renderer: &Renderer, canvas: &mut Canvas, moments: &[Moment]) {
    draw_deaths(renderer, canvas, moments);
    for strike in strikes(renderer, moments, EXPLOSION) {
        let fade = fading(strike.age, ATTACK);
        match strike.attack.kind {
            AttackKind::Explosion { radius } => draw_explosion(renderer, canvas, &strike, radius),
            AttackKind::Beam { width, height } if fade > 0.0 => {
                draw_beam(renderer, canvas, &strike, width, height, fade);
            }
            AttackKind::Shot { flight: 0 } if fade > 0.0 => draw_shot(renderer, canvas, &strike, fade),
            _ => {}
        }
    }
}

/// Draws what lies above the units: projectiles, hits and heals.
pub(super) fn draw_above(renderer: &Renderer, canvas: &mut Canvas, moments: &[Moment]) {
    for strike in strikes(renderer, moments, RECENT_TICKS + 1) {
        let fade = fading(strike.age, ATTACK);
        match strike.attack.kind {
            AttackKind::Shot { flight } if strike.age < usize::from(flight) => {
                draw_projectile(renderer, canvas, &strike, strike.age as f32 / f32::from(flight));
            }
            AttackKind::Shot { flight } => {
                let fade = fading(strike.age - usize::from(flight), ATTACK);
                if fade > 0.0 {
                    draw_spark(renderer, canvas, &strike, fade);
                }
            }
            AttackKind::Heal if fade > 0.0 => draw_heal(renderer, canvas, &strike, fade),
            AttackKind::Heal | AttackKind::Beam { .. } | AttackKind::Explosion { .. } => {}
        }
    }
}

/// What a unit fired, after this part of its way.
fn draw_projectile(renderer: &Renderer, canvas: &mut Canvas, strike: &Strike<'_>, part: f32) {
    let Some((start, end)) = strike.between() else { return };
    let (at, tail) = (start.lerp(end, part), strike.direction() * (0.35 * renderer.camera.scale));
    let width = renderer.stroke(0.16);
    let ink = renderer.palette.side(strike.by.faction).line;
    canvas.line(at - tail.clamp_length_max((at - start).length()), at, width * 0.5, width, ink);
}

fn draw_shot(renderer: &Renderer, canvas: &mut Canvas, strike: &Strike<'_>, fade: f32) {
    let Some((start, end)) = strike.between() else { return };
    let width = renderer.stroke(0.11);
    let ink = renderer.palette.side(strike.by.faction).line.fade(0.9 * fade);
    canvas.line(start, end, width * 0.4, width, ink);
}

/// A star where a target was hit.
fn draw_spark(renderer: &Renderer, canvas: &mut Canvas, strike: &Strike<'_>, fade: f32) {
    let size = (strike.on.radius * 0.55).max(2.0);
    let at = strike.to - strike.direction() * strike.on.radius;
    let point = |i: i32| {
        let angle = std::f32::consts::FRAC_PI_4 * i as f32;
        at + Vec2::from_angle(angle) * if i % 2 == 0 { size } else { size * 0.35 }
    };
    canvas.fill((0..8).map(point), renderer.palette.spark.fade(fade));
}

/// A laser: rays from the attacker that end in a glowing bar across the line of fire.
fn draw_beam(
    renderer: &Renderer,
    canvas: &mut Canvas,
    strike: &Strike<'_>,
    width: f32,
    height: f32,
    fade: f32,
) {
    let scale = renderer.camera.scale;
    let forward = strike.direction();
    let (across, along) = (forward.perp() * (width * scale / 2.0), forward * (height * scale / 2.0));
    let ink = renderer.palette.side(strike.by.faction).line;
    let (left, right) = (strike.to - across, strike.to + across);
    canvas.fill([strike.from, left, right], ink.fade(0.14 * fade));
    canvas.fill([left - along, left + along, right + along, right - along], ink.fade(0.45 * fade));
    let stroke = renderer.stroke(0.12);
    for end in [left, right] {
        canvas.line(strike.from, end, stroke * 0.4, stroke, ink.fade(0.9 * fade));
    }
    canvas.line(left, right, stroke, stroke, renderer.palette.spark.fade(fade));
}

fn draw_heal(renderer: &Renderer, canvas: &mut Canvas, strike: &Strike<'_>, fade: f32) {
    let ink = renderer.palette.heal;
    if let Some((start, end)) = strike.between() {
        let width = renderer.stroke(0.09);
        canvas.line(start, end, width, width, ink.fade(0.7 * fade));
    }
    let size = (strike.on.radius * 0.42).max(2.0);
    let at = strike.to + Vec2::new(1.0, -1.0) * (strike.on.radius * 0.8);
    let (x, y, thin) = (Vec2::X * size, Vec2::Y * size, size * 0.6);
    canvas.line(at - x, at + x, thin, thin, ink.fade(fade));
    canvas.line(at - y, at + y, thin, thin, ink.fade(fade));
}

/// A disc that grows to the radius of the explosion, with a bright middle that shrinks.
fn draw_explosion(renderer: &Renderer, canvas: &mut Canvas, strike: &Strike<'_>, radius: f32) {
    let fade = fading(strike.age, EXPLOSION);
    let reach = (radius * renderer.camera.scale).max(strike.by.radius);
    let grown = reach * (0.6 + 0.2 * (strike.age as f32).min(2.0));
    let ink = renderer.palette.side(strike.by.faction).line;
    let disc = renderer.shapes.disc(reach);
    canvas.fill(disc.at(strike.from, grown), ink.fade(0.25 * fade));
    canvas.fill(disc.band(strike.from, grown - renderer.stroke(0.12), grown, 1.0), ink.fade(fade));
    canvas.fill(disc.at(strike.from, reach * 0.35 * fade), renderer.palette.spark.fade(fade));
}

/// A cross where a unit died: clear at first, then faint for the rest of the episode.
fn draw_deaths(renderer: &Renderer, canvas: &mut Canvas, moments: &[Moment]) {
    let Some((now, before)) = moments.split_last() else { return };
    for (id, (look, unit)) in renderer.looks.iter().zip(&now.units).enumerate() {
        if unit.alive {
            continue;
        }
        let was_dead = |moment: &&Moment| moment.units.get(id).is_some_and(|unit| !unit.alive);
        let dead_for = before.iter().rev().take_while(was_dead).count();
        // With no moment in which it lived, the unit may have been dead for long.
        let age = if dead_for == before.len() { DEATH } else { dead_for };
        draw_cross(renderer, canvas, look, renderer.camera.pixel(unit.pos), age);
    }
}

fn draw_cross(renderer: &Renderer, canvas: &mut Canvas, look: &Look, at: Vec2, age: usize) {
    let fade = 0.22 + 0.78 * fading(age, DEATH);
    let ink = renderer.palette.side(look.faction).line.fade(fade);
    let (size, width) = ((look.radius * 0.5).max(1.5), (look.radius * 0.2).max(0.8));
    for corner in [Vec2::new(size, size), Vec2::new(size, -size)] {
        canvas.line(at - corner, at + corner, width, width, ink);
    }
    if age < ATTACK {
        let radius = look.radius * (1.0 + 0.2 * age as f32);
        let outline = renderer.shapes.body(look.faction, radius);
        let ring = outline.band(at, radius - width, radius, 1.0);
        canvas.fill(ring, ink.fade(0.6 * fading(age, ATTACK)));
    }
}
