//! For every square of the map, the obstacle edges that a unit in it may see, in the order in which it meets
//! them.
//!
//! Edges lie on the lines of the grid, so all points inside a square are on the same side of each of them;
//! that is why one list serves a whole square. Distances are checked again by the unit that asks.

use glam::Vec2;
use smaclite_scenarios::Terrain;

use super::edges::{Edge, outline};
use super::partition::Partition;

/// The most entries that the lists of all squares may have together: 16 MiB. They are made for speed alone,
/// and beyond the processor's caches they are not faster than the search.
const MOST_ENTRIES: usize = 1 << 22;

/// The edges to consider in each square, with one ring of squares around the map for whoever leaves it.
#[derive(Debug)]
pub(crate) struct EdgesByCell {
    partition: Partition,
    range: f32,
    /// `None` on maps with so many edges that every search is made when it is asked for.
    lists: Option<Lists>,
    longest_list: usize,
    columns: usize,
    /// Column and row of the cell in the north-east.
    last: Vec2,
}

/// The results of the searches from every cell.
#[derive(Debug, Default)]
struct Lists {
    /// Numbers of edges, cell after cell.
    edges: Vec<u32>,
    /// Where the list of each cell starts in `edges`, row by row from the south-west, and one last end.
    starts: Vec<u32>,
}

impl EdgesByCell {
    /// Prepares the edges of all obstacles for units that see edges nearer than `range`.
    pub fn new(terrain: &Terrain, range: f64) -> EdgesByCell {
        let (columns, rows) = (terrain.width() as usize + 2, terrain.height() as usize + 2);
        let partition = Partition::new(terrain.obstacles().iter().flat_map(outline).collect());
        let last = Vec2::new((columns - 1) as f32, (rows - 1) as f32);
        // Rounding in the exact check must not let in what was left out here.
        let sight = range as f32 + 0.01;
        let mut cells = EdgesByCell { partition, range: sight, lists: None, longest_list: 0, columns, last };
        cells.lists = cells.search_all(columns * rows);
        cells.longest_list = match &cells.lists {
            Some(lists) => {
                lists.starts.windows(2).map(|ends| (ends[1] - ends[0]) as usize).max().unwrap_or(0)
            }
            None => terrain.outline_in_sight(range),
        };
        cells
    }

    /// The lists of all cells; `None` if they have too many entries.
    fn search_all(&self, n_cells: usize) -> Option<Lists> {
        let mut lists = Lists { edges: Vec::new(), starts: vec![0] };
        for cell in 0..n_cells {
            self.search(cell, &mut lists.edges);
            if lists.edges.len() > MOST_ENTRIES {
                return None;
            }
            lists.starts.push(lists.edges.len() as u32);
        }
        Some(lists)
    }

    fn search(&self, cell: usize, list: &mut Vec<u32>) {
        let south_west = Vec2::new((cell % self.columns) as f32, (cell / self.columns) as f32) - Vec2::ONE;
        self.partition.visit(south_west, self.range, list);
    }

    /// The numbers of the edges that may be in sight of `position`; its square lies outside all of them.
    /// `searched` is working memory.
    pub fn near<'a>(&'a self, position: Vec2, searched: &'a mut Vec<u32>) -> &'a [u32] {
        let cell = (position.floor() + Vec2::ONE).max(Vec2::ZERO).min(self.last).as_uvec2();
        let cell = cell.y as usize * self.columns + cell.x as usize;
        match &self.lists {
            Some(lists) => &lists.edges[lists.starts[cell] as usize..lists.starts[cell + 1] as usize],
            None => {
                searched.clear();
                self.search(cell, searched);
                searched
            }
        }
    }

    /// How many edges may be in sight of a position at most.
    pub fn longest_list(&self) -> usize {
        self.longest_list
    }

    /// The edge of that number.
    pub fn edge(&self, number: u32) -> &Edge {
        &self.partition.edges[number as usize]
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    fn map(side: u32, is_walkable: impl Fn(u32, u32) -> bool) -> Terrain {
        let squares = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
        Terrain::new(side, side, squares.map(|(x, y)| is_walkable(x, y)).collect()).unwrap()
    }

    #[test]
    fn a_search_finds_what_is_in_the_list() {
        let mut terrains: Vec<Terrain> = Terrain::preset_names().filter_map(Terrain::preset).collect();
        terrains.push(map(48, |x, y| (x * 7 + y * y * 3) % 5 > 1));
        for terrain in &terrains {
            let listed = EdgesByCell::new(terrain, 3.75);
            let searched = EdgesByCell { lists: None, ..EdgesByCell::new(terrain, 3.75) };
            let (mut none, mut found) = (Vec::new(), Vec::new());
            for cell in 0..searched.columns * 50 {
                let position =
                    Vec2::new((cell % searched.columns) as f32, (cell / searched.columns) as f32) - 0.5;
                let expected = listed.near(position, &mut none);
                assert_eq!(searched.near(position, &mut found), expected, "{position} of {terrain:?}");
                assert!(found.len() <= terrain.outline_in_sight(3.75), "{position} of {terrain:?}");
            }
            assert!(none.is_empty() && listed.longest_list() > 0);
        }
    }

    /// Loading a checkerboard took five minutes. Triangles are maps of rectangles that overlap, with up to a
    /// thousand edges in one spot.
    #[test]
    fn large_maps_are_prepared_at_once() {
        let begin = Instant::now();
        for terrain in [map(1024, |x, y| (x + y) % 2 == 0), map(1024, |x, y| x + y < 1024)] {
            let cells = EdgesByCell::new(&terrain, 4.0);
            assert!(cells.lists.is_none() && cells.longest_list() < 100_000);
            let mut found = Vec::new();
            let corner = cells.near(Vec2::new(511.5, 511.5), &mut found).to_vec();
            assert!(!corner.is_empty() && corner.len() <= cells.longest_list());
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "{:?}", begin.elapsed());
    }
}
