//! The reader of `terrain_preset`, `terrain`, `width` and `height` of scenario files.

use super::{BLOCKED, MAX_SIDE, Terrain, WALKABLE};
use crate::keys::{self, DEFAULT_SIDE};
use smaclite_units::file::{Node, Object, Reported};

impl Terrain {
    /// Reads the map of a scenario file: a preset, or rows of squares.
    pub(crate) fn read(file: &Object) -> Result<Terrain, Reported> {
        let (width, height) = (file.read(&keys::WIDTH), file.read(&keys::HEIGHT));
        match (file.get(&keys::TERRAIN_PRESET), file.get(&keys::TERRAIN)) {
            (Some(preset), None) => read_preset(file, &preset, [width, height]),
            (None, Some(rows)) => read_rows(&rows, width, height),
            (Some(preset), Some(_)) => Err(preset.invalid("left out, because `terrain` defines the map")),
            (None, None) => {
                let names = Terrain::preset_names().collect::<Vec<_>>().join(", ");
                let expected = format!("one of {names}; or `terrain` must define the map");
                Err(file.missing(keys::TERRAIN_PRESET.name, &expected))
            }
        }
    }
}

fn read_preset(file: &Object, name: &Node, sides: [Result<u32, Reported>; 2]) -> Result<Terrain, Reported> {
    let preset = name.one_of(&Terrain::preset_names().collect::<Vec<_>>());
    let sides = sides.into_iter().zip([&keys::WIDTH, &keys::HEIGHT]).map(|(side, key)| {
        if side? == DEFAULT_SIDE {
            return Ok(());
        }
        Err(file.require(key)?.invalid(&format!("{DEFAULT_SIDE}, the size of the terrain presets")))
    });
    sides.collect::<Vec<_>>().into_iter().collect::<Result<(), _>>()?;
    Terrain::preset(preset?).ok_or_else(|| name.invalid("a preset of 32 x 32 squares"))
}

/// Reads rows of `_` and `X`, row y = 0 first; a row is one string, or a list of strings that are joined.
fn read_rows(
    rows: &Node,
    width: Result<u32, Reported>,
    height: Result<u32, Reported>,
) -> Result<Terrain, Reported> {
    let items = rows.items()?;
    let n_rows = height.and_then(|height| {
        if items.len() == height as usize {
            return Ok(height);
        }
        Err(rows.invalid(&format!("a list of {height} rows, {}", size_of("height", height))))
    });
    // After a wrong number of rows only the first ones are read: the list can be millions long.
    let rows_of_squares: Vec<_> =
        items.iter().take(MAX_SIDE as usize).map(|row| read_row(row, width)).collect();
    let mut walkable = Vec::new();
    for row in rows_of_squares {
        walkable.extend(row?.chars().map(|square| square == WALKABLE));
    }
    Terrain::new(width?, n_rows?, walkable).ok_or_else(|| rows.invalid("a rectangular map"))
}

/// The squares of a row; their number is checked if the width is known.
fn read_row(row: &Node, width: Result<u32, Reported>) -> Result<String, Reported> {
    let squares = row_text(row)?;
    if let Some(wrong) = squares.chars().find(|square| ![WALKABLE, BLOCKED].contains(square)) {
        let expected = "made of `_` (walkable) and `X` (blocked)";
        return Err(row.invalid(&format!("{expected}, without {wrong:?}")));
    }
    match width {
        Ok(width) if squares.len() != width as usize => {
            let expected = format!("a row of {width} squares, {}", size_of("width", width));
            Err(row.invalid(&format!("{expected}; it has {}", squares.len())))
        }
        _ => Ok(squares),
    }
}

/// Where the size of a side comes from.
fn size_of(key: &str, side: u32) -> String {
    match side {
        DEFAULT_SIDE => format!("the value of `{key}` ({DEFAULT_SIDE} if it is missing)"),
        _ => format!("the value of `{key}`"),
    }
}

fn row_text(row: &Node) -> Result<String, Reported> {
    if !row.is_list() {
        let text = row.as_str().filter(|text| !text.is_empty() && !text.contains(char::is_control));
        return text.map(str::to_owned).ok_or_else(|| row.invalid("a string of `_` and `X`"));
    }
    let parts: Vec<_> = row.items()?.iter().map(|item| item.text(MAX_SIDE as usize)).collect();
    parts.into_iter().collect()
}
