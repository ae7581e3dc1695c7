//! The moves that are available from a position.

use glam::Vec2;
use smaclite_scenarios::Terrain;

use crate::command::DIRECTIONS;
use crate::fast_math::floor;

/// The available moves of every square of a map.
#[derive(Debug)]
pub(crate) struct Moves {
    /// Per square, row y = 0 first: bit i for direction i.
    squares: Vec<u8>,
    n_columns: usize,
    /// Width and height of the map.
    size: Vec2,
}

impl Moves {
    /// Computes the moves of all squares.
    pub fn new(terrain: &Terrain) -> Moves {
        let (width, height) = (terrain.width(), terrain.height());
        let centres = (0..height).flat_map(|y| (0..width).map(move |x| Vec2::new(x as f32, y as f32) + 0.5));
        Moves {
            squares: centres.map(|centre| moves_from(terrain, centre)).collect(),
            n_columns: width as usize,
            size: Vec2::new(width as f32, height as f32),
        }
    }

    /// The available moves of a unit, in the order of their actions from the lowest bit on.
    ///
    /// A move is available if the square one square away from the unit is on the map and walkable. Units
    /// and the far end of the move, which is two squares away, do not matter. Near a wall a move may thus
    /// be available that collision avoidance then stops at the wall.
    pub fn from(&self, terrain: &Terrain, position: Vec2) -> u8 {
        let Vec2 { x, y } = position;
        // One square away from a unit on the map is a neighbouring square, whichever part of its square the
        // unit is in. Off the map that may fail: from -1e-30, `x + 1` is rounded to 1, two squares away.
        if x >= 0.0 && y >= 0.0 && x < self.size.x && y < self.size.y {
            self.squares[y as i32 as usize * self.n_columns + x as i32 as usize]
        } else {
            moves_from(terrain, position)
        }
    }
}

fn moves_from(terrain: &Terrain, position: Vec2) -> u8 {
    DIRECTIONS.iter().enumerate().fold(0, |moves, (i, [dx, dy])| {
        let (x, y) = (f64::from(position.x) + dx, f64::from(position.y) + dy);
        moves | u8::from(terrain.is_walkable(floor(x), floor(y))) << i
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moves_depend_only_on_the_square() {
        let terrain = Terrain::preset("CHECKERBOARD").unwrap();
        let moves = Moves::new(&terrain);
        let mut coordinates = vec![-0.0, 1e-45, 1e-30, 1e-9];
        for i in -2_i8..=34 {
            let x = f32::from(i);
            coordinates.extend([x, x.next_up(), x + 0.3, x.next_down()]);
        }
        for &x in &coordinates {
            for &y in &coordinates {
                let position = Vec2::new(x, y);
                assert_eq!(moves.from(&terrain, position), moves_from(&terrain, position), "{position}");
            }
        }
    }
}
