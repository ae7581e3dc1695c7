//! One recording: its arrays, and the scenario that it was recorded in.

use std::error::Error;
use std::path::Path;

use serde_json::{Map, Value, json};
use smaclite_engine::smacv2::{Frame, Interface};
use smaclite_scenarios::{Scenario, Smacv2, Terrain};
use smaclite_tests::npy::Npz;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// The names of the types by their codes.
const NAMES: [&str; 9] =
    ["BANELING", "COLOSSUS", "HYDRALISK", "MARAUDER", "MARINE", "MEDIVAC", "STALKER", "ZEALOT", "ZERGLING"];
/// SMACv2's divisors of the cooldown; of the energy of medivacs.
const READINESS: [f64; 9] = [1.0, 24.0, 10.0, 25.0, 15.0, 200.0, 35.0, 22.0, 11.0];
const MEDIVAC: usize = 5;
const SIDE: u32 = 32;

/// A recording.
pub struct Case {
    pub arrays: Npz,
    pub scenario: Scenario,
    pub interface: Interface,
    pub n_agents: usize,
    pub n_enemies: usize,
    /// The arguments of the recorded environment.
    pub args: Value,
    /// How many units appear in each tick of a reset; all at once if `None`.
    pub spawn_per_tick: Option<usize>,
    /// By code: the index in the scenario's types.
    type_index: [Option<u32>; 9],
    columns: Columns,
}

/// The raw states of the units in all frames.
struct Columns {
    episode: Vec<i64>,
    types: Vec<i64>,
    positions: Vec<f32>,
    health: Vec<f32>,
    shield: Vec<f32>,
    energy: Vec<f32>,
    cooldown: Vec<f32>,
}

impl Case {
    pub fn read(path: &Path) -> Result<Case> {
        let arrays = Npz::read(path)?;
        let meta = arrays.json("meta")?;
        let args = meta["args"].clone();
        let size =
            |key: &str| meta["sizes"][key].as_u64().map(|x| x as usize).ok_or(format!("no size {key}"));
        let (n_agents, n_enemies) = (size("n_agents")?, size("n_enemies")?);
        let mut scenario = scenario(&args, &meta["override"], [n_agents, n_enemies])?;
        let columns = Columns {
            episode: arrays.integers("episode")?,
            types: arrays.integers("type")?,
            positions: arrays.singles("pos")?,
            health: arrays.singles("health")?,
            shield: arrays.singles("shield")?,
            energy: arrays.singles("energy")?,
            cooldown: arrays.singles("cooldown")?,
        };
        let (health_max, shield_max) = (arrays.singles("health_max")?, arrays.singles("shield_max")?);
        let mut type_index = [None; 9];
        for (code, name) in NAMES.iter().enumerate() {
            let Some(index) = scenario.unit_types.iter().position(|unit_type| unit_type.name == *name) else {
                continue;
            };
            type_index[code] = Some(index as u32);
            let unit_type = &mut scenario.unit_types[index];
            // The units of SMACv2's map, not those of the scenario's unit files.
            if let Some(unit) = columns.types.iter().position(|other| *other == code as i64) {
                unit_type.hp = health_max[unit].into();
                unit_type.shield = shield_max[unit].into();
            }
            (unit_type.cooldown, unit_type.energy) = match code {
                MEDIVAC => (unit_type.cooldown, READINESS[code]),
                _ => (READINESS[code], unit_type.energy),
            };
        }
        if arrays.has("pathing_grid") {
            let open = by_row(arrays.integers("pathing_grid")?, arrays.is_by_column("pathing_grid")?);
            let is_open = |x: u32, y: u32| open[(y * SIDE + x) as usize] != 0;
            scenario.terrain = Terrain::from_fn(SIDE, SIDE, is_open).ok_or("a map without squares")?;
        }
        let options = scenario.smacv2.clone().ok_or("no options")?;
        let mut interface = Interface::new(&scenario, &options);
        if arrays.has("terrain_height") {
            let heights = arrays.floats("terrain_height")?;
            interface = interface.with_heights(by_row(heights, arrays.is_by_column("terrain_height")?));
        }
        Ok(Case {
            spawn_per_tick: meta["spawn_per_tick"].as_u64().map(|n| n as usize),
            arrays,
            scenario,
            interface,
            n_agents,
            n_enemies,
            args,
            type_index,
            columns,
        })
    }

    pub fn n_units(&self) -> usize {
        self.n_agents + self.n_enemies
    }

    /// Whether an argument of the recorded environment was true.
    pub fn is_on(&self, argument: &str) -> bool {
        self.args[argument].as_bool().unwrap_or(false)
    }

    /// The index in the scenario's types of a code.
    pub fn type_of(&self, code: i64) -> u32 {
        self.type_index[code as usize].expect("a type of the race")
    }

    pub fn episode(&self, frame: usize) -> usize {
        self.columns.episode[frame] as usize
    }

    /// The units of a frame.
    pub fn frame(&self, index: usize) -> Frame {
        let (columns, n_units) = (&self.columns, self.n_units());
        let row = |column: &[f32]| column[index * n_units..][..n_units].to_vec();
        let wide = |column: &[f32]| row(column).into_iter().map(f64::from).collect::<Vec<f64>>();
        let codes = &columns.types[self.episode(index) * n_units..][..n_units];
        let (energy, cooldown) = (wide(&columns.energy), wide(&columns.cooldown));
        let readiness = codes.iter().zip(energy.iter().zip(&cooldown));
        let readiness = readiness.map(|(code, (energy, cooldown))| match *code == MEDIVAC as i64 {
            true => *energy,
            false => *cooldown,
        });
        let positions = columns.positions[index * n_units * 2..][..n_units * 2].chunks_exact(2);
        let mut frame = Frame {
            types: codes.iter().map(|code| self.type_of(*code)).collect(),
            x: positions.clone().map(|p| p[0]).collect(),
            y: positions.map(|p| p[1]).collect(),
            health: wide(&columns.health),
            shield: wide(&columns.shield),
            readiness: readiness.collect(),
            ..Frame::default()
        };
        self.interface.measure(&mut frame);
        frame
    }
}

/// Items of a map `[x][y]`, row y = 0 first.
fn by_row<T: Copy>(items: Vec<T>, is_by_column: bool) -> Vec<T> {
    if is_by_column {
        return items;
    }
    let side = SIDE as usize;
    (0..side * side).map(|i| items[i % side * side + i / side]).collect()
}

/// The scenario with the options that the arguments of a recorded environment mean.
fn scenario(args: &Value, overridden: &Value, [n_agents, n_enemies]: [usize; 2]) -> Result<Scenario> {
    let race = args["map_name"].as_str().and_then(|name| name.strip_prefix("10gen_")).ok_or("no map name")?;
    let ids = match race {
        "protoss" => json!({"STALKER": 0, "ZEALOT": 1, "COLOSSUS": 2}),
        "terran" => json!({"MARINE": 0, "MARAUDER": 1, "MEDIVAC": 2}),
        _ => json!({"ZERGLING": 0, "HYDRALISK": 1, "BANELING": 2}),
    };
    let types: Vec<&String> = ids.as_object().ok_or("no types")?.keys().collect();
    let text = json!({
        "name": race,
        "num_allied_units": n_agents,
        "num_enemy_units": n_enemies,
        "teams": {
            "distribution": "weighted_teams",
            "unit_types": types,
            "weights": [0.25, 0.25, 0.5],
        },
        "start_positions": {"distribution": "reflect_position"},
        "terrain_preset": "FLAT",
        "num_unit_types": 3,
        "unit_type_ids": ids,
        "ally_has_shields": race == "protoss",
        "enemy_has_shields": race == "protoss",
        "episode_limit": 200,
    });
    let mut scenario = Scenario::from_json(&text.to_string(), race, Path::new("."))
        .map_err(|problems| format!("{problems}"))?;
    scenario.smacv2 = Some(options(args, overridden)?);
    Ok(scenario)
}

/// The options that the arguments of a recorded environment mean.
fn options(args: &Value, overridden: &Value) -> Result<Smacv2> {
    let known = serde_json::to_value(Smacv2::default())?;
    let known = known.as_object().ok_or("no options")?;
    let mut options = Map::new();
    for (key, value) in args.as_object().into_iter().chain(overridden.as_object()).flatten() {
        if known.contains_key(key) {
            options.insert(key.clone(), value.clone());
        }
    }
    let capabilities = &args["capability_config"];
    for name in ["attack", "health"] {
        let capability = &capabilities[name];
        if !capability.is_null() {
            let observe = &capability["observe"];
            options.insert(name.into(), json!({"lower_bound": 0.0, "upper_bound": 1.0, "observe": observe}));
        }
    }
    if !capabilities["enemy_mask"].is_null() {
        options.insert("enemy_mask".into(), json!({"mask_probability": 0.5}));
    }
    options.insert("observe_team".into(), capabilities["team_gen"]["observe"].clone());
    options.insert("published".into(), true.into());
    Ok(serde_json::from_value(options.into())?)
}
