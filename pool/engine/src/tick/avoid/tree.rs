//! The search for neighbours: a k-d tree over the living units of a plane, grown anew in every tick.
//!
//! The tree is part of the rules. Neighbours come nearest first, but units that march in formation are often
//! equally near to the last bit; then those come first that the tree meets first, and the linear program's
//! rounding depends on that order.

use glam::Vec2;

use super::found::Found;

/// A box with no more units than this is not divided.
const LEAF_SIZE: usize = 10;

/// A k-d tree whose boxes are halved across their longer side.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Positions and ids, each box's next to each other.
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
    /// Forgets all units.
    pub fn clear(&mut self) {
        self.units.clear();
        self.boxes.clear();
    }

    /// Adds a unit; ids must come ascending. The tree is to be grown before it is asked.
    pub fn push(&mut self, position: Vec2, id: u32) {
        self.units.push((position, id));
    }

    /// Divides the units into boxes.
    pub fn grow(&mut self) {
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
        if end - begin <= LEAF_SIZE {
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

    /// Finds the units whose squared distance to `position` is below `range_squared`, without unit `but`.
    pub fn find(&self, position: Vec2, range_squared: f32, but: u32, found: &mut Found) {
        found.clear();
        if !self.boxes.is_empty() {
            self.find_in(0, &Query { position, range_squared, but }, found);
        }
    }

    fn find_in(&self, index: usize, query: &Query, found: &mut Found) {
        let this = &self.boxes[index];
        if this.upper == 0 {
            for &(position, id) in &self.units[this.begin as usize..this.end as usize] {
                let distance_squared = (query.position - position).length_squared();
                if distance_squared < query.range_squared && id != query.but {
                    found.push(distance_squared, id);
                }
            }
            return;
        }
        let (lower, upper) = (index + 1, this.upper as usize);
        let to_lower = self.boxes[lower].distance_squared(query.position);
        let to_upper = self.boxes[upper].distance_squared(query.position);
        let nearer_first = if to_lower < to_upper {
            [(to_lower, lower), (to_upper, upper)]
        } else {
            [(to_upper, upper), (to_lower, lower)]
        };
        for (distance_squared, half) in nearer_first {
            if distance_squared < query.range_squared {
                self.find_in(half, query, found);
            }
        }
    }
}

struct Query {
    position: Vec2,
    range_squared: f32,
    but: u32,
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

    fn tree(positions: &[Vec2]) -> Tree {
        let mut tree = Tree::default();
        positions.iter().zip(0..).for_each(|(&position, id)| tree.push(position, id));
        tree.grow();
        tree
    }

    fn find(tree: &Tree, position: Vec2, range_squared: f32, but: u32) -> Vec<u32> {
        let mut found = Found::default();
        tree.find(position, range_squared, but, &mut found);
        found.nearest_first().collect()
    }

    #[test]
    fn finds_what_a_scan_finds() {
        let positions: Vec<Vec2> =
            (0..97).map(|i| Vec2::new((i * 37 % 23) as f32 * 0.31, (i * 53 % 19) as f32 * 0.29)).collect();
        let tree = tree(&positions);
        for (id, &position) in (0..).zip(&positions) {
            let away = |other: &u32| (position - positions[*other as usize]).length_squared();
            for range_squared in [0.0, 0.1, 1.3, 100.0] {
                let mut found = find(&tree, position, range_squared, id);
                assert!(found.is_sorted_by_key(away), "nearest first: {found:?}");
                found.sort_unstable();
                let near = |other: &u32| away(other) < range_squared && *other != id;
                assert_eq!(found, (0..97).filter(near).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn many_units_in_one_spot_can_be_held() {
        assert_eq!(find(&tree(&[Vec2::ONE; 50]), Vec2::ONE, 1.0, 7).len(), 49);
    }

    #[test]
    fn of_a_few_the_lowest_id_is_first() {
        assert_eq!(find(&tree(&[Vec2::X, Vec2::ZERO, Vec2::NEG_X]), Vec2::ZERO, 2.0, 1), [0, 2]);
    }
}
