//! Units: bodies with a letter, and their health, shield, energy, cooldown and facing.
//!
//! A body is a vessel: its filled part is the unit's health. A rim around it is the shield, clockwise from
//! north; a second rim is energy, and a thin arc inside is the time until the unit can act again.

use glam::Vec2;
use smaclite_units::Plane;

use super::canvas::Canvas;
use super::font::Place;
use super::shapes::Outline;
use super::{Look, Renderer};
use crate::UnitMoment;

/// The smallest radii in pixels of bodies with a letter, with an arc of the cooldown, and with rims.
const MIN_RADIUS_OF_LETTERS: f32 = 4.0;
const MIN_RADIUS_OF_ARCS: f32 = 5.0;
const MIN_RADIUS_OF_RIMS: f32 = 6.0;

/// A unit on its way into a picture.
struct Body<'a> {
    renderer: &'a Renderer,
    look: &'a Look,
    unit: &'a UnitMoment,
    at: Vec2,
    outline: &'a Outline,
    /// The radius inside the rims.
    radius: f32,
}

/// Draws a living unit.
pub(super) fn draw(renderer: &Renderer, canvas: &mut Canvas, look: &Look, unit: &UnitMoment) {
    let outline = renderer.shapes.body(look.faction, look.radius);
    let radius = look.radius - Rims::of(look).total;
    let body = Body { renderer, look, unit, at: renderer.camera.pixel(unit.pos), outline, radius };
    body.draw_plane(canvas);
    body.draw_nose(canvas);
    body.draw_health(canvas);
    if radius >= MIN_RADIUS_OF_ARCS {
        body.draw_cooldown(canvas);
    }
    if look.radius >= MIN_RADIUS_OF_RIMS {
        body.draw_rims(canvas);
    }
    if radius >= MIN_RADIUS_OF_LETTERS {
        let ink = renderer.palette.letter;
        canvas.text(look.letter.encode_utf8(&mut [0; 4]), Place::Middle(body.at), radius * 0.95, ink);
    }
}

impl Body<'_> {
    /// The direction in which the unit faces, in pixels.
    fn forward(&self) -> Vec2 {
        let (sin, cos) = self.unit.facing.sin_cos();
        Vec2::new(cos, -sin)
    }

    /// Flying units have a shadow and wings, those of the plane COLOSSUS legs.
    fn draw_plane(&self, canvas: &mut Canvas) {
        let (r, palette) = (self.look.radius, self.renderer.palette);
        let side = palette.side(self.look.faction);
        match self.look.plane {
            Plane::Ground => {}
            Plane::Air => {
                let below = self.at + Vec2::new(0.25, 0.5) * r;
                canvas.fill(self.outline.at(below, r * 0.95), palette.shadow.fade(0.35));
                let forward = self.forward() * r;
                for across in [forward.perp(), -forward.perp()] {
                    let wing = [
                        across * 0.7 + forward * 0.9,
                        across * 1.75 - forward * 0.4,
                        across * 1.7 - forward * 0.95,
                        across * 0.6 - forward * 0.9,
                    ];
                    canvas.fill(wing.map(|corner| self.at + corner), side.line);
                }
            }
            Plane::Colossus => {
                for leg in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                    let foot = Vec2::from(leg) * r * 0.95;
                    canvas.line(self.at, self.at + foot, r * 0.5, r * 0.25, side.line);
                }
            }
        }
    }

    /// A point on the outside that shows where the unit faces.
    fn draw_nose(&self, canvas: &mut Canvas) {
        let r = self.look.radius;
        let forward = self.forward();
        let tip = forward * (r + (0.4 * r).max(2.0));
        let (base, across) = (forward * (r * 0.8), forward.perp() * (r * 0.5));
        let ink = self.renderer.palette.side(self.look.faction).line;
        canvas.fill([tip, base + across, base - across].map(|corner| self.at + corner), ink);
    }

    fn draw_health(&self, canvas: &mut Canvas) {
        let (r, palette) = (self.radius, self.renderer.palette);
        let side = palette.side(self.look.faction);
        // A gap keeps the bodies of a crowd apart.
        let gap = (0.09 * r).clamp(0.5, 2.5);
        canvas.fill(self.outline.at(self.at, self.look.radius + gap), palette.floor);
        if self.look.radius > r {
            canvas.fill(self.outline.at(self.at, self.look.radius), side.lost);
        }
        canvas.fill(self.outline.at(self.at, r), side.body);
        let health = share(self.unit.hp, self.look.hp);
        if health < 1.0 {
            // The edge keeps its colour, so that the faction of a unit without health is clear.
            let inner = r - (0.08 * r).max(0.7);
            canvas.fill(self.outline.filled_above(self.at, inner, health), side.lost);
        }
    }

    fn draw_cooldown(&self, canvas: &mut Canvas) {
        let (r, left) = (self.radius, share(self.unit.cooldown, self.look.cooldown));
        if left > 0.0 {
            let outer = r - (0.1 * r).max(0.7);
            let band = self.outline.band(self.at, outer - (0.1 * r).max(0.8), outer, left);
            canvas.fill(band, self.renderer.palette.cooldown.fade(0.7));
        }
    }

    /// The rims of shield and energy, from the body outwards.
    fn draw_rims(&self, canvas: &mut Canvas) {
        let palette = self.renderer.palette;
        let rims = [
            (self.unit.shield, self.look.shield, palette.shield),
            (self.unit.energy, self.look.energy, palette.energy),
        ];
        let Rims { width, gap, .. } = Rims::of(self.look);
        let mut outer = self.radius;
        for (value, max, ink) in rims.into_iter().filter(|(_, max, _)| *max > 0.0) {
            outer += gap + width;
            let value = share(value, max);
            if value > 0.0 {
                canvas.fill(self.outline.band(self.at, outer - width, outer, value), ink);
            }
        }
    }
}

/// The space that rims need, in pixels: they are inside the unit's radius, so that its outline is where it
/// collides.
struct Rims {
    width: f32,
    gap: f32,
    total: f32,
}

impl Rims {
    fn of(look: &Look) -> Rims {
        if look.radius < MIN_RADIUS_OF_RIMS {
            return Rims { width: 0.0, gap: 0.0, total: 0.0 };
        }
        let n_rims = [look.shield, look.energy].into_iter().filter(|max| *max > 0.0).count();
        let (width, gap) = ((0.11 * look.radius).max(1.0), (0.05 * look.radius).max(0.4));
        Rims { width, gap, total: n_rims as f32 * (width + gap) }
    }
}

/// A value as a share of its maximum; 0 if there is no maximum.
fn share(value: f32, max: f32) -> f32 {
    if max > 0.0 { (value / max).clamp(0.0, 1.0) } else { 0.0 }
}
