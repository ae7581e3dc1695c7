//! The order of neighbours that are equally near: that in which a search through a k-d tree meets them.
//!
//! The tree is part of the rules. Neighbours come nearest first, but units that march in formation are often
//! equally near to the last bit; then those come first that the tree meets first, and the linear program's
//! rounding depends on that order. Where no two are equally near a plain search does (`crowd`).
//!
//! It is grown in every tick, by partitioning the list of units in place: the order that a tick leaves is the order
//! that the next one partitions (`NeighbourOrder`). Units move little in a tick, so the list is mostly partitioned
//! already and only scanned.

use glam::Vec2;
use wide::f32x4;

use crate::units::make_room;

/// A k-d tree whose boxes are halved across their longer side.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Positions of the units, in the order of the list that the tree was grown over.
    positions: Vec<Vec2>,
    boxes: Vec<Box>,
}

/// A box around the units `begin..end`. Its lower half, if it has halves, comes right behind it in the list.
#[derive(Clone, Copy, Debug)]
struct Box {
    south_west: Vec2,
    north_east: Vec2,
    begin: u32,
    end: u32,
    /// The index of the upper half; 0 for none, as the root is nobody's half.
    upper: u32,
}

impl Tree {
    /// A box with no more units than this is not divided; so few units are met in the order in which they came.
    pub const LEAF_SIZE: usize = 10;

    pub fn fit(&mut self, n_units: usize) {
        make_room(&mut self.positions, n_units);
        // A binary tree with a unit in every leaf.
        make_room(&mut self.boxes, 2 * n_units);
    }

    /// Grows the tree over the units of a list, which it partitions. `positions` are by id; a unit's place is its number
    /// in the partitioned list.
    pub fn grow(&mut self, ids: &mut [u32], positions: &[Vec2]) {
        self.positions.clear();
        self.positions.extend(ids.iter().map(|&id| positions[id as usize]));
        self.boxes.clear();
        if !ids.is_empty() {
            self.divide(ids, 0, ids.len());
        }
    }

    fn divide(&mut self, ids: &mut [u32], begin: usize, end: usize) {
        let positions = &mut self.positions[begin..end];
        let (south_west, north_east) = corners(positions);
        let index = self.boxes.len();
        self.boxes.push(Box { south_west, north_east, begin: begin as u32, end: end as u32, upper: 0 });
        if end - begin <= Tree::LEAF_SIZE {
            return;
        }
        let sides = north_east - south_west;
        let middle = 0.5 * (north_east + south_west);
        let n_lower = if sides.x > sides.y {
            part(positions, &mut ids[begin..end], |position| position.x < middle.x)
        } else {
            part(positions, &mut ids[begin..end], |position| position.y < middle.y)
        };
        // Units in one spot cannot be parted; that must not go on forever.
        let n_lower = n_lower.max(1);
        self.divide(ids, begin, begin + n_lower);
        self.boxes[index].upper = self.boxes.len() as u32;
        self.divide(ids, begin + n_lower, end);
    }

    /// Meets the units whose squared distance to `position` is below `range_squared`: distance and place.
    pub fn find(&self, position: Vec2, range_squared: f32, mut meet: impl FnMut(f32, u32)) {
        if !self.boxes.is_empty() {
            self.find_in(0, position, range_squared, &mut meet);
        }
    }

    fn find_in(&self, index: usize, position: Vec2, range_squared: f32, meet: &mut impl FnMut(f32, u32)) {
        let this = &self.boxes[index];
        if this.upper == 0 {
            for place in this.begin..this.end {
                let distance_squared = (position - self.positions[place as usize]).length_squared();
                if distance_squared < range_squared {
                    meet(distance_squared, place);
                }
            }
            return;
        }
        let (lower, upper) = (index + 1, this.upper as usize);
        let to_lower = self.boxes[lower].distance_squared(position);
        let to_upper = self.boxes[upper].distance_squared(position);
        let nearer_first = if to_lower < to_upper {
            [(to_lower, lower), (to_upper, upper)]
        } else {
            [(to_upper, upper), (to_lower, lower)]
        };
        for (distance_squared, half) in nearer_first {
            if distance_squared < range_squared {
                self.find_in(half, position, range_squared, meet);
            }
        }
    }
}

impl Box {
    fn distance_squared(&self, point: Vec2) -> f32 {
        let beyond = |low: f32, x: f32, high: f32| most(0.0, low - x) + most(0.0, x - high);
        let dx = beyond(self.south_west.x, point.x, self.north_east.x);
        let dy = beyond(self.south_west.y, point.y, self.north_east.y);
        dx * dx + dy * dy
    }
}

/// The least and the greatest coordinates of positions, two positions at a time.
fn corners(positions: &[Vec2]) -> (Vec2, Vec2) {
    let first = positions[0];
    let both = |a: Vec2, b: Vec2| f32x4::new([a.x, a.y, b.x, b.y]);
    let (mut low, mut high) = (both(first, first), both(first, first));
    let (pairs, rest) = positions.as_chunks::<2>();
    for four in pairs.iter().map(|&[a, b]| both(a, b)).chain(rest.iter().map(|&a| both(a, a))) {
        low = low.fast_min(four);
        high = high.fast_max(four);
    }
    let ([a, b, c, d], [e, f, g, h]) = (low.to_array(), high.to_array());
    (Vec2::new(least(a, c), least(b, d)), Vec2::new(most(e, g), most(f, h)))
}

/// Moves those that belong to the lower half before the others and returns how many they are.
///
/// From both ends, the first that does not belong changes places with the last that does.
fn part(positions: &mut [Vec2], ids: &mut [u32], is_lower: impl Fn(Vec2) -> bool) -> usize {
    let (mut begin, mut end) = (0, positions.len());
    loop {
        while begin < end && is_lower(positions[begin]) {
            begin += 1;
        }
        while begin < end && !is_lower(positions[end - 1]) {
            end -= 1;
        }
        if begin == end {
            return begin;
        }
        positions.swap(begin, end - 1);
        ids.swap(begin, end - 1);
        begin += 1;
        end -= 1;
    }
}

// As `f32::min` and `f32::max` for numbers, without their care for what is none.

fn least(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

fn most(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_units_in_one_spot_can_be_held() {
        let mut tree = Tree::default();
        tree.grow(&mut (0..50).collect::<Vec<_>>(), &[Vec2::ONE; 50]);
        let mut n_met = 0;
        tree.find(Vec2::ONE, 1.0, |_, _| n_met += 1);
        assert_eq!(n_met, 50);
    }

    #[test]
    fn the_nearer_half_is_met_first() {
        let mut tree = Tree::default();
        let positions: Vec<Vec2> = (0..12).map(|x| Vec2::new(x as f32, 0.0)).collect();
        tree.grow(&mut (0..12).collect::<Vec<_>>(), &positions);
        let mut met = Vec::new();
        tree.find(Vec2::new(8.0, 0.0), 100.0, |_, place| met.push(place));
        assert_eq!(met, [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]);
    }
}
