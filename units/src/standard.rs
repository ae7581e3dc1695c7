//! The ten standard unit types, embedded from `units/data`.
//!
//! Nine are the published environment's. HYDRALISK is added for SMAC's map 6h_vs_8z: its health is that of
//! the map, its other stats are the public unit statistics of StarCraft II, the source of the nine as well.

use crate::UnitType;

/// Names and files, in the order in which they are listed.
const STANDARD: [(&str, &str); 10] = [
    ("BANELING", include_str!("../data/BANELING.json")),
    ("COLOSSUS", include_str!("../data/COLOSSUS.json")),
    ("HYDRALISK", include_str!("../data/HYDRALISK.json")),
    ("MARAUDER", include_str!("../data/MARAUDER.json")),
    ("MARINE", include_str!("../data/MARINE.json")),
    ("MEDIVAC", include_str!("../data/MEDIVAC.json")),
    ("SPINE_CRAWLER", include_str!("../data/SPINE_CRAWLER.json")),
    ("STALKER", include_str!("../data/STALKER.json")),
    ("ZEALOT", include_str!("../data/ZEALOT.json")),
    ("ZERGLING", include_str!("../data/ZERGLING.json")),
];

/// The same types with the figures of the game, for rules `starcraft`, in the same order.
const STARCRAFT: [&str; STANDARD.len()] = [
    include_str!("../data/starcraft/BANELING.json"),
    include_str!("../data/starcraft/COLOSSUS.json"),
    include_str!("../data/starcraft/HYDRALISK.json"),
    include_str!("../data/starcraft/MARAUDER.json"),
    include_str!("../data/starcraft/MARINE.json"),
    include_str!("../data/starcraft/MEDIVAC.json"),
    include_str!("../data/starcraft/SPINE_CRAWLER.json"),
    include_str!("../data/starcraft/STALKER.json"),
    include_str!("../data/starcraft/ZEALOT.json"),
    include_str!("../data/starcraft/ZERGLING.json"),
];

impl UnitType {
    /// The standard type of that name (`"MARINE"`, in capitals), if there is one.
    pub fn standard(name: &str) -> Option<UnitType> {
        let text = UnitType::standard_file(name)?;
        // A test reads all ten, so an embedded file never fails here.
        UnitType::from_json(text, name, &format!("units/data/{name}.json")).ok()
    }

    /// The text of the unit file of the standard type of that name, if there is one.
    pub fn standard_file(name: &str) -> Option<&'static str> {
        STANDARD.iter().find(|(standard, _)| *standard == name).map(|(_, text)| *text)
    }

    /// The standard type of that name with the figures of the game, which rules `starcraft` play.
    pub fn starcraft(name: &str) -> Option<UnitType> {
        let index = STANDARD.iter().position(|(standard, _)| *standard == name)?;
        UnitType::from_json(STARCRAFT[index], name, &format!("units/data/starcraft/{name}.json")).ok()
    }

    /// The names of the standard types, in alphabetical order.
    pub fn standard_names() -> impl Iterator<Item = &'static str> {
        STANDARD.iter().map(|(name, _)| *name)
    }
}
