//! Ways around walls: from each square of a map, where to walk to next on a short way to a goal.
//!
//! A search from the square of a goal gives each square its next one among its eight neighbours. Then ways
//! are drawn tight, from the goal on: if a straight line to the square after the next is free, it is the next
//! one. So a unit asks once per tick, and gets the corner around which it walks. A search is made when the
//! first unit has its goal in a square, and all battles of an arena share it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::OnceLock;

use glam::{IVec2, Vec2};
use smaclite_scenarios::Terrain;

/// The largest map with ways, in squares: the searches of all squares together take 32 MiB at most.
const MAX_SQUARES: usize = 1 << 12;
/// Lengths of steps to a neighbour beside a square and at its corner: nearly as a square's side and diagonal.
const STEPS: [u32; 2] = [5, 7];
/// How far the middle of a blocked square may be inside the convex hull of the walkable ones, in squares:
/// where an edge is made of steps.
const STEP_OF_EDGE: f32 = 0.75;
/// Half of the width of the lane that a straight line needs, in squares.
const CLEARANCE: f32 = 0.45;
/// Distance between two points of a line that are looked at, in squares.
const SAMPLE: f32 = 0.25;

/// The ways of a map. They do not depend on units: see [`Ways::next`].
#[derive(Debug)]
pub(crate) struct Ways {
    columns: usize,
    rows: usize,
    /// By square, row by row from the south-west.
    is_walkable: Vec<bool>,
    /// For each square of a goal: by square, the one to walk straight to; itself at the goal, and where there
    /// is no way.
    fields: Vec<OnceLock<Box<[u16]>>>,
}

impl Ways {
    /// `None` for a map on which all ways are straight, and for one that is too large.
    pub(crate) fn new(terrain: &Terrain) -> Option<Ways> {
        let (columns, rows) = (terrain.width() as usize, terrain.height() as usize);
        let squares = (0..rows as i64).flat_map(|y| (0..columns as i64).map(move |x| (x, y)));
        let is_walkable: Vec<bool> = squares.map(|(x, y)| terrain.is_walkable(x, y)).collect();
        if is_walkable.len() > MAX_SQUARES || is_convex(&is_walkable, columns) {
            return None;
        }
        let fields = is_walkable.iter().map(|_| OnceLock::new()).collect();
        Some(Ways { columns, rows, is_walkable, fields })
    }

    /// The end of the first straight part of a way: a corner, or the goal itself where nothing is between,
    /// there is no way, or a point is off the map.
    pub(crate) fn next(&self, from: Vec2, goal: Vec2) -> Vec2 {
        let (Some(here), Some(there)) = (self.square(from), self.square(goal)) else { return goal };
        let next = usize::from(self.fields[there].get_or_init(|| self.search(there))[here]);
        if next == here || next == there { goal } else { self.middle(next) }
    }

    fn search(&self, goal: usize) -> Box<[u16]> {
        let count = self.is_walkable.len();
        let mut next: Vec<usize> = (0..count).collect();
        let mut lengths = vec![u32::MAX; count];
        let mut open = BinaryHeap::new();
        for start in self.ends(goal) {
            lengths[start] = 0;
            open.push(Reverse((0, start)));
        }
        let mut order = Vec::with_capacity(count);
        while let Some(Reverse((length, square))) = open.pop() {
            if length > lengths[square] {
                continue;
            }
            order.push(square);
            for (neighbour, step) in self.neighbours(square) {
                let longer = length + step;
                if longer < lengths[neighbour] {
                    lengths[neighbour] = longer;
                    next[neighbour] = square;
                    open.push(Reverse((longer, neighbour)));
                }
            }
        }
        // In the order of their lengths: a square comes after the next one of its way.
        for square in order {
            let after = next[next[square]];
            if self.is_free(square, after) {
                next[square] = after;
            }
        }
        next.into_iter().map(|square| square as u16).collect()
    }

    /// Where ways to a goal end: at its square, or if it is blocked, at those that are nearest to it.
    fn ends(&self, goal: usize) -> Vec<usize> {
        let far = |square: &usize| (self.middle(*square) - self.middle(goal)).length_squared();
        let walkable = || (0..self.is_walkable.len()).filter(|&square| self.is_walkable[square]);
        let least = walkable().map(|square| far(&square)).fold(f32::INFINITY, f32::min);
        walkable().filter(|square| far(square) == least).collect()
    }

    /// The squares to which one step leads, and its length. No step leads past the corner of a wall.
    fn neighbours(&self, square: usize) -> impl Iterator<Item = (usize, u32)> + '_ {
        let (x, y) = ((square % self.columns) as isize, (square / self.columns) as isize);
        let at = move |x: isize, y: isize| {
            let is_inside = x >= 0 && y >= 0 && x < self.columns as isize && y < self.rows as isize;
            let square = || x as usize + y as usize * self.columns;
            is_inside.then(square).filter(|&square| self.is_walkable[square])
        };
        let steps = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        steps.filter(|&step| step != (0, 0)).filter_map(move |(dx, dy)| {
            let is_beside = dx == 0 || dy == 0;
            let may_cross = is_beside || at(x + dx, y).is_some() && at(x, y + dy).is_some();
            at(x + dx, y + dy).filter(|_| may_cross).map(|to| (to, STEPS[usize::from(!is_beside)]))
        })
    }

    /// Whether a unit can walk straight from the middle of a square to that of another.
    fn is_free(&self, from: usize, to: usize) -> bool {
        let (from, to) = (self.middle(from), self.middle(to));
        let way = to - from;
        let side = way.normalize_or_zero().perp() * CLEARANCE;
        let samples = (way.length() / SAMPLE).ceil();
        (0..=samples as u32).all(|sample| {
            let at = from + way * (sample as f32 / f32::max(samples, 1.0));
            [at - side, at, at + side].into_iter().all(|at| self.is_walkable_at(at))
        })
    }

    fn is_walkable_at(&self, at: Vec2) -> bool {
        self.square(at).is_some_and(|square| self.is_walkable[square])
    }

    fn square(&self, at: Vec2) -> Option<usize> {
        let is_inside = at.x >= 0.0 && at.y >= 0.0 && at.x < self.columns as f32 && at.y < self.rows as f32;
        is_inside.then(|| at.x as usize + at.y as usize * self.columns)
    }

    fn middle(&self, square: usize) -> Vec2 {
        Vec2::new((square % self.columns) as f32 + 0.5, (square / self.columns) as f32 + 0.5)
    }
}

/// Whether no blocked square is between two walkable ones, but for the steps of an edge.
fn is_convex(is_walkable: &[bool], columns: usize) -> bool {
    let corner = |square: usize| IVec2::new((square % columns) as i32, (square / columns) as i32);
    let squares = |walkable| (0..is_walkable.len()).filter(move |&square| is_walkable[square] == walkable);
    let corners = squares(true).flat_map(|square| {
        [IVec2::ZERO, IVec2::X, IVec2::Y, IVec2::ONE].map(|offset| corner(square) + offset)
    });
    let hull = hull(corners.collect());
    let sides = || hull.iter().zip(hull.iter().cycle().skip(1)).map(|(a, b)| (a.as_vec2(), b.as_vec2()));
    !squares(false).any(|square| {
        let middle = corner(square).as_vec2() + 0.5;
        sides().all(|(from, to)| (to - from).normalize_or_zero().perp_dot(middle - from) > STEP_OF_EDGE)
    })
}

/// The convex hull of points, counter-clockwise: Andrew's monotone chain.
fn hull(mut points: Vec<IVec2>) -> Vec<IVec2> {
    points.sort_unstable_by_key(|point| point.to_array());
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = IVec2>| {
        let mut chain: Vec<IVec2> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(point - b) <= 0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.append(&mut half(&mut points.iter().rev().copied()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall from (2, 4) to (6, 4) on a map of 9 x 9 squares.
    fn walled() -> Ways {
        let terrain = Terrain::from_fn(9, 9, |x, y| y != 4 || !(2..=6).contains(&x));
        Ways::new(&terrain.expect("a map")).expect("it has a wall")
    }

    fn walk(ways: &Ways, from: [f32; 2], goal: [f32; 2]) -> f32 {
        let (mut at, goal, mut length) = (Vec2::from(from), Vec2::from(goal), 0.0);
        for _ in 0..200 {
            let way = ways.next(at, goal) - at;
            if way.length() < 0.1 {
                return length;
            }
            at += way.normalize() * 0.1;
            length += 0.1;
            assert!(ways.is_walkable_at(at), "{at} is in the wall");
        }
        panic!("the goal is not reached");
    }

    #[test]
    fn a_way_leads_around_a_wall_and_is_hardly_longer_than_the_shortest() {
        let length = walk(&walled(), [4.2, 2.3], [4.4, 6.8]);
        assert!((6.3..8.5).contains(&length), "{length}");
    }

    #[test]
    fn a_free_way_is_straight() {
        let ways = walled();
        let goal = Vec2::new(8.3, 0.2);
        assert_eq!(ways.next(Vec2::new(0.7, 3.6), goal), goal);
    }

    #[test]
    fn a_way_to_a_wall_ends_beside_it() {
        let length = walk(&walled(), [4.5, 1.0], [4.5, 4.02]);
        assert!((2.9..3.2).contains(&length), "{length}");
    }

    #[test]
    fn without_a_way_units_walk_straight() {
        let terrain = Terrain::from_fn(5, 5, |x, _| x != 2).expect("a map");
        let ways = Ways::new(&terrain).expect("it has a wall");
        let goal = Vec2::new(4.5, 1.5);
        assert_eq!(ways.next(Vec2::new(0.5, 3.5), goal), goal);
        assert!(Ways::new(&Terrain::from_fn(5, 5, |_, _| true).expect("a map")).is_none());
    }

    #[test]
    fn only_maps_with_walls_between_their_squares_need_ways() {
        let is_needed = |name: &&str| Ways::new(&Terrain::preset(name).expect("a preset")).is_some();
        let needed: Vec<&str> = Terrain::preset_names().filter(is_needed).collect();
        assert_eq!(needed, ["ALL_GREEN", "CHECKERBOARD", "CORRIDOR", "NARROW", "RAVINE"]);
    }
}
