//! How far units get: the map and a margin around it.

use glam::Vec2;
use smaclite_scenarios::Terrain;

/// The least margin, in squares.
const LEAST_MARGIN: f32 = 16.0;

/// The least and the greatest position of units.
///
/// Agents cannot walk off the map, but collision avoidance pushes units over its edge. Without an end a
/// battle could reach any number, and no range of positions could be checked; so units stop at a margin. It
/// is half a side of the map, and at least 16 squares: farther than units of any recorded battle are pushed.
/// With it, positions relative to the centre, in shares of the sides, are between -1 and 1 on all maps of 32
/// squares and more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    pub low: Vec2,
    pub high: Vec2,
}

impl Extent {
    /// The extent of battles on a map.
    pub fn of(terrain: &Terrain) -> Extent {
        let size = Vec2::new(terrain.width() as f32, terrain.height() as f32);
        let margin = (0.5 * size).max(Vec2::splat(LEAST_MARGIN));
        Extent { low: -margin, high: size + margin }
    }

    /// The position itself, or the nearest one of the extent.
    #[inline(always)]
    pub fn nearest(self, position: Vec2) -> Vec2 {
        position.max(self.low).min(self.high)
    }
}
