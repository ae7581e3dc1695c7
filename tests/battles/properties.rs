//! Properties of every battle, however it is played.

use std::path::Path;
use std::sync::Arc;

use proptest::prelude::*;
use smaclite_engine::policy::Random;
use smaclite_engine::{Arena, Battle, Faction, Rules, Scratch, action};
use smaclite_scenarios::Scenario;

/// A battle of more than 85 units of all types, where healers are neither last nor alone and there are more
/// than 64 actions.
const ZOO: &str = r#"{
    "name": "zoo", "num_allied_units": 24, "num_enemy_units": 70, "attack_point": [9, 16],
    "groups": [
        { "x": 9, "y": 16, "faction": "ALLY",
          "units": { "MEDIVAC": 2, "COLOSSUS": 1, "BANELING": 3, "MARINE": 10, "STALKER": 2 } },
        { "x": 13, "y": 11, "faction": "ALLY", "units": { "MEDIVAC": 1, "ZEALOT": 5 } },
        { "x": 22, "y": 16, "faction": "ENEMY",
          "units": { "ZERGLING": 50, "MEDIVAC": 2, "COLOSSUS": 1, "SPINE_CRAWLER": 1, "MARAUDER": 6 } },
        { "x": 17, "y": 16, "faction": "ENEMY", "units": { "BANELING": 9, "MEDIVAC": 1 } }
    ],
    "terrain_preset": "TERRAIN", "num_unit_types": 0, "ally_has_shields": true, "enemy_has_shields": true
}"#;

/// All standard scenarios, and a zoo on open ground and among many obstacles.
fn scenarios() -> Vec<Scenario> {
    let zoo = |terrain: &str| {
        Scenario::from_json(&ZOO.replace("TERRAIN", terrain), "zoo", Path::new(".")).expect("a valid zoo")
    };
    let standard =
        Scenario::standard_names().map(|name| Scenario::standard(name).expect("a standard scenario"));
    standard.chain([zoo("SIMPLE"), zoo("CHECKERBOARD")]).collect()
}

fn any_arena() -> impl Strategy<Value = Arc<Arena>> {
    let arenas: Vec<Arc<Arena>> = scenarios()
        .iter()
        .flat_map(|scenario| Rules::ALL.map(|rules| Arc::new(Arena::new(scenario, rules))))
        .collect();
    proptest::sample::select(arenas)
}

/// A battle after some steps of random play.
fn any_battle() -> impl Strategy<Value = Battle> {
    (any_arena(), any::<u64>(), 0..60_usize).prop_map(|(arena, seed, n_steps)| {
        let mut battle = Battle::new(arena, seed);
        play(&mut battle, seed, n_steps);
        battle
    })
}

/// Random legal play; returns the outputs after each step, and its reward.
fn play(battle: &mut Battle, seed: u64, n_steps: usize) -> Vec<(Outputs, f64)> {
    let (mut player, mut scratch) = (Random::new(seed), Scratch::new());
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    let mut outputs = Vec::new();
    for _ in 0..n_steps {
        player.act(battle, &mut actions);
        let step = battle.step(&actions, &mut scratch).expect("available actions are legal");
        outputs.push((Outputs::of(battle), step.reward));
    }
    outputs
}

/// Everything that agents receive.
#[derive(Debug, PartialEq)]
struct Outputs {
    obs: Vec<f32>,
    state: Vec<f32>,
    avail: Vec<u8>,
    alive: Vec<u8>,
}

impl Outputs {
    fn of(battle: &Battle) -> Outputs {
        let sizes = battle.arena().sizes();
        let mut outputs = Outputs {
            obs: vec![f32::NAN; sizes.n_agents * sizes.obs_size],
            state: vec![f32::NAN; sizes.state_size],
            avail: vec![7; sizes.n_agents * sizes.n_actions],
            alive: vec![7; sizes.n_agents],
        };
        battle.write_obs(Faction::Ally, &mut outputs.obs, &mut Scratch::new());
        battle.write_state(Faction::Ally, &mut outputs.state);
        battle.write_avail_actions(Faction::Ally, &mut outputs.avail);
        battle.write_alive(Faction::Ally, &mut outputs.alive);
        outputs
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn what_is_available_is_what_is_accepted(battle in any_battle(), seed: u64) {
        let sizes = battle.arena().sizes();
        let mut legal = vec![0; sizes.n_agents];
        Random::new(seed).act(&battle, &mut legal);
        let avail = Outputs::of(&battle).avail;
        for agent in 0..sizes.n_agents {
            for number in -1..=sizes.n_actions as i32 {
                let mut actions = legal.clone();
                actions[agent] = number;
                let index = usize::try_from(number).ok().filter(|&number| number < sizes.n_actions);
                let available = index.is_some_and(|number| avail[agent * sizes.n_actions + number] == 1);
                let is_ok = battle.check(&actions).is_ok();
                prop_assert_eq!(is_ok, available, "agent {} action {}", agent, number);
                prop_assert_eq!(index.is_some_and(|number| battle.is_available(agent, number)), available);
                if !available {
                    let before = battle.save();
                    let mut battle = battle.clone();
                    prop_assert!(battle.step(&actions, &mut Scratch::new()).is_err());
                    prop_assert_eq!(battle.save(), before, "a refused step must change nothing");
                }
            }
        }
        prop_assert!(battle.check(&legal[1..]).is_err());
    }

    #[test]
    fn step_checked_is_step(battle in any_battle(), seed: u64) {
        let mut actions = vec![0; battle.arena().sizes().n_agents];
        Random::new(seed).act(&battle, &mut actions);
        let (mut checked, mut other) = (battle.clone(), battle);
        let step = checked.step(&actions, &mut Scratch::new()).expect("available actions are legal");
        prop_assert_eq!(step, other.step_checked(actions.iter().copied(), &mut Scratch::new()));
        prop_assert_eq!(checked.save(), other.save());
    }

    /// The effect that `step_checked` documents for builds without debug assertions.
    #[cfg(not(debug_assertions))]
    #[test]
    fn unchecked_actions_have_a_defined_effect(
        battle in any_battle(),
        steps in prop::collection::vec(prop::collection::vec(prop_oneof![-2..80, any::<i32>()], 0..40), 5),
    ) {
        let sizes = battle.arena().sizes();
        let is_action = |action: i32| usize::try_from(action).is_ok_and(|action| action < sizes.n_actions);
        let (mut battle, mut other) = (battle.clone(), battle);
        for mut actions in steps {
            let step = battle.step_checked(actions.iter().copied(), &mut Scratch::new());
            actions.iter_mut().filter(|action| !is_action(**action)).for_each(|action| *action = 0);
            actions.resize(sizes.n_agents, 0);
            prop_assert_eq!(step, other.step_checked(actions.iter().copied(), &mut Scratch::new()));
            prop_assert_eq!(Outputs::of(&battle), Outputs::of(&other));
        }
        prop_assert!(Outputs::of(&battle).state.iter().all(|x| x.is_finite()));
        prop_assert!(other.restore(&battle.save()).is_ok());
    }

    #[test]
    fn values_stay_in_range(arena in any_arena(), seed: u64) {
        let mut battle = Battle::new(arena, seed);
        let full = battle.units().clone();
        for (outputs, reward) in play(&mut battle, seed, 40) {
            prop_assert!(outputs.obs.iter().all(|x| x.is_finite() && (-1.0..=1.0).contains(x)));
            prop_assert!(outputs.state.iter().all(|x| x.is_finite()));
            prop_assert!((0.0..=20.0 + 1e-9).contains(&reward), "reward {}", reward);
        }
        let units = battle.units();
        for unit in 0..units.hp.len() {
            prop_assert!((0.0..=full.hp[unit]).contains(&units.hp[unit]), "health of unit {}", unit);
            prop_assert!((0.0..=full.shield[unit]).contains(&units.shield[unit]), "shield of unit {}", unit);
            prop_assert!((0.0..=200.0).contains(&units.energy[unit]), "energy of unit {}", unit);
            prop_assert!(!units.alive[unit] || units.hp[unit] > 0.0, "unit {} is alive without health", unit);
        }
        prop_assert!(battle.save().units == *units && battle.clone().restore(&battle.save()).is_ok());
    }

    #[test]
    fn the_dead_are_inert(battle in any_battle(), seed: u64) {
        let sizes = battle.arena().sizes();
        let before = battle.units().clone();
        let mut battle = battle;
        play(&mut battle, seed, 5);
        let (after, outputs) = (battle.units(), Outputs::of(&battle));
        for unit in (0..sizes.n_units()).filter(|&unit| !before.alive[unit]) {
            prop_assert!(!after.alive[unit], "unit {} is alive again", unit);
            prop_assert_eq!(before.pos[unit], after.pos[unit]);
            prop_assert_eq!(before.shield[unit], after.shield[unit]);
            prop_assert_eq!(before.energy[unit], after.energy[unit]);
        }
        for agent in (0..sizes.n_agents).filter(|&agent| outputs.alive[agent] == 0) {
            let row = |size: usize| agent * size..(agent + 1) * size;
            prop_assert!(outputs.obs[row(sizes.obs_size)].iter().all(|&x| x == 0.0));
            let avail = &outputs.avail[row(sizes.n_actions)];
            prop_assert!(avail[action::NO_OP] == 1 && avail[1..].iter().all(|&bit| bit == 0));
        }
        prop_assert_eq!(outputs.alive.iter().filter(|&&bit| bit == 0).count(), battle.dead_allies());
        let alive = after.alive.iter().filter(|&&alive| alive).count();
        prop_assert_eq!(sizes.n_units() - alive, battle.dead_allies() + battle.dead_enemies());
    }

    #[test]
    fn a_restored_battle_continues_with_the_same_bits(battle in any_battle(), seed: u64) {
        let mut battle = battle;
        let snapshot = battle.save();
        let mut other = Battle::new(battle.arena().clone(), seed);
        play(&mut other, seed, 3);
        other.restore(&snapshot).expect("a snapshot of the same arena");
        prop_assert_eq!(Outputs::of(&battle), Outputs::of(&other));
        prop_assert_eq!(play(&mut battle, seed, 12), play(&mut other, seed, 12));
        prop_assert_eq!(battle.save(), other.save());
    }

    #[test]
    fn a_reset_gives_the_same_start(battle in any_battle()) {
        let mut battle = battle;
        battle.reset();
        let fresh = Battle::new(battle.arena().clone(), 0);
        prop_assert_eq!(Outputs::of(&battle), Outputs::of(&fresh));
        prop_assert_eq!(&battle.save().units, &fresh.save().units);
        prop_assert_eq!((battle.episode_length(), battle.episode_return()), (0, 0.0));
    }
}

#[test]
fn a_snapshot_of_another_scenario_is_refused() {
    let battle = |name: &str| {
        let scenario = Scenario::standard(name).expect("a standard scenario");
        Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1)
    };
    let error = battle("3s5z").restore(&battle("2s3z").save()).expect_err("10 units are not 16");
    assert_eq!(error.to_string(), "snapshot column 'unit_type' must have 16 entries, got 10");
}

/// An episode is truncated at its limit, unless it ends by itself in that step.
#[test]
fn episodes_end_at_their_limit() {
    let scenario = Scenario::standard("2s3z").expect("a standard scenario");
    let arena = Arena::new(&scenario, Rules::Smaclite).with_episode_limit(Some(3));
    let mut battle = Battle::new(Arc::new(arena), 1);
    let mut scratch = Scratch::new();
    for length in 1..=3 {
        assert!(!battle.is_over());
        let step = battle.step(&[action::STOP as i32; 5], &mut scratch).expect("all can stop");
        assert_eq!((step.terminated, step.truncated), (false, length == 3));
    }
    assert!(battle.is_over());
    battle.reset();
    assert!(!battle.is_over());
}
