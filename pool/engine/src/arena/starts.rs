//! Where units start under rules `starcraft`: side by side around the centre of their group, as in recorded
//! battles.
//!
//! Each unit takes the free point that is nearest to the centre, of a lattice with four points to its width.
//! Of points at one distance that in the south is the first, then those a quarter turn farther,
//! counter-clockwise.

use glam::{DVec2, Vec2};
use smaclite_scenarios::{Placement, Scenario};
use smaclite_units::{Plane, UnitType};

/// How much nearer than their radii units may be, in squares: in recordings 0.0625, and 0.0643 where a zealot
/// stands beside a stalker.
const OVERLAP: f64 = 0.065;
/// How much nearer to the centre than the lattice has them points straight in the south, east, north and west
/// are.
const PULL: f64 = 0.0625;

/// The start positions of all units. One without a free point on walkable ground keeps that of its scenario.
pub(super) fn starts(scenario: &Scenario) -> Vec<Vec2> {
    let offsets = lattice(scenario.units.len());
    let mut starts: Vec<DVec2> = Vec::with_capacity(scenario.units.len());
    // What was taken stays taken: units of one type and group go on where the one before them stopped.
    let (mut kind, mut begin) = (None, 0);
    for unit in &scenario.units {
        let (unit_type, centre) = (type_of(scenario, unit), DVec2::from(unit.centre));
        if kind.replace((unit.unit_type, centre)) != Some((unit.unit_type, centre)) {
            begin = 0;
        }
        let point = |&(x, y): &(i32, i32)| centre + offset(x, y, unit_type.radius());
        let is_free = |at: &usize| is_free(scenario, &starts, unit_type, point(&offsets[*at]));
        let found = (begin..offsets.len()).find(is_free);
        begin = found.map_or(offsets.len(), |at| at + 1);
        starts.push(found.map_or(DVec2::from(unit.position), |at| point(&offsets[at])));
    }
    starts.into_iter().map(DVec2::as_vec2).collect()
}

/// The points of the lattice by their distance, enough for all units and for walls beside them.
fn lattice(n_units: usize) -> Vec<(i32, i32)> {
    let reach = 40 + 5 * n_units.isqrt() as i32;
    let quarter = (0..=reach).flat_map(|x| (1..=reach).map(move |south| (x, south)));
    let mut quarter: Vec<(i32, i32)> = quarter.filter(|(x, y)| x * x + y * y <= reach * reach).collect();
    quarter.sort_by_key(|&(x, south)| (x * x + south * south, x));
    let turned =
        quarter.into_iter().flat_map(|(x, south)| [(x, -south), (south, x), (-x, south), (-south, -x)]);
    std::iter::once((0, 0)).chain(turned).collect()
}

fn offset(x: i32, y: i32, radius: f64) -> DVec2 {
    let offset = DVec2::new(f64::from(x), f64::from(y)) * (radius / 2.0);
    let is_straight = (x == 0) != (y == 0);
    // Small units of files keep different starts.
    let pull = f64::min(PULL, radius / 4.0);
    if is_straight { offset - offset.normalize() * pull } else { offset }
}

/// Whether a unit fits at a point, beside the units that have their starts.
fn is_free(scenario: &Scenario, starts: &[DVec2], unit_type: &UnitType, point: DVec2) -> bool {
    // Battles round to f32, which may leave the map.
    let [x, y] = point.as_vec2().to_array().map(|coordinate| coordinate.floor() as i64);
    let (width, height) = (i64::from(scenario.terrain.width()), i64::from(scenario.terrain.height()));
    let is_on_map = (0..width).contains(&x) && (0..height).contains(&y);
    if !is_on_map || unit_type.plane == Plane::Ground && !scenario.terrain.is_walkable(x, y) {
        return false;
    }
    starts.iter().zip(&scenario.units).all(|(start, unit)| {
        let other = type_of(scenario, unit);
        let radii = unit_type.radius() + other.radius();
        let apart = f64::max(radii - OVERLAP, radii / 2.0);
        other.plane != unit_type.plane || start.distance_squared(point) >= apart * apart
    })
}

fn type_of<'a>(scenario: &'a Scenario, unit: &Placement) -> &'a UnitType {
    &scenario.unit_types[unit.unit_type]
}
