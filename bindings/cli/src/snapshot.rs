//! Files of snapshots, NAME.snapshot: the bytes of one snapshot. The scenario is found by the hash in them.

use super::table::Table;
use smaclite_engine::{
    Arena, BattleSetup, Column, Opponent, RecordLayout, RecordSizes, Rules, Sides, Snapshot, SnapshotError,
};
use smaclite_learn::resolve_scenario;
use smaclite_scenarios::{Faction, Placement, Scenario, ScenarioError};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The suffix of the files.
pub(super) const SUFFIX: &str = "snapshot";

/// More than the snapshot of the largest scenario has.
const MAX_BYTES: u64 = 16 << 20;

/// How NumPy's files begin.
const NUMPY: &[u8] = b"\x93NUMPY";

/// Whether a file is called as snapshots are.
pub(super) fn is_snapshot(file: &Path) -> bool {
    file.extension().is_some_and(|suffix| suffix == SUFFIX)
}

/// The state of a battle, and what is played.
pub(super) struct SavedBattle {
    pub(super) setup: BattleSetup,
    pub(super) scenario: Scenario,
    pub(super) arena: Arena,
    pub(super) snapshot: Snapshot,
}

/// Why there is no battle in a file.
#[derive(Debug, thiserror::Error)]
pub(super) enum SavedBattleError {
    #[error("cannot read `{}`: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("`{}` is not a regular file of at most {} MiB", path.display(), MAX_BYTES >> 20)]
    NotRegular { path: PathBuf },
    #[error(
        "`{}` is an array file of NumPy; write the bytes of one snapshot, `batch.snapshot[0].tofile(FILE)`",
        path.display()
    )]
    NumPy { path: PathBuf },
    #[error("`{}`: {source}", path.display())]
    Snapshot { path: PathBuf, source: SnapshotError },
    #[error(
        "`{}` is of no standard scenario: column 'scenario' is {hash:#018x}, of {n_agents} agents and \
         {n_enemies} enemies; name the scenario's file too",
        path.display()
    )]
    UnknownScenario { path: PathBuf, hash: u64, n_agents: usize, n_enemies: usize },
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
}

impl SavedBattle {
    /// Reads a file. Its scenario is `scenario`, if that is given, or one of the standard ones.
    pub(super) fn read(path: &Path, scenario: Option<&str>) -> Result<SavedBattle, SavedBattleError> {
        let bytes = read_bytes(path)?;
        let damaged = |source| SavedBattleError::Snapshot { path: path.to_owned(), source };
        let layout = RecordLayout::of(&bytes).map_err(damaged)?;
        let rules = layout.rules(&bytes).map_err(damaged)?;
        let (setup, mut scenario, arena) = find_scenario(path, &layout, &bytes, rules, scenario)?;
        let mut snapshot = Snapshot::default();
        let n_past = layout.sizes().n_past;
        snapshot.read_record(&arena, n_past, &bytes, &mut Vec::new()).map_err(damaged)?;
        // The units of this episode, of which those of a generated scenario are one sample.
        for (unit, unit_type) in scenario.units.iter_mut().zip(&snapshot.types) {
            unit.unit_type = *unit_type as usize;
        }
        Ok(SavedBattle { setup, scenario, arena, snapshot })
    }

    /// The same battle with enemies that a script plays from now on.
    pub(super) fn against(self, opponent: Opponent) -> Result<SavedBattle, SavedBattleError> {
        let SavedBattle { setup, scenario, mut snapshot, .. } = self;
        let setup = BattleSetup { opponents: opponent.into(), sides: Sides::Allies, ..setup };
        let (_, arena) = setup.arena().map_err(ScenarioError::from)?;
        snapshot.play_on(&arena, opponent);
        Ok(SavedBattle { setup, scenario, arena, snapshot })
    }

    /// Prints what has happened and all units.
    pub(super) fn print(&self) -> io::Result<()> {
        let SavedBattle { setup, scenario, arena, snapshot } = self;
        let end = if snapshot.is_over(arena) { ", the battle is over" } else { "" };
        out!("{}: rules {}, opponent {}", scenario.name, setup.rules, snapshot.opponent.name())?;
        out!("step {}, return {:.2}{end}\n", snapshot.episode_length, snapshot.episode_return)?;
        let mut table = Table::new(["unit", "type", "x", "y", "health", "shield", "energy", "cooldown"]);
        let mut units: Vec<(usize, &Placement)> = scenario.units.iter().enumerate().collect();
        units.sort_by_key(|(_, unit)| (unit.faction == Faction::Enemy, unit.id_in_faction));
        for (id, unit) in units {
            let unit_type = &scenario.unit_types[unit.unit_type];
            let faction = if unit.faction == Faction::Ally { "agent" } else { "enemy" };
            let units = &snapshot.units;
            let of = |value: f64, max: f64| {
                if max > 0.0 { format!("{value:.1} of {max}") } else { "-".to_owned() }
            };
            let alive = |text: String| if units.alive[id] { text } else { "-".to_owned() };
            let health = if units.alive[id] { of(units.hp[id], unit_type.hp) } else { "dead".to_owned() };
            table.push([
                format!("{faction} {}", unit.id_in_faction),
                unit_type.name.clone(),
                alive(format!("{:.2}", units.pos[id].x)),
                alive(format!("{:.2}", units.pos[id].y)),
                health,
                alive(of(units.shield[id], unit_type.shield)),
                alive(of(units.energy[id], unit_type.energy)),
                alive(format!("{:.2} s", units.cooldown[id])),
            ]);
        }
        table.print()
    }
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, SavedBattleError> {
    let unreadable = |source| SavedBattleError::Read { path: path.to_owned(), source };
    let metadata = fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() || metadata.len() > MAX_BYTES {
        return Err(SavedBattleError::NotRegular { path: path.to_owned() });
    }
    let bytes = fs::read(path).map_err(unreadable)?;
    if bytes.starts_with(NUMPY) {
        return Err(SavedBattleError::NumPy { path: path.to_owned() });
    }
    Ok(bytes)
}

/// Whether joint actions play both sides of the battle of a record.
fn has_two_sides(layout: &RecordLayout, bytes: &[u8]) -> bool {
    layout.column(bytes, Column::Opponent) == (Opponent::Learner.index() as u32).to_le_bytes()
}

/// The scenario whose hash the snapshot has with these rules; a named scenario of another hash, too, by which
/// reading the snapshot says what differs.
fn find_scenario(
    path: &Path,
    layout: &RecordLayout,
    bytes: &[u8],
    rules: Rules,
    named: Option<&str>,
) -> Result<(BattleSetup, Scenario, Arena), SavedBattleError> {
    let hash = layout.column(bytes, Column::Scenario).iter().rev();
    let hash = hash.fold(0, |hash, byte| hash << 8 | u64::from(*byte)); // little-endian
    let RecordSizes { n_agents, n_enemies, .. } = layout.sizes();
    let names: Vec<&str> = named.map_or_else(
        || Scenario::standard_names().chain(Scenario::generated_names()).collect(),
        |name| vec![name],
    );
    let mut other = None;
    for name in names {
        let setup = resolve_scenario(name, rules)?;
        let setup = match has_two_sides(layout, bytes) {
            true => setup.with_sides(Sides::Both),
            false => setup,
        };
        let (scenario, arena) = match setup.arena() {
            Ok(played) => played,
            Err(_) if named.is_none() => continue, // a standard one, whose battles have one side
            Err(problems) => return Err(ScenarioError::from(problems).into()),
        };
        let found = (setup, scenario, arena);
        if found.2.scenario_hash() == hash {
            return Ok(found);
        }
        other = Some(found);
    }
    let unknown = SavedBattleError::UnknownScenario { path: path.to_owned(), hash, n_agents, n_enemies };
    other.filter(|_| named.is_some()).ok_or(unknown)
}
