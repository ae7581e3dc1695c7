//! The map: which squares can be walked on, the eight presets, and the reader of inline maps.

use crate::obstacles;
use crate::sight::Outlines;
use smaclite_units::Word;
use smaclite_units::file::{FileError, Json, Node, Object};

/// The longest side a map may have, in squares.
pub const MAX_SIDE: u32 = 1024;

/// Side of every terrain preset, and of a map whose file does not say.
const DEFAULT_SIDE: u32 = 32;

const WALKABLE: char = '_';
const BLOCKED: char = 'X';

/// A blocked rectangle in squares, half-open: `[x0, x1)` x `[y0, y1)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// West edge.
    pub x0: u32,
    /// South edge.
    pub y0: u32,
    /// East edge.
    pub x1: u32,
    /// North edge.
    pub y1: u32,
}

/// A map of walkable and blocked squares. x grows east, y grows north.
///
/// ```
/// use smaclite_scenarios::Terrain;
///
/// let corridor = Terrain::preset("CORRIDOR").unwrap();
/// assert!(corridor.is_walkable(2, 1) && !corridor.is_walkable(1, 1));
/// assert!(!corridor.is_walkable(-1, 1), "off the map");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Terrain {
    width: u32,
    height: u32,
    /// Row-major, row y = 0 first.
    walkable: Vec<bool>,
    obstacles: Vec<Rect>,
}

impl Terrain {
    /// A map from its squares, row y = 0 first, west to east in a row. `None` if a side is not in
    /// `1..=`[`MAX_SIDE`] or there are not `width * height` squares.
    pub fn new(width: u32, height: u32, walkable: Vec<bool>) -> Option<Terrain> {
        let sides = 1..=MAX_SIDE;
        if !sides.contains(&width) || !sides.contains(&height) || walkable.len() != (width * height) as usize
        {
            return None;
        }
        let mut terrain = Terrain { width, height, walkable, obstacles: Vec::new() };
        terrain.obstacles = obstacles::rectangles(&terrain);
        Some(terrain)
    }

    /// The terrain preset of that name (`"SIMPLE"`, in capitals), if there is one.
    pub fn preset(name: &str) -> Option<Terrain> {
        Preset::WORDS.iter().find(|(word, _)| *word == name)?.1.terrain()
    }

    /// The names of the terrain presets, in alphabetical order.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        Preset::WORDS.iter().map(|(name, _)| *name)
    }

    /// Number of squares from west to east.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Number of squares from south to north.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Whether square (x, y) can be walked on; false off the map.
    pub fn is_walkable(&self, x: i64, y: i64) -> bool {
        let inside = (0..i64::from(self.width)).contains(&x) && (0..i64::from(self.height)).contains(&y);
        inside && self.walkable[y as usize * self.width as usize + x as usize]
    }

    /// The blocked squares as rectangles, which may overlap, in the order a scan from the south-west finds
    /// them.
    pub fn obstacles(&self) -> &[Rect] {
        &self.obstacles
    }

    /// How many squares of obstacle outline may be within `range` of a square, at most. No scenario file has
    /// a ground unit with more than [`MAX_OUTLINE_IN_SIGHT`](crate::MAX_OUTLINE_IN_SIGHT) in sight.
    pub fn outline_in_sight(&self, range: f64) -> usize {
        Outlines::of(self).most_in_sight(range)
    }

    /// Reads `terrain_preset` or `terrain`, `width` and `height` of a scenario file.
    pub(crate) fn read(file: &Object) -> Result<Terrain, FileError> {
        let width = side(file, "width")?;
        let height = side(file, "height")?;
        match (file.get("terrain_preset"), file.get("terrain")) {
            (Some(preset), None) => read_preset(file, &preset),
            (None, Some(rows)) => read_rows(&rows, width, height),
            (Some(preset), Some(_)) => Err(preset.invalid("left out, because `terrain` draws the map")),
            (None, None) => {
                let names = Terrain::preset_names().collect::<Vec<_>>().join(", ");
                let expected = format!("one of {names}; or `terrain` draws the map");
                Err(file.missing("terrain_preset", &expected))
            }
        }
    }
}

/// A preset's drawing: `_` walkable, `X` blocked, north row first.
#[derive(Clone, Copy)]
struct Preset(&'static str);

impl Word for Preset {
    const WORDS: &'static [(&'static str, Preset)] = &[
        ("ALL_GREEN", Preset(include_str!("../terrains/ALL_GREEN.txt"))),
        ("CHECKERBOARD", Preset(include_str!("../terrains/CHECKERBOARD.txt"))),
        ("CORRIDOR", Preset(include_str!("../terrains/CORRIDOR.txt"))),
        ("NARROW", Preset(include_str!("../terrains/NARROW.txt"))),
        ("OCTAGON", Preset(include_str!("../terrains/OCTAGON.txt"))),
        ("PENTAGON", Preset(include_str!("../terrains/PENTAGON.txt"))),
        ("RAVINE", Preset(include_str!("../terrains/RAVINE.txt"))),
        ("SIMPLE", Preset(include_str!("../terrains/SIMPLE.txt"))),
    ];
}

impl Preset {
    /// `None` never happens: a test reads every preset.
    fn terrain(self) -> Option<Terrain> {
        let squares = self.0.lines().rev().flat_map(str::chars).map(|square| square == WALKABLE);
        Terrain::new(DEFAULT_SIDE, DEFAULT_SIDE, squares.collect())
    }
}

fn side(file: &Object, key: &str) -> Result<u32, FileError> {
    file.get(key).map_or(Ok(DEFAULT_SIDE), |node| node.integer(1, MAX_SIDE))
}

fn read_preset(file: &Object, name: &Node) -> Result<Terrain, FileError> {
    let preset: Preset = name.word()?;
    for side in ["width", "height"].iter().filter_map(|key| file.get(key)) {
        if side.integer(1, MAX_SIDE)? != DEFAULT_SIDE {
            return Err(side.invalid(format!("{DEFAULT_SIDE}, the size of the terrain presets")));
        }
    }
    preset.terrain().ok_or_else(|| name.invalid("a preset of 32 x 32 squares"))
}

/// Reads rows of `_` and `X`, row y = 0 first; a row is one string, or a list of strings that make it up.
fn read_rows(rows: &Node, width: u32, height: u32) -> Result<Terrain, FileError> {
    let size = |key, side| match side {
        DEFAULT_SIDE => format!("as `{key}` says (32 if it is left out)"),
        _ => format!("as `{key}` says"),
    };
    let items = rows.items()?;
    if items.len() != height as usize {
        return Err(rows.invalid(format!("a list of {height} rows, {}", size("height", height))));
    }
    let mut walkable = Vec::with_capacity(width as usize * height as usize);
    for row in &items {
        let squares = row_text(row)?;
        if let Some(wrong) = squares.chars().find(|square| ![WALKABLE, BLOCKED].contains(square)) {
            let expected = "made of `_` (walkable) and `X` (blocked)";
            return Err(row.invalid(format!("{expected}, without {wrong:?}")));
        }
        if squares.len() != width as usize {
            let expected = format!("a row of {width} squares, {}", size("width", width));
            return Err(row.invalid(format!("{expected}; it has {}", squares.len())));
        }
        walkable.extend(squares.chars().map(|square| square == WALKABLE));
    }
    Terrain::new(width, height, walkable).ok_or_else(|| rows.invalid("a rectangular map"))
}

fn row_text(row: &Node) -> Result<String, FileError> {
    let Json::Array(_) = row.json() else {
        return row.text(usize::MAX).map(str::to_owned).map_err(|_| row.invalid("a string of `_` and `X`"));
    };
    row.items()?.iter().map(|item| item.text(MAX_SIDE as usize)).collect()
}
