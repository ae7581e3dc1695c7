//! The data of the page: what its scripts (`track.js`) decode. `page/data.d.ts` describes it to them; a test
//! writes that file. It has no version, because a page contains both the data and the scripts.
//!
//! Moments and steps are streams of variable-length integers (LEB128; signed ones in zigzag order),
//! compressed by deflate and written in base64. Values are rounded to what can be seen.

use std::f32::consts::TAU;
use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use serde::Serialize;
use smaclite_engine::{Arena, Battle, FeatureBlock, agent_ranges, obs_features};
use smaclite_scenarios::{Faction, Scenario, Smacv2};
use smaclite_units::{Keyword, Targeter, UnitType};

#[cfg(test)]
use ts_rs::TS;

use crate::{AttackKind, EpisodeResult, Moment, Replay, ReplayError, UnitMoment, type_letters};

/// Units of the columns of a moment, per square, second, or point.
const POSITION: f32 = 256.0;
const POINTS: f32 = 10.0;
/// A tick is a whole number of these, so a running cooldown falls by equal differences.
const SECONDS: f32 = 160.0;
const DIRECTIONS: i64 = 256;

/// What no tick changes: terrain, unit types, units, sizes.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub struct ScenarioInfo {
    name: String,
    width: u32,
    height: u32,
    /// Blocked rectangles: west, south, east and north side, in squares.
    obstacles: Vec<[u32; 4]>,
    attack_point: [f64; 2],
    types: Vec<TypeInfo>,
    units: Vec<UnitInfo>,
    n_agents: usize,
    n_actions: usize,
    /// The action of an agent that means its first target. Looks stand before it, if there are any.
    first_target: usize,
    episode_limit: Option<u32>,
    units_per: UnitsPer,
}

/// What a page shows of a unit type.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub struct TypeInfo {
    name: String,
    label: char,
    radius: f64,
    hp: f64,
    shield: f64,
    energy: f64,
    initial_energy: f64,
    cooldown: f64,
    attack_range: f64,
    /// How far agents of the type see.
    sight_range: f64,
    plane: &'static str,
    #[cfg_attr(test, ts(type = "\"shot\" | \"beam\" | \"explosion\" | \"heal\""))]
    attack: &'static str,
    /// Width and height of a beam, or the radius of an explosion.
    attack_size: [f64; 2],
}

#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
struct UnitInfo {
    /// Index in `types`.
    #[serde(rename = "type")]
    unit_type: usize,
    /// 0 for agents, 1 for enemies.
    faction: usize,
    /// The number in its faction.
    id: usize,
}

/// A block of features of an observation.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub struct Features {
    name: &'static str,
    start: usize,
    /// `None` for a block that is one row and not a list of units.
    rows: Option<usize>,
    features: Vec<String>,
}

/// How many units of the encoded columns are one square, point, second or turn.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
struct UnitsPer {
    position: f32,
    points: f32,
    seconds: f32,
    turn: i32,
}

/// The data of the page of a replay.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(super) struct ReplayData {
    pub(super) program: String,
    pub(super) rules: String,
    pub(super) scenario: ScenarioInfo,
    pub(super) episodes: Vec<EpisodeData>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(super) struct EpisodeData {
    /// A text, because JavaScript has no 64-bit integers.
    seed: String,
    steps: u32,
    /// The step with which the recording begins.
    first_step: u32,
    episode_return: f64,
    #[cfg_attr(test, ts(type = "\"won\" | \"lost\" | \"truncated\" | \"unfinished\""))]
    result: &'static str,
    /// Allies and enemies that died.
    dead: [u32; 2],
    n_moments: usize,
    /// Compressed, in base64.
    moments: String,
    /// Compressed, in base64.
    decisions: String,
}

/// The data of a scenario.
pub fn scenario_info(scenario: &Scenario, arena: &Arena) -> ScenarioInfo {
    let terrain = &scenario.terrain;
    let rects = terrain.obstacles().iter().map(|rect| [rect.x0, rect.y0, rect.x1, rect.y1]);
    let units = scenario.units.iter().map(|unit| UnitInfo {
        unit_type: unit.unit_type,
        faction: usize::from(unit.faction == Faction::Enemy),
        id: unit.id_in_faction,
    });
    ScenarioInfo {
        name: scenario.name.clone(),
        width: terrain.width(),
        height: terrain.height(),
        obstacles: rects.collect(),
        attack_point: scenario.attack_point,
        types: types_info(&arena.rules().figures(scenario).unit_types, scenario.smacv2.as_ref()),
        units: units.collect(),
        n_agents: arena.sizes().n_agents,
        n_actions: arena.sizes().n_actions,
        first_target: arena.first_target(Faction::Ally),
        episode_limit: arena.episode_limit(),
        units_per: UnitsPer { position: POSITION, points: POINTS, seconds: SECONDS, turn: DIRECTIONS as i32 },
    }
}

/// What agents of a scenario observe, block by block.
pub fn features_info(scenario: &Scenario) -> Vec<Features> {
    let blocks = obs_features(scenario).into_iter();
    let info = |FeatureBlock { name, start, rows, features }| Features { name, start, rows, features };
    blocks.map(info).collect()
}

/// What the page shows of unit types, with the letter of each, where agents observe by these options.
pub fn types_info(types: &[UnitType], options: Option<&Smacv2>) -> Vec<TypeInfo> {
    let types = types.iter().zip(type_letters(types));
    types.map(|(unit_type, letter)| type_info(unit_type, letter, options)).collect()
}

fn type_info(unit_type: &UnitType, label: char, options: Option<&Smacv2>) -> TypeInfo {
    let (attack, attack_size) = match unit_type.targeter {
        Targeter::Standard => ("shot", [0.0, 0.0]),
        Targeter::LaserBeam { width, height } => ("beam", [width, height]),
        Targeter::Kamikaze { radius } => ("explosion", [radius, radius]),
        Targeter::Heal => ("heal", [0.0, 0.0]),
    };
    TypeInfo {
        name: unit_type.name.clone(),
        label,
        radius: unit_type.radius(),
        hp: unit_type.hp,
        shield: unit_type.shield,
        energy: unit_type.energy,
        initial_energy: unit_type.initial_energy,
        cooldown: unit_type.cooldown,
        attack_range: unit_type.attack_range,
        sight_range: agent_ranges(options, unit_type)[0],
        plane: unit_type.plane.name(),
        attack,
        attack_size,
    }
}

/// An episode of a replay, played by this version.
pub(super) fn episode(replay: &Replay, index: usize) -> Result<EpisodeData, ReplayError> {
    let mut player = replay.play(index)?;
    let mut moments = vec![player.moment().clone()];
    let first_step = player.battle().episode_length();
    let mut steps = Vec::new();
    loop {
        encode_step(player.battle(), player.actions(player.step()), &mut steps);
        let Some(played) = player.play_step()? else {
            break;
        };
        moments.extend(played.moments);
    }
    let episode = player.episode();
    let outcome = episode.outcome;
    Ok(EpisodeData {
        seed: episode.start.seed.to_string(),
        steps: outcome.steps,
        first_step,
        episode_return: outcome.episode_return,
        result: outcome.result().map_or("unfinished", EpisodeResult::name),
        dead: [outcome.dead_allies, outcome.dead_enemies],
        n_moments: moments.len(),
        moments: compressed(&encode_moments(&moments)),
        decisions: compressed(&steps),
    })
}

/// Encodes consecutive moments of an episode: the type of each unit; then column by column, in each unit by
/// unit, and in that each value as the difference from the moment before; then the attacks, moment by moment.
pub fn encode_moments(moments: &[Moment]) -> Vec<u8> {
    let columns: [fn(&UnitMoment) -> i64; 9] = [
        |unit| (unit.pos.x * POSITION).round() as i64,
        |unit| (unit.pos.y * POSITION).round() as i64,
        |unit| (unit.facing.rem_euclid(TAU) / TAU * DIRECTIONS as f32).round() as i64,
        |unit| (unit.hp * POINTS).ceil() as i64,
        |unit| (unit.shield * POINTS).round() as i64,
        |unit| (unit.energy * POINTS).round() as i64,
        |unit| (unit.cooldown * SECONDS).round() as i64,
        |unit| unit.target.map_or(0, |id| i64::from(id) + 1),
        |unit| unit.alive.into(),
    ];
    let mut out = Vec::new();
    let n_units = moments.first().map_or(0, |moment| moment.units.len());
    let types = moments.iter().take(1).flat_map(|moment| &moment.units).map(|unit| unit.unit_type as u64);
    types.for_each(|unit_type| put(&mut out, unit_type));
    for column in columns {
        for id in 0..n_units {
            let mut last = 0;
            for moment in moments {
                let value = column(&moment.units[id]);
                let difference = value - last;
                put(&mut out, (difference << 1 ^ difference >> 63) as u64);
                last = value;
            }
        }
    }
    for moment in moments {
        put(&mut out, moment.attacks.len() as u64);
        for attack in &moment.attacks {
            let (kind, flight) = match attack.kind {
                AttackKind::Shot { flight } => (0, Some(flight)),
                AttackKind::Beam { .. } => (1, None),
                AttackKind::Explosion { .. } => (2, None),
                AttackKind::Heal => (3, None),
            };
            let numbers = [attack.by.into(), attack.on.into(), kind];
            numbers.into_iter().chain(flight.map(u64::from)).for_each(|number| put(&mut out, number));
        }
    }
    out
}

/// Appends a decision: for each agent its action plus 1, or 0 if there is none, and the words of its
/// available actions, 32 bits each.
pub fn encode_step(battle: &Battle, actions: &[u16], out: &mut Vec<u8>) {
    let sizes = battle.arena().sizes();
    for agent in 0..sizes.n_agents {
        put(out, actions.get(agent).map_or(0, |&action| u64::from(action) + 1));
        let halves = battle.available(agent).iter().flat_map(|word| [word & 0xffff_ffff, word >> 32]);
        halves.take(sizes.n_actions.div_ceil(32)).for_each(|half| put(out, half));
    }
}

/// Appends an unsigned LEB128 number.
fn put(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn compressed(bytes: &[u8]) -> String {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    // Writing to a vector never fails.
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    STANDARD.encode(written.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AgentOrder, Order, Recorder};
    use smaclite_engine::{BattleSetup, EpisodeLimit, policy};
    use smaclite_scenarios::ScenarioFiles;
    use ts_rs::Config;

    #[test]
    fn generated_types_of_page_data() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/page/data.d.ts");
        let config = Config::default();
        let declarations = [
            ScenarioInfo::decl(&config),
            TypeInfo::decl(&config),
            UnitInfo::decl(&config),
            UnitsPer::decl(&config),
            ReplayData::decl(&config),
            EpisodeData::decl(&config),
            EpisodeResult::decl(&config),
            Features::decl(&config),
            Order::decl(&config),
            AgentOrder::decl(&config),
        ];
        let head = "// Written by a test of src/page/data.rs: `just generate`\n";
        let text = head.to_owned() + &declarations.map(|text| format!("export {text}\n")).concat();
        if std::env::var_os("SMACLITE_WRITE").is_some() {
            std::fs::write(file, &text).unwrap();
        }
        let written = std::fs::read_to_string(file).unwrap_or_default();
        assert!(written == text, "the data has changed: run `just generate`");
    }

    /// The test of `track.js` decodes the file that this one writes.
    #[test]
    fn generated_battle_for_the_test_of_the_decoder() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/page/track.test.json");
        let text = format!("{}\n", battle_as_json());
        if std::env::var_os("SMACLITE_WRITE").is_some() {
            std::fs::write(file, &text).unwrap();
        }
        let written = std::fs::read_to_string(file).unwrap_or_default();
        assert!(written == text, "it has changed: run `just generate`");
    }

    /// Some steps of a battle, encoded and as they are.
    fn battle_as_json() -> serde_json::Value {
        let (scenario, files) = ScenarioFiles::resolve("MMM").unwrap();
        let setup = BattleSetup { episode_limit: EpisodeLimit::Steps(40), ..BattleSetup::new(files) };
        let mut recorder = Recorder::new(setup, 1).unwrap();
        let mut actions = vec![0; scenario.n_agents()];
        while !recorder.battle().is_over() {
            policy::nearest(recorder.battle(), &mut actions);
            recorder.step(&actions).unwrap();
        }
        let replay = recorder.finish();
        let moments: Vec<Moment> = replay.play(0).unwrap().map(Result::unwrap).collect();
        let unit = |unit: &UnitMoment| {
            serde_json::json!({"x": unit.pos.x, "y": unit.pos.y, "hp": unit.hp, "alive": unit.alive,
                "target": unit.target.map_or(-1, i64::from)})
        };
        let of_moment = |moment: &Moment| {
            let units = moment.units.iter().map(unit).collect::<Vec<_>>();
            serde_json::json!({"units": units, "attacks": moment.attacks.len()})
        };
        serde_json::json!({
            "info": scenario_info(&scenario, replay.arena()),
            "episode": episode(&replay, 0).unwrap(),
            "actions": replay.play(0).unwrap().actions(0),
            "moments": moments.iter().step_by(40).map(of_moment).collect::<Vec<_>>(),
        })
    }
}
