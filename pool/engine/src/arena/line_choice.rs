//! The choice of the edge whose line divides a part of the partition most evenly, in time proportional to the
//! number of edges.
//!
//! Comparing every edge with every other takes quadratic time: minutes on a map of 1024 x 1024 squares. But
//! edges lie on the lines of the grid, so all edges on one line with the same direction divide the others
//! equally, and the numbers on each side follow from three counts per line: the edges without a point above
//! it, those without a point below it, and those in it.
//!
//! There is an exception. A cut may miss the grid by a rounding error, and a point next to a line counts as
//! on it if its distance times the length of the dividing edge is small. Edges whose line has such a point
//! nearby are compared with all others one by one, as are all edges of small parts.

use super::edges::{Edge, ON_LINE, Side};

/// Parts with at most this number of edges are divided faster by comparing all pairs.
const FEW: usize = 16;

/// Chooses lines, and keeps its memory for the next choice.
#[derive(Default)]
pub(super) struct LineChoice {
    /// For lines from south to north, and for lines from west to east.
    counts: [Counts; 2],
}

impl LineChoice {
    /// The edge whose line has the fewest edges on its fuller side; of equals the fewest on the other side;
    /// of equals the first.
    pub fn most_even(&mut self, edges: &[Edge]) -> Choice {
        if edges.len() > FEW {
            self.counts.iter_mut().zip(0..).for_each(|(counts, axis)| counts.count(edges, axis));
        }
        let mut best = (0, Sides { fuller: usize::MAX, other: usize::MAX });
        // All other edges on one side: such a line divides nothing.
        let worst = Sides::new(edges.len() - 1, 0);
        let (mut undivided, mut fewest_cut) = (Vec::new(), usize::MAX);
        for (i, edge) in edges.iter().enumerate() {
            let counted = if edges.len() > FEW { self.counted(edge, edges.len()) } else { None };
            // A comparison stops where it cannot become the best any more.
            let sides = counted.unwrap_or_else(|| compared(edges, i, best.1.fuller));
            if sides < best.1 {
                best = (i, sides);
            }
            if sides == worst {
                undivided.push(i);
            } else {
                fewest_cut = fewest_cut.min(sides.other);
            }
        }
        if best.1 != worst {
            return Choice::Divide(best.0);
        }
        // See `Choice::Take` for why their number is limited to that of the edges that any other line cuts.
        undivided.truncate(fewest_cut);
        Choice::Take(undivided)
    }

    /// The sides of the line through an edge, from the counts. `None` if a point next to the line might count
    /// as on it.
    fn counted(&self, edge: &Edge, n: usize) -> Option<Sides> {
        let axis = edge.axis();
        let length = (edge.end - edge.start)[1 - axis];
        let (line, counts) = (edge.start[axis], &self.counts[axis]);
        let Line { up_to, from, within, clearance, .. } = counts.lines[(line - counts.first) as usize];
        if clearance * length.abs() <= ON_LINE {
            return None;
        }
        // An edge that runs north has lower coordinates (the west) on its left, one that runs east has higher
        // ones (the north). Edges in the line count as left, like the dividing edge itself.
        let low_is_left = (length > 0.0) == (axis == 0);
        let (left, right) = if low_is_left { (up_to, from - within) } else { (from, up_to - within) };
        // Every edge without a point on the right is on the left only, and the others are cut or on the
        // right. So the left side has all edges except those on the right only, and except the dividing edge;
        // likewise the right side.
        Some(Sides::new(n - right as usize - 1, n - left as usize))
    }
}

/// The outcome of the choice.
#[derive(Debug)]
pub(super) enum Choice {
    /// The line through this edge divides the others.
    Divide(usize),
    /// No line divides the edges: every line has all other edges on one side, and at most cuts some of them.
    /// These edges, whose lines cut none, are chosen next, one after the other: every other line cuts at
    /// least as many edges as there are of these, so it still cuts one when the last of these is chosen, and
    /// is worse.
    Take(Vec<usize>),
}

/// The numbers of edges on the two sides of a line; less is more even.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Sides {
    fuller: usize,
    other: usize,
}

impl Sides {
    fn new(left: usize, right: usize) -> Sides {
        Sides { fuller: left.max(right), other: left.min(right) }
    }
}

/// The sides of the line through edge `i`; incomplete as soon as one has more than `fullest` edges.
fn compared(edges: &[Edge], i: usize, fullest: usize) -> Sides {
    let (mut left, mut right) = (0, 0);
    for (_, other) in edges.iter().enumerate().filter(|&(j, _)| j != i) {
        match edges[i].side_of(other) {
            Side::Left => left += 1,
            Side::Right => right += 1,
            Side::Both { .. } => (left, right) = (left + 1, right + 1),
        }
        if usize::max(left, right) > fullest {
            break;
        }
    }
    Sides::new(left, right)
}

/// Counts for the grid's lines across one axis.
#[derive(Default)]
struct Counts {
    /// The coordinate of the first of `lines`; the others follow at distances of 1.
    first: f32,
    lines: Vec<Line>,
}

/// One line of the grid.
#[derive(Clone)]
struct Line {
    /// Edges without a point above the line.
    up_to: u32,
    /// Edges without a point below it.
    from: u32,
    /// Edges in it; they are part of both counts above.
    within: u32,
    /// Edges whose highest point is between this line and the next, and edges whose lowest point is.
    highest_after: u32,
    lowest_after: u32,
    /// The distance of the nearest end of an edge that is not on the line.
    clearance: f32,
}

impl Counts {
    fn count(&mut self, edges: &[Edge], axis: usize) {
        let ends = |edge: &Edge| edge.bounds().map(|corner| corner[axis]);
        let [first, last] = edges.iter().map(ends).fold([f32::INFINITY, f32::NEG_INFINITY], |all, ends| {
            [all[0].min(ends[0].floor()), all[1].max(ends[1].ceil())]
        });
        self.first = first;
        self.lines.clear();
        let none = Line { up_to: 0, from: 0, within: 0, highest_after: 0, lowest_after: 0, clearance: 1.0 };
        self.lines.resize((last - first) as usize + 1, none);
        for edge in edges {
            // First only the edges whose highest or lowest point is at, or just after, each line; `add_up`
            // sums.
            let [lowest, highest] = ends(edge);
            let (line, is_on) = self.line_below(highest);
            *(if is_on { &mut line.up_to } else { &mut line.highest_after }) += 1;
            let (line, is_on) = self.line_below(lowest);
            *(if is_on { &mut line.from } else { &mut line.lowest_after }) += 1;
            line.within += u32::from(is_on && lowest == highest);
        }
        self.add_up();
    }

    /// The line at `coordinate`, or the next one below and `false`.
    fn line_below(&mut self, coordinate: f32) -> (&mut Line, bool) {
        let below = coordinate.floor();
        let number = (below - self.first) as usize;
        // A rounded cut: both adjacent lines have a point nearby.
        if coordinate != below {
            for (number, distance) in [(number, coordinate - below), (number + 1, below + 1.0 - coordinate)] {
                let clearance = &mut self.lines[number].clearance;
                *clearance = clearance.min(distance);
            }
        }
        (&mut self.lines[number], coordinate == below)
    }

    /// Sums the counts: from edges that end or begin at each line to edges that end at or before it, and that
    /// begin at or after it.
    fn add_up(&mut self) {
        let mut up_to = 0;
        for line in &mut self.lines {
            up_to += line.up_to;
            line.up_to = up_to;
            up_to += line.highest_after;
        }
        let mut from = 0;
        for line in self.lines.iter_mut().rev() {
            from += line.lowest_after + line.from;
            line.from = from;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;
    use smaclite_scenarios::Rect;

    use super::super::edges::outline;
    use super::*;

    /// Edges of random rectangles; some end a little off the grid, as cuts may, or at a tiny distance from
    /// their start.
    fn random_edges(random: &mut Pcg64) -> Vec<Edge> {
        let (n, origin) = (random.random_range(1..60), random.random_range(0..=1000_u32));
        let mut random_edge = || {
            let mut number = |upper: u32| random.random_range(0..upper);
            let (x0, y0) = (origin + number(9), origin + number(9));
            let rect = Rect { x0, y0, x1: x0 + 1 + number(9), y1: y0 + 1 + number(9) };
            let mut edge = outline(&rect)[number(4) as usize];
            let along = 1 - edge.axis();
            for _ in 0..number(3) {
                edge.start[along] = edge.start[along].next_up();
            }
            match number(12) {
                0 => edge.end[along] = edge.end[along].next_down(),
                1 => edge.end[along] += 1e-5,
                2 => edge.end[along] = edge.start[along].next_up().next_up(),
                _ => {}
            }
            edge
        };
        (0..n).map(|_| random_edge()).collect()
    }

    #[test]
    fn counting_decides_as_comparing_does() {
        let mut random = Pcg64::seed_from_u64(2);
        let mut choice = LineChoice::default();
        let mut n_counted = [0; 2];
        for _ in 0..20_000 {
            let edges = random_edges(&mut random);
            let sides = |i| compared(&edges, i, usize::MAX);
            let best = (0..edges.len()).min_by_key(|&i| sides(i));
            match choice.most_even(&edges) {
                Choice::Divide(chosen) => assert_eq!(Some(chosen), best, "{edges:#?}"),
                Choice::Take(chosen) => assert_eq!(chosen.first().copied(), best, "{edges:#?}"),
            }
            if edges.len() > FEW {
                edges.iter().for_each(|edge| {
                    n_counted[usize::from(choice.counted(edge, edges.len()).is_some())] += 1;
                });
            }
        }
        assert!(n_counted.iter().all(|&n| n > 10_000), "{n_counted:?} are too few for either way");
    }
}
