//! The reader of scenario files: the keys, their defaults, and the dependencies between them.

use crate::groups::Roster;
use crate::unit_files::{Origin, UnitFiles, UnitSource};
use crate::{Faction, MAX_UNITS, Scenario, ScenarioError, ScenarioFiles, Terrain, UnitFile};
use smaclite_units::file::{FileError, Json, Node, Object, Range};
use std::path::Path;

/// Every key of a scenario file.
const KEYS: [&str; 15] = [
    "name",
    "custom_unit_path",
    "num_allied_units",
    "num_enemy_units",
    "groups",
    "attack_point",
    "terrain_preset",
    "terrain",
    "width",
    "height",
    "num_unit_types",
    "unit_type_ids",
    "ally_has_shields",
    "enemy_has_shields",
    "episode_limit",
];

/// The longest name of a scenario, in bytes.
const MAX_NAME: usize = 100;

/// The longest path, in bytes; no system takes longer ones.
const MAX_PATH: usize = 4096;

impl Scenario {
    /// Reads a scenario file's text. `source` is what error messages call the file; unit files are searched
    /// from `base_dir`, the folder that contains the file.
    ///
    /// # Errors
    /// [`ScenarioError`] for the first mistake in the file or in a unit file that it names.
    pub fn from_json(text: &str, source: &str, base_dir: &Path) -> Result<Scenario, ScenarioError> {
        Scenario::read(text, source, Origin::Folder(base_dir)).map(|(scenario, _)| scenario)
    }

    /// As [`from_json`](Self::from_json), with unit files from `origin`; also gives the unit files that were
    /// found in folders.
    pub(crate) fn read(
        text: &str,
        source: &str,
        origin: Origin<'_>,
    ) -> Result<(Scenario, Vec<UnitFile>), ScenarioError> {
        let json = Json::parse(text, source)?;
        let file = Node::root(source, &json).object(&KEYS)?;
        let name = file.require("name", "the scenario's name")?.text(MAX_NAME)?;
        let custom_unit_path = file.get("custom_unit_path").map(|node| node.text(MAX_PATH)).transpose()?;
        let files = UnitFiles::new(source, origin, custom_unit_path);
        let terrain = Terrain::read(&file)?;
        let groups = file.require("groups", "a list of groups with `x`, `y`, `faction` and `units`")?;
        let roster = Roster::read(&groups, &files, &terrain)?;
        for (key, faction) in [("num_allied_units", Faction::Ally), ("num_enemy_units", Faction::Enemy)] {
            roster.check_count(&file.require(key, "the number of units of that faction")?, faction)?;
        }
        let (num_unit_types, type_ids) = read_type_ids(&file, &files, &roster)?;
        let scenario = Scenario {
            name: name.into(),
            attack_point: attack_point(&file, &terrain)?,
            num_unit_types,
            type_ids,
            ally_has_shields: file.require("ally_has_shields", "true or false")?.bool()?,
            enemy_has_shields: file.require("enemy_has_shields", "true or false")?.bool()?,
            episode_limit: file.get("episode_limit").map(|node| node.integer(1, u32::MAX)).transpose()?,
            terrain,
            unit_types: roster.unit_types,
            units: roster.units,
        };
        Ok((scenario, files.into_found()))
    }

    /// Reads a scenario file, and the unit files it names relative to its own folder.
    ///
    /// # Errors
    /// As [`from_json`](Self::from_json), and for a file that cannot be read.
    pub fn load(path: &Path) -> Result<Scenario, ScenarioError> {
        ScenarioFiles::load(path).map(|(scenario, _)| scenario)
    }
}

fn attack_point(file: &Object, terrain: &Terrain) -> Result<[f64; 2], FileError> {
    let node = file.require("attack_point", "[x, y], the point that the enemies march to")?;
    let items = node.items()?;
    let [x, y] = items.as_slice() else {
        return Err(node.invalid("two numbers, [x, y]"));
    };
    let range = |side: u32| Range::closed(0.0, side.into());
    Ok([x.number(range(terrain.width()))?, y.number(range(terrain.height()))?])
}

/// The length of the type one-hot, and the position in it of each type of the roster.
///
/// A one-hot of length 1 carries no information, so a file's 1 counts as 0, and then `unit_type_ids` has no
/// effect.
fn read_type_ids(
    file: &Object,
    files: &UnitFiles,
    roster: &Roster,
) -> Result<(usize, Vec<usize>), ScenarioError> {
    let expected = "0, or the number of types to tell apart in observations";
    let num_unit_types = file.require("num_unit_types", expected)?.integer(0, MAX_UNITS)?;
    if num_unit_types <= 1 {
        return Ok((0, vec![0; roster.unit_types.len()]));
    }
    let expected = format!("an object of unit types and their ids, 0 to {}", num_unit_types - 1);
    let ids = read_ids(&file.require("unit_type_ids", &expected)?, num_unit_types, files)?;
    let id_of = |(source, name): (&UnitSource, &str)| {
        let found = ids.iter().find(|(known, _)| known == source);
        found.map(|(_, id)| *id).ok_or_else(|| {
            let expected =
                format!("an id from 0 to {}, because `groups` contains the type", num_unit_types - 1);
            file.missing(&format!("unit_type_ids.{name}"), &expected).into()
        })
    };
    let names = roster.unit_types.iter().map(|unit_type| unit_type.name.as_str());
    let type_ids: Result<_, ScenarioError> = roster.sources.iter().zip(names).map(id_of).collect();
    Ok((num_unit_types as usize, type_ids?))
}

/// Reads `unit_type_ids`, a bijection of unit types onto 0..n. It may contain types that the groups do not
/// have.
fn read_ids(node: &Node, n: u32, files: &UnitFiles) -> Result<Vec<(UnitSource, usize)>, ScenarioError> {
    let mut ids: Vec<(UnitSource, usize)> = Vec::new();
    for (name, entry) in node.entries()? {
        let source = files.find(name, &entry)?;
        let id = entry.integer(0, n - 1)? as usize;
        if ids.iter().any(|(known, _)| *known == source) {
            return Err(entry.invalid("left out, because another key names the same unit type").into());
        }
        if ids.iter().any(|(_, known)| *known == id) {
            return Err(entry.invalid(format!("an id from 0 to {} that no other type has", n - 1)).into());
        }
        ids.push((source, id));
    }
    if ids.len() != n as usize {
        return Err(node.invalid(format!("an object of size {n}, the value of `num_unit_types`")).into());
    }
    Ok(ids)
}
