//! `smaclite-pool new`: valid scenario and unit files to start from.

use super::CommandResult;
use super::check;
use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand};
use serde_json::json;
use smaclite_scenarios::{Faction, MAX_UNITS, Problems, Scenario};
use smaclite_units::UnitType;
use smaclite_units::file::{shown_path, write_new};
use std::error::Error;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// The maps, and on each the centres of agents and enemies: open ground, where a group of a dozen units fits.
/// CHECKERBOARD is not among them, since no ground unit can leave its square there.
const MAPS: [(&str, [u32; 2], [u32; 2]); 8] = [
    ("ALL_GREEN", [9, 16], [23, 16]),
    ("CORRIDOR", [19, 19], [27, 27]),
    ("FLAT", [8, 16], [24, 16]),
    ("NARROW", [9, 16], [23, 16]),
    ("OCTAGON", [16, 11], [16, 21]),
    ("PENTAGON", [14, 10], [14, 19]),
    ("RAVINE", [9, 16], [23, 16]),
    ("SIMPLE", [9, 16], [23, 16]),
];

#[derive(Args)]
pub(super) struct New {
    #[command(subcommand)]
    kind: Kind,
}

#[derive(Subcommand)]
enum Kind {
    /// Write a scenario of two groups
    Scenario(NewScenario),
    /// Write a unit type, a copy of a standard one
    Unit(NewUnit),
}

#[derive(Args)]
struct NewScenario {
    /// The file to write; it must not exist
    file: PathBuf,
    /// The map
    #[arg(long, value_name = "PRESET", default_value = "SIMPLE",
        value_parser = PossibleValuesParser::new(MAPS.map(|(name, ..)| name)))]
    map: String,
    /// The agents: numbers and types of units, as in `3xMARINE,1xMEDIVAC`; a type is a standard one or the
    /// name of a unit file beside FILE
    #[arg(long, value_name = "UNITS", default_value = "3xMARINE", value_delimiter = ',')]
    agents: Vec<UnitCount>,
    /// The enemies, written like the agents [default: 3xMARINE]
    #[arg(long, value_name = "UNITS", value_delimiter = ',')]
    enemies: Vec<UnitCount>,
    /// Draw the teams and start positions of each episode: as many units as the counts say in sum, both teams
    /// of the types of the agents, with their counts as weights
    #[arg(long)]
    generated: bool,
}

#[derive(Args)]
struct NewUnit {
    /// The file to write; it must not exist. The unit type gets its name, without `.json`
    file: PathBuf,
    /// The standard type to copy
    #[arg(long, value_name = "TYPE", default_value = "MARINE",
        value_parser = PossibleValuesParser::new(UnitType::standard_names()))]
    like: String,
}

/// A number of units of one type.
#[derive(Clone, Debug, PartialEq)]
struct UnitCount {
    count: u32,
    unit_type: String,
}

#[derive(Debug, thiserror::Error)]
#[error("must be NUMBERxTYPE, as in 3xMARINE, with a number between 1 and {MAX_UNITS}")]
struct NotAUnitCount;

impl FromStr for UnitCount {
    type Err = NotAUnitCount;

    fn from_str(text: &str) -> Result<UnitCount, NotAUnitCount> {
        let (count, unit_type) = text.split_once('x').ok_or(NotAUnitCount)?;
        let count =
            count.parse().ok().filter(|count| (1..=MAX_UNITS).contains(count)).ok_or(NotAUnitCount)?;
        if unit_type.is_empty() {
            return Err(NotAUnitCount);
        }
        Ok(UnitCount { count, unit_type: unit_type.into() })
    }
}

impl New {
    pub(super) fn run(self) -> CommandResult {
        let (file, text) = match self.kind {
            Kind::Scenario(new) => {
                let new = new.with_enemies()?;
                let text = new.text()?;
                (new.file, text)
            }
            Kind::Unit(new) => {
                let text = new.text()?.to_owned();
                (new.file, text)
            }
        };
        write(&file, &text)?;
        let (_, content) = check::read(&file);
        out!("wrote {}: {}", shown_path(&file), content?)?;
        Ok(())
    }
}

/// Writes a file that does not exist, whole or not at all.
fn write(file: &Path, text: &str) -> CommandResult {
    let refused = |error: std::io::Error| match error.kind() {
        ErrorKind::AlreadyExists => format!("{}: exists; FILE must be a new file", shown_path(file)),
        _ => format!("{}: {error}", shown_path(file)),
    };
    Ok(write_new(file, |output| output.write_all(text.as_bytes())).map_err(refused)?)
}

/// The name of the file without `.json`.
fn stem(file: &Path) -> Result<String, String> {
    let name = file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    match name.strip_suffix(".json") {
        Some(stem) if !stem.is_empty() => Ok(stem.into()),
        _ => Err(format!("FILE must end in .json, as `mine.json` does, got `{}`", shown_path(file))),
    }
}

impl NewUnit {
    fn text(&self) -> Result<&'static str, Box<dyn Error>> {
        let name = stem(&self.file)?;
        if UnitType::standard_names().any(|standard| standard == name) {
            return Err(format!("FILE must not have the name of a standard unit type, got `{name}`").into());
        }
        UnitType::standard_file(&self.like).ok_or_else(|| format!("no standard type {}", self.like).into())
    }
}

impl NewScenario {
    /// The same with three marines as enemies where none are named.
    ///
    /// Both teams of a generated scenario are drawn from the types of the agents: others of the enemies
    /// would be left out without a word.
    fn with_enemies(mut self) -> Result<NewScenario, String> {
        let is_drawn = |unit: &UnitCount| self.agents.iter().any(|agent| agent.unit_type == unit.unit_type);
        if let Some(other) = self.enemies.iter().find(|unit| self.generated && !is_drawn(unit)) {
            let types: Vec<_> = counted(&self.agents).into_iter().map(|unit| unit.unit_type).collect();
            return Err(format!(
                "--enemies has {}, but --generated draws both teams from the types of --agents: {}; name it \
                 there, or write the key `teams` of the file yourself",
                other.unit_type,
                types.join(", ")
            ));
        }
        if self.enemies.is_empty() {
            self.enemies = vec![UnitCount { count: 3, unit_type: "MARINE".into() }];
        }
        Ok(self)
    }

    /// The text of the file, which was read as a scenario.
    fn text(&self) -> Result<String, Box<dyn Error>> {
        let name = stem(&self.file)?;
        let read = |text: &str| {
            let folder = self.file.parent().unwrap_or(Path::new(""));
            // There is no file, so a message cannot say where in it the problem is.
            let messages = |problems: Problems| {
                let messages: Vec<_> = problems.list().iter().map(|problem| &*problem.message).collect();
                messages.join("\n")
            };
            Scenario::from_json(text, &shown_path(&self.file), folder).map_err(messages)
        };
        // Only the scenario knows whether its units have shields.
        let scenario = read(&self.with_shields(&name, [false, false]))?;
        let have_shields = |faction| {
            let mut units = scenario.units.iter().filter(|unit| unit.faction == faction);
            units.any(|unit| scenario.unit_types[unit.unit_type].shield > 0.0)
        };
        let text = self.with_shields(&name, [Faction::Ally, Faction::Enemy].map(have_shields));
        read(&text)?;
        Ok(text)
    }

    /// The value of `num_unit_types`, and the line of `unit_type_ids` if there are several types.
    fn unit_type_ids(&self) -> (usize, String) {
        let mut types: Vec<&str> = Vec::new();
        // The types of a generated scenario are those of the agents.
        let enemies: &[UnitCount] = if self.generated { &[] } else { &self.enemies };
        for UnitCount { unit_type, .. } in self.agents.iter().chain(enemies) {
            if !types.contains(&unit_type.as_str()) {
                types.push(unit_type);
            }
        }
        if types.len() == 1 {
            return (0, String::new());
        }
        let ids = types.iter().enumerate().map(|(id, name)| format!("{}: {id}", json!(name)));
        let ids = ids.collect::<Vec<_>>().join(", ");
        (types.len(), format!("\n    \"unit_type_ids\": {{ {ids} }},"))
    }

    /// The keys of two groups.
    fn groups(&self) -> String {
        let (agents, enemies) = (units_object(&self.agents), units_object(&self.enemies));
        let centres = MAPS.iter().find(|(name, ..)| *name == self.map).unwrap_or(&MAPS[0]);
        let (_, [ax, ay], [ex, ey]) = centres;
        format!(
            r#"    "groups": [
        {{ "x": {ax}, "y": {ay}, "faction": "ALLY", "units": {agents} }},
        {{ "x": {ex}, "y": {ey}, "faction": "ENEMY", "units": {enemies} }}
    ],
    "attack_point": [{ax}, {ay}],"#
        )
    }

    /// The keys of teams and start positions that are drawn.
    fn distributions(&self) -> String {
        let counts = counted(&self.agents);
        let types = json!(counts.iter().map(|unit| &unit.unit_type).collect::<Vec<_>>());
        let weights = json!(counts.iter().map(|unit| unit.count).collect::<Vec<_>>());
        format!(
            r#"    "teams": {{
        "distribution": "weighted_teams",
        "unit_types": {types},
        "weights": {weights}
    }},
    "start_positions": {{ "distribution": "surrounded_and_reflect", "p": 0.5 }},
    "opponent": "attack_nearest","#
        )
    }

    /// The text of the file.
    fn with_shields(&self, name: &str, [ally_has_shields, enemy_has_shields]: [bool; 2]) -> String {
        let (n_types, ids) = self.unit_type_ids();
        let total = |units: &[UnitCount]| units.iter().map(|unit| u64::from(unit.count)).sum::<u64>();
        let (n_agents, n_enemies) = (total(&self.agents), total(&self.enemies));
        let (name, map) = (json!(name), json!(self.map));
        let units = if self.generated { self.distributions() } else { self.groups() };
        format!(
            r#"{{
    "name": {name},
    "num_allied_units": {n_agents},
    "num_enemy_units": {n_enemies},
{units}
    "terrain_preset": {map},
    "num_unit_types": {n_types},{ids}
    "ally_has_shields": {ally_has_shields},
    "enemy_has_shields": {enemy_has_shields},
    "episode_limit": 120
}}
"#
        )
    }
}

/// Types and their counts; a type that is named twice is counted together.
fn counted(units: &[UnitCount]) -> Vec<UnitCount> {
    let mut counts: Vec<UnitCount> = Vec::new();
    for unit in units {
        match counts.iter_mut().find(|known| known.unit_type == unit.unit_type) {
            Some(known) => known.count += unit.count,
            None => counts.push(unit.clone()),
        }
    }
    counts
}

/// Types and their counts as a JSON object.
fn units_object(units: &[UnitCount]) -> String {
    let entries: Vec<_> =
        counted(units).iter().map(|unit| format!("{}: {}", json!(unit.unit_type), unit.count)).collect();
    format!("{{ {} }}", entries.join(", "))
}
