//! The nine terrain presets, embedded from `scenarios/terrains`.

use super::{Terrain, WALKABLE};
use crate::keys::DEFAULT_SIDE;

/// Names and drawings: `_` walkable, `X` blocked, north row first.
const PRESETS: [(&str, &str); 9] = [
    ("ALL_GREEN", include_str!("../../terrains/ALL_GREEN.txt")),
    ("CHECKERBOARD", include_str!("../../terrains/CHECKERBOARD.txt")),
    ("CORRIDOR", include_str!("../../terrains/CORRIDOR.txt")),
    ("FLAT", include_str!("../../terrains/FLAT.txt")),
    ("NARROW", include_str!("../../terrains/NARROW.txt")),
    ("OCTAGON", include_str!("../../terrains/OCTAGON.txt")),
    ("PENTAGON", include_str!("../../terrains/PENTAGON.txt")),
    ("RAVINE", include_str!("../../terrains/RAVINE.txt")),
    ("SIMPLE", include_str!("../../terrains/SIMPLE.txt")),
];

impl Terrain {
    /// The terrain preset of that name (`"SIMPLE"`, in capitals), if there is one.
    pub fn preset(name: &str) -> Option<Terrain> {
        let (_, drawing) = PRESETS.iter().find(|(preset, _)| *preset == name)?;
        let squares = drawing.lines().rev().flat_map(str::chars).map(|square| square == WALKABLE);
        // A test reads all nine, so an embedded drawing never fails here.
        Terrain::new(DEFAULT_SIDE, DEFAULT_SIDE, squares.collect())
    }

    /// The names of the terrain presets, in alphabetical order.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        PRESETS.iter().map(|(name, _)| *name)
    }
}
