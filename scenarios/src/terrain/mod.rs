//! The map: its walkable squares and obstacles. `presets` has the presets, `read` reads maps from files,
//! `obstacles` finds the rectangles of blocked squares, and `sight` measures how much of their outline units
//! see.

mod obstacles;
mod presets;
mod read;
mod sight;

pub use sight::MAX_OUTLINE_IN_SIGHT;
pub(crate) use sight::Outlines;

use smaclite_units::file::Range;

/// The longest side a map may have, in squares.
pub const MAX_SIDE: u32 = 1024;
/// The coordinates of points on the largest map.
pub(crate) const ON_ANY_MAP: Range = Range::closed(0.0, MAX_SIDE as f64);

/// A walkable square in drawings and files.
const WALKABLE: char = '_';

/// A blocked square in drawings and files.
const BLOCKED: char = 'X';

/// A blocked rectangle in squares, half-open: `[x0, x1)` x `[y0, y1)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// West edge.
    pub x0: u32,
    /// South edge.
    pub y0: u32,
    /// East edge.
    pub x1: u32,
    /// North edge.
    pub y1: u32,
}

/// A map of walkable and blocked squares. x grows east, y grows north.
///
/// ```
/// use smaclite_scenarios::Terrain;
///
/// let corridor = Terrain::preset("CORRIDOR").unwrap();
/// assert!(corridor.is_walkable(2, 1) && !corridor.is_walkable(1, 1));
/// assert!(!corridor.is_walkable(-1, 1), "off the map");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Terrain {
    width: u32,
    height: u32,
    /// Row-major, row y = 0 first.
    walkable: Vec<bool>,
    obstacles: Vec<Rect>,
}

impl Terrain {
    /// A map from its squares, row y = 0 first, west to east in a row. `None` if a side is not in
    /// `1..=`[`MAX_SIDE`] or there are not `width * height` squares.
    pub fn new(width: u32, height: u32, walkable: Vec<bool>) -> Option<Terrain> {
        let sides = 1..=MAX_SIDE;
        if !sides.contains(&width) || !sides.contains(&height) || walkable.len() != (width * height) as usize
        {
            return None;
        }
        let mut terrain = Terrain { width, height, walkable, obstacles: Vec::new() };
        terrain.obstacles = obstacles::rectangles(&terrain);
        Some(terrain)
    }

    /// A map whose square `(x, y)` is walkable if `is_walkable(x, y)`. `None` as in [`new`](Self::new).
    pub fn from_fn(width: u32, height: u32, is_walkable: impl Fn(u32, u32) -> bool) -> Option<Terrain> {
        let squares = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Terrain::new(width, height, squares.map(|(x, y)| is_walkable(x, y)).collect())
    }

    /// The map after half a turn: north is south, and east is west.
    pub(crate) fn turned(&self) -> Terrain {
        let walkable = self.walkable.iter().rev().copied().collect();
        let mut turned = Terrain { walkable, obstacles: Vec::new(), ..*self };
        turned.obstacles = obstacles::rectangles(&turned);
        turned
    }

    /// Number of squares from west to east.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Number of squares from south to north.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Whether square (x, y) can be walked on; false off the map.
    pub fn is_walkable(&self, x: i64, y: i64) -> bool {
        let inside = (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y);
        inside && self.walkable[y as usize * self.width as usize + x as usize]
    }

    /// The blocked squares as rectangles, which may overlap, in the order in which a scan from the south-west
    /// finds them.
    pub fn obstacles(&self) -> &[Rect] {
        &self.obstacles
    }

    /// The largest length of obstacle outline, in squares, within `range` of any square. No ground unit of a
    /// checked scenario has more than [`MAX_OUTLINE_IN_SIGHT`](crate::MAX_OUTLINE_IN_SIGHT) in sight.
    pub fn outline_in_sight(&self, range: f64) -> usize {
        Outlines::of(self).most_in_sight(range)
    }
}
