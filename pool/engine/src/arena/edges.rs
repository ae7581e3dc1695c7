//! The edges of the obstacle rectangles, arranged in a binary space partition.
//!
//! The partition has two effects on collision avoidance, which is why it exists although maps are small: it cuts
//! edges that cross the line of another one in two, and it fixes the order in which a unit meets edges that are
//! equally far away, as the two edges of a corner are. Which edges a square can see is in `cells`.

use glam::Vec2;
use smaclite_scenarios::Rect;

/// A straight piece of an obstacle's outline. The outline runs counter-clockwise: outside is on the right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Edge {
    pub start: Vec2,
    pub end: Vec2,
    /// Direction of this edge.
    pub along: Vec2,
    /// Direction of the edge that ends where this one starts.
    pub before: Vec2,
    /// Direction of the edge that starts where this one ends.
    pub after: Vec2,
}

/// A node of the partition: the line through `edge` parts the others into those on its left and on its right.
#[derive(Debug)]
pub(super) struct Node {
    /// The index of the node's edge in the list that `arrange` fills.
    pub edge: usize,
    /// South-west and north-east corner of a box around all edges below and in this node.
    pub bounds: [Vec2; 2],
    pub left: Option<Box<Node>>,
    pub right: Option<Box<Node>>,
}

/// Above this many edges the partition is built without looking for the best line, which takes quadratic time.
const MOST_EDGES_FOR_SEARCH: usize = 4096;

/// How far from a line a point may be and still count as on it.
const ON_LINE: f32 = 1e-5;

/// Positive if `point` lies to the left of the line from `a` to `b`, negative if to the right.
pub(crate) fn left_of(a: Vec2, b: Vec2, point: Vec2) -> f32 {
    (a - point).perp_dot(b - a)
}

/// The four edges of a rectangle, from the south-west corner counter-clockwise.
pub(super) fn outline(rect: &Rect) -> [Edge; 4] {
    let [west, south, east, north] = [rect.x0, rect.y0, rect.x1, rect.y1].map(|x| x as f32);
    let corners = [[west, south], [east, south], [east, north], [west, north]].map(Vec2::from);
    let corner = |i: usize| corners[i % 4];
    let along = |i: usize| {
        let span = corner(i + 1) - corner(i);
        span * (1.0 / span.length())
    };
    std::array::from_fn(|i| Edge {
        start: corner(i),
        end: corner(i + 1),
        along: along(i),
        before: along(i + 3),
        after: along(i + 1),
    })
}

impl Node {
    /// Arranges the edges and appends them, cut as need be, to `arranged`; `None` when there are none.
    pub fn arrange(mut edges: Vec<Edge>, arranged: &mut Vec<Edge>) -> Option<Box<Node>> {
        if edges.is_empty() {
            return None;
        }
        let chosen = most_even_line(&edges);
        let edge = edges.remove(chosen);
        let bounds = edges.iter().map(Edge::bounds).fold(edge.bounds(), join);
        let (mut left, mut right) = (Vec::new(), Vec::new());
        for other in edges {
            match edge.side_of(&other) {
                Side::Left => left.push(other),
                Side::Right => right.push(other),
                Side::Both { start_is_left } => {
                    let (first, second) = other.cut_by(&edge);
                    let (on_left, on_right) = if start_is_left { (first, second) } else { (second, first) };
                    left.push(on_left);
                    right.push(on_right);
                }
            }
        }
        let index = arranged.len();
        arranged.push(edge);
        let (left, right) = (Node::arrange(left, arranged), Node::arrange(right, arranged));
        Some(Box::new(Node { edge: index, bounds, left, right }))
    }
}

/// Where an edge lies with respect to the line through another.
enum Side {
    Left,
    Right,
    Both { start_is_left: bool },
}

impl Edge {
    fn side_of(&self, other: &Edge) -> Side {
        let start = left_of(self.start, self.end, other.start);
        let end = left_of(self.start, self.end, other.end);
        if start >= -ON_LINE && end >= -ON_LINE {
            Side::Left
        } else if start <= ON_LINE && end <= ON_LINE {
            Side::Right
        } else {
            Side::Both { start_is_left: start > 0.0 }
        }
    }

    /// Cuts this edge where it crosses the line through `other`.
    fn cut_by(&self, other: &Edge) -> (Edge, Edge) {
        let line = other.end - other.start;
        let share = line.perp_dot(self.start - other.start) / line.perp_dot(self.start - self.end);
        let cut = self.start + share * (self.end - self.start);
        (Edge { end: cut, after: self.along, ..*self }, Edge { start: cut, before: self.along, ..*self })
    }

    pub fn bounds(&self) -> [Vec2; 2] {
        [self.start.min(self.end), self.start.max(self.end)]
    }
}

fn join(a: [Vec2; 2], b: [Vec2; 2]) -> [Vec2; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The edge whose line leaves the fewest edges on its fuller side, of equals the fewest on the other, of equals
/// the first.
fn most_even_line(edges: &[Edge]) -> usize {
    if edges.len() > MOST_EDGES_FOR_SEARCH {
        return edges.len() / 2;
    }
    let mut best = (0, (usize::MAX, usize::MAX));
    for (i, edge) in edges.iter().enumerate() {
        let (mut left, mut right) = (0, 0);
        for (_, other) in edges.iter().enumerate().filter(|&(j, _)| j != i) {
            match edge.side_of(other) {
                Side::Left => left += 1,
                Side::Right => right += 1,
                Side::Both { .. } => (left, right) = (left + 1, right + 1),
            }
            if usize::max(left, right) > best.1.0 {
                break;
            }
        }
        let unevenness = (usize::max(left, right), usize::min(left, right));
        if unevenness < best.1 {
            best = (i, unevenness);
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: Rect = Rect { x0: 2, y0: 3, x1: 4, y1: 5 };

    #[test]
    fn outside_is_on_the_right() {
        for edge in outline(&SQUARE) {
            assert!(left_of(edge.start, edge.end, Vec2::new(3.0, 4.0)) > 0.0, "{edge:?}");
        }
        let south = outline(&SQUARE)[0];
        assert!(left_of(south.start, south.end, Vec2::new(3.0, 2.0)) < 0.0);
        assert_eq!([south.before, south.along, south.after], [Vec2::NEG_Y, Vec2::X, Vec2::Y]);
    }

    #[test]
    fn an_edge_across_a_line_is_cut_on_it() {
        let [_, east, _, _] = outline(&SQUARE);
        let [long, ..] = outline(&Rect { x0: 0, y0: 6, x1: 10, y1: 7 });
        assert!(matches!(east.side_of(&long), Side::Both { start_is_left: true }));
        let (west, rest) = long.cut_by(&east);
        assert_eq!([west.start, west.end, rest.start, rest.end].map(|point| point.x), [0.0, 4.0, 4.0, 10.0]);
        assert_eq!(
            [west.before, west.after, rest.before, rest.after],
            [Vec2::NEG_Y, Vec2::X, Vec2::X, Vec2::Y]
        );
    }

    #[test]
    fn arranging_loses_no_length() {
        // In a pinwheel of four bars every line crosses another bar.
        let bars = [[0, 4, 5, 6], [4, 5, 6, 10], [5, 4, 10, 6], [4, 0, 6, 5]];
        let bars = bars.map(|[x0, y0, x1, y1]| Rect { x0, y0, x1, y1 });
        let mut pieces = Vec::new();
        Node::arrange(bars.iter().flat_map(outline).collect(), &mut pieces);
        assert!(pieces.len() > 16, "nothing was cut");
        let length: f32 = pieces.iter().map(|edge| (edge.end - edge.start).length()).sum();
        assert_eq!(length, 4.0 * 14.0);
    }
}
