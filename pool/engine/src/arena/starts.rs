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

/// The start positions of all units. One for which the map has no free point on walkable ground keeps that of
/// its scenario.
pub(super) fn starts(scenario: &Scenario) -> Vec<Vec2> {
    let mut starts: Vec<DVec2> = Vec::with_capacity(scenario.units.len());
    // What was taken stays taken: units of one type and group go on where the one before them stopped.
    let (mut kind, mut points) = (None, lattice(0));
    for unit in &scenario.units {
        let (unit_type, centre) = (type_of(scenario, unit), DVec2::from(unit.centre));
        if kind.replace((unit.unit_type, centre)) != Some((unit.unit_type, centre)) {
            let n_units = scenario.units.iter().filter(|other| other.centre == unit.centre).count();
            // Enough for the group and for walls and other units beside it, and no more: maps may be full.
            points = lattice(40 + 5 * n_units.isqrt() as u32);
        }
        let mut candidates = points.by_ref().map(|at| centre + offset(at, unit_type.radius()));
        let is_free = |point: &DVec2| is_free(scenario, &starts, unit_type, *point);
        let found = candidates.find(is_free).or_else(|| {
            // A group in a wide wall, or on a full map.
            let distance = |point: &DVec2| point.distance_squared(centre);
            squares(scenario).filter(is_free).min_by(|a, b| distance(a).total_cmp(&distance(b)))
        });
        starts.push(found.unwrap_or(DVec2::from(unit.position)));
    }
    starts.into_iter().map(DVec2::as_vec2).collect()
}

/// The middles of all squares, those in the south first.
fn squares(scenario: &Scenario) -> impl Iterator<Item = DVec2> {
    let (width, height) = (scenario.terrain.width(), scenario.terrain.height());
    (0..height).flat_map(move |y| (0..width).map(move |x| DVec2::new(x.into(), y.into()) + 0.5))
}

/// The points of the lattice by their distance, up to this many steps.
fn lattice(reach: u32) -> impl Iterator<Item = [i32; 2]> {
    // Of each four points that are a quarter turn apart, the one between the south and the east.
    let ring = |squared: u32| {
        let souths = (0..=squared.isqrt()).filter_map(move |x| {
            let south = (squared - x * x).isqrt();
            (south > 0 && x * x + south * south == squared).then_some([x as i32, south as i32])
        });
        souths.flat_map(|[x, south]| [[x, -south], [south, x], [-x, south], [-south, -x]])
    };
    std::iter::once([0, 0]).chain((1..=reach * reach).flat_map(ring))
}

fn offset([x, y]: [i32; 2], radius: f64) -> DVec2 {
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
