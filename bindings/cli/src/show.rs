//! `smaclite-pool show`: a scenario as a map of characters, or as a picture; all of them as a contact sheet.

use super::files::write_file;
use super::number::{seed, whole};
use super::picture::{Size, theme};
use super::snapshot::{SavedBattle, is_snapshot};
use super::usage::{file_ending_in, first_given};
use super::{CommandResult, completions};
use clap::Args;
use smaclite_engine::{Arena, Battle, Rules, Units};
use smaclite_scenarios::{Faction, Generation, Placement, Scenario, Starts, Teams};
use smaclite_units::UnitType;
use smaclite_view::{Cell, Observer, Options, Picture, Renderer, Sheet, SizeError, Theme, type_letters};
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
    /// Show so many draws of the teams and start positions of a generated scenario, 1 to 100 [default: 1]
    #[arg(long, value_name = "K", conflicts_with_all = ["all", "of"], value_parser = whole(1..=100_u16))]
    samples: Option<u16>,
    /// Seed of the first draw; each further one has the next [default: 0]
    #[arg(long, conflicts_with_all = ["all", "of"], value_parser = seed())]
    seed: Option<u64>,
    /// Put the 23 maps of SMAC into one picture, each with its name
    #[arg(long, conflicts_with = "scenario", requires = "png")]
    all: bool,
    /// Write a picture to this PNG file, instead of printing the map; a file of that name is replaced
    #[arg(long, value_name = "OUT", value_parser = file_ending_in("png"))]
    png: Option<PathBuf>,
    /// Width and height of the picture, or of each one with --all, in pixels [default: 512x512; 256x256]
    #[arg(long, value_name = "WxH", requires = "png")]
    size: Option<Size>,
    /// Background of the picture [default: dark]
    #[arg(long, requires = "png", value_parser = theme())]
    theme: Option<Theme>,
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
            let starts = all.map(|scenario| (scenario.name.clone(), Start::drawn(scenario, 0)));
            return self.write_png(&self.sheet(starts)?);
        };
        let of_draws = first_given([("--samples", self.samples.is_some()), ("--seed", self.seed.is_some())]);
        let (scenario, units) = if is_snapshot(name.as_ref()) {
            if let Some(option) = of_draws {
                return Err(format!("{option} is for generated scenarios; `{name}` is a snapshot").into());
            }
            let saved = SavedBattle::read(name.as_ref(), self.of.as_deref())?;
            if self.png.is_none() {
                saved.print()?;
                out!()?;
            }
            (saved.setup.rules.figures(&saved.scenario).into_owned(), saved.snapshot.units)
        } else if self.of.is_some() {
            return Err(format!("--scenario is for snapshots, FILE.snapshot; `{name}` is none").into());
        } else {
            let scenario = Scenario::resolve(name)?;
            if let Some(option) = of_draws.filter(|_| scenario.generation.is_none()) {
                return Err(
                    format!("{option} is for generated scenarios; `{}` is none", scenario.name).into()
                );
            }
            let (samples, seed) = (self.samples.unwrap_or(1), self.seed.unwrap_or(0));
            if samples > 1 {
                return self.show_samples(&scenario, samples, seed);
            }
            let Start { scenario, units } = Start::drawn(scenario, seed);
            (scenario, units)
        };
        if self.png.is_none() {
            return print(&scenario, &units);
        }
        let default = Options::default();
        let size = Size { width: default.width, height: default.height };
        self.write_png(&self.picture(&scenario, &units, self.size.unwrap_or(size))?)
    }

    /// Shows several draws, as maps one after the other or as one picture.
    fn show_samples(&self, scenario: &Scenario, samples: u16, seed: u64) -> CommandResult {
        let seeds = (0..u64::from(samples)).map(|i| seed.wrapping_add(i));
        let starts = seeds.map(|seed| (format!("seed {seed}"), Start::drawn(scenario.clone(), seed)));
        if self.png.is_some() {
            return self.write_png(&self.sheet(starts)?);
        }
        for (caption, Start { scenario, units }) in starts {
            out!("{caption}")?;
            print(&scenario, &units)?;
            out!()?;
        }
        Ok(())
    }

    fn write_png(&self, picture: &Picture) -> CommandResult {
        let Some(png) = &self.png else { return Ok(()) };
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
            theme: self.theme.unwrap_or_default(),
            ..Options::default()
        };
        let start = Observer::of_units(scenario, units);
        Ok(Renderer::new(scenario, options)?.render(start.moment()))
    }

    /// A contact sheet of starts with their captions.
    fn sheet(&self, starts: impl Iterator<Item = (String, Start)>) -> Result<Picture, SizeError> {
        let size = self.size.unwrap_or(CELL);
        let picture =
            |(caption, Start { scenario, units })| Ok((self.picture(&scenario, &units, size)?, caption));
        let pictures = starts.map(picture);
        let pictures = pictures.collect::<Result<Vec<_>, SizeError>>()?;
        let cells = pictures.iter().map(|(picture, caption)| Cell { picture, caption }).collect::<Vec<_>>();
        Sheet { columns: COLUMNS, theme: self.theme.unwrap_or_default() }.compose(&cells)
    }
}

/// The start of a battle: its units, and the scenario with them as its own.
struct Start {
    scenario: Scenario,
    units: Units,
}

impl Start {
    /// The start of the first battle of a seed.
    fn drawn(mut scenario: Scenario, seed: u64) -> Start {
        let battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::default())), seed);
        for (unit, unit_type) in scenario.units.iter_mut().zip(battle.types()) {
            unit.unit_type = unit_type;
        }
        Start { units: battle.units().clone(), scenario }
    }
}

fn print(scenario: &Scenario, units: &Units) -> CommandResult {
    let limit = scenario.episode_limit.map_or("none".to_owned(), |steps| format!("{steps} steps"));
    let (width, height) = (scenario.terrain.width(), scenario.terrain.height());
    out!("{}: {width} x {height} squares, episode limit {limit}", scenario.name)?;
    if let Some(generation) = &scenario.generation {
        out!("drawn for each episode: {}", described(generation, scenario))?;
    }
    out!("< agents: {}", army(scenario, units, Faction::Ally))?;
    out!("> enemies: {}\n", army(scenario, units, Faction::Enemy))?;
    let units = units_by_square(scenario, units);
    for y in (0..i64::from(height)).rev() {
        let row: String = (0..i64::from(width)).map(|x| square(scenario, &units, x, y)).collect();
        out!("{}", row.trim_end())?;
    }
    Ok(())
}

/// The distributions of a generated scenario.
fn described(generation: &Generation, scenario: &Scenario) -> String {
    let name = |unit_type: &usize| &*scenario.unit_types[*unit_type].name;
    let names = |types: &[usize]| types.iter().map(name).collect::<Vec<_>>().join(", ");
    let teams = match &generation.teams {
        Teams::OfGroups => "the units of the groups".to_owned(),
        Teams::Weighted { types, weights, .. } => {
            let shares = types.iter().zip(weights);
            let shares =
                shares.map(|(unit_type, weight)| format!("{} {:.0} %", name(unit_type), 100.0 * weight));
            shares.collect::<Vec<_>>().join(", ")
        }
        Teams::All { types, .. } => format!("all teams of {}", names(types)),
        Teams::Fixed { teams } => format!("one of {} teams", teams.len()),
    };
    let starts = match generation.starts {
        Starts::OfGroups => "at their groups".to_owned(),
        Starts::Reflect => "reflected".to_owned(),
        Starts::Surrounded => "surrounded".to_owned(),
        Starts::SurroundedAndReflect { p } => format!("reflected ({:.0} %) or surrounded", 100.0 * p),
        Starts::Uniform { .. } => "uniform in areas".to_owned(),
    };
    format!("{teams}; {starts}")
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
        let start = Start::drawn(scenario.clone(), 0).units;
        assert_eq!(army(&scenario, &start, Faction::Ally), "2 STALKER (S), 3 ZEALOT (Z)");
        let units = units_by_square(&scenario, &start);
        let unit = &scenario.units[0];
        let (x, y) = square_of(unit.position);
        assert_eq!((unit.faction, square(&scenario, &units, x, y).as_str()), (Faction::Ally, "S<"));
        assert_eq!(square(&scenario, &units, 0, 0), "##", "the border is blocked");
        assert_eq!(square(&scenario, &units, 16, 16), ". ");
    }
}
