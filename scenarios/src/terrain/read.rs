//! The reader of `terrain_preset`, `terrain`, `width` and `height` of scenario files.

use super::{DEFAULT_SIDE, MAX_SIDE, Terrain, WALKABLE};
use smaclite_units::file::{FileError, Json, Node, Object};

/// A blocked square in files.
const BLOCKED: char = 'X';

impl Terrain {
    /// Reads the map of a scenario file: a preset, or rows of squares.
    pub(crate) fn read(file: &Object) -> Result<Terrain, FileError> {
        let width = side(file, "width")?;
        let height = side(file, "height")?;
        match (file.get("terrain_preset"), file.get("terrain")) {
            (Some(preset), None) => read_preset(file, &preset),
            (None, Some(rows)) => read_rows(&rows, width, height),
            (Some(preset), Some(_)) => Err(preset.invalid("left out, because `terrain` defines the map")),
            (None, None) => {
                let names = Terrain::preset_names().collect::<Vec<_>>().join(", ");
                let expected = format!("one of {names}; or `terrain` must define the map");
                Err(file.missing("terrain_preset", &expected))
            }
        }
    }
}

fn side(file: &Object, key: &str) -> Result<u32, FileError> {
    file.get(key).map_or(Ok(DEFAULT_SIDE), |node| node.integer(1, MAX_SIDE))
}

fn read_preset(file: &Object, name: &Node) -> Result<Terrain, FileError> {
    let preset = name.one_of(&Terrain::preset_names().collect::<Vec<_>>())?;
    for side in ["width", "height"].iter().filter_map(|key| file.get(key)) {
        if side.integer(1, MAX_SIDE)? != DEFAULT_SIDE {
            return Err(side.invalid(format!("{DEFAULT_SIDE}, the size of the terrain presets")));
        }
    }
    Terrain::preset(preset).ok_or_else(|| name.invalid("a preset of 32 x 32 squares"))
}

/// Reads rows of `_` and `X`, row y = 0 first; a row is one string, or a list of strings that are joined.
fn read_rows(rows: &Node, width: u32, height: u32) -> Result<Terrain, FileError> {
    let size = |key, side| match side {
        DEFAULT_SIDE => format!("the value of `{key}` ({DEFAULT_SIDE} if it is missing)"),
        _ => format!("the value of `{key}`"),
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
