//! Which part of the map a picture shows, and where: the mapping of squares to pixels.

use glam::Vec2;
use smaclite_scenarios::{MAX_SIDE, Scenario, Terrain};
use smaclite_units::Plane;

use crate::Moment;

/// Squares that are visible around the region that units can reach.
const MARGIN: f32 = 0.5;

/// The part of the map that a picture shows. North is always up, and squares are square: a picture of another
/// shape shows more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum View {
    /// The squares that units can reach, and a small margin.
    #[default]
    Battlefield,
    /// The whole map, and a small margin.
    Map,
    /// A rectangle of squares, which may extend beyond the map. Units outside of it are not visible.
    Squares {
        /// The south-west corner.
        min: Vec2,
        /// The north-east corner, at least one square to the north and east of `min`.
        max: Vec2,
    },
}

impl View {
    /// The part of the map where units are alive in these moments, with `margin` squares around their
    /// positions, as far as the map reaches. With no living unit it is the
    /// [`Battlefield`](View::Battlefield).
    pub fn around<'a>(
        scenario: &Scenario,
        moments: impl IntoIterator<Item = &'a Moment>,
        margin: f32,
    ) -> View {
        let units = moments.into_iter().flat_map(|moment| &moment.units).filter(|unit| unit.alive);
        let bounds = units.fold(None, |bounds: Option<(Vec2, Vec2)>, unit| {
            let (min, max) = bounds.unwrap_or((unit.pos, unit.pos));
            Some((min.min(unit.pos), max.max(unit.pos)))
        });
        let map = Region::map(&scenario.terrain);
        bounds.map_or(View::Battlefield, |(min, max)| View::Squares {
            min: (min - margin).max(map.min).min(min),
            max: (max + margin).min(map.max).max(max),
        })
    }

    /// The squares that are visible at least.
    pub(crate) fn region(self, scenario: &Scenario) -> Region {
        match self {
            View::Battlefield => Region::battlefield(scenario).grown(MARGIN),
            View::Map => Region::map(&scenario.terrain).grown(MARGIN),
            View::Squares { min, max } => {
                // Corners that are not finite or too close together would give no scale.
                let limit = Vec2::splat(MAX_SIDE as f32 * 2.0);
                let min = Vec2::select(min.is_finite_mask(), min, Vec2::ZERO).clamp(-limit, limit);
                let max = Vec2::select(max.is_finite_mask(), max, min).clamp(min + 1.0, limit + 1.0);
                Region { min, max }
            }
        }
    }
}

/// A region of the map in squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Region {
    pub min: Vec2,
    pub max: Vec2,
}

impl Region {
    fn grown(self, margin: f32) -> Region {
        Region { min: self.min - margin, max: self.max + margin }
    }

    /// The whole map.
    pub fn map(terrain: &Terrain) -> Region {
        Region { min: Vec2::ZERO, max: Vec2::new(terrain.width() as f32, terrain.height() as f32) }
    }

    /// The smallest region that contains all squares which ground units can reach, all start positions, and
    /// the point to which the enemies march.
    ///
    /// Agents in the air are offered moves only to walkable squares, so they hardly leave it either.
    fn battlefield(scenario: &Scenario) -> Region {
        let is_ground = |unit_type: usize| scenario.unit_types[unit_type].plane != Plane::Air;
        if !scenario.units.iter().any(|unit| is_ground(unit.unit_type)) {
            return Region::map(&scenario.terrain);
        }
        let [x, y] = scenario.attack_point.map(|coordinate| coordinate as f32);
        let mut region = Region { min: Vec2::new(x, y), max: Vec2::new(x, y) };
        let mut reached = Reached::new(&scenario.terrain);
        for unit in &scenario.units {
            let [x, y] = unit.position.map(|coordinate| coordinate as f32);
            let radius = scenario.unit_types[unit.unit_type].radius() as f32;
            region.include(Vec2::new(x - radius, y - radius));
            region.include(Vec2::new(x + radius, y + radius));
            if is_ground(unit.unit_type) {
                reached.flood(x as i64, y as i64, |x, y| {
                    region.include(Vec2::new(x as f32, y as f32));
                    region.include(Vec2::new(x as f32 + 1.0, y as f32 + 1.0));
                });
            }
        }
        let map = Region::map(&scenario.terrain);
        Region { min: region.min.max(map.min), max: region.max.min(map.max) }
    }

    /// The middle of a picture of `visible` squares that contains this region: its own, but moved so that the
    /// picture ends where the map does. Where the map is smaller than the picture, the map is in the middle.
    fn middle_within(self, map: Region, visible: Vec2) -> Vec2 {
        // The region itself is shown, also where it extends beyond the map.
        let (min, max) = (self.min.min(map.min), self.max.max(map.max));
        let half = visible / 2.0;
        let moved = ((self.min + self.max) / 2.0).max(min + half).min(max - half);
        Vec2::select(visible.cmple(max - min), moved, (min + max) / 2.0)
    }

    fn include(&mut self, point: Vec2) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }
}

/// The squares that a flood fill has reached.
struct Reached<'a> {
    terrain: &'a Terrain,
    squares: Vec<bool>,
    open: Vec<(i64, i64)>,
}

impl Reached<'_> {
    fn new(terrain: &Terrain) -> Reached<'_> {
        let squares = vec![false; (terrain.width() * terrain.height()) as usize];
        Reached { terrain, squares, open: Vec::new() }
    }

    /// Visits all squares that are connected to one, also over corners, and were not visited before.
    fn flood(&mut self, x: i64, y: i64, mut visit: impl FnMut(i64, i64)) {
        self.enter(x, y);
        while let Some((x, y)) = self.open.pop() {
            visit(x, y);
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                self.enter(x + dx, y + dy);
            }
        }
    }

    /// Marks a square to be visited, if it is walkable and new.
    fn enter(&mut self, x: i64, y: i64) {
        if self.terrain.is_walkable(x, y) {
            let reached = &mut self.squares[y as usize * self.terrain.width() as usize + x as usize];
            if !std::mem::replace(reached, true) {
                self.open.push((x, y));
            }
        }
    }
}

/// Maps squares to pixels; north is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Camera {
    /// Pixels per square.
    pub scale: f32,
    /// A corner of squares in the middle of the picture, and its pixel. All other points are computed from
    /// this one, because pixels far outside the picture have no exact coordinates.
    corner: Vec2,
    corner_pixel: Vec2,
}

impl Camera {
    /// Shows a region as large as possible. A picture of another shape shows more of the map around it, and
    /// what is beyond the map only if the map is smaller than the picture.
    pub fn new(region: Region, map: Region, width: u32, height: u32) -> Camera {
        let size = Vec2::new(width as f32, height as f32);
        let scale = (size / (region.max - region.min)).min_element();
        let middle = region.middle_within(map, size / scale);
        let corner = middle.floor();
        // Whole pixels keep the edges of squares sharp where the scale is a whole number.
        let corner_pixel = (size / 2.0 + (corner - middle) * Vec2::new(scale, -scale)).round();
        Camera { scale, corner, corner_pixel }
    }

    pub fn pixel(&self, square: Vec2) -> Vec2 {
        self.corner_pixel + (square - self.corner) * Vec2::new(self.scale, -self.scale)
    }

    pub fn square(&self, pixel: Vec2) -> Vec2 {
        self.corner + (pixel - self.corner_pixel) / Vec2::new(self.scale, -self.scale)
    }
}
