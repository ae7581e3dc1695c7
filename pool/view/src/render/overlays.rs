//! What a viewer asks for: sight, attack range, targets and ids.

use glam::Vec2;
use smaclite_scenarios::Faction;
use tiny_skia::FillRule;

use super::canvas::Canvas;
use super::font::Place;
use super::{Look, Renderer};
use crate::{Moment, UnitMoment};

/// The living units and how they look.
fn living<'a>(
    renderer: &'a Renderer,
    moment: &'a Moment,
) -> impl Iterator<Item = (&'a Look, &'a UnitMoment)> {
    renderer.looks.iter().zip(&moment.units).filter(|(_, unit)| unit.alive)
}

/// The area that agents see together.
pub(super) fn draw_sight(renderer: &Renderer, canvas: &mut Canvas, moment: &Moment) {
    let agents = living(renderer, moment).filter(|(look, _)| look.faction == Faction::Ally);
    let circles: Vec<Circle> = agents.map(|(look, unit)| Circle::new(renderer, unit, look.sight)).collect();
    draw_union(renderer, canvas, Faction::Ally, &circles, [0.05, 0.35]);
}

/// The area in which each faction can attack. The range of a unit goes from its edge to the edge of its
/// target.
pub(super) fn draw_range(renderer: &Renderer, canvas: &mut Canvas, moment: &Moment) {
    for faction in [Faction::Ally, Faction::Enemy] {
        let units = living(renderer, moment).filter(|(look, _)| look.faction == faction);
        let circles: Vec<Circle> =
            units.map(|(look, unit)| Circle::new(renderer, unit, look.range)).collect();
        draw_union(renderer, canvas, faction, &circles, [0.08, 0.7]);
    }
}

/// A circle in pixels.
struct Circle {
    centre: Vec2,
    radius: f32,
}

impl Circle {
    fn new(renderer: &Renderer, unit: &UnitMoment, radius: f32) -> Circle {
        Circle { centre: renderer.camera.pixel(unit.pos), radius }
    }

    fn contains(&self, point: Vec2) -> bool {
        // The edge is outside, so that equal circles do not hide each other.
        let inside = self.radius - 0.5;
        inside > 0.0 && point.distance_squared(self.centre) < inside * inside
    }
}

/// Draws the union of circles in the colour of a faction: the area, and its edge. A crowd of whole circles
/// would be unreadable.
fn draw_union(
    renderer: &Renderer,
    canvas: &mut Canvas,
    faction: Faction,
    circles: &[Circle],
    [area, edge]: [f32; 2],
) {
    let ink = renderer.palette.side(faction).line;
    for Circle { centre, radius } in circles {
        canvas.add(renderer.shapes.disc(*radius).at(*centre, *radius));
    }
    canvas.fill_path(ink.fade(area), FillRule::Winding);
    for circle in circles {
        let corners = renderer.shapes.disc(circle.radius).corners();
        let next = corners.iter().cycle().skip(1);
        for (&a, &b) in corners.iter().zip(next) {
            let middle = circle.centre + (a + b) / 2.0 * circle.radius;
            if !circles.iter().any(|other| other.contains(middle)) {
                let point = |corner: Vec2, inset: f32| circle.centre + corner * (circle.radius - inset);
                canvas.add([point(a, 0.0), point(b, 0.0), point(b, 1.0), point(a, 1.0)]);
            }
        }
    }
    canvas.fill_path(ink.fade(edge), FillRule::Winding);
}

/// A line from each unit to its target, with a dot at the target.
pub(super) fn draw_targets(renderer: &Renderer, canvas: &mut Canvas, moment: &Moment) {
    for (look, unit) in living(renderer, moment) {
        let Some(id) = unit.target else { continue };
        let Some(target) = moment.units.get(id as usize).filter(|target| target.alive) else { continue };
        let Some(target_look) = renderer.looks.get(id as usize) else { continue };
        let (from, to) = (renderer.camera.pixel(unit.pos), renderer.camera.pixel(target.pos));
        let direction = (to - from).normalize_or_zero();
        let (start, end) = (from + direction * look.radius, to - direction * target_look.radius);
        if (end - start).dot(direction) > 1.0 {
            let ink = renderer.palette.side(look.faction).line.fade(0.4);
            canvas.line(start, end, 1.0, 1.0, ink);
            let dot = renderer.stroke(0.12) * 1.2;
            canvas.fill(renderer.shapes.disc(dot).at(end, dot), ink.fade(1.0));
        }
    }
}

/// The number of each unit within its faction, which is the number of its agent.
pub(super) fn draw_ids(renderer: &Renderer, canvas: &mut Canvas, moment: &Moment) {
    let height = (renderer.camera.scale * 0.3).clamp(5.0, 14.0);
    for (look, unit) in living(renderer, moment) {
        let at = renderer.camera.pixel(unit.pos) + Vec2::splat(0.72) * (look.radius + height * 0.25);
        let palette = renderer.palette;
        canvas.text_with_border(&look.id, Place::Middle(at), height, palette.text, palette.floor);
    }
}
