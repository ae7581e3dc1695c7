//! The order of neighbours that are equally near: that in which a search through a k-d tree visits them.
//!
//! The tree is part of the rules. Neighbours come nearest first, but units that march in formation are often
//! equally near to the last bit; then those come first that the tree visits first, and the linear program's
//! rounding depends on that order. Where no two are equally near, the plain search of `plane_units` finds the
//! same order.
//!
//! It is built in every tick, by partitioning the list of units in place: the order that a tick leaves is the
//! order that the next one partitions (`NeighbourOrder`). Units move little in a tick, so the list is mostly
//! partitioned already and only scanned.

use glam::Vec2;
use wide::f32x4;

use crate::units::make_room;

/// A k-d tree whose boxes are halved across their longer side.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Positions of the units, in the order of the list that the tree was grown over.
    positions: Vec<[f32; 2]>,
    nodes: Vec<Node>,
}

/// A box around the units `begin..end`. Its lower half, if it has halves, comes right behind it in the list.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// South-west and north-east; of a box without halves not before a search asks for it.
    corners: Option<[Vec2; 2]>,
    begin: u32,
    end: u32,
    /// The number of the upper half; 0 for none, as the root is no half.
    upper: u32,
}

impl Tree {
    /// A box with no more units than this is not divided; so few units are met in the order in which they
    /// came.
    pub const LEAF_SIZE: usize = 10;

    pub fn fit(&mut self, n_units: usize) {
        make_room(&mut self.positions, n_units);
        // A binary tree with a unit in every leaf.
        make_room(&mut self.nodes, 2 * n_units);
    }

    /// Builds the tree over the units of a list, which it partitions. `positions` are by id; a unit's index
    /// is its number in the partitioned list.
    pub fn build(&mut self, ids: &mut [u32], positions: &[Vec2]) {
        self.positions.clear();
        self.positions.extend(ids.iter().map(|&id| positions[id as usize].to_array()));
        self.nodes.clear();
        if !ids.is_empty() {
            self.split(ids, 0, ids.len());
        }
    }

    fn split(&mut self, ids: &mut [u32], begin: usize, end: usize) {
        let index = self.nodes.len();
        self.nodes.push(Node { corners: None, begin: begin as u32, end: end as u32, upper: 0 });
        if end - begin <= Tree::LEAF_SIZE {
            return;
        }
        let positions = &mut self.positions[begin..end];
        let [south_west, north_east] = corners(positions);
        self.nodes[index].corners = Some([south_west, north_east]);
        let sides = north_east - south_west;
        let middle = 0.5 * (north_east + south_west);
        let n_lower = if sides.x > sides.y {
            partition(positions, &mut ids[begin..end], |[x, _]| x < middle.x)
        } else {
            partition(positions, &mut ids[begin..end], |[_, y]| y < middle.y)
        };
        // Units in one spot cannot be parted; that must not go on forever.
        let n_lower = n_lower.max(1);
        self.split(ids, begin, begin + n_lower);
        self.nodes[index].upper = self.nodes.len() as u32;
        self.split(ids, begin + n_lower, end);
    }

    /// Visits the units whose squared distance to `position` is below `range_squared`: distance and index.
    pub fn find(&self, position: Vec2, range_squared: f32, mut visit: impl FnMut(f32, u32)) {
        if !self.nodes.is_empty() {
            self.find_in(0, position, range_squared, &mut visit);
        }
    }

    /// The squared distance of a box to a point; 0 inside.
    fn distance_squared(&self, index: usize, point: Vec2) -> f32 {
        let Node { corners: known, begin, end, .. } = self.nodes[index];
        let [low, high] = known.unwrap_or_else(|| corners(&self.positions[begin as usize..end as usize]));
        let beyond = |low: f32, x: f32, high: f32| most(0.0, low - x) + most(0.0, x - high);
        let (dx, dy) = (beyond(low.x, point.x, high.x), beyond(low.y, point.y, high.y));
        dx * dx + dy * dy
    }

    fn find_in(&self, index: usize, position: Vec2, range_squared: f32, visit: &mut impl FnMut(f32, u32)) {
        let this = &self.nodes[index];
        if this.upper == 0 {
            for index in this.begin..this.end {
                let other = Vec2::from(self.positions[index as usize]);
                let distance_squared = (position - other).length_squared();
                if distance_squared < range_squared {
                    visit(distance_squared, index);
                }
            }
            return;
        }
        let (lower, upper) = (index + 1, this.upper as usize);
        let [to_lower, to_upper] = [lower, upper].map(|half| self.distance_squared(half, position));
        let nearer_first = if to_lower < to_upper {
            [(to_lower, lower), (to_upper, upper)]
        } else {
            [(to_upper, upper), (to_lower, lower)]
        };
        for (distance_squared, half) in nearer_first {
            if distance_squared < range_squared {
                self.find_in(half, position, range_squared, visit);
            }
        }
    }
}

/// The least and the greatest coordinates of positions, two positions at a time.
fn corners(positions: &[[f32; 2]]) -> [Vec2; 2] {
    let (pairs, rest) = positions.as_flattened().as_chunks::<4>();
    let [x, y] = positions[0];
    let last = if let [x, y] = *rest { [x, y, x, y] } else { [x, y, x, y] };
    let (mut low, mut high) = (f32x4::from(last), f32x4::from(last));
    for &pair in pairs {
        low = low.fast_min(f32x4::from(pair));
        high = high.fast_max(f32x4::from(pair));
    }
    let ([a, b, c, d], [e, f, g, h]) = (low.to_array(), high.to_array());
    [Vec2::new(least(a, c), least(b, d)), Vec2::new(most(e, g), most(f, h))]
}

/// Moves those that belong to the lower half before the others and returns how many they are.
///
/// From both ends, the first that does not belong changes indices with the last that does.
fn partition(positions: &mut [[f32; 2]], ids: &mut [u32], is_lower: impl Fn([f32; 2]) -> bool) -> usize {
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
        tree.build(&mut (0..50).collect::<Vec<_>>(), &[Vec2::ONE; 50]);
        let mut n_met = 0;
        tree.find(Vec2::ONE, 1.0, |_, _| n_met += 1);
        assert_eq!(n_met, 50);
    }

    #[test]
    fn the_nearer_half_is_met_first() {
        let mut tree = Tree::default();
        let positions: Vec<Vec2> = (0..12).map(|x| Vec2::new(x as f32, 0.0)).collect();
        tree.build(&mut (0..12).collect::<Vec<_>>(), &positions);
        let mut visited = Vec::new();
        tree.find(Vec2::new(8.0, 0.0), 100.0, |_, index| visited.push(index));
        assert_eq!(visited, [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]);
    }
}
