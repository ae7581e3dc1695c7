//! The blocked squares as rectangles, whose outlines collision avoidance avoids.

use crate::{Rect, Terrain};

/// The obstacle rectangles of a map, by the rule that the recorded battles follow: scan rows from y = 0 and
/// each row from x = 0; a blocked square that no rectangle has yet starts one, which grows east while
/// blocked, then north while its whole width is blocked. Growth goes over squares that other rectangles
/// already have, so rectangles may overlap.
///
/// Rectangles that start in one row are disjoint, and so are those that start in one column. Hence their
/// widths sum to at most one map, so do their heights, and a loop over the widths of all of them takes one
/// step per square.
pub(crate) fn rectangles(terrain: &Terrain) -> Vec<Rect> {
    let (width, height) = (terrain.width(), terrain.height());
    let blocked_until = blocked_until(terrain);
    let until = |x: u32, y: u32| u32::from(blocked_until[index(terrain, x, y)]);
    let blocked = |x: u32, y: u32| until(x, y) > y;
    // The row up to which the rectangles found so far cover each column.
    let mut covered_until = vec![0; width as usize];
    let mut rectangles = Vec::new();
    for y0 in 0..height {
        for x0 in 0..width {
            if covered_until[x0 as usize] > y0 || !blocked(x0, y0) {
                continue;
            }
            let x1 = (x0..width).find(|&x| !blocked(x, y0)).unwrap_or(width);
            let y1 = (x0..x1).map(|x| until(x, y0)).min().unwrap_or(y0);
            for covered in &mut covered_until[x0 as usize..x1 as usize] {
                *covered = y1.max(*covered);
            }
            rectangles.push(Rect { x0, y0, x1, y1 });
        }
    }
    rectangles
}

/// For every square the first row, from its own northwards, that is not blocked in its column. Row-major.
fn blocked_until(terrain: &Terrain) -> Vec<u16> {
    let mut until = vec![0; terrain.width() as usize * terrain.height() as usize];
    let mut next = vec![terrain.height() as u16; terrain.width() as usize]; // fits: MAX_SIDE
    for y in (0..terrain.height()).rev() {
        for x in 0..terrain.width() {
            let column = &mut next[x as usize];
            if terrain.is_walkable(x.into(), y.into()) {
                *column = y as u16;
            }
            until[index(terrain, x, y)] = *column;
        }
    }
    until
}

fn index(terrain: &Terrain, x: u32, y: u32) -> usize {
    y as usize * terrain.width() as usize + x as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The rule as it is written down, square by square.
    fn by_the_rule(terrain: &Terrain) -> Vec<Rect> {
        let (width, height) = (terrain.width(), terrain.height());
        let blocked = |x: u32, y: u32| !terrain.is_walkable(x.into(), y.into());
        let mut covered = vec![false; (width * height) as usize];
        let mut rectangles = Vec::new();
        for (x0, y0) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            if covered[index(terrain, x0, y0)] || !blocked(x0, y0) {
                continue;
            }
            let x1 = (x0..width).find(|&x| !blocked(x, y0)).unwrap_or(width);
            let y1 = (y0..height).find(|&y| (x0..x1).any(|x| !blocked(x, y))).unwrap_or(height);
            (y0..y1).for_each(|y| (x0..x1).for_each(|x| covered[index(terrain, x, y)] = true));
            rectangles.push(Rect { x0, y0, x1, y1 });
        }
        rectangles
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// The rule once was followed square by square, in cubic time for rectangles that overlap.
        #[test]
        fn rectangles_are_those_of_the_rule(
            (width, squares, percent) in (1..=16_usize, prop::collection::vec(0..100_u8, 1..=256), 0..100_u8)
        ) {
            let width = width.min(squares.len());
            let height = squares.len() / width;
            let walkable = squares[..width * height].iter().map(|square| *square < percent).collect();
            let terrain = Terrain::new(width as u32, height as u32, walkable).unwrap();
            prop_assert_eq!(terrain.obstacles(), by_the_rule(&terrain));
        }
    }

    /// Draws the map with the north row first, as people do.
    fn check(map: &[&str], expected: &[[u32; 4]]) {
        let walkable = map.iter().rev().flat_map(|row| row.chars().map(|square| square == '_')).collect();
        let terrain = Terrain::new(map[0].len() as u32, map.len() as u32, walkable).unwrap();
        let found: Vec<_> = terrain.obstacles().iter().map(|r| [r.x0, r.y0, r.x1, r.y1]).collect();
        assert_eq!(found, expected, "{map:#?}");
    }

    #[test]
    fn rectangles_grow_east_then_north() {
        check(&["___", "___"], &[]);
        check(&["XXX", "XXX"], &[[0, 0, 3, 2]]);
        check(&["XX_", "XXX"], &[[0, 0, 3, 1], [0, 1, 2, 2]]);
        check(&["X_X", "_X_"], &[[1, 0, 2, 1], [0, 1, 1, 2], [2, 1, 3, 2]]);
    }

    #[test]
    fn a_rectangle_extends_east_over_squares_that_are_taken() {
        // The column at x = 2 takes (2, 0) to (2, 2); the run from (0, 1) passes over it, and north over row
        // 2.
        check(&["XXX_", "XXXX", "__X_"], &[[2, 0, 3, 3], [0, 1, 4, 2], [0, 2, 3, 3]]);
        check(&["XXX", "XXX", "__X"], &[[2, 0, 3, 3], [0, 1, 3, 3]]);
    }
}
