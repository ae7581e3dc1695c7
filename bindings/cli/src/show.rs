//! `smaclite-pool show`: a scenario as a map of characters, or as a picture; all of them as a contact sheet.

use super::picture::{Size, ThemeName, write_file};
use super::snapshot::{SavedBattle, is_snapshot};
use super::{CommandResult, completions};
use clap::Args;
use smaclite_engine::{Arena, Battle, Rules, Units};
use smaclite_scenarios::{Faction, Placement, Scenario};
use smaclite_units::UnitType;
use smaclite_view::{Cell, Observer, Options, Picture, Renderer, Sheet, SizeError, type_letters};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Args)]
#[command(after_help = "\
The map of characters: north is up, and a square is two columns wide. `##` is a blocked square, `x` the \
point to which the enemies move. A letter stands for a unit; `<` after it marks an agent, `>` an enemy. \
Units that share a square are shown by the first one.")]
pub(super) struct Show {
    /// A standard scenario, a scenario file, or a snapshot, FILE.snapshot, whose units are listed too
    #[arg(required_unless_present = "all", add = completions::scenario())]
    scenario: Option<String>,
    /// Scenario of a snapshot [default: the standard scenario that it is of]
    #[arg(long = "scenario", value_name = "SCENARIO", add = completions::scenario())]
    of: Option<String>,
    /// Put all standard scenarios into one picture, each with its name
    #[arg(long, conflicts_with = "scenario", requires = "png")]
    all: bool,
    /// Write a picture to this PNG file, instead of printing the map; a file of that name is replaced
    #[arg(long, value_name = "OUT")]
    png: Option<PathBuf>,
    /// Width and height of the picture, or of each one with --all, in pixels [default: 512x512; 256x256]
    #[arg(long, value_name = "WxH", requires = "png")]
    size: Option<Size>,
    /// Background of the picture [default: dark]
    #[arg(long, requires = "png")]
    theme: Option<ThemeName>,
    /// Show how far each agent sees
    #[arg(long, requires = "png")]
    sight: bool,
    /// Show the attack range of each unit
    #[arg(long, requires = "png")]
    range: bool,
    /// Show the number of each unit within its faction
    #[arg(long, requires = "png")]
    ids: bool,
}

/// Width and height of each picture of a contact sheet.
const CELL: Size = Size { width: 256, height: 256 };

/// Pictures per row of the sheet of all standard scenarios.
const COLUMNS: usize = 6;

impl Show {
    pub(super) fn run(self) -> CommandResult {
        let Some(name) = &self.scenario else {
            let all = Scenario::standard_names().filter_map(Scenario::standard);
            return self.write_png(&self.sheet(all)?);
        };
        let (scenario, units) = if is_snapshot(name.as_ref()) {
            let saved = SavedBattle::read(name.as_ref(), self.of.as_deref())?;
            if self.png.is_none() {
                saved.print()?;
                out!()?;
            }
            (saved.scenario, saved.snapshot.units)
        } else if self.of.is_some() {
            return Err(format!("--scenario is for snapshots, FILE.snapshot; `{name}` is none").into());
        } else {
            let scenario = Scenario::resolve(name)?;
            let units = start_of(&scenario);
            (scenario, units)
        };
        if self.png.is_none() {
            return print(&scenario, &units);
        }
        let default = Options::default();
        let size = Size { width: default.width, height: default.height };
        self.write_png(&self.picture(&scenario, &units, self.size.unwrap_or(size))?)
    }

    fn write_png(&self, picture: &Picture) -> CommandResult {
        let Some(png) = &self.png else { return Ok(()) };
        if png.extension().is_none_or(|suffix| suffix != "png") {
            return Err(format!("--png must end in .png, got `{}`", png.display()).into());
        }
        write_file(png, |output| picture.write_png(output))
    }

    /// The units of a battle.
    fn picture(&self, scenario: &Scenario, units: &Units, size: Size) -> Result<Picture, SizeError> {
        let options = Options {
            width: size.width,
            height: size.height,
            show_sight: self.sight,
            show_range: self.range,
            show_ids: self.ids,
            theme: self.theme.unwrap_or_default().into(),
            ..Options::default()
        };
        let start = Observer::new(scenario, units);
        Ok(Renderer::new(scenario, options)?.render(start.moment()))
    }

    /// A contact sheet of scenarios.
    fn sheet(&self, scenarios: impl Iterator<Item = Scenario>) -> Result<Picture, SizeError> {
        let size = self.size.unwrap_or(CELL);
        let picture =
            |scenario: Scenario| Ok((self.picture(&scenario, &start_of(&scenario), size)?, scenario.name));
        let pictures = scenarios.map(picture);
        let pictures = pictures.collect::<Result<Vec<_>, SizeError>>()?;
        let cells = pictures.iter().map(|(picture, caption)| Cell { picture, caption }).collect::<Vec<_>>();
        Sheet { columns: COLUMNS, theme: self.theme.unwrap_or_default().into() }.compose(&cells)
    }
}

/// The units at the start of a battle.
fn start_of(scenario: &Scenario) -> Units {
    Battle::new(Arc::new(Arena::new(scenario, Rules::default())), 0).units().clone()
}

fn print(scenario: &Scenario, units: &Units) -> CommandResult {
    let limit = scenario.episode_limit.map_or("none".to_owned(), |steps| format!("{steps} steps"));
    let (width, height) = (scenario.terrain.width(), scenario.terrain.height());
    out!("{}: {width} x {height} squares, episode limit {limit}", scenario.name)?;
    out!("< agents: {}", army(scenario, units, Faction::Ally))?;
    out!("> enemies: {}\n", army(scenario, units, Faction::Enemy))?;
    let units = units_by_square(scenario, units);
    for y in (0..i64::from(height)).rev() {
        let row: String = (0..i64::from(width)).map(|x| square(scenario, &units, x, y)).collect();
        out!("{}", row.trim_end())?;
    }
    Ok(())
}

/// The living units of a faction by type, such as `2 STALKER (S), 3 ZEALOT (Z)`.
fn army(scenario: &Scenario, units: &Units, faction: Faction) -> String {
    let letters = type_letters(&scenario.unit_types);
    let group = |(i, unit_type): (usize, &UnitType)| {
        let is_counted = |unit: &&Placement| unit.faction == faction && unit.unit_type == i;
        let living = scenario.units.iter().zip(&units.alive).filter(|(_, alive)| **alive);
        let n = living.map(|(unit, _)| unit).filter(is_counted).count();
        (n > 0).then(|| format!("{n} {} ({})", unit_type.name, letters[i]))
    };
    let groups = scenario.unit_types.iter().enumerate().filter_map(group).collect::<Vec<_>>();
    if groups.is_empty() { "none".to_owned() } else { groups.join(", ") }
}

/// A letter and the mark of a faction.
type Mark = [char; 2];

/// The first living unit of each square with units.
fn units_by_square(scenario: &Scenario, units: &Units) -> BTreeMap<(i64, i64), Mark> {
    let letters = type_letters(&scenario.unit_types);
    let mut squares = BTreeMap::new();
    for (id, unit) in scenario.units.iter().enumerate().filter(|(id, _)| units.alive[*id]) {
        let mark = match unit.faction {
            Faction::Ally => '<',
            Faction::Enemy => '>',
        };
        squares.entry(square_of(units.pos[id].as_dvec2().into())).or_insert([letters[unit.unit_type], mark]);
    }
    squares
}

fn square_of(position: [f64; 2]) -> (i64, i64) {
    let [x, y] = position.map(|coordinate| coordinate.floor() as i64);
    (x, y)
}

/// The two characters of a square.
fn square(scenario: &Scenario, units: &BTreeMap<(i64, i64), Mark>, x: i64, y: i64) -> String {
    let [first, second] = match units.get(&(x, y)) {
        Some(mark) => *mark,
        None if square_of(scenario.attack_point) == (x, y) => ['x', ' '],
        None if scenario.terrain.is_walkable(x, y) => ['.', ' '],
        None => ['#', '#'],
    };
    String::from_iter([first, second])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_shows_north_above_south_and_units_with_their_side() {
        let scenario = Scenario::standard("2s3z").unwrap();
        let start = start_of(&scenario);
        assert_eq!(army(&scenario, &start, Faction::Ally), "2 STALKER (S), 3 ZEALOT (Z)");
        let units = units_by_square(&scenario, &start);
        let unit = &scenario.units[0];
        let (x, y) = square_of(unit.position);
        assert_eq!((unit.faction, square(&scenario, &units, x, y).as_str()), (Faction::Ally, "S<"));
        assert_eq!(square(&scenario, &units, 0, 0), "##", "the border is blocked");
        assert_eq!(square(&scenario, &units, 16, 16), ". ");
    }
}
