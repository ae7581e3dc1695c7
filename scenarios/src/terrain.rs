//! The map: which squares can be walked on, and the rectangles that stand in the way.

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
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Terrain {
    width: u32,
    height: u32,
    /// Row-major, row y = 0 first.
    walkable: Vec<bool>,
    obstacles: Vec<Rect>,
}

impl Terrain {
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

    /// The blocked squares as rectangles, which may overlap, in the order a scan from the south-west finds them.
    pub fn obstacles(&self) -> &[Rect] {
        &self.obstacles
    }
}
