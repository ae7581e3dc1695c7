//! For every square of the map, the obstacle edges that a unit in it may see, in the order in which a search
//! of the partition visits them.
//!
//! Edges lie on the lines of the grid, so all points inside a square are on the same side of each of them:
//! one list is valid for a whole square. The exact distance is checked for each unit
//! (`tick::avoid::obstacles`).

use std::collections::HashMap;

use glam::Vec2;
use smaclite_scenarios::Terrain;

use super::edges::{Edge, outline};
use super::partition::Partition;
use crate::buffers::clear_and_reserve;
use crate::simd::{Column, F32s, InstructionSet, MAX_WIDTH, Vec2s, x4};

/// The largest number of blocks of the lists of all squares together: 40 MiB. The lists exist only for speed,
/// and far beyond the size of the processor's caches they are not faster than the search.
const MAX_BLOCKS: usize = 1 << 17;

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
    /// Cells with the same edges share their blocks.
    blocks: Vec<EdgeBlock>,
    /// First block of each cell, and the one behind the last, row by row from the south-west.
    by_cell: Vec<[u32; 2]>,
    longest: usize,
}

/// Some edges of a list, one per entry from the first on: what decides whether a unit sees them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeBlock {
    pub start: [Column; 2],
    /// The same as `start` in an entry without an edge.
    pub end: [Column; 2],
    /// Their indices, or [`EdgeBlock::NO_EDGE`].
    pub numbers: [u32; MAX_WIDTH],
}

impl EdgeBlock {
    /// There are fewer edges than that.
    pub const NO_EDGE: u32 = u32::MAX;
    const EMPTY: EdgeBlock = EdgeBlock {
        start: [Column::ZERO; 2],
        end: [Column::ZERO; 2],
        numbers: [EdgeBlock::NO_EDGE; MAX_WIDTH],
    };
}

/// Working memory of a search.
#[derive(Debug, Default)]
pub(crate) struct EdgeSearch {
    numbers: Vec<u32>,
    blocks: Vec<EdgeBlock>,
}

impl EdgeSearch {
    /// Reserves memory for `n` results.
    pub fn reserve(&mut self, n: usize) {
        clear_and_reserve(&mut self.numbers, n);
        clear_and_reserve(&mut self.blocks, n.div_ceil(MAX_WIDTH));
    }
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
            Some(lists) => lists.longest,
            // An edge is at least one square long, so there are no more edges than squares of outline.
            None => terrain.outline_in_sight(range),
        };
        cells
    }

    /// The lists of all cells; `None` if they have too many blocks.
    fn search_all(&self, n_cells: usize) -> Option<Lists> {
        let mut lists = Lists::default();
        let mut known = HashMap::new();
        for cell in 0..n_cells {
            let mut numbers = Vec::new();
            self.search(cell, &mut numbers);
            lists.longest = lists.longest.max(numbers.len());
            let blocks = &mut lists.blocks;
            let range = *known.entry(numbers).or_insert_with_key(|numbers| {
                let first = blocks.len();
                blocks.extend(self.blocks(numbers));
                [first, blocks.len()].map(|block| block as u32)
            });
            if blocks.len() > MAX_BLOCKS {
                return None;
            }
            lists.by_cell.push(range);
        }
        Some(lists)
    }

    /// A list of edges in blocks.
    fn blocks(&self, numbers: &[u32]) -> impl Iterator<Item = EdgeBlock> {
        numbers.chunks(MAX_WIDTH).map(|numbers| {
            let mut block = EdgeBlock::EMPTY;
            for (entry, &number) in numbers.iter().enumerate() {
                let edge = self.edge(number);
                for (columns, point) in [(&mut block.start, edge.start), (&mut block.end, edge.end)] {
                    let [x, y] = columns;
                    (x[entry], y[entry]) = point.into();
                }
                block.numbers[entry] = number;
            }
            block
        })
    }

    fn search(&self, cell: usize, list: &mut Vec<u32>) {
        // Cell (0, 0) belongs to the ring around the map: its south-west corner is at (-1, -1).
        let south_west = Vec2::new((cell % self.columns) as f32, (cell / self.columns) as f32) - Vec2::ONE;
        self.partition.visit(south_west, self.range, list);
    }

    /// The cells of positions, as [`may_see`](Self::may_see) and [`near`](Self::near) take them: with the
    /// number of the cell in the low bits, which saves a conversion.
    #[inline(always)]
    pub fn cells<S: InstructionSet>(&self, positions: Vec2s<S>) -> F32s<S> {
        let simd = positions.x.simd();
        // A unit beyond the ring uses the nearest cell of it. That cell is on the same side of all edges, and
        // not farther from any of them, so its list contains all edges that the unit sees.
        let column = (positions.x.floor() + F32s::splat(simd, 1.0))
            .max(F32s::splat(simd, 0.0))
            .min(F32s::splat(simd, self.last.x));
        let row = (positions.y.floor() + F32s::splat(simd, 1.0))
            .max(F32s::splat(simd, 0.0))
            .min(F32s::splat(simd, self.last.y));
        // Exact: there are fewer cells than that.
        row * F32s::splat(simd, self.columns as f32) + column + F32s::splat(simd, CELL_BASE)
    }

    /// The [cell](Self::cells) of one position.
    #[inline(always)]
    pub fn cell(&self, position: Vec2) -> f32 {
        let [cell, ..] = self.cells(Vec2s::splat(x4::four(), position)).to_array();
        cell
    }

    /// Whether [`near`](Self::near) has any edges.
    #[inline(always)]
    pub fn may_see(&self, cell: f32) -> bool {
        let Some(lists) = &self.lists else { return true };
        let [first, end] = lists.by_cell[number(cell)];
        first != end
    }

    /// The edges that may be in sight of a position in this cell.
    #[inline(always)]
    pub fn near<'a>(&'a self, cell: f32, search: &'a mut EdgeSearch) -> &'a [EdgeBlock] {
        let cell = number(cell);
        let Some(lists) = &self.lists else { return self.search_now(cell, search) };
        let [first, end] = lists.by_cell[cell];
        &lists.blocks[first as usize..end as usize]
    }

    #[cold]
    fn search_now<'a>(&self, cell: usize, search: &'a mut EdgeSearch) -> &'a [EdgeBlock] {
        search.numbers.clear();
        self.search(cell, &mut search.numbers);
        search.blocks.clear();
        search.blocks.extend(self.blocks(&search.numbers));
        &search.blocks
    }

    /// The largest number of edges that may be in sight of a position.
    pub fn longest_list(&self) -> usize {
        self.longest_list
    }

    /// How many edges there are.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.partition.edges.len()
    }

    /// The edge with this index.
    pub fn edge(&self, index: u32) -> &Edge {
        &self.partition.edges[index as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(blocks: &[EdgeBlock]) -> Vec<u32> {
        let numbers = blocks.iter().flat_map(|block| block.numbers);
        numbers.filter(|number| *number != EdgeBlock::NO_EDGE).collect()
    }

    #[test]
    fn a_search_finds_what_is_in_the_list() {
        let terrains = Terrain::preset_names().filter_map(Terrain::preset);
        let mut terrains: Vec<Terrain> = terrains.filter(|terrain| !terrain.obstacles().is_empty()).collect();
        terrains.push(Terrain::from_fn(48, 48, |x, y| (x * 7 + y * y * 3) % 5 > 1).unwrap());
        for terrain in &terrains {
            let listed = EdgesByCell::new(terrain, 3.75);
            let searched = EdgesByCell { lists: None, ..EdgesByCell::new(terrain, 3.75) };
            let (mut none, mut found) = (EdgeSearch::default(), EdgeSearch::default());
            for cell in 0..searched.columns * 50 {
                let position =
                    Vec2::new((cell % searched.columns) as f32, (cell / searched.columns) as f32) - 0.5;
                let expected = numbers(listed.near(listed.cell(position), &mut none));
                let found = numbers(searched.near(searched.cell(position), &mut found));
                assert_eq!(found, expected, "{position} of {terrain:?}");
                assert!(found.len() <= terrain.outline_in_sight(3.75), "{position} of {terrain:?}");
            }
            assert!(none.blocks.is_empty() && listed.longest_list() > 0);
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
            let mut found = EdgeSearch::default();
            let corner = numbers(cells.near(cells.cell(Vec2::new(511.5, 511.5)), &mut found));
            assert!(!corner.is_empty() && corner.len() <= cells.longest_list());
        }
    }
}
