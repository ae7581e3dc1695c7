//! Blocked squares as rectangles, the form in which collision avoidance sees them.

use crate::{Rect, Terrain};

/// The obstacle rectangles of a map, by the rule that the recorded battles follow: scan rows from y = 0 and each
/// row from x = 0; a blocked square that no rectangle has yet starts one, which grows east while blocked, then north
/// while its whole width is blocked. Growth goes over squares that other rectangles already have, so rectangles may
/// overlap.
pub(crate) fn rectangles(terrain: &Terrain) -> Vec<Rect> {
    let (width, height) = (terrain.width(), terrain.height());
    let blocked = |x: u32, y: u32| !terrain.is_walkable(x.into(), y.into());
    let mut covered = vec![false; width as usize * height as usize];
    let index = |x: u32, y: u32| y as usize * width as usize + x as usize;
    let mut rectangles = Vec::new();
    for y0 in 0..height {
        for x0 in 0..width {
            if covered[index(x0, y0)] || !blocked(x0, y0) {
                continue;
            }
            let x1 = (x0..width).find(|&x| !blocked(x, y0)).unwrap_or(width);
            let y1 = (y0..height).find(|&y| (x0..x1).any(|x| !blocked(x, y))).unwrap_or(height);
            for y in y0..y1 {
                covered[index(x0, y)..index(x0, y) + (x1 - x0) as usize].fill(true);
            }
            rectangles.push(Rect { x0, y0, x1, y1 });
        }
    }
    rectangles
}

#[cfg(test)]
mod tests {
    use crate::Terrain;

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
        // The column at x = 2 takes (2, 0) to (2, 2); the run from (0, 1) passes over it, and north over row 2.
        check(&["XXX_", "XXXX", "__X_"], &[[2, 0, 3, 3], [0, 1, 4, 2], [0, 2, 3, 3]]);
        check(&["XXX", "XXX", "__X"], &[[2, 0, 3, 3], [0, 1, 3, 3]]);
    }
}
