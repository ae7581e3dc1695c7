//! The binary space partition of the obstacle edges, and the search for the edges near a square.
//!
//! The partition has two effects on collision avoidance, so it is needed although most maps are small: it
//! cuts edges that cross the line of another edge in two, and it determines the order of equally near edges,
//! as the two edges of a corner are. `line_choice` chooses the line that divides a part.

use std::num::NonZeroU32;

use glam::Vec2;

use super::edges::{Edge, Side, left_of};
use super::line_choice::{Choice, LineChoice};

/// Edges in a binary tree. The line through the edge of a node divides all other edges of its part into those
/// on its left and those on its right; an edge on both sides is cut in two.
#[derive(Debug, Default)]
pub(super) struct Partition {
    /// The edge of each node. A node comes before its left part, which comes before its right part.
    pub edges: Vec<Edge>,
    nodes: Vec<Node>,
}

/// The bounds and children of a node.
#[derive(Clone, Debug)]
struct Node {
    /// South-west and north-east corner of a box around the edges of this node and its parts.
    bounds: [Vec2; 2],
    /// Node 0 is the root, which is no part of another node.
    left: Option<NonZeroU32>,
    right: Option<NonZeroU32>,
}

/// Edges that are not divided yet.
struct Part {
    edges: Vec<Edge>,
    /// The node that the part belongs to, and whether it lies on its left.
    parent: Option<(usize, bool)>,
}

impl Partition {
    /// Builds the tree over the edges, and cuts edges where necessary.
    pub fn new(edges: Vec<Edge>) -> Partition {
        let mut partition = Partition::default();
        let mut choice = LineChoice::default();
        // Not recursive: edges that no line divides become a chain, as deep as their number.
        let mut open = vec![Part { edges, parent: None }];
        while let Some(Part { mut edges, parent }) = open.pop() {
            if edges.is_empty() {
                continue;
            }
            match choice.most_even(&edges) {
                Choice::Divide(chosen) => {
                    let edge = edges.remove(chosen);
                    let right = divide(&mut edges, &edge);
                    let node = partition.push(edge, parent);
                    // The stack returns the left part first: nodes are numbered in this order.
                    open.push(Part { edges: right, parent: Some((node, false)) });
                    open.push(Part { edges, parent: Some((node, true)) });
                }
                Choice::Take(chosen) => {
                    let (taken, rest) = take(edges, chosen);
                    let parent = partition.push_chain(&taken, &rest, parent);
                    open.push(Part { edges: rest, parent });
                }
            }
        }
        partition.find_bounds();
        partition
    }

    /// Appends a node and returns its number.
    fn push(&mut self, edge: Edge, parent: Option<(usize, bool)>) -> usize {
        let number = self.nodes.len();
        if let Some((parent, is_left)) = parent {
            let parent = &mut self.nodes[parent];
            let link = if is_left { &mut parent.left } else { &mut parent.right };
            // It fits: edges sum to at most four times the squares of a map in length, and are cut at its
            // grid.
            *link = NonZeroU32::new(number as u32);
        }
        self.nodes.push(Node { bounds: edge.bounds(), left: None, right: None });
        self.edges.push(edge);
        number
    }

    /// Appends edges each of which has all following edges on one side; returns the parent of `rest`.
    fn push_chain(
        &mut self,
        chain: &[Edge],
        rest: &[Edge],
        parent: Option<(usize, bool)>,
    ) -> Option<(usize, bool)> {
        let following = chain.iter().skip(1).chain(rest.first());
        let is_left = |(edge, next): (&Edge, &Edge)| matches!(edge.side_of(next), Side::Left);
        // If `rest` is empty the last edge has no following one, and its side has no effect.
        let sides = chain.iter().zip(following).map(is_left).chain([false]);
        chain
            .iter()
            .zip(sides)
            .fold(parent, |parent, (edge, is_left)| Some((self.push(*edge, parent), is_left)))
    }

    /// Extends the bounds of every node by those of its parts.
    fn find_bounds(&mut self) {
        // Parts have higher numbers than their node, so in descending order they are complete.
        for number in (0..self.nodes.len()).rev() {
            let Node { bounds, left, right } = self.nodes[number].clone();
            let parts = [left, right].into_iter().flatten();
            let parts = parts.map(|part| self.nodes[part.get() as usize].bounds);
            self.nodes[number].bounds = parts.fold(bounds, join);
        }
    }

    /// Appends to `list` the edges nearer than `range` to the square with this south-west corner that its
    /// units can see, in the order of the rules: of every node first the part on the unit's side of its line,
    /// then its edge, then the other part.
    pub fn visit(&self, south_west: Vec2, range: f32, list: &mut Vec<u32>) {
        if !self.nodes.is_empty() {
            self.visit_part(0, south_west, range, list);
        }
    }

    fn visit_part(&self, number: u32, south_west: Vec2, range: f32, list: &mut Vec<u32>) {
        let node = &self.nodes[number as usize];
        if gap(node.bounds, south_west) >= range {
            return;
        }
        let edge = &self.edges[number as usize];
        // Edges lie on the grid, so the centre of the square is on the same side as all of it.
        let side = left_of(edge.start, edge.end, south_west + Vec2::splat(0.5));
        let (near, far) = if side >= 0.0 { (node.left, node.right) } else { (node.right, node.left) };
        if let Some(near) = near {
            self.visit_part(near.get(), south_west, range, list);
        }
        // The outer side is on the right: from the left the edge is the back of an obstacle.
        if side < 0.0 && gap(edge.bounds(), south_west) < range {
            list.push(number);
        }
        if let Some(far) = far {
            self.visit_part(far.get(), south_west, range, list);
        }
    }
}

/// The edges at these ascending indices, and the others.
fn take(edges: Vec<Edge>, indices: Vec<usize>) -> (Vec<Edge>, Vec<Edge>) {
    let mut indices = indices.into_iter().peekable();
    let (taken, rest): (Vec<_>, Vec<_>) =
        edges.into_iter().enumerate().partition(|(i, _)| indices.next_if_eq(i).is_some());
    let edges = |numbered: Vec<(usize, Edge)>| numbered.into_iter().map(|(_, edge)| edge).collect();
    (edges(taken), edges(rest))
}

/// Keeps the edges on the left of the line through `edge` and returns those on its right, both in their
/// order.
fn divide(edges: &mut Vec<Edge>, edge: &Edge) -> Vec<Edge> {
    let mut right = Vec::new();
    edges.retain_mut(|other| match edge.side_of(other) {
        Side::Left => true,
        Side::Right => {
            right.push(*other);
            false
        }
        Side::Both { start_is_left } => {
            let (first, second) = other.cut_by(edge);
            let (on_left, on_right) = if start_is_left { (first, second) } else { (second, first) };
            *other = on_left;
            right.push(on_right);
            true
        }
    });
    right
}

fn join(a: [Vec2; 2], b: [Vec2; 2]) -> [Vec2; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The distance between a box and the cell with this south-west corner.
fn gap(bounds: [Vec2; 2], south_west: Vec2) -> f32 {
    let north_east = south_west + Vec2::ONE;
    (south_west - bounds[1]).max(bounds[0] - north_east).max(Vec2::ZERO).length()
}

#[cfg(test)]
mod tests {
    use super::super::edges::outline;
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;
    use smaclite_scenarios::{Rect, Terrain};

    /// The partition by its definition: every edge is compared with every other.
    fn arrange(mut edges: Vec<Edge>, arranged: &mut Vec<(Edge, [bool; 2])>) {
        let sides = |i: usize| {
            let (mut left, mut right) = (0, 0);
            for (_, other) in edges.iter().enumerate().filter(|&(j, _)| j != i) {
                match edges[i].side_of(other) {
                    Side::Left => left += 1,
                    Side::Right => right += 1,
                    Side::Both { .. } => (left, right) = (left + 1, right + 1),
                }
            }
            (usize::max(left, right), usize::min(left, right), i)
        };
        let Some((.., chosen)) = (0..edges.len()).map(sides).min() else { return };
        let edge = edges.remove(chosen);
        let right = divide(&mut edges, &edge);
        arranged.push((edge, [&edges, &right].map(|part| !part.is_empty())));
        [edges, right].into_iter().for_each(|part| arrange(part, arranged));
    }

    fn check(terrain: &Terrain) {
        let edges: Vec<Edge> = terrain.obstacles().iter().flat_map(outline).collect();
        let mut expected = Vec::new();
        arrange(edges.clone(), &mut expected);
        let Partition { edges, nodes } = Partition::new(edges);
        let parts = nodes.iter().map(|node| [node.left.is_some(), node.right.is_some()]);
        assert!(edges.into_iter().zip(parts).eq(expected), "{terrain:?}");
    }

    /// Squares blocked at random: single ones, walls that others cut, and triangles, whose rectangles
    /// overlap.
    fn random_map(random: &mut Pcg64) -> Terrain {
        let mut number = |range: std::ops::RangeInclusive<u32>| random.random_range(range);
        let (width, height) = (number(1..=130), number(1..=130));
        let mut walkable = vec![true; (width * height) as usize];
        for _ in 0..number(0..=60) {
            let (x0, y0) = (number(0..=width), number(0..=height));
            let (size, thickness, shape, is_free) =
                (number(1..=130), number(1..=3), number(0..=7), number(0..=7));
            for (x, y) in (y0..height).flat_map(|y| (x0..width).map(move |x| (x, y))) {
                let (dx, dy) = (x - x0, y - y0);
                let is_inside = match shape {
                    0..3 => dx < size && dy < thickness,
                    3..6 => dx < thickness && dy < size,
                    6 => dx < thickness && dy < thickness,
                    _ => dx.max(dy) < size / 4 && if size % 2 == 0 { dx < dy } else { dx + dy >= size / 4 },
                };
                if is_inside {
                    walkable[(y * width + x) as usize] = is_free == 0;
                }
            }
        }
        Terrain::new(width, height, walkable).unwrap()
    }

    /// On maps of 1024 x 1024 squares the partition once took minutes. Its order decides battles, so it must
    /// stay.
    #[test]
    fn the_fast_choice_is_the_slow_one() {
        let mut random = Pcg64::seed_from_u64(1);
        for _ in 0..3000 {
            check(&random_map(&mut random));
        }
        for preset in Terrain::preset_names() {
            check(&Terrain::preset(preset).unwrap());
        }
    }

    #[test]
    fn arranging_loses_no_length() {
        // In a pinwheel of four bars every line crosses another bar.
        let bars = [[0, 4, 5, 6], [4, 5, 6, 10], [5, 4, 10, 6], [4, 0, 6, 5]];
        let bars = bars.map(|[x0, y0, x1, y1]| Rect { x0, y0, x1, y1 });
        let pieces = Partition::new(bars.iter().flat_map(outline).collect()).edges;
        assert!(pieces.len() > 16, "nothing was cut");
        let length: f32 = pieces.iter().map(|edge| (edge.end - edge.start).length()).sum();
        assert_eq!(length, 4.0 * 14.0);
    }
}
