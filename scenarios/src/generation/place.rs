//! Free places for units that were drawn at one point, near another unit, or on a blocked square.
//!
//! Units are placed in the order of their list, allies first. A unit that has room where it was drawn stays
//! there. Any other one goes to the nearest place with room, among the points of a grid of half a square
//! around the drawn point; of equally near ones to the western, then the southern one. A place has room
//! if the unit's disc is on the map, does not overlap that of a unit of the same plane that was placed
//! before, and, for ground units, touches no blocked square. The pattern of the enemies is reflected
//! east-west, so that teams that were drawn as mirror images stay mirror images, unless a unit has to move
//! across the middle of the map.

use crate::{Drawn, DrawnTeams, Scenario, Terrain};
use smaclite_units::{Plane, UnitType};

/// The distance between neighbouring points of the grid, in squares.
const GRID: f64 = 0.5;
/// How far places are searched, in squares.
const MAX_RADIUS: u32 = 64;

/// Finds places; shared by all episodes.
#[derive(Clone, Debug)]
pub(crate) struct Placer {
    terrain: Terrain,
    /// Whether all squares are walkable.
    is_open: bool,
    bodies: Vec<Body>,
    /// Offsets from the drawn point in steps of the grid, from the nearest to the farthest.
    pattern: Vec<[i16; 2]>,
}

/// What placing needs of a type.
#[derive(Clone, Copy, Debug)]
struct Body {
    radius: f64,
    plane: Plane,
    /// The place of its name among all, in alphabetical order.
    rank: usize,
}

impl Placer {
    pub(crate) fn new(scenario: &Scenario) -> Placer {
        let types = &scenario.unit_types;
        let rank = |unit_type: &UnitType| types.iter().filter(|other| other.name < unit_type.name).count();
        let body = |unit_type: &UnitType| Body {
            radius: unit_type.radius(),
            plane: unit_type.plane,
            rank: rank(unit_type),
        };
        let terrain = scenario.terrain.clone();
        Placer {
            is_open: terrain.obstacles().is_empty(),
            bodies: types.iter().map(body).collect(),
            pattern: pattern(terrain.width().max(terrain.height()).min(MAX_RADIUS)),
            terrain,
        }
    }

    /// Gives the units places in their order: `all` that have room, or those before the first one without.
    /// Whether all have room.
    pub(crate) fn spread(&self, teams: &mut DrawnTeams, all: bool) -> bool {
        let DrawnTeams { allies, enemies } = teams;
        let (mut search, mut has_room) = (Search::default(), true);
        let n_allies = allies.len();
        for unit in 0..n_allies + enemies.len() {
            let (side, others, unit, east) = match unit.checked_sub(n_allies) {
                None => (&mut *allies, &[][..], unit, 1.0),
                Some(unit) => (&mut *enemies, &allies[..], unit, -1.0),
            };
            let (before, rest) = side.split_at_mut(unit);
            match self.find(rest[0], east, before, others, &mut search) {
                Some(place) => rest[0].position = place,
                None => has_room = false,
            }
            if !has_room && !all {
                break;
            }
        }
        has_room
    }

    /// Orders allies by the name of their type, then from west to east, then from south to north.
    pub(crate) fn number(&self, allies: &mut [Drawn]) {
        let rank = |unit: &Drawn| self.bodies[unit.unit_type].rank;
        let by_place = |a: &Drawn, b: &Drawn| {
            let [(ax, ay), (bx, by)] = [a, b].map(|unit| (unit.position[0], unit.position[1]));
            rank(a).cmp(&rank(b)).then(ax.total_cmp(&bx)).then(ay.total_cmp(&by))
        };
        // Units that compare equal, of one type at one point, are equal: any order of them is the same. A
        // stable sort would take memory.
        allies.sort_unstable_by(by_place);
    }

    /// The nearest place with room. Where no place is wide enough, one whose middle is on a walkable square.
    fn find(
        &self,
        unit: Drawn,
        east: f64,
        own: &[Drawn],
        others: &[Drawn],
        search: &mut Search,
    ) -> Option<[f64; 2]> {
        let body = self.bodies[unit.unit_type];
        let [x, y] = unit.position;
        let is_apart =
            |place: [f64; 2]| own.iter().chain(others).all(|other| self.are_apart(body, place, other));
        // The drawn point may be nearer to the edge of the map than the unit's radius.
        if self.is_on_map(0.0, unit.position)
            && self.is_walkable(body, body.radius, unit.position)
            && is_apart(unit.position)
        {
            return Some(unit.position);
        }
        let place =
            |[dx, dy]: &[i16; 2]| [exact(x + east * GRID * f64::from(*dx)), exact(y + GRID * f64::from(*dy))];
        let is_free = |i: &usize, clearance: f64| {
            let place = place(&self.pattern[*i]);
            self.is_on_map(body.radius, place) && self.is_walkable(body, clearance, place) && is_apart(place)
        };
        let tried = search.at(unit.position, body, east);
        for (tried, clearance) in [(&mut tried.wide, body.radius), (&mut tried.narrow, 0.0)] {
            *tried =
                (*tried..self.pattern.len()).find(|i| is_free(i, clearance)).unwrap_or(self.pattern.len());
            if let Some(found) = self.pattern.get(*tried) {
                return Some(place(found));
            }
        }
        None
    }

    fn is_on_map(&self, margin: f64, [x, y]: [f64; 2]) -> bool {
        let [width, height] = [self.terrain.width(), self.terrain.height()].map(f64::from);
        // A unit belongs to the square in which it is, so the far edges belong to no square.
        x >= margin && y >= margin && x + margin <= width && y + margin <= height && x < width && y < height
    }

    fn are_apart(&self, body: Body, [x, y]: [f64; 2], other: &Drawn) -> bool {
        let Body { radius, plane, .. } = self.bodies[other.unit_type];
        let (dx, dy, reach) = (x - other.position[0], y - other.position[1], body.radius + radius);
        plane != body.plane || dx * dx + dy * dy >= reach * reach
    }

    /// Whether a ground unit has that much room on walkable squares; all units fly over others.
    fn is_walkable(&self, body: Body, radius: f64, [x, y]: [f64; 2]) -> bool {
        if self.is_open || body.plane != Plane::Ground {
            return true;
        }
        let [width, height] = [self.terrain.width(), self.terrain.height()].map(i64::from);
        let squares = |x: f64, side: i64| {
            ((x - radius).floor() as i64).max(0)..=((x + radius).floor() as i64).min(side - 1)
        };
        squares(y, height).all(|square_y| {
            squares(x, width).all(|square_x| {
                let nearest = |x: f64, square: i64| x - x.clamp(square as f64, square as f64 + 1.0);
                let (dx, dy) = (nearest(x, square_x), nearest(y, square_y));
                let distance = dx * dx + dy * dy;
                distance > 0.0 && distance >= radius * radius || self.terrain.is_walkable(square_x, square_y)
            })
        })
    }
}

/// What was searched in this draw: what had no room for a unit has none for an equal or larger one at the
/// same point, as units are only added. Without this, hundreds of units of a few types that are drawn at one
/// point would each try the places of all before them.
#[derive(Default)]
struct Search {
    tried: [Option<Tried>; Search::KEPT],
    /// Which of them is forgotten next.
    next: usize,
}

/// The offsets that were tried for a unit at a point.
#[derive(Clone, Copy)]
struct Tried {
    point: [f64; 2],
    east: f64,
    body: Body,
    /// How many of them have no room: with walkable squares below the whole unit, and below its middle.
    wide: usize,
    narrow: usize,
}

impl Search {
    /// Types at one point that are told apart, or points.
    const KEPT: usize = 16;

    /// What was tried for such a unit, which the caller continues; begins with what was tried for smaller
    /// ones.
    fn at(&mut self, point: [f64; 2], body: Body, east: f64) -> &mut Tried {
        let is_here =
            |tried: &&Tried| tried.point == point && tried.east == east && tried.body.plane == body.plane;
        let known = || self.tried.iter().flatten().filter(is_here);
        let smaller = || known().filter(|tried| tried.body.radius <= body.radius);
        let wide = smaller().map(|tried| tried.wide).max().unwrap_or(0);
        let narrow = smaller().map(|tried| tried.narrow).max().unwrap_or(0);
        let is_same = |tried: &Option<Tried>| {
            tried.as_ref().filter(is_here).is_some_and(|tried| tried.body.radius == body.radius)
        };
        let at = self.tried.iter().position(is_same).unwrap_or_else(|| {
            self.next = (self.next + 1) % Search::KEPT;
            self.next
        });
        self.tried[at].insert(Tried { point, east, body, wide, narrow })
    }
}

/// The points of the grid within a radius in squares, but the origin.
fn pattern(radius: u32) -> Vec<[i16; 2]> {
    let most = (f64::from(radius) / GRID) as i16;
    let length = |[dx, dy]: &[i16; 2]| i32::from(*dx).pow(2) + i32::from(*dy).pow(2);
    let all = (-most..=most).flat_map(|dx| (-most..=most).map(move |dy| [dx, dy]));
    let within = |offset: &[i16; 2]| (1..=i32::from(most).pow(2)).contains(&length(offset));
    let mut pattern: Vec<[i16; 2]> = all.filter(within).collect();
    pattern.sort_by_key(length); // stable: of equally near ones the western, then the southern comes first
    pattern
}

/// The nearest multiple of 2^-13, which f32 has on all maps: so a mirrored position is exactly the mirror.
pub(super) fn exact(x: f64) -> f64 {
    (x * 8192.0).round() / 8192.0
}
