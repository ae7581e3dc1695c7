//! The edges of the obstacle rectangles, and the sides of their lines.

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

/// The tolerance of [`Edge::side_of`]: points with at most this [`left_of`] count as on the line.
pub(super) const ON_LINE: f32 = 1e-5;

/// Positive if `point` lies to the left of the line from `a` to `b`, negative if to the right: twice the
/// signed area of the triangle, that is the distance from the line times the length of the edge.
pub(super) fn left_of(a: Vec2, b: Vec2, point: Vec2) -> f32 {
    (a - point).perp_dot(b - a)
}

/// The four edges of a rectangle, from the south-west corner counter-clockwise.
pub(super) fn outline(rect: &Rect) -> [Edge; 4] {
    let [west, south, east, north] = [rect.x0, rect.y0, rect.x1, rect.y1].map(|x| x as f32);
    let corners = [[west, south], [east, south], [east, north], [west, north]].map(Vec2::from);
    let corner = |i: usize| corners[i % 4];
    // Every edge keeps the directions of its neighbours in the outline: an obstacle's corner is avoided by
    // the edges on both of its sides together.
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

/// Where an edge lies with respect to the line through another.
pub(super) enum Side {
    Left,
    Right,
    Both { start_is_left: bool },
}

impl Edge {
    /// On which side of this edge's line another edge lies.
    pub(super) fn side_of(&self, other: &Edge) -> Side {
        let start = left_of(self.start, self.end, other.start);
        let end = left_of(self.start, self.end, other.end);
        // Within the tolerance an end belongs to both sides. So an edge that only touches the line is not
        // cut, and an edge in the line counts as left.
        if start >= -ON_LINE && end >= -ON_LINE {
            Side::Left
        } else if start <= ON_LINE && end <= ON_LINE {
            Side::Right
        } else {
            Side::Both { start_is_left: start > 0.0 }
        }
    }

    /// Cuts this edge where it crosses the line through `other`.
    pub(super) fn cut_by(&self, other: &Edge) -> (Edge, Edge) {
        // The cut is the point c = start + share (end - start) with line x (c - other.start) = 0, where x is
        // the cross product. Solved for the share:
        let line = other.end - other.start;
        let share = line.perp_dot(self.start - other.start) / line.perp_dot(self.start - self.end);
        let cut = self.start + share * (self.end - self.start);
        // At the cut the outline goes straight on, so each piece has the other's direction as its
        // neighbour's.
        (Edge { end: cut, after: self.along, ..*self }, Edge { start: cut, before: self.along, ..*self })
    }

    /// South-west and north-east end.
    pub(super) fn bounds(&self) -> [Vec2; 2] {
        [self.start.min(self.end), self.start.max(self.end)]
    }

    /// The coordinate that is the same all along the edge: 0 for x, 1 for y. A cut leaves it as it is.
    pub(super) fn axis(&self) -> usize {
        usize::from(self.start.x != self.end.x)
    }
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
}
