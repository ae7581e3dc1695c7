//! The order of neighbours that are equally near: that in which a search through a k-d tree meets them.
//!
//! The tree is part of the rules. Neighbours come nearest first, but units that march in formation are often
//! equally near to the last bit; then those come first that the tree meets first, and the linear program's
//! rounding depends on that order. Where no two are equally near a plain search does (`crowd`).

use glam::Vec2;

use crate::units::make_room;

/// A k-d tree whose boxes are halved across their longer side.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Positions and places of units, each box's next to each other.
    units: Vec<(Vec2, u32)>,
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
        make_room(&mut self.units, n_units);
        // A binary tree with a unit in every leaf.
        make_room(&mut self.boxes, 2 * n_units);
    }

    /// Forgets all units.
    pub fn clear(&mut self) {
        self.units.clear();
        self.boxes.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.boxes.is_empty()
    }

    /// Grows the tree over units at these positions; their places are numbers from 0 in the order given.
    pub fn grow(&mut self, positions: impl Iterator<Item = Vec2>) {
        self.clear();
        self.units.extend(positions.zip(0..));
        if !self.units.is_empty() {
            self.divide(0, self.units.len());
        }
    }

    fn divide(&mut self, begin: usize, end: usize) {
        let units = &mut self.units[begin..end];
        let (mut south_west, mut north_east) = (units[0].0, units[0].0);
        for (position, _) in units.iter() {
            south_west = Vec2::new(least(south_west.x, position.x), least(south_west.y, position.y));
            north_east = Vec2::new(most(north_east.x, position.x), most(north_east.y, position.y));
        }
        let index = self.boxes.len();
        self.boxes.push(Box { south_west, north_east, begin: begin as u32, end: end as u32, upper: 0 });
        if end - begin <= Tree::LEAF_SIZE {
            return;
        }
        let sides = north_east - south_west;
        let middle = 0.5 * (north_east + south_west);
        let n_lower = if sides.x > sides.y {
            part(units, |position| position.x < middle.x)
        } else {
            part(units, |position| position.y < middle.y)
        };
        // Units in one spot cannot be parted; that must not go on forever.
        let n_lower = n_lower.max(1);
        self.divide(begin, begin + n_lower);
        self.boxes[index].upper = self.boxes.len() as u32;
        self.divide(begin + n_lower, end);
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
            for &(other, place) in &self.units[this.begin as usize..this.end as usize] {
                let distance_squared = (position - other).length_squared();
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

/// Moves those that belong to the lower half before the others and returns how many they are.
///
/// From both ends, the first that does not belong changes places with the last that does.
fn part(units: &mut [(Vec2, u32)], is_lower: impl Fn(Vec2) -> bool) -> usize {
    let (mut begin, mut end) = (0, units.len());
    loop {
        while begin < end && is_lower(units[begin].0) {
            begin += 1;
        }
        while begin < end && !is_lower(units[end - 1].0) {
            end -= 1;
        }
        if begin == end {
            return begin;
        }
        units.swap(begin, end - 1);
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
        tree.grow(std::iter::repeat_n(Vec2::ONE, 50));
        let mut n_met = 0;
        tree.find(Vec2::ONE, 1.0, |_, _| n_met += 1);
        assert_eq!(n_met, 50);
    }

    #[test]
    fn the_nearer_half_is_met_first() {
        let mut tree = Tree::default();
        tree.grow((0..12).map(|x| Vec2::new(x as f32, 0.0)));
        let mut met = Vec::new();
        tree.find(Vec2::new(8.0, 0.0), 100.0, |_, place| met.push(place));
        assert_eq!(met, [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]);
    }
}
