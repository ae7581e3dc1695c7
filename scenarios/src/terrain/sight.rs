//! The length of obstacle outline that a unit can have in sight, and its limit.
//!
//! Collision avoidance considers every obstacle edge within a unit's speed plus radius. On a large map with
//! many obstacles a speed of 315, mistyped for 3.15, would fill the memory and make every step last minutes.

use crate::{Rect, Terrain};

/// The largest length of outline, in squares, that a unit may have in sight. No map of up to 64 x 64 squares
/// has more at any speed, and no map of any size has more within the 5 squares or so that the standard units
/// see.
pub const MAX_OUTLINE_IN_SIGHT: usize = 1 << 16;

/// The outlines of a map's obstacles, cut into pieces of one square, as a table of sums.
pub(crate) struct Outlines {
    /// For (x, y) the pieces with a south-western end south and west of it, row by row; one column and row
    /// more than the grid has lines.
    sums: Vec<u32>,
    columns: usize,
    rows: usize,
}

impl Outlines {
    pub(crate) fn of(terrain: &Terrain) -> Outlines {
        let (columns, rows) = (terrain.width() as usize + 2, terrain.height() as usize + 2);
        let mut sums = vec![0; columns * rows];
        for &Rect { x0, y0, x1, y1 } in terrain.obstacles() {
            let mut count = |x: u32, y: u32| sums[(y as usize + 1) * columns + x as usize + 1] += 1;
            (x0..x1).for_each(|x| [y0, y1].into_iter().for_each(|y| count(x, y)));
            (y0..y1).for_each(|y| [x0, x1].into_iter().for_each(|x| count(x, y)));
        }
        for y in 1..rows {
            let mut row = 0;
            for x in 1..columns {
                row += sums[y * columns + x];
                sums[y * columns + x] = row + sums[(y - 1) * columns + x];
            }
        }
        Outlines { sums, columns, rows }
    }

    /// The largest length of outline, in squares, within `range` of any square of the map.
    pub(crate) fn most_in_sight(&self, range: f64) -> usize {
        // A piece is counted at its south-western end; its other end may be in sight, one square farther.
        let reach = range.ceil() as usize + 1;
        let window =
            |at: usize, end: usize| (at.saturating_sub(reach), end.min(at.saturating_add(reach + 1)));
        let sum = |x: usize, y: usize| self.sums[y * self.columns + x] as usize;
        let in_sight = |x: usize, y: usize| {
            let ((x0, x1), (y0, y1)) = (window(x, self.columns - 1), window(y, self.rows - 1));
            sum(x1, y1) + sum(x0, y0) - sum(x1, y0) - sum(x0, y1)
        };
        let squares = (0..self.rows - 2).flat_map(|y| (0..self.columns - 2).map(move |x| (x, y)));
        squares.map(|(x, y)| in_sight(x, y)).max().unwrap_or(0)
    }

    /// The largest range, in whole squares, that keeps [`MAX_OUTLINE_IN_SIGHT`].
    pub(crate) fn largest_range(&self) -> u32 {
        let sides = self.columns.max(self.rows) as u32;
        let ranges: Vec<u32> = (1..=sides).collect();
        ranges.partition_point(|&range| self.most_in_sight(range.into()) <= MAX_OUTLINE_IN_SIGHT) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_are_counted_where_they_are_in_sight() {
        let one = Outlines::of(&Terrain::from_fn(9, 9, |x, y| (x, y) != (0, 0)).unwrap());
        assert_eq!((one.most_in_sight(0.0), one.most_in_sight(1e9)), (4, 4));
        // The middle sees all of two squares in opposite corners from 4 squares away.
        let two = Outlines::of(&Terrain::from_fn(9, 9, |x, y| x != y || x % 8 != 0).unwrap());
        assert_eq!((two.most_in_sight(1.0), two.most_in_sight(4.0)), (4, 8));
    }

    #[test]
    fn every_speed_is_accepted_on_a_small_map_and_every_usual_one_on_a_large_one() {
        let checkerboard =
            |side| Outlines::of(&Terrain::from_fn(side, side, |x, y| (x + y) % 2 == 0).unwrap());
        assert!(checkerboard(64).most_in_sight(1e9) <= MAX_OUTLINE_IN_SIGHT);
        let large = checkerboard(1024);
        assert!((80..90).contains(&large.largest_range()), "{}", large.largest_range());
        // Rows that get wider northwards make rectangles of which every one reaches to the north edge.
        let triangle = Outlines::of(&Terrain::from_fn(1024, 1024, |x, y| x < 1023 - y).unwrap());
        assert!(triangle.largest_range() >= 10, "{}", triangle.largest_range());
    }
}
