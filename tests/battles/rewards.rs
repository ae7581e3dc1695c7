//! Rewards by SMAC's options, computed a second time from the units, and the shares of single units.

use std::path::Path;
use std::sync::Arc;

use smaclite_engine::policy::Random;
use smaclite_engine::{
    Arena, Battle, ExecutionOrder, Faction, KILL_REWARD, Rewards, Rules, Scratch, Sides, Step, Tick, action,
    policy,
};
use smaclite_scenarios::Scenario;

const STOP: i32 = action::STOP as i32;
const TARGET: i32 = action::FIRST_TARGET as i32;
/// No option has its default, nor those of the other constants.
const ALL: Rewards = Rewards {
    sparse: false,
    only_positive: false,
    death_value: 7.0,
    win: 90.0,
    defeat: -30.0,
    negative_scale: 0.25,
    scale: true,
    scale_rate: 5.0,
};

fn scenario(name: &str, rewards: Rewards) -> Scenario {
    Scenario { rewards, ..Scenario::standard(name).expect("a standard scenario") }
}

fn battle(name: &str, rewards: Rewards) -> Battle {
    Battle::new(Arc::new(Arena::new(&scenario(name, rewards), Rules::Smaclite)), 3)
}

fn shares(battle: &Battle, side: Faction) -> Vec<f32> {
    let mut shares = vec![f32::NAN; battle.arena().sizes_of(side).n_agents];
    battle.write_shares_of(side, &mut shares);
    shares
}

/// Agents that attack what is near in even episodes, and act at random in odd ones; `n` steps.
fn play(battle: &mut Battle, n: usize, mut see: impl FnMut(&Battle, &Battle, &Step, f64)) {
    let (mut random, mut scratch, mut episode) = (Random::new(5), Scratch::new(), 0);
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    for _ in 0..n {
        if battle.is_over() {
            battle.reset();
            episode += 1;
        }
        match episode % 2 {
            0 => policy::nearest(battle, &mut actions),
            _ => random.act(battle, &mut actions),
        }
        let (before, mut earned) = (battle.clone(), 0.0);
        let observe = |tick: Tick<'_>| earned += tick.earned;
        let step = battle.step_observed(&actions, ExecutionOrder::Drawn, &mut scratch, observe);
        see(&before, battle, &step.expect("available actions"), earned);
    }
}

/// Health and shields of the living units of a side, and their number.
fn total(scenario: &Scenario, battle: &Battle, side: Faction) -> (f64, f64) {
    let units = battle.units();
    let is_counted = |i: &usize| units.alive[*i] && scenario.units[*i].faction == side;
    let living = (0..units.hp.len()).filter(is_counted);
    living.fold((0.0, 0.0), |(total, n), i| (total + units.hp[i] + units.shield[i], n + 1.0))
}

/// The reward of the agents by the definition of the options; `earned` is by the default ones, unscaled and
/// without the end.
fn expected(scenario: &Scenario, before: &Battle, after: &Battle, step: &Step, earned: f64) -> f64 {
    let options = scenario.rewards;
    let change = |side| {
        let (before, after) = (total(scenario, before, side), total(scenario, after, side));
        (before.0 - after.0, before.1 - after.1)
    };
    let (lost, deaths) = change(Faction::Ally);
    let kills = change(Faction::Enemy).1;
    let mut points = earned + (options.death_value - KILL_REWARD) * kills;
    if !options.only_positive {
        points -= options.negative_scale * (lost + options.death_value * deaths);
    }
    points += if step.battle_won {
        options.win
    } else if step.terminated {
        options.defeat
    } else {
        0.0
    };
    if options.sparse {
        points = f64::from(u8::from(step.terminated)) * if step.battle_won { 1.0 } else { -1.0 };
    }
    let enemies = scenario.units.iter().filter(|unit| unit.faction == Faction::Enemy);
    let health = enemies.map(|unit| {
        let unit_type = &scenario.unit_types[unit.unit_type];
        unit_type.hp + unit_type.shield + options.death_value
    });
    let greatest = health.sum::<f64>() + options.win;
    if options.scale { points * options.scale_rate / greatest } else { points }
}

/// Each option alone, and all together; no enemy of these maps heals or destroys itself.
#[test]
fn rewards_are_those_of_their_options() {
    let default = Rewards::DEFAULT;
    let options = [
        default,
        ALL,
        Rewards { sparse: true, ..default },
        Rewards { sparse: true, ..ALL },
        Rewards { only_positive: false, ..default },
        Rewards { only_positive: false, negative_scale: 1.5, scale: false, ..default },
        Rewards { death_value: 0.0, ..default },
        Rewards { win: 0.0, defeat: 12.0, ..default },
        Rewards { scale: false, ..default },
        Rewards { scale_rate: 1.0, ..default },
    ];
    for name in ["2s3z", "3s_vs_5z", "27m_vs_30m", "2s_vs_1sc"] {
        for options in options {
            let (scenario, mut battle) = (scenario(name, options), battle(name, options));
            let (mut ends, mut negative) = (0, 0);
            play(&mut battle, 400, |before, after, step, earned| {
                let expected = expected(&scenario, before, after, step, earned);
                assert!((step.reward - expected).abs() < 1e-9, "{name}, {options:?}: {step:?}, {expected}");
                ends += u32::from(step.terminated);
                negative += u32::from(step.reward < 0.0);
            });
            let can_be_negative = options.sparse || !options.only_positive;
            assert!(ends > 0 && (negative > 0) == can_be_negative, "{name}, {options:?}: {negative}");
        }
    }
}

/// Options change rewards and nothing else; rewards that are written out are the defaults to the bit.
#[test]
fn options_change_rewards_alone() {
    let course = |rewards| {
        let (mut battle, mut course) = (battle("MMM", rewards), Vec::new());
        battle.keep_shares();
        play(&mut battle, 150, |_, after, step, _| course.push((after.units().clone(), *step)));
        course
    };
    let (plain, other) = (course(Rewards::DEFAULT), course(ALL));
    let mut differ = 0;
    for ((units, step), (other_units, other_step)) in plain.iter().zip(&other) {
        assert_eq!(units, other_units);
        assert_eq!(step.terminated, other_step.terminated);
        differ += u32::from(step.reward != other_step.reward);
    }
    assert!(differ > 10);
}

/// On every map, for both sides, and for rewards that are common, own, and at the end alone.
#[test]
fn shares_add_up_to_the_reward() {
    for name in Scenario::standard_names().chain(Scenario::generated_names()) {
        for rewards in [Rewards::DEFAULT, ALL, Rewards { sparse: true, ..ALL }] {
            let mut scenario = scenario(name, rewards);
            scenario.smacv2.iter_mut().for_each(|options| options.rewards = rewards);
            for sides in [Sides::Allies, Sides::Both] {
                if sides.check(&scenario).is_err() {
                    continue;
                }
                let arena = Arena::new(&scenario, Rules::Smaclite).with_sides(sides);
                let mut battle = Battle::new(Arc::new(arena), 1);
                battle.keep_shares();
                let mut rewarded = 0;
                let n_steps = battle.arena().episode_limit().unwrap_or(100) as usize;
                let see = |after: &Battle, step: &Step| {
                    add_up(&shares(after, Faction::Ally), step.reward, name);
                    if after.arena().interface().is_none() {
                        add_up(&shares(after, Faction::Enemy), step.enemy_reward, name);
                    }
                    rewarded += u32::from(step.reward != 0.0);
                };
                play_sides(&mut battle, n_steps, see);
                assert!(rewarded > 0 || rewards.sparse, "{name}, {rewards:?}");
            }
        }
    }
}

/// As [`play`], where actions play both sides, too.
fn play_sides(battle: &mut Battle, n: usize, mut see: impl FnMut(&Battle, &Step)) {
    if !battle.arena().sides().are_both() {
        return play(battle, n, |_, after, step, _| see(after, step));
    }
    let (mut scratch, sizes) = (Scratch::new(), battle.arena().sizes());
    let mut agents = vec![0; sizes.n_agents];
    for _ in 0..n {
        if battle.is_over() {
            battle.reset();
        }
        policy::nearest(battle, &mut agents);
        let mut available = vec![0; sizes.n_enemies * sizes.of(Faction::Enemy).expect("both").n_actions];
        battle.write_avail_actions(Faction::Enemy, &mut available);
        // The last available action is that on a target, if there is one.
        let rows = available.chunks_exact(available.len() / sizes.n_enemies);
        let last = rows.map(|row| row.iter().rposition(|flag| *flag == 1).unwrap_or(0) as i32);
        let actions: Vec<i32> = agents.iter().copied().chain(last).collect();
        let step = battle.step(&actions, &mut scratch).expect("available actions");
        see(battle, &step);
    }
}

#[track_caller]
fn add_up(shares: &[f32], reward: f64, name: &str) {
    let sum: f64 = shares.iter().map(|share| f64::from(*share)).sum();
    let size: f64 = shares.iter().map(|share| f64::from(share.abs())).sum();
    assert!((sum - reward).abs() <= 1e-6 * (size + 1e-3), "{name}: {shares:?} for {reward}");
}

/// A battle of a few units on an open map, and the first step with these actions.
fn first_step(
    allies: &str,
    enemies: &str,
    positions: &[[f32; 2]],
    rewards: &str,
    actions: &[i32],
) -> (Battle, Step) {
    let count = |units: &str| units.split(',').count();
    let allies_then_enemies = [("ALLY", allies), ("ENEMY", enemies)];
    let units =
        allies_then_enemies.iter().flat_map(|(side, units)| units.split(',').map(move |unit| (side, unit)));
    let groups = units.zip(positions).map(|((side, unit), [x, y])| {
        format!(r#"{{ "x": {x}, "y": {y}, "faction": "{side}", "units": {{ "{unit}": 1 }} }}"#)
    });
    let json = format!(
        r#"{{ "name": "few", "num_allied_units": {}, "num_enemy_units": {}, "groups": [{}],
            "terrain_preset": "SIMPLE", "attack_point": [9, 16], "num_unit_types": 0,
            "ally_has_shields": false, "enemy_has_shields": false, "rewards": {rewards} }}"#,
        count(allies),
        count(enemies),
        groups.collect::<Vec<_>>().join(",")
    );
    let scenario = Scenario::from_json(&json, "few", Path::new(".")).expect("a valid scenario");
    let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::Smaclite)), 1);
    battle.keep_shares();
    let step = battle.step(actions, &mut Scratch::new()).expect("available actions");
    (battle, step)
}

/// Who hits is rewarded, who stands by is not.
#[test]
fn damage_is_credited_to_who_dealt_it() {
    let positions = [[16.0, 16.0], [16.0, 20.0], [20.0, 16.0], [28.0, 28.0]];
    let (battle, step) = first_step("MARINE,MARINE", "MARINE,MARINE", &positions, "{}", &[TARGET, STOP]);
    assert!(step.reward > 0.0);
    assert_eq!(shares(&battle, Faction::Ally), [step.reward as f32, 0.0]);
}

/// Who is hit bears the loss.
#[test]
fn losses_are_charged_to_who_has_them() {
    let positions = [[16.0, 16.0], [4.0, 28.0], [20.0, 16.0]];
    let rewards = r#"{ "reward_only_positive": false }"#;
    let (battle, step) = first_step("MARINE,MARINE", "MARINE", &positions, rewards, &[STOP, STOP]);
    assert!(step.reward < 0.0);
    assert_eq!(shares(&battle, Faction::Ally), [step.reward as f32, 0.0]);
}

/// What an enemy gives that blows itself up is nobody's work.
#[test]
fn what_nobody_did_is_divided_equally() {
    let positions = [[16.0, 16.0], [16.0, 20.0], [17.0, 16.0], [28.0, 28.0]];
    let (battle, step) = first_step("ZEALOT,ZEALOT", "BANELING,ZERGLING", &positions, "{}", &[STOP, STOP]);
    assert!(step.reward > 0.0);
    assert_eq!(shares(&battle, Faction::Ally), [(step.reward / 2.0) as f32; 2]);
}

/// An episode begins without shares, and so does a battle that was restored.
#[test]
fn shares_are_of_the_last_step() {
    let mut battle = battle("2s3z", Rewards::DEFAULT);
    battle.keep_shares();
    let mut seen = 0;
    play(&mut battle, 60, |_, after, step, _| {
        if step.reward > 0.0 {
            seen += 1;
            assert!(shares(after, Faction::Ally).iter().any(|share| *share > 0.0));
            let mut again = after.clone();
            again.reset();
            assert_eq!(shares(&again, Faction::Ally), [0.0; 5]);
            again = after.clone();
            again.restore(&after.save()).expect("its own snapshot");
            assert_eq!(shares(&again, Faction::Ally), [0.0; 5]);
        }
    });
    assert!(seen > 0);
}

/// With SMAClite's ends, and with those of SMACv2's interface.
#[test]
fn the_return_is_the_sum_of_the_rewards_of_an_episode() {
    for mut battle in [battle("2s3z", Rewards::DEFAULT), battle("terran_5_vs_5", Rewards::DEFAULT)] {
        let mut sum = 0.0;
        play(&mut battle, 120, |before, after, step, _| {
            sum = if before.is_over() || before.episode_length() == 0 { 0.0 } else { sum } + step.reward;
            assert_eq!(after.episode_return(), sum, "after step {}", after.episode_length());
        });
        assert!(sum > 0.0);
    }
}
