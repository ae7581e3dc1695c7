//! The reader of scenario files: the values of the keys, and the dependencies between them. `keys` declares
//! the keys.

use crate::generation::{lists_of, read_generated, sample};
use crate::groups::Roster;
use crate::terrain::ON_ANY_MAP;
use crate::unit_files::{Origin, UnitFiles, UnitSource};
use crate::{Destination, Faction, MAX_UNITS, Rewards, Scenario, ScenarioFiles, Terrain, UnitFile};
use crate::{keys, rewards, smacv2};
use smaclite_units::Problems;
use smaclite_units::file::{Document, Node, Object, Range, Report, Reported, SCHEMA_KEY};
use std::path::Path;

impl Scenario {
    /// Reads a scenario file's text. `source` is what problems call the file; unit files are searched from
    /// `base_dir`, the folder that contains the file.
    ///
    /// # Errors
    /// [`Problems`] of the file and of the unit files that it names.
    pub fn from_json(text: &str, source: &str, base_dir: &Path) -> Result<Scenario, Problems> {
        let report = Report::default();
        let read = Scenario::read(text, source, Origin::Folder(base_dir), &report);
        report.finish(read).map(|(scenario, _)| scenario)
    }

    /// Reads a scenario file, and the unit files it names relative to its own folder.
    ///
    /// # Errors
    /// As [`from_json`](Self::from_json), and for a file that cannot be read.
    pub fn load(path: &Path) -> Result<Scenario, Problems> {
        ScenarioFiles::load(path).map(|(scenario, _)| scenario)
    }

    /// Reads a scenario with unit files from `origin`; also gives the unit files that were found in folders.
    pub(crate) fn read(
        text: &str,
        source: &str,
        origin: Origin<'_>,
        report: &Report,
    ) -> Result<(Scenario, Vec<UnitFile>), Reported> {
        refuse_page(text, source, report)?;
        let document = Document::parse(text, source, report)?;
        refuse_other(&document.root(), source, report)?;
        let file = document.root().object(&keys::KEYS)?;
        let (schema, name) = (file.read_optional(&SCHEMA_KEY), file.read(&keys::NAME));
        let files = UnitFiles::new(origin, file.read_optional(&keys::CUSTOM_UNIT_PATH), report);
        let terrain = Terrain::read(&file);
        let map = terrain.as_ref().ok();
        let counts = [&keys::NUM_ALLIED_UNITS, &keys::NUM_ENEMY_UNITS];
        let given = counts.map(|key| file.get(key).and_then(|node| node.as_whole()).map(|n| n as usize));
        let generated = read_generated(&file, &files, map, given);
        let roster = generated.as_ref().map(|(roster, _)| roster);
        let counts = check_counts(&file, roster.ok());
        let ids = read_type_ids(&file, &files, roster.ok());
        let attack_point = attack_point(&file, map);
        let march_to = file.get(&keys::MARCH_TO).map(|node| march_to(&node, map)).transpose();
        let smacv2 = file.get(&keys::SMACV2).map(|node| smacv2::read(&node)).transpose();
        let rewards = read_rewards(&file);
        let opponent = file.read_optional(&keys::OPPONENT);
        let heights = file.get(&keys::TERRAIN_HEIGHT).map(|node| read_heights(&node, map)).transpose();
        let ally_has_shields = file.read(&keys::ALLY_HAS_SHIELDS);
        let enemy_has_shields = file.read(&keys::ENEMY_HAS_SHIELDS);
        let episode_limit = file.read_optional(&keys::EPISODE_LIMIT);
        schema?;
        let (counts, (num_unit_types, type_ids)) = (counts?, ids?);
        let (roster, generation) = generated?;
        roster.placed.0?;
        let mut scenario = Scenario {
            name: name?,
            attack_point: attack_point?,
            march_to: march_to?,
            opponent: opponent?,
            num_unit_types,
            type_ids,
            ally_has_shields: ally_has_shields?,
            enemy_has_shields: enemy_has_shields?,
            episode_limit: episode_limit?,
            terrain: terrain?,
            unit_types: roster.unit_types,
            units: roster.units,
            generation,
            smacv2: smacv2?,
            rewards: rewards?,
            heights: heights?,
        };
        check_fighters(&file, &scenario)?;
        if scenario.generation.is_some() {
            let units = sample(&file, &scenario, counts)?;
            // The units of groups stay as they are, whatever positions are drawn for them.
            if scenario.units.is_empty() {
                scenario.units = units;
            }
        }
        Ok((scenario, files.into_found()))
    }
}

/// The numbers of allies and enemies, compared with the groups if these are valid.
fn check_counts(file: &Object, roster: Option<&Roster>) -> Result<[usize; 2], Reported> {
    let check = |key, faction: Faction| {
        let count = file.read(key)? as usize;
        // A roster of `teams` has no units.
        let groups = roster.filter(|roster| !roster.units.is_empty());
        let actual = groups.map_or(count, |roster| roster.count(faction));
        if count == actual {
            return Ok(count);
        }
        let name = smaclite_units::Keyword::name(faction);
        let expected = format!("{actual}, the number of {name} units in `groups`");
        Err(file.require(key)?.invalid(&expected))
    };
    let allies = check(&keys::NUM_ALLIED_UNITS, Faction::Ally);
    let enemies = check(&keys::NUM_ENEMY_UNITS, Faction::Enemy);
    let (allies, enemies) = (allies?, enemies?);
    if allies + enemies > MAX_UNITS as usize {
        let total =
            format!("raises the number of units to {}; at most {MAX_UNITS} are allowed", allies + enemies);
        return Err(file.require(&keys::NUM_ENEMY_UNITS)?.conflict(&total));
    }
    Ok([allies, enemies])
}

/// With SMACv2's interface a side of healers alone has lost: a battle that always has one would be over
/// before its first step.
fn check_fighters(file: &Object, scenario: &Scenario) -> Result<(), Reported> {
    if scenario.smacv2.is_none() {
        return Ok(());
    }
    let is_healer = |unit_type: usize| scenario.unit_types[unit_type].is_healer();
    let conflict = |node: &Node, side: &str| {
        let why = "which have lost with `smacv2`; add a unit that fights";
        Err(node.conflict(&format!("gives {side} healers alone, {why}")))
    };
    if let (Some(node), Some(generation)) = (file.get(&keys::TEAMS), &scenario.generation) {
        let lists = lists_of(&node, &generation.teams)?;
        let helpless = lists.iter().find(|(_, types)| types.iter().all(|unit_type| is_healer(*unit_type)));
        return helpless.map_or(Ok(()), |(list, _)| conflict(list, "both sides"));
    }
    for (side, name) in [(Faction::Ally, "the agents"), (Faction::Enemy, "the enemies")] {
        let mut units = scenario.units.iter().filter(|unit| unit.faction == side);
        if units.all(|unit| is_healer(unit.unit_type)) {
            return conflict(&file.require(&keys::GROUPS)?, name);
        }
    }
    Ok(())
}

/// Refuses the page of a replay.
pub(crate) fn refuse_page(text: &str, source: &str, report: &Report) -> Result<(), Reported> {
    match text.trim_start().starts_with("<!") {
        true => Err(report.add_unreadable(source.to_owned(), "it is a web page, not a scenario")),
        false => Ok(()),
    }
}

/// Refuses JSON of another kind, of which every key would be a problem.
pub(crate) fn refuse_other(root: &Node, source: &str, report: &Report) -> Result<(), Reported> {
    let other = other_kind(&root.entries()?);
    other.map_or(Ok(()), |other| Err(report.add_unreadable(source.to_owned(), other)))
}

/// What an object with these keys is, if it is not a scenario.
fn other_kind(entries: &[(&str, Node)]) -> Option<&'static str> {
    let has = |name: &str| entries.iter().any(|(key, _)| *key == name);
    let is_known = |name: &str| keys::KEYS.iter().any(|key| key.name() == name);
    let n_known = entries.iter().filter(|(key, _)| is_known(key)).count();
    match () {
        // Of a scenario that is begun, or has wrong keys, all problems are told.
        () if has(keys::GROUPS.name) || has(keys::TEAMS.name) || has(keys::NAME.name) => None,
        () if 2 * n_known >= entries.len() => None,
        () if has("hp") && has("damage") => {
            Some("it is a unit type, not a scenario; scenarios name it in `units`")
        }
        () if has("config") && has("files") => Some(
            "it describes a run of `smaclite-pool train` and is not a scenario; commands take its folder",
        ),
        () => Some("it is not a scenario, which has keys such as `name`, and `groups` or `teams`"),
    }
}

/// The rewards of both sides; with SMACv2's interface those of agents are among its options.
fn read_rewards(file: &Object) -> Result<Rewards, Reported> {
    let Some(node) = file.get(&keys::REWARDS) else { return Ok(Rewards::DEFAULT) };
    if file.get(&keys::SMACV2).is_some() {
        return Err(node.wrong_key("must be left out beside `smacv2`, whose own options `reward_*` are used"));
    }
    rewards::read(&node)
}

/// The height of each square, row y = 0 first.
fn read_heights(node: &Node, map: Option<&Terrain>) -> Result<Vec<u8>, Reported> {
    let rows = node.items()?;
    let expected = map.map(|map| (map.width() as usize, map.height() as usize));
    if let Some((_, height)) = expected.filter(|(_, height)| *height != rows.len()) {
        return Err(node.invalid(&format!("a list of {height} rows")));
    }
    let mut heights = Vec::new();
    for row in rows {
        let squares = row.items()?;
        if let Some((width, _)) = expected.filter(|(width, _)| *width != squares.len()) {
            return Err(row.invalid(&format!("a list of {width} numbers from 0 to 255")));
        }
        for square in squares {
            heights.push(square.integer(0, 255)? as u8);
        }
    }
    Ok(heights)
}

fn attack_point(file: &Object, map: Option<&Terrain>) -> Result<[f64; 2], Reported> {
    let Some(node) = file.get(&keys::ATTACK_POINT) else {
        if file.get(&keys::START_POSITIONS).is_none() {
            return Err(file.missing(keys::ATTACK_POINT.name, "[x, y], the point that the enemies march to"));
        }
        let side = |side: fn(&Terrain) -> u32| map.map_or(0.0, |map| f64::from(side(map)) / 2.0);
        return Ok([side(Terrain::width), side(Terrain::height)]);
    };
    point(&node, map)
}

fn march_to(node: &Node, map: Option<&Terrain>) -> Result<Destination, Reported> {
    if node.as_str() == Some("AGENTS") {
        return Ok(Destination::Agents);
    }
    let refused = || node.invalid(keys::MARCH_TO.kind.expected);
    let items = if node.is_list() { node.items()? } else { return Err(refused()) };
    let [from, to] = items.as_slice() else { return Err(refused()) };
    let (from, to) = (point(from, map), point(to, map));
    Ok(Destination::Line([from?, to?]))
}

/// A point of the map.
fn point(node: &Node, map: Option<&Terrain>) -> Result<[f64; 2], Reported> {
    let items = node.items()?;
    let [x, y] = items.as_slice() else {
        return Err(node.invalid("two numbers, [x, y]"));
    };
    let range =
        |side: fn(&Terrain) -> u32| map.map_or(ON_ANY_MAP, |map| Range::closed(0.0, side(map).into()));
    let (x, y) = (x.number(range(Terrain::width)), y.number(range(Terrain::height)));
    Ok([x?, y?])
}

/// The length of the type one-hot, and the position in it of each type of the roster.
///
/// A one-hot of length 1 carries no information, so a file's 1 counts as 0, and then `unit_type_ids` has no
/// effect.
fn read_type_ids(
    file: &Object,
    files: &UnitFiles,
    roster: Option<&Roster>,
) -> Result<(usize, Vec<usize>), Reported> {
    let num_unit_types = file.read(&keys::NUM_UNIT_TYPES)?;
    let types: Vec<_> = roster.iter().flat_map(|roster| roster.types()).collect();
    if num_unit_types <= 1 {
        return Ok((0, vec![0; types.len()]));
    }
    let key = &keys::UNIT_TYPE_IDS;
    let node = file.get(key).ok_or_else(|| {
        let expected = format!("an object of unit types and their ids, 0 to {}", num_unit_types - 1);
        file.missing(key.name, &expected)
    })?;
    let ids = read_ids(&node, num_unit_types, files)?;
    let id_of = |(source, name): (&UnitSource, &str)| {
        let found = ids.iter().find(|(known, _)| known == source);
        found.map(|(_, id)| *id).ok_or_else(|| {
            let last = num_unit_types - 1;
            let expected = format!("an id from 0 to {last}, because `groups` or `teams` contains the type");
            node.missing(name, &expected)
        })
    };
    let type_ids: Vec<_> = types.into_iter().map(id_of).collect();
    Ok((num_unit_types as usize, type_ids.into_iter().collect::<Result<_, _>>()?))
}

/// Reads `unit_type_ids`, a bijection of unit types onto 0..n. It may contain types that the groups do not
/// have.
fn read_ids(node: &Node, n: u32, files: &UnitFiles) -> Result<Vec<(UnitSource, usize)>, Reported> {
    let mut ids: Vec<(UnitSource, usize)> = Vec::new();
    let mut outcome = Ok(());
    for (name, entry) in node.entries()? {
        let read = read_id(name, &entry, n, files).and_then(|(source, id)| {
            if ids.iter().any(|(known, _)| *known == source) {
                return Err(entry.invalid("left out, because another key names the same unit type"));
            }
            if ids.iter().any(|(_, known)| *known == id) {
                return Err(entry.invalid(&format!("an id from 0 to {} that no other type has", n - 1)));
            }
            ids.push((source, id));
            Ok(())
        });
        outcome = outcome.and(read);
    }
    outcome?;
    if ids.len() != n as usize {
        return Err(node.invalid(&format!("an object of size {n}, the value of `num_unit_types`")));
    }
    Ok(ids)
}

fn read_id(name: &str, entry: &Node, n: u32, files: &UnitFiles) -> Result<(UnitSource, usize), Reported> {
    let (source, id) = (files.find(name, entry), entry.integer(0, n - 1));
    Ok((source?, id? as usize))
}
