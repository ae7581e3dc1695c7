//! For every square of the map, the obstacle edges that a unit in it may see, in the order in which it meets them.
//!
//! Edges lie on the lines of the grid, so all points inside a square are on the same side of each of them; that
//! is why one list serves a whole square. Distances are checked again by the unit that asks.

use glam::Vec2;
use smaclite_scenarios::Terrain;

use super::edges::{Edge, Node, left_of, outline};

/// The edges to consider in each square, with one ring of squares around the map for whoever leaves it.
#[derive(Debug)]
pub(crate) struct EdgesByCell {
    edges: Vec<Edge>,
    /// Indices into `edges`, cell after cell.
    lists: Vec<u32>,
    /// Where the list of each cell starts in `lists`, row by row from the south-west, and one last end.
    starts: Vec<u32>,
    longest_list: usize,
    columns: usize,
    /// Column and row of the cell in the north-east.
    last: Vec2,
}

impl EdgesByCell {
    /// Prepares the edges of all obstacles for units that see edges nearer than `range`.
    pub fn new(terrain: &Terrain, range: f64) -> EdgesByCell {
        let (columns, rows) = (terrain.width() as usize + 2, terrain.height() as usize + 2);
        let last = Vec2::new((columns - 1) as f32, (rows - 1) as f32);
        let mut edges = Vec::new();
        let root = Node::arrange(terrain.obstacles().iter().flat_map(outline).collect(), &mut edges);
        let mut cells =
            EdgesByCell { edges, lists: Vec::new(), starts: vec![0], longest_list: 0, columns, last };
        // Rounding in the exact check must not let in what was left out here.
        let range = range as f32 + 0.01;
        for cell in 0..columns * rows {
            let south_west = Vec2::new((cell % columns) as f32, (cell / columns) as f32) - Vec2::ONE;
            if let Some(root) = &root {
                visit(root, &cells.edges, south_west, range, &mut cells.lists);
            }
            cells.starts.push(cells.lists.len() as u32);
        }
        let lengths = cells.starts.windows(2).map(|ends| (ends[1] - ends[0]) as usize);
        cells.longest_list = lengths.max().unwrap_or(0);
        cells
    }

    /// The numbers of the edges that may be in sight of `position`; its square lies outside all of them.
    pub fn near(&self, position: Vec2) -> &[u32] {
        let cell = (position.floor() + Vec2::ONE).max(Vec2::ZERO).min(self.last).as_uvec2();
        let cell = cell.y as usize * self.columns + cell.x as usize;
        &self.lists[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// How many edges may be in sight of a position at most.
    pub fn longest_list(&self) -> usize {
        self.longest_list
    }

    /// The edge of that number.
    pub fn edge(&self, number: u32) -> &Edge {
        &self.edges[number as usize]
    }
}

/// Appends to `list` what a unit in the cell meets: its own side of the line first, then the line, then the far side.
fn visit(node: &Node, edges: &[Edge], south_west: Vec2, range: f32, list: &mut Vec<u32>) {
    if gap(node.bounds, south_west) >= range {
        return;
    }
    let edge = &edges[node.edge];
    let side = left_of(edge.start, edge.end, south_west + Vec2::splat(0.5));
    let (near, far) = if side >= 0.0 { (&node.left, &node.right) } else { (&node.right, &node.left) };
    if let Some(near) = near {
        visit(near, edges, south_west, range, list);
    }
    if side < 0.0 && gap(edge.bounds(), south_west) < range {
        list.push(node.edge as u32);
    }
    if let Some(far) = far {
        visit(far, edges, south_west, range, list);
    }
}

/// The distance between a box and the cell with this south-west corner.
fn gap(bounds: [Vec2; 2], south_west: Vec2) -> f32 {
    let north_east = south_west + Vec2::ONE;
    (south_west - bounds[1]).max(bounds[0] - north_east).max(Vec2::ZERO).length()
}
