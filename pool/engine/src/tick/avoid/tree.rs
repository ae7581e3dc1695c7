//! The order of equally near neighbours: the order in which a search through a k-d tree visits them.
//!
//! The tree is part of the rules. Neighbours come nearest first, but units that march in formation are often
//! equally near to the last bit. Then those come first that the tree visits first, and the rounding of the
//! linear program depends on that order. Where no two are equally near, the plain search of `plane_units`
//! finds the same order.
//!
//! The tree is built in every tick by partitioning the list of units in place, and each tick partitions the
//! order that the last one left (`NeighbourOrder`). Units move little in a tick, so the list is mostly
//! partitioned already and only scanned.

use glam::Vec2;
use wide::f32x4;

use crate::fast_math::{max, min};
use crate::units::clear_and_reserve;

/// A k-d tree whose boxes are halved across their longer side.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Positions of the units, in the order of the list that the tree was built over.
    positions: Vec<[f32; 2]>,
    nodes: Vec<Node>,
}

/// A box around the units `begin..end`. If it has halves, the lower one is the next node.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// South-west and north-east corner. `None` for leaves, where they are computed when a search needs them:
    /// most searches do not.
    corners: Option<[Vec2; 2]>,
    begin: u32,
    end: u32,
    /// The index of the upper half; 0 for leaves, because the root is not a half.
    upper: u32,
}

impl Tree {
    /// The largest number of units of a box that is not divided; these units are visited in the order of the
    /// list.
    pub const LEAF_SIZE: usize = 10;

    pub fn reserve(&mut self, n_units: usize) {
        clear_and_reserve(&mut self.positions, n_units);
        // A binary tree with one unit in every leaf is the largest.
        clear_and_reserve(&mut self.nodes, 2 * n_units);
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
        // The line crosses the longer side in its middle; units on it belong to the upper half.
        let sides = north_east - south_west;
        let middle = 0.5 * (north_east + south_west);
        let n_lower = if sides.x > sides.y {
            partition(positions, &mut ids[begin..end], |[x, _]| x < middle.x)
        } else {
            partition(positions, &mut ids[begin..end], |[_, y]| y < middle.y)
        };
        // Units at one point are all in the upper half. Moving one to the lower half ends the recursion.
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
        let beyond = |low: f32, x: f32, high: f32| max(low - x, 0.0) + max(x - high, 0.0);
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
        // The nearer half first, and of equally near halves the upper one. A half out of range is skipped.
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
    // An odd position is left over; the first one stands for it if there is none.
    let (pairs, rest) = positions.as_flattened().as_chunks::<4>();
    let [x, y] = positions[0];
    let last = if let [x, y] = *rest { [x, y, x, y] } else { [x, y, x, y] };
    let (mut low, mut high) = (f32x4::from(last), f32x4::from(last));
    for &pair in pairs {
        low = low.fast_min(f32x4::from(pair));
        high = high.fast_max(f32x4::from(pair));
    }
    let ([a, b, c, d], [e, f, g, h]) = (low.to_array(), high.to_array());
    [Vec2::new(min(c, a), min(d, b)), Vec2::new(max(g, e), max(h, f))]
}

/// Moves the units of the lower half before the others and returns their number.
///
/// The first unit that does not belong to the lower half is exchanged with the last that does, and so on
/// inwards. Which units are exchanged decides the order of equally near neighbours in later ticks.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_units_at_one_point_fit() {
        let mut tree = Tree::default();
        tree.build(&mut (0..50).collect::<Vec<_>>(), &[Vec2::ONE; 50]);
        let mut n_visited = 0;
        tree.find(Vec2::ONE, 1.0, |_, _| n_visited += 1);
        assert_eq!(n_visited, 50);
    }

    #[test]
    fn the_nearer_half_is_visited_first() {
        let mut tree = Tree::default();
        let positions: Vec<Vec2> = (0..12).map(|x| Vec2::new(x as f32, 0.0)).collect();
        tree.build(&mut (0..12).collect::<Vec<_>>(), &positions);
        let mut visited = Vec::new();
        tree.find(Vec2::new(8.0, 0.0), 100.0, |_, index| visited.push(index));
        assert_eq!(visited, [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]);
    }
}
