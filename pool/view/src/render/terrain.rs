//! The layer below all units, drawn once: floor, blocked squares, and the border of the map.

use glam::Vec2;
use smaclite_scenarios::Terrain;
use tiny_skia::{FillRule, Pixmap};

use super::camera::{Camera, Region};
use super::canvas::Canvas;
use super::theme::Palette;

/// With fewer pixels per square, outlines and corners would only blur the map; more outlines would take
/// seconds.
const MIN_SCALE_OF_OUTLINES: f32 = 3.0;
const MAX_OUTLINES: usize = 20_000;
/// In squares: the visible height of walls, and the radius of the corners of blocked areas.
const WALL: f32 = 0.28;
const CORNER: f32 = 0.22;
/// Squares between the lines of the grid, and the scale from which on they do not crowd the map.
const GRID: i64 = 4;
const MIN_SCALE_OF_GRID: f32 = 8.0;

/// Draws the layer; `None` if the size is 0 or too large.
pub(crate) fn draw(
    terrain: &Terrain,
    camera: &Camera,
    palette: &Palette,
    width: u32,
    height: u32,
) -> Option<Pixmap> {
    let mut canvas = Canvas::new(width, height, palette.void)?;
    let layer = Layer { terrain, camera, palette, window: Window::visible(terrain, camera, width, height) };
    let is_large_enough = camera.scale >= MIN_SCALE_OF_OUTLINES;
    match is_large_enough.then(|| layer.outlines()).filter(|outlines| outlines.len() <= MAX_OUTLINES) {
        Some(outlines) => layer.draw_fine(&mut canvas, &outlines),
        None => layer.draw_coarse(&mut canvas),
    }
    layer.draw_border(&mut canvas);
    Some(canvas.into_pixels())
}

/// The squares of the map that are visible, half-open.
struct Window {
    x: std::ops::Range<i64>,
    y: std::ops::Range<i64>,
}

impl Window {
    fn visible(terrain: &Terrain, camera: &Camera, width: u32, height: u32) -> Window {
        let south_west = camera.square(Vec2::new(0.0, height as f32));
        let north_east = camera.square(Vec2::new(width as f32, 0.0));
        let range = |from: f32, to: f32, side: u32| {
            (from.floor() as i64 - 1).max(0)..(to.ceil() as i64 + 1).min(i64::from(side))
        };
        Window {
            x: range(south_west.x, north_east.x, terrain.width()),
            y: range(south_west.y, north_east.y, terrain.height()),
        }
    }
}

struct Layer<'a> {
    terrain: &'a Terrain,
    camera: &'a Camera,
    palette: &'a Palette,
    window: Window,
}

impl Layer<'_> {
    fn is_floor(&self, x: i64, y: i64) -> bool {
        self.window.x.contains(&x) && self.window.y.contains(&y) && self.terrain.is_walkable(x, y)
    }

    fn pixel(&self, x: f32, y: f32) -> Vec2 {
        self.camera.pixel(Vec2::new(x, y))
    }

    fn rectangle(&self, min: Vec2, max: Vec2) -> [Vec2; 4] {
        [min, Vec2::new(max.x, min.y), max, Vec2::new(min.x, max.y)].map(|corner| self.camera.pixel(corner))
    }

    fn map(&self) -> [Vec2; 4] {
        let Region { min, max } = Region::map(self.terrain);
        self.rectangle(min, max)
    }

    /// Gives each pixel the mean colour of four points in it.
    fn draw_coarse(&self, canvas: &mut Canvas) {
        canvas.fill(self.map(), self.palette.blocked);
        let is_floor = |x: f32, y: f32| {
            let square = self.camera.square(Vec2::new(x, y)).floor();
            self.terrain.is_walkable(square.x as i64, square.y as i64)
        };
        canvas.fill_pixels(self.palette.floor, |x, y| {
            let points = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)];
            let on_floor = points.iter().filter(|(dx, dy)| is_floor(x as f32 + dx, y as f32 + dy)).count();
            on_floor as f32 / points.len() as f32
        });
    }

    /// The runs of columns that have a property, half-open.
    fn runs(&self, has: impl Fn(i64) -> bool) -> Vec<(i64, i64)> {
        let mut runs: Vec<(i64, i64)> = Vec::new();
        for x in self.window.x.clone().filter(|&x| has(x)) {
            match runs.last_mut() {
                Some((_, end)) if *end == x => *end += 1,
                _ => runs.push((x, x + 1)),
            }
        }
        runs
    }

    fn draw_fine(&self, canvas: &mut Canvas, outlines: &[Vec<Vec2>]) {
        canvas.fill(self.map(), self.palette.floor);
        if self.camera.scale >= MIN_SCALE_OF_GRID {
            self.draw_grid(canvas);
        }
        self.draw_walls(canvas);
        // Blocked squares are the map without the outlined areas of floor; this also cuts off what the grid
        // and the walls have drawn beyond the floor's round corners.
        let add_outlines = |canvas: &mut Canvas| {
            for outline in outlines {
                canvas.add_rounded(outline, CORNER * self.camera.scale);
            }
        };
        canvas.add(self.map());
        add_outlines(canvas);
        canvas.fill_path(self.palette.blocked, FillRule::EvenOdd);
        add_outlines(canvas);
        canvas.stroke_path(self.palette.edge, self.line_width());
    }

    fn line_width(&self) -> f32 {
        (self.camera.scale / 16.0).clamp(1.0, 4.0)
    }

    fn draw_grid(&self, canvas: &mut Canvas) {
        let Window { x, y } = &self.window;
        let ink = self.palette.grid;
        for x in x.clone().filter(|x| x % GRID == 0) {
            let (from, to) = (self.pixel(x as f32, y.start as f32), self.pixel(x as f32, y.end as f32));
            canvas.line(from, to, 1.0, 1.0, ink);
        }
        for y in y.clone().filter(|y| y % GRID == 0) {
            let (from, to) = (self.pixel(x.start as f32, y as f32), self.pixel(x.end as f32, y as f32));
            canvas.line(from, to, 1.0, 1.0, ink);
        }
    }

    /// The south sides of blocked squares.
    fn draw_walls(&self, canvas: &mut Canvas) {
        for y in self.window.y.clone() {
            let is_below_wall = |x| {
                let map_goes_on = y + 1 < i64::from(self.terrain.height());
                self.is_floor(x, y) && map_goes_on && !self.terrain.is_walkable(x, y + 1)
            };
            for (x0, x1) in self.runs(is_below_wall) {
                let top = y as f32 + 1.0;
                let south_west = Vec2::new(x0 as f32, top - WALL);
                canvas.add(self.rectangle(south_west, Vec2::new(x1 as f32, top)));
            }
        }
        canvas.fill_path(self.palette.wall, FillRule::Winding);
    }

    fn draw_border(&self, canvas: &mut Canvas) {
        canvas.add(self.map());
        canvas.stroke_path(self.palette.edge, self.line_width());
    }

    /// The corners of the closed lines between floor and blocked squares, in pixels. Squares of floor that
    /// only touch at a corner have separate lines.
    fn outlines(&self) -> Vec<Vec<Vec2>> {
        let mut edges = Edges::new(self);
        let mut outlines = Vec::new();
        for y in self.window.y.clone() {
            for x in self.window.x.clone() {
                while edges.take(x, y, EAST) {
                    outlines.push(edges.follow(x, y, |x, y| self.pixel(x as f32, y as f32)));
                }
            }
        }
        outlines
    }
}

const EAST: usize = 0;
/// East, north, west, south: each is a left turn from the one before.
const DIRECTIONS: [(i64, i64); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// The sides of squares between floor and blocked squares, directed so that the floor is on the left.
struct Edges {
    /// Bit `d` of a corner: whether a side leaves it in direction `d`.
    leaving: Vec<u8>,
    west: i64,
    south: i64,
    columns: i64,
}

impl Edges {
    fn new(layer: &Layer<'_>) -> Edges {
        let Window { x, y } = &layer.window;
        let (columns, rows) = ((x.end - x.start + 1).max(0), (y.end - y.start + 1).max(0));
        let leaving = vec![0; (columns * rows) as usize];
        let mut edges = Edges { leaving, west: x.start, south: y.start, columns };
        for y in y.clone() {
            for x in x.clone().filter(|&x| layer.is_floor(x, y)) {
                // Around a square counterclockwise: its corner and the neighbour across the side that starts
                // there.
                let sides =
                    [(x, y, x, y - 1), (x + 1, y, x + 1, y), (x + 1, y + 1, x, y + 1), (x, y + 1, x - 1, y)];
                for (direction, (from_x, from_y, beyond_x, beyond_y)) in sides.into_iter().enumerate() {
                    if !layer.is_floor(beyond_x, beyond_y) {
                        let index = edges.index(from_x, from_y);
                        edges.leaving[index] |= 1 << direction;
                    }
                }
            }
        }
        edges
    }

    fn index(&self, x: i64, y: i64) -> usize {
        ((y - self.south) * self.columns + x - self.west) as usize
    }

    /// Removes a side; whether it was there.
    fn take(&mut self, x: i64, y: i64, direction: usize) -> bool {
        let index = self.index(x, y);
        let was_there = self.leaving[index] >> direction & 1 == 1;
        self.leaving[index] &= !(1 << direction);
        was_there
    }

    /// Removes the closed line whose side to the east of a corner was removed; returns its corners.
    fn follow(&mut self, start_x: i64, start_y: i64, pixel: impl Fn(i64, i64) -> Vec2) -> Vec<Vec2> {
        let mut corners = Vec::new();
        let (mut x, mut y, mut direction) = (start_x + 1, start_y, EAST);
        loop {
            // Left first, which keeps squares apart that touch at this corner; never back.
            let turn = [1, 0, 3].into_iter().find(|turn| self.take(x, y, (direction + turn) % 4));
            let Some(turn) = turn else { break };
            if turn != 0 {
                corners.push(pixel(x, y));
            }
            direction = (direction + turn) % 4;
            x += DIRECTIONS[direction].0;
            y += DIRECTIONS[direction].1;
        }
        // The line is closed: it ends where it started, and there is a corner unless it goes straight on.
        if direction != EAST {
            corners.push(pixel(start_x, start_y));
        }
        corners
    }
}
