//! The same battles on 1, 2 and 4 threads have the same bits, also if battles share a scratch; and those of
//! rules `starcraft-1` have the bits that they had when the rules got this name.

use std::sync::Arc;
use std::thread;

use smaclite_engine::policy::{Random, Scripted};
use smaclite_engine::{Arena, Battle, ExecutionOrder, Rules, Scratch, TICKS_PER_STEP, Units};
use smaclite_scenarios::Scenario;
use xxhash_rust::xxh3::Xxh3;

const N_STEPS: usize = 40;

/// The names of all scenarios.
fn names() -> impl Iterator<Item = &'static str> {
    Scenario::standard_names().chain(Scenario::generated_names())
}

fn arena(name: &str, rules: Rules) -> Arc<Arena> {
    Arc::new(Arena::new(&Scenario::standard(name).expect("a standard scenario"), rules))
}

/// Two battles of every scenario under each of two rule sets.
fn battles() -> Vec<Battle> {
    let arenas = names().flat_map(|name| [Rules::Smaclite, Rules::Starcraft].map(|rules| arena(name, rules)));
    arenas.flat_map(|arena| [Battle::new(arena.clone(), 1), Battle::new(arena, 2)]).collect()
}

/// The units of a battle after every tick.
type Course = Vec<Units>;

fn course(mut battle: Battle, seed: u64, scratch: &mut Scratch) -> Course {
    let mut player = Random::new(seed);
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    let mut course = Vec::new();
    for _ in 0..N_STEPS {
        if battle.is_over() {
            battle.reset();
        }
        player.act(&battle, &mut actions);
        let observe = |tick: smaclite_engine::Tick<'_>| course.push(tick.units.clone());
        battle.step_observed(&actions, ExecutionOrder::Drawn, scratch, observe).expect("legal actions");
    }
    course
}

/// The courses of all battles, distributed over threads; each thread has one scratch for all of its battles.
fn courses(n_threads: usize) -> Vec<Course> {
    let battles = battles();
    let mut courses: Vec<Course> = vec![Vec::new(); battles.len()];
    thread::scope(|scope| {
        let mut shares: Vec<Vec<_>> = (0..n_threads).map(|_| Vec::new()).collect();
        for (i, (battle, course)) in battles.into_iter().zip(&mut courses).enumerate() {
            shares[i % n_threads].push((i, battle, course));
        }
        for share in shares {
            scope.spawn(move || {
                let mut scratch = Scratch::new();
                for (i, battle, out) in share {
                    *out = course(battle, i as u64, &mut scratch);
                }
            });
        }
    });
    courses
}

/// The first difference between two courses of the same battles.
fn first_difference(a: &[Course], b: &[Course]) -> Option<String> {
    let bits = |units: &Units, unit: usize| {
        let floats = [
            &units.hp,
            &units.shield,
            &units.energy,
            &units.cooldown,
            &units.shield_cooldown,
            &units.healing,
        ];
        (
            [units.pos[unit], units.vel[unit]].map(|v| v.to_array().map(f32::to_bits)),
            floats.map(|column| column[unit].to_bits()),
            (units.alive[unit], units.target[unit]),
            units.phases.get(unit).copied(),
        )
    };
    for (env, (a, b)) in a.iter().zip(b).enumerate() {
        for (tick, (a, b)) in a.iter().zip(b).enumerate() {
            if let Some(unit) = (0..a.pos.len()).find(|&unit| bits(a, unit) != bits(b, unit)) {
                let step = tick / TICKS_PER_STEP;
                return Some(format!("environment {env}, step {step}, tick {tick}, unit {unit}"));
            }
        }
    }
    None
}

#[test]
fn threads_change_no_bit() {
    let alone = courses(1);
    assert!(alone.iter().all(|course| course.len() == N_STEPS * TICKS_PER_STEP));
    for n_threads in [2, 4] {
        let difference = first_difference(&alone, &courses(n_threads));
        assert_eq!(difference, None, "first difference between 1 and {n_threads} threads");
    }
}

#[test]
fn a_difference_is_reported() {
    let a = courses(1);
    let mut b = a.clone();
    b[3][17].pos[2].x = f32::from_bits(b[3][17].pos[2].x.to_bits() ^ 1);
    assert_eq!(first_difference(&a, &b).as_deref(), Some("environment 3, step 2, tick 17, unit 2"));
}

/// A hash of the units of a battle after every step, played by a script and then at random.
fn fingerprint(name: &str) -> u64 {
    let mut hash = Xxh3::new();
    let mut scratch = Scratch::new();
    let mut battle = Battle::new(arena(name, Rules::Starcraft), 1);
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    let (mut script, mut random) = (Scripted::from_name("nearest", 1).expect("a script"), Random::new(1));
    for step in 0..3 * N_STEPS {
        if battle.is_over() {
            battle.reset();
        }
        match step < 2 * N_STEPS {
            true => script.act(&battle, &mut actions),
            false => random.act(&battle, &mut actions),
        }
        battle.step(&actions, &mut scratch).expect("legal actions");
        // Every number as text that has all of its bits.
        hash.update(&serde_json::to_vec(battle.units()).expect("finite numbers"));
    }
    hash.digest()
}

#[test]
fn battles_of_starcraft_1_keep_their_bits() {
    let found: String = names().map(|name| format!("{name} {:016x}\n", fingerprint(name))).collect();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/golden/starcraft-1.txt");
    let kept = std::fs::read_to_string(path).unwrap_or_default();
    assert_eq!(found, kept, "other bits are other rules, which need another version than starcraft-1");
}
