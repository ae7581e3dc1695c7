//! The data of the page: what its scripts (`track.js`) decode.
//!
//! Moments and steps are streams of variable-length integers (LEB128; signed ones in zigzag order),
//! compressed by deflate and written in base64. Values are rounded to what can be seen.

use std::f32::consts::TAU;
use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use serde_json::{Value, json};
use smaclite_engine::{Arena, Battle, SIGHT_RANGE};
use smaclite_scenarios::{Faction, Scenario};
use smaclite_units::{Keyword, Targeter, UnitType};

use crate::{AttackKind, Moment, Replay, ReplayError, UnitMoment, type_letters};

/// Units of the columns of a moment, per square, second, or point.
const POSITION: f32 = 256.0;
const POINTS: f32 = 10.0;
/// A tick is a whole number of these, so a running cooldown falls by equal differences.
const SECONDS: f32 = 160.0;
const DIRECTIONS: i64 = 256;

/// What no tick changes: terrain, unit types, units, sizes.
pub fn scenario_info(scenario: &Scenario, arena: &Arena) -> Value {
    let terrain = &scenario.terrain;
    let rects = terrain.obstacles().iter().map(|rect| [rect.x0, rect.y0, rect.x1, rect.y1]);
    let units = scenario.units.iter().map(|unit| {
        let faction = usize::from(unit.faction == Faction::Enemy);
        json!({"type": unit.unit_type, "faction": faction, "id": unit.id_in_faction})
    });
    json!({
        "name": scenario.name,
        "width": terrain.width(),
        "height": terrain.height(),
        "obstacles": rects.collect::<Vec<_>>(),
        "attack_point": scenario.attack_point,
        "types": types_info(&scenario.unit_types),
        "units": units.collect::<Vec<_>>(),
        "n_agents": arena.sizes().n_agents,
        "n_actions": arena.sizes().n_actions,
        "episode_limit": arena.episode_limit(),
        "sight_range": SIGHT_RANGE,
        "units_per": {"position": POSITION, "points": POINTS, "seconds": SECONDS, "turn": DIRECTIONS},
    })
}

/// What the page shows of unit types, with the letter of each.
pub fn types_info(types: &[UnitType]) -> Vec<Value> {
    let types = types.iter().zip(type_letters(types));
    types.map(|(unit_type, letter)| type_info(unit_type, letter)).collect()
}

fn type_info(unit_type: &UnitType, letter: char) -> Value {
    let (attack, size) = match unit_type.targeter {
        Targeter::Standard => ("shot", [0.0, 0.0]),
        Targeter::LaserBeam { width, height } => ("beam", [width, height]),
        Targeter::Kamikaze { radius } => ("explosion", [radius, radius]),
        Targeter::Heal => ("heal", [0.0, 0.0]),
    };
    json!({
        "name": unit_type.name,
        "label": letter,
        "radius": unit_type.radius(),
        "hp": unit_type.hp,
        "shield": unit_type.shield,
        "energy": unit_type.energy,
        "initial_energy": unit_type.initial_energy,
        "cooldown": unit_type.cooldown,
        "attack_range": unit_type.attack_range,
        "speed": unit_type.speed,
        "plane": unit_type.plane.name(),
        "attack": attack,
        "attack_size": size,
    })
}

/// An episode of a replay, played by this version.
pub(super) fn episode(replay: &Replay, index: usize) -> Result<Value, ReplayError> {
    let mut player = replay.play(index)?;
    let mut moments = vec![player.moment().clone()];
    let (mut steps, mut rewards) = (Vec::new(), Vec::new());
    loop {
        encode_step(player.battle(), player.actions(player.step()), &mut steps);
        let Some(played) = player.play_step()? else {
            break;
        };
        moments.extend(played.moments);
        rewards.push((played.step.reward * 1e4).round() / 1e4);
    }
    let episode = player.episode();
    let outcome = episode.outcome;
    Ok(json!({
        "seed": episode.start.seed.to_string(),
        "draws": episode.start.draws,
        "steps": outcome.steps,
        "episode_return": outcome.episode_return,
        "result": match outcome {
            _ if outcome.battle_won => "won",
            _ if outcome.terminated => "lost",
            _ if outcome.truncated => "truncated",
            _ => "unfinished",
        },
        "dead": [outcome.dead_allies, outcome.dead_enemies],
        "rewards": rewards,
        "n_moments": moments.len(),
        "moments": compressed(&encode_moments(&moments)),
        "decisions": compressed(&steps),
    }))
}

/// Encodes consecutive moments: column by column, in each unit by unit, and in that each value as the
/// difference from the moment before; then the attacks, moment by moment.
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
            let kind = match attack.kind {
                AttackKind::Shot => 0,
                AttackKind::Beam { .. } => 1,
                AttackKind::Explosion { .. } => 2,
                AttackKind::Heal => 3,
            };
            [attack.by.into(), attack.on.into(), kind].into_iter().for_each(|number| put(&mut out, number));
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
