//! For every square of the map, the obstacle edges that a unit in it may see, in the order in which a search
//! of the partition visits them.
//!
//! Edges lie on the lines of the grid, so all points inside a square are on the same side of each of them:
//! one list is valid for a whole square. The exact distance is checked for each unit
//! (`tick::avoid::obstacles`).

use glam::Vec2;
use smaclite_scenarios::Terrain;

use super::edges::{Edge, outline};
use super::partition::Partition;
use crate::lanes::{Floats, Lanes, Vectors};

/// The largest number of entries of the lists of all squares together: 16 MiB. The lists exist only for
/// speed, and beyond the size of the processor's caches they are not faster than the search.
const MAX_ENTRIES: usize = 1 << 22;

/// Floats from 2^23 to 2^24 are integers, and their low 23 bits are what exceeds 2^23.
const CELL_BASE: f32 = 8_388_608.0;

fn number(cell: f32) -> usize {
    cell.to_bits() as usize & 0x7f_ffff
}

/// The edges to consider in each square, with a ring of squares around the map for units that are pushed off
/// it.
#[derive(Debug)]
pub(crate) struct EdgesByCell {
    partition: Partition,
    range: f32,
    /// `None` on maps with very many edges, where every query searches the partition.
    lists: Option<Lists>,
    longest_list: usize,
    columns: usize,
    /// Column and row of the cell in the north-east.
    last: Vec2,
}

/// The results of the searches from every cell.
#[derive(Debug, Default)]
struct Lists {
    /// Indices of edges, cell after cell.
    edges: Vec<u32>,
    /// Where the list of each cell starts in `edges`, row by row from the south-west, and the end of the last
    /// one.
    starts: Vec<u32>,
}

impl EdgesByCell {
    /// Prepares the edges of all obstacles for units that see edges nearer than `range`.
    pub fn new(terrain: &Terrain, range: f64) -> EdgesByCell {
        let (columns, rows) = (terrain.width() as usize + 2, terrain.height() as usize + 2);
        let partition = Partition::new(terrain.obstacles().iter().flat_map(outline).collect());
        let last = Vec2::new((columns - 1) as f32, (rows - 1) as f32);
        // The exact check rounds, and must not find an edge that was excluded here: hence the margin.
        let sight = range as f32 + 0.01;
        let mut cells = EdgesByCell { partition, range: sight, lists: None, longest_list: 0, columns, last };
        cells.lists = cells.search_all(columns * rows);
        cells.longest_list = match &cells.lists {
            Some(lists) => {
                lists.starts.windows(2).map(|ends| (ends[1] - ends[0]) as usize).max().unwrap_or(0)
            }
            // An edge is at least one square long, so there are no more edges than squares of outline.
            None => terrain.outline_in_sight(range),
        };
        cells
    }

    /// The lists of all cells; `None` if they have too many entries.
    fn search_all(&self, n_cells: usize) -> Option<Lists> {
        let mut lists = Lists { edges: Vec::new(), starts: vec![0] };
        for cell in 0..n_cells {
            self.search(cell, &mut lists.edges);
            if lists.edges.len() > MAX_ENTRIES {
                return None;
            }
            lists.starts.push(lists.edges.len() as u32);
        }
        Some(lists)
    }

    fn search(&self, cell: usize, list: &mut Vec<u32>) {
        // Cell (0, 0) belongs to the ring around the map: its south-west corner is at (-1, -1).
        let south_west = Vec2::new((cell % self.columns) as f32, (cell / self.columns) as f32) - Vec2::ONE;
        self.partition.visit(south_west, self.range, list);
    }

    /// The cells of positions, as [`may_see`](Self::may_see) and [`near`](Self::near) take them: with the
    /// number of the cell in the low bits, which saves a conversion.
    #[inline(always)]
    pub fn cells<S: Lanes>(&self, positions: Vectors<S>) -> Floats<S> {
        let simd = positions.x.simd();
        // A unit beyond the ring uses the nearest cell of it. That cell is on the same side of all edges, and
        // not farther from any of them, so its list contains all edges that the unit sees.
        let column = (positions.x.floor() + Floats::splat(simd, 1.0))
            .max(Floats::splat(simd, 0.0))
            .min(Floats::splat(simd, self.last.x));
        let row = (positions.y.floor() + Floats::splat(simd, 1.0))
            .max(Floats::splat(simd, 0.0))
            .min(Floats::splat(simd, self.last.y));
        // Exact: there are fewer cells than that.
        row * Floats::splat(simd, self.columns as f32) + column + Floats::splat(simd, CELL_BASE)
    }

    /// Whether [`near`](Self::near) has any edges.
    #[inline(always)]
    pub fn may_see(&self, cell: f32) -> bool {
        let Some(lists) = &self.lists else { return true };
        let ends = &lists.starts[number(cell)..][..2];
        ends[0] != ends[1]
    }

    /// The indices of the edges that may be in sight of a position in this cell. `searched` is working
    /// memory.
    pub fn near<'a>(&'a self, cell: f32, searched: &'a mut Vec<u32>) -> &'a [u32] {
        let cell = number(cell);
        match &self.lists {
            Some(lists) => &lists.edges[lists.starts[cell] as usize..lists.starts[cell + 1] as usize],
            None => {
                searched.clear();
                self.search(cell, searched);
                searched
            }
        }
    }

    /// The largest number of edges that may be in sight of a position.
    pub fn longest_list(&self) -> usize {
        self.longest_list
    }

    /// The edge with this index.
    pub fn edge(&self, index: u32) -> &Edge {
        &self.partition.edges[index as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell_of(cells: &EdgesByCell, position: Vec2) -> f32 {
        cells.cells(Vectors::splat(pulp::Scalar, position)).each()[0]
    }

    #[test]
    fn a_search_finds_what_is_in_the_list() {
        let mut terrains: Vec<Terrain> = Terrain::preset_names().filter_map(Terrain::preset).collect();
        terrains.push(Terrain::from_fn(48, 48, |x, y| (x * 7 + y * y * 3) % 5 > 1).unwrap());
        for terrain in &terrains {
            let listed = EdgesByCell::new(terrain, 3.75);
            let searched = EdgesByCell { lists: None, ..EdgesByCell::new(terrain, 3.75) };
            let (mut none, mut found) = (Vec::new(), Vec::new());
            for cell in 0..searched.columns * 50 {
                let position =
                    Vec2::new((cell % searched.columns) as f32, (cell / searched.columns) as f32) - 0.5;
                let expected = listed.near(cell_of(&listed, position), &mut none);
                assert_eq!(
                    searched.near(cell_of(&searched, position), &mut found),
                    expected,
                    "{position} of {terrain:?}"
                );
                assert!(found.len() <= terrain.outline_in_sight(3.75), "{position} of {terrain:?}");
            }
            assert!(none.is_empty() && listed.longest_list() > 0);
        }
    }

    /// Loading a checkerboard took five minutes, with a list for each cell. Triangles are maps of rectangles
    /// that overlap, with up to a thousand edges in one spot.
    #[test]
    fn large_maps_have_no_list_per_cell() {
        let checkerboard = Terrain::from_fn(1024, 1024, |x, y| (x + y) % 2 == 0).unwrap();
        let triangle = Terrain::from_fn(1024, 1024, |x, y| x + y < 1024).unwrap();
        for terrain in [checkerboard, triangle] {
            let cells = EdgesByCell::new(&terrain, 4.0);
            assert!(cells.lists.is_none() && cells.longest_list() < 100_000);
            let mut found = Vec::new();
            let corner = cells.near(cell_of(&cells, Vec2::new(511.5, 511.5)), &mut found).to_vec();
            assert!(!corner.is_empty() && corner.len() <= cells.longest_list());
        }
    }
}
