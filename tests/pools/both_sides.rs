//! Battles in which joint actions play both sides: what the enemies see, do and earn is what agents would in
//! their place, and everything about lanes holds for them.

use smaclite_engine::policy::{BattleSide, LearnerView, Scripted};
use smaclite_engine::{Arena, Battle, Faction, Opponent, Opponents, Rules, Scratch, Sides, Step};
use smaclite_pool::Autoreset;
use smaclite_pool::fields::{FIELDS, Field};
use smaclite_scenarios::Scenario;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{LanePlan, Learner, PoolPlan, TestDir};
use std::sync::Arc;

fn battle(scenario: &Scenario, sides: Sides) -> Battle {
    let arena = Arena::new(scenario, Rules::Smaclite).with_sides(sides);
    Battle::new(Arc::new(arena), 1)
}

/// A scripted policy on one side, which sees what a learner of that side sees.
struct Player {
    side: Faction,
    policy: Scripted,
    state: Vec<f32>,
    available: Vec<u8>,
    actions: Vec<i32>,
}

impl Player {
    fn new(policy: &str, side: Faction, battle: &Battle) -> Player {
        let sizes = battle.arena().sizes_of(side);
        Player {
            side,
            policy: Scripted::from_name(policy, 1).expect("a policy"),
            state: vec![0.0; sizes.state_size],
            available: vec![0; sizes.n_agents * sizes.n_actions],
            actions: vec![0; sizes.n_agents],
        }
    }

    fn act(&mut self, battle: &Battle) -> &[i32] {
        battle.write_state(self.side, &mut self.state);
        battle.write_avail_actions(self.side, &mut self.available);
        let view = LearnerView::of(battle.arena(), self.side, &self.state, &self.available);
        let mut expected = self.actions.clone();
        self.policy.clone().act(&view, &mut expected);
        self.policy.act(&BattleSide::new(battle, self.side), &mut self.actions);
        assert_eq!(self.actions, expected, "a policy decides by what the learner sees");
        &self.actions
    }
}

/// Plays an episode of a policy on each side; the outcomes of its steps.
fn play(battle: &mut Battle, allies: &str, enemies: &str) -> Vec<Step> {
    let mut allies = Player::new(allies, Faction::Ally, battle);
    let mut enemies = Player::new(enemies, Faction::Enemy, battle);
    let (mut scratch, mut steps) = (Scratch::new(), Vec::new());
    while !battle.is_over() {
        let actions = [allies.act(battle), enemies.act(battle)].concat();
        steps.push(battle.step(&actions, &mut scratch).expect("available actions"));
    }
    steps
}

/// The same units, in the same order, on the other sides.
fn exchanged(scenario: &Scenario) -> Scenario {
    let mut exchanged = scenario.clone();
    exchanged.units.iter_mut().for_each(|unit| unit.faction = unit.faction.opponent());
    std::mem::swap(&mut exchanged.ally_has_shields, &mut exchanged.enemy_has_shields);
    exchanged
}

/// Nothing depends on which side units are on, to the bit: neither what they do nor what they earn.
#[test]
fn exchanging_the_sides_exchanges_what_they_see_and_earn() {
    let policies = [("nearest", "focus_fire"), ("kite", "spread"), ("focus_fire", "flank")];
    for name in Scenario::standard_names() {
        let scenario = Scenario::standard(name).expect("a standard scenario");
        let other = exchanged(&scenario);
        for (allies, enemies) in policies {
            let (mut here, mut there) = (battle(&scenario, Sides::Both), battle(&other, Sides::Both));
            let steps = play(&mut here, allies, enemies);
            let of_others = play(&mut there, enemies, allies);
            let rewards = |step: &Step| [step.reward, step.enemy_reward].map(f64::to_bits);
            let swapped = |step: &Step| [step.enemy_reward, step.reward].map(f64::to_bits);
            let (here, there) = (steps.iter().map(rewards), of_others.iter().map(swapped));
            assert_eq!(
                here.collect::<Vec<_>>(),
                there.collect::<Vec<_>>(),
                "{name}: {allies} against {enemies}"
            );
        }
    }
}

/// Enemies that kill all agents have a return of 20, and more if shields of agents regenerated in between.
#[test]
fn enemies_that_win_have_a_return_of_20() {
    for (name, most) in [("3m", 20.0), ("3s5z", 23.0), ("25m", 20.0)] {
        let scenario = Scenario::standard(name).expect("a standard scenario");
        let mut battle = battle(&scenario, Sides::Both);
        let steps = play(&mut battle, "random", "focus_fire");
        assert!(battle.is_won_by(Faction::Enemy) && !battle.is_won_by(Faction::Ally), "{name}");
        let earned: f64 = steps.iter().map(|step| step.enemy_reward).sum();
        assert!((20.0 - 1e-9..=most + 1e-9).contains(&earned), "{name}: {earned}");
    }
}

/// Half a turn maps the agents of these maps to their enemies, so both sides see the same in a mirror, until
/// the first of them acts before the other.
#[test]
fn both_sides_of_a_symmetric_map_see_the_same_in_a_mirror() {
    for name in ["3m", "8m", "25m", "2s3z", "3s5z", "MMM"] {
        let scenario = Scenario::standard(name).expect("a standard scenario");
        let mut battle = battle(&scenario, Sides::Mirrored);
        let sizes = battle.arena().sizes();
        assert_eq!(sizes.of(Faction::Enemy).map(|sizes| sizes.obs_size), Some(sizes.obs_size), "{name}");
        let mut scratch = Scratch::new();
        let east = vec![4; 2 * sizes.n_agents];
        let mut seen = 0;
        for step in 0..4 {
            let [obs, enemy_obs] = [Faction::Ally, Faction::Enemy].map(|side| {
                let mut obs = vec![0.0f32; sizes.n_agents * sizes.obs_size];
                battle.write_obs(side, &mut obs, &mut scratch);
                obs
            });
            let difference = obs.iter().zip(&enemy_obs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(difference < 1e-3, "{name}, step {step}: {difference}");
            seen = enemy_obs.iter().filter(|x| **x != 0.0).count();
            battle.step(&east, &mut scratch).expect("all may go east");
        }
        assert!(seen > 0);
    }
}

/// In an episode of a script the enemies look dead to learners, and their numbers have no effect.
#[test]
fn enemies_of_a_script_look_dead_to_learners() {
    let scenario = Scenario::standard("2s3z").expect("a standard scenario");
    let opponents = Opponents::new([("learner", 1.0), ("attack_move", 1.0)]).expect("opponents");
    let arena = Arena::new(&scenario, Rules::Smaclite).with_sides(Sides::Mirrored);
    let mut battle = Battle::new(Arc::new(arena.with_opponents(opponents)), 3);
    let mut seen = [false; 2];
    for _ in 0..20 {
        battle.reset();
        let is_learner = battle.opponent() == Opponent::Learner;
        seen[usize::from(is_learner)] = true;
        let mut alive = [7; 5];
        battle.write_alive(Faction::Enemy, &mut alive);
        assert_eq!(alive, [u8::from(is_learner); 5]);
        let mut enemies = Player::new("nearest", Faction::Enemy, &battle);
        let actions = [&[1; 5], enemies.act(&battle)].concat();
        assert_eq!(actions[5..] == [0; 5], !is_learner);
        battle.step(&actions, &mut Scratch::new()).expect("available actions");
        let refused = battle.check(&[1, 1, 1, 1, 1, 9, 9, 9, 9, 9]).expect_err("no enemy is in range");
        assert!(refused.to_string().starts_with("enemy 0: action 9 is not available"), "{refused}");
    }
    assert_eq!(seen, [true; 2]);
}

/// A learner compares every field of every frame with battles that are stepped one by one.
#[test]
fn lanes_of_both_sides_show_the_bits_of_the_reference() {
    let dir = TestDir::new();
    let fields = Some(FIELDS.iter().map(|spec| spec.name.to_owned()).collect());
    let mixture = Opponents::new([("learner", 2.0), ("attack_move", 1.0), ("kite", 1.0)]);
    let mixture = mixture.expect("opponents");
    for (i, autoreset) in [Autoreset::NextStep, Autoreset::SameStep].into_iter().enumerate() {
        for (threads, batch_size, map) in [(1, 6, "2s3z"), (3, 6, "MMM"), (2, 2, "2c_vs_64zg")] {
            let plan = LanePlan {
                batch_size,
                autoreset,
                episode_limit: Some(9),
                fields: fields.clone(),
                obs_last_actions: threads - 1,
                obs_agent_id: i == 1,
                ..LanePlan::new(map, 6)
            };
            let plan = plan.both_sides([Sides::Both, Sides::Mirrored][i]);
            let opponents = if threads == 3 { mixture.clone() } else { plan.opponents };
            let pool = PoolPlan::new([LanePlan { opponents, ..plan }]).threads(threads);
            let _pool = dir.start(&pool);
            let mut learner =
                Learner::connect(dir.runtime_dir(), &pool.name, &pool.lanes[0]).expect("a lane");
            learner.reset(Some(11), TIMEOUT).expect("a batch");
            for _ in 0..60 {
                let batch = learner.step(TIMEOUT).unwrap_or_else(|e| panic!("{map}, {autoreset:?}: {e}"));
                assert!(batch.field::<f32>(Field::EnemyObs).is_some());
            }
        }
    }
}
