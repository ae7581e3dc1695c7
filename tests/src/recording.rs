//! The reader of recorded battles.

use std::error::Error;
use std::path::{Path, PathBuf};

use crate::npy::Npz;
use glam::Vec2;
use smaclite_engine::{Battle, Generator, NeighbourOrder, Opponent, Snapshot, TICKS_PER_STEP, Units};
use smaclite_scenarios::{Scenario, ScenarioFiles};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// One recorded battle of T steps.
pub struct Recording {
    /// The file.
    pub path: PathBuf,
    /// Name of the scenario.
    pub scenario: String,
    /// Seed of the battle's generator.
    pub seed: u64,
    /// The sizes of the recorded environment: agents, enemies, actions, floats in obs and state.
    pub sizes: [usize; 5],
    /// Its greatest unscaled return.
    pub max_reward: f64,
    /// Units before each step, and after the last: T + 1.
    pub frames: Vec<Units>,
    /// Joint action of each step.
    pub actions: Vec<Vec<i32>>,
    /// Execution order of each tick of each step.
    pub orders: Vec<[Vec<u32>; TICKS_PER_STEP]>,
    /// Reward of each step.
    pub rewards: Vec<f64>,
    /// Whether each step ended the episode.
    pub terminated: Vec<bool>,
    /// Whether the last step ended in a victory.
    pub won: bool,
    /// Observations before each step, and after the last.
    pub obs: Vec<Vec<f32>>,
    /// The state likewise.
    pub state: Vec<Vec<f32>>,
    /// Available actions likewise.
    pub avail: Vec<Vec<u8>>,
    /// The same tick by tick, in files that contain it.
    pub ticks: Option<Ticks>,
}

/// The additional content of files that were recorded tick by tick.
pub struct Ticks {
    /// Units before each tick, and after the last: 8 T + 1.
    pub frames: Vec<Units>,
    /// Preferred velocity of each unit in each tick.
    pub preferred: Vec<Vec<Vec2>>,
    /// Unscaled reward of each tick, without that for winning.
    pub earned: Vec<f64>,
}

/// The folder of recordings: `SMACLITE_TRACES`, else `golden`.
pub fn folder() -> PathBuf {
    match std::env::var_os("SMACLITE_TRACES") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("golden"),
    }
}

/// All recordings in the folder and its subfolders, by path.
///
/// # Panics
/// If one cannot be read, or there are none.
pub fn all() -> Vec<Recording> {
    let mut paths = Vec::new();
    gather(&folder(), &mut paths);
    paths.sort();
    assert!(!paths.is_empty(), "no recordings (*.npz) in {}", folder().display());
    let read = |path: PathBuf| Recording::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    paths.into_iter().map(read).collect()
}

fn gather(folder: &Path, paths: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    for path in entries.map(|entry| entry.expect("a readable folder").path()) {
        if path.is_dir() {
            gather(&path, paths);
        } else if path.extension().is_some_and(|extension| extension == "npz") {
            paths.push(path);
        }
    }
}

impl Recording {
    /// Reads one file.
    ///
    /// # Errors
    /// The part that could not be read.
    pub fn read(path: &Path) -> Result<Recording> {
        let arrays = Npz::read(path)?;
        let meta = arrays.json("meta")?;
        let size = |key: &str| meta[key].as_u64().map(|x| x as usize).ok_or(format!("no {key} in meta"));
        let sizes = [
            size("n_agents")?,
            size("n_enemies")?,
            size("n_actions")?,
            size("obs_size")?,
            size("state_size")?,
        ];
        let [n_agents, n_enemies, n_actions, obs_size, state_size] = sizes;
        let n_units = n_agents + n_enemies;
        let has_ticks = arrays.has("tick_pos");
        let ticks = if has_ticks {
            Some(Ticks {
                frames: frames(&arrays, "tick_", n_units)?,
                preferred: rows(vectors(&arrays, "tick_pref")?, n_units),
                earned: arrays.floats("tick_reward")?,
            })
        } else {
            None
        };
        Ok(Recording {
            path: path.to_owned(),
            scenario: meta["scenario"].as_str().ok_or("no scenario in meta")?.to_owned(),
            seed: meta["seed"].as_u64().ok_or("no seed in meta")?,
            sizes,
            max_reward: meta["max_reward"].as_f64().ok_or("no max_reward in meta")?,
            frames: frames(&arrays, "", n_units)?,
            actions: rows(arrays.integers("actions")?.into_iter().map(|x| x as i32).collect(), n_agents),
            orders: orders(&arrays.integers("order")?, n_units),
            rewards: arrays.floats("reward")?,
            terminated: arrays.flags("terminated")?,
            won: arrays.flags("won")?.first().copied().ok_or("won is empty")?,
            obs: rows(arrays.singles("obs")?, n_agents * obs_size),
            state: rows(arrays.singles("state")?, state_size),
            avail: rows(
                arrays.integers("avail")?.into_iter().map(|x| x as u8).collect(),
                n_agents * n_actions,
            ),
            ticks,
        })
    }

    /// The name of the file without its ending.
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The scenario, read from [its files](Self::load_files).
    ///
    /// # Panics
    /// If there is none.
    pub fn load_scenario(&self) -> Scenario {
        self.load_files().scenario().unwrap_or_else(|e| panic!("{e}"))
    }

    /// The texts of the scenario: of a file of its name beside the recording or at the top of the recordings,
    /// else of a standard one.
    ///
    /// # Panics
    /// If there is neither.
    pub fn load_files(&self) -> ScenarioFiles {
        let file = format!("{}.json", self.scenario);
        let beside = self.path.with_file_name(&file);
        let at_top = folder().join(&file);
        let files = match [beside, at_top].into_iter().find(|path| path.is_file()) {
            Some(path) => ScenarioFiles::load(&path).map_err(|e| e.to_string()),
            None => {
                ScenarioFiles::resolve(&self.scenario).map_err(|e| format!("no {file} beside it, and {e}"))
            }
        };
        files.unwrap_or_else(|e| panic!("{}: {e}", self.path.display())).1
    }

    /// Number of steps.
    pub fn n_steps(&self) -> usize {
        self.actions.len()
    }

    /// The battle before step `t`. Values that the recording does not contain come from `played`, the same
    /// battle played up to there: the neighbour order, planned velocities, and in older files the declared
    /// attacks.
    ///
    /// If other units are alive in `played`, because it differs from the recording, the neighbour order is
    /// that of the start of an episode.
    pub fn snapshot(&self, t: usize, played: &Battle) -> Snapshot {
        let last = t.checked_sub(1).map(|last| &self.actions[last]);
        let mut units = self.frames[t].clone();
        for (unit, planned_vel) in units.planned_vel.iter_mut().enumerate() {
            if *planned_vel == played.units().vel[unit] {
                *planned_vel = played.units().planned_vel[unit];
            }
        }
        if units.declared.is_empty() {
            units.declared.clone_from(&played.units().declared);
        }
        let Snapshot { types, neighbour_order, perception, .. } = played.save();
        let neighbour_order = if units.alive == played.units().alive {
            neighbour_order
        } else {
            NeighbourOrder::new(played.arena(), &types, &units)
        };
        Snapshot {
            types,
            units,
            neighbour_order,
            perception,
            // A script plays the enemies.
            last_actions: (0..self.sizes[0])
                .map(|agent| last.map(|actions| actions[agent] as u32))
                .chain((0..self.sizes[1]).map(|_| None))
                .collect(),
            opponent: Opponent::default(),
            generator: Generator::new(self.seed),
            episode_length: t as u32,
            episode_return: self.rewards[..t].iter().sum(),
        }
    }

    /// The execution orders of step `t`.
    pub fn order(&self, t: usize) -> [&[u32]; TICKS_PER_STEP] {
        std::array::from_fn(|tick| &self.orders[t][tick][..])
    }
}

fn frames(arrays: &Npz, prefix: &str, n_units: usize) -> Result<Vec<Units>> {
    let name = |column: &str| format!("{prefix}{column}");
    let pos = rows(vectors(arrays, &name("pos"))?, n_units);
    let vel = rows(vectors(arrays, &name("vel"))?, n_units);
    let column = |column: &str| arrays.floats(&name(column)).map(|values| rows(values, n_units));
    let (hp, shield, energy) = (column("hp")?, column("shield")?, column("energy")?);
    let (cooldown, shield_cooldown) = (column("cooldown")?, column("shield_cooldown")?);
    let healing = column("healing")?;
    let alive = rows(arrays.flags(&name("alive"))?, n_units);
    let target = arrays.integers(&name("target"))?.into_iter().map(|id| u32::try_from(id).ok()).collect();
    let target: Vec<Vec<Option<u32>>> = rows(target, n_units);
    let declared = match arrays.has(&name("declared")) {
        true => rows(arrays.flags(&name("declared"))?, n_units),
        false => vec![Vec::new(); pos.len()],
    };
    let frame = |t: usize| Units {
        pos: pos[t].clone(),
        vel: vel[t].clone(),
        planned_vel: vel[t].clone(),
        hp: hp[t].clone(),
        shield: shield[t].clone(),
        energy: energy[t].clone(),
        cooldown: cooldown[t].clone(),
        shield_cooldown: shield_cooldown[t].clone(),
        healing: healing[t].clone(),
        alive: alive[t].clone(),
        target: target[t].clone(),
        declared: declared[t].clone(),
        phases: Vec::new(),
    };
    Ok((0..pos.len()).map(frame).collect())
}

fn orders(ids: &[i64], n_units: usize) -> Vec<[Vec<u32>; TICKS_PER_STEP]> {
    const PADDING: i64 = 255;
    let tick = |ids: &[i64]| ids.iter().take_while(|&&id| id != PADDING).map(|&id| id as u32).collect();
    let ticks = |step: &[i64]| std::array::from_fn(|i| tick(&step[i * n_units..(i + 1) * n_units]));
    ids.chunks_exact(TICKS_PER_STEP * n_units).map(ticks).collect()
}

fn rows<T: Clone>(values: Vec<T>, size: usize) -> Vec<Vec<T>> {
    values.chunks_exact(size).map(<[T]>::to_vec).collect()
}

fn vectors(arrays: &Npz, name: &str) -> Result<Vec<Vec2>> {
    Ok(arrays.singles(name)?.chunks_exact(2).map(Vec2::from_slice).collect())
}
