//! The opponents that can play the enemies: they keep to the rules that agents have, and everything about
//! them can be repeated.

use smaclite_engine::policy::{Scripted, Situation};
use smaclite_engine::{Arena, Battle, Opponent, Opponents, Rules, SIGHT_RANGE, Scratch, Snapshot, Units};
use smaclite_pool::fields::{FIELDS, Field};
use smaclite_scenarios::Scenario;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{LanePlan, Learner, PoolPlan, TestDir};
use std::collections::BTreeSet;
use std::sync::Arc;

const MIXTURE: &str = "attack_move=0.3,random=0.4,kite=0.3";

fn battle(map: &str, opponents: impl Into<Opponents>, seed: u64) -> Battle {
    let scenario = Scenario::standard(map).expect("a standard scenario");
    let arena = Arena::new(&scenario, Rules::Smaclite).with_opponents(opponents.into());
    Battle::new(Arc::new(arena), seed)
}

/// Agents of a scripted policy.
struct Agents {
    policy: Scripted,
    actions: Vec<i32>,
    scratch: Scratch,
}

impl Agents {
    fn new(policy: &str, battle: &Battle) -> Agents {
        let actions = vec![0; battle.arena().sizes().n_agents];
        Agents { policy: Scripted::from_name(policy, 1).expect("a policy"), actions, scratch: Scratch::new() }
    }

    /// Plays a step; whether the battle goes on.
    fn step(&mut self, battle: &mut Battle) -> bool {
        self.policy.act(battle, &mut self.actions);
        battle.step(&self.actions, &mut self.scratch).expect("policies choose available actions");
        !battle.is_over()
    }
}

fn bits(snapshot: &Snapshot) -> (Vec<[u32; 2]>, Vec<u64>, u64) {
    let Units { pos, hp, .. } = &snapshot.units;
    let positions = pos.iter().map(|pos| pos.to_array().map(f32::to_bits)).collect();
    let draws = snapshot.generator.position().draws;
    (positions, hp.iter().map(|hp| hp.to_bits()).collect(), draws)
}

/// From any step on: also while an opponent draws random actions.
#[test]
fn battles_against_every_opponent_continue_from_a_snapshot_with_the_same_bits() {
    for map in Scenario::standard_names() {
        for opponent in Opponent::scripts() {
            let mut whole = battle(map, opponent, 5);
            let mut agents = Agents::new("nearest", &whole);
            let mut saved = whole.save();
            for step in 0..60 {
                if step == 25 {
                    saved = whole.save();
                }
                if !agents.step(&mut whole) {
                    break;
                }
            }
            let mut part = battle(map, Opponent::AttackMove, 9);
            part.restore(&saved).expect("a state of this scenario");
            assert_eq!(part.opponent(), opponent);
            while part.episode_length() < whole.episode_length() {
                agents.step(&mut part);
            }
            assert_eq!(bits(&part.save()), bits(&whole.save()), "{map} against {}", opponent.name());
        }
    }
}

/// The definition of the default: whoever else may play, its battles are those without other opponents.
#[test]
fn attack_move_is_what_it_is_alone() {
    let mut mixed = battle("2s3z", MIXTURE.parse::<Opponents>().expect("opponents"), 3);
    let mut alone = battle("2s3z", Opponent::AttackMove, 3);
    let mut agents = Agents::new("focus_fire", &alone);
    alone.set_generator(mixed.generator().clone());
    mixed.reset_against(Opponent::AttackMove);
    alone.reset();
    while agents.step(&mut alone) {
        agents.step(&mut mixed);
        assert_eq!(bits(&mixed.save()), bits(&alone.save()));
    }
}

/// Enemies that see no agent go to the attack point, those that do not move stay, and no enemy acts on an
/// agent that no enemy sees.
#[test]
fn opponents_know_only_what_they_see() {
    for opponent in ["nearest", "focus_fire", "kite", "line", "flank", "escort", "spread"] {
        let mut battle = battle("2s3z", Opponent::from_name(opponent).expect("an opponent"), 1);
        let (mut scratch, stop) = (Scratch::new(), [1; 5]);
        let enemies = |battle: &Battle| (5..10).map(|id| battle.position(id)).collect::<Vec<_>>();
        let sees = |battle: &Battle| {
            let near = |enemy: u32, agent: u32| {
                f64::from(battle.position(enemy).distance(battle.position(agent))) < SIGHT_RANGE - 0.1
            };
            (5..10).any(|enemy| (0..5).any(|agent| near(enemy, agent)))
        };
        let attack_point = glam::Vec2::new(9.0, 16.0);
        let mut steps = 0;
        while !sees(&battle) {
            let before = enemies(&battle);
            battle.step(&stop, &mut scratch).expect("a legal action");
            let nearer = enemies(&battle)
                .iter()
                .zip(&before)
                .all(|(now, before)| now.distance(attack_point) < before.distance(attack_point) + 0.5);
            assert!(nearer, "{opponent}: {before:?} to {:?}", enemies(&battle));
            steps += 1;
            assert!(steps < 30, "{opponent} never comes");
        }
        assert!(steps > 0, "{opponent} sees agents at the start");
    }
    let mut holding = battle("2s3z", Opponent::from_name("hold").expect("an opponent"), 1);
    let before = holding.position(7);
    for _ in 0..10 {
        holding.step(&[1; 5], &mut Scratch::new()).expect("a legal action");
    }
    assert!(holding.position(7).distance(before) < 0.5, "hold moves only where others push");
}

/// It goes straight to the agents, wherever they are: they retreat to the west of the attack point.
#[test]
fn attack_nearest_finds_agents_beyond_the_attack_point() {
    let dead = |opponent: Opponent| {
        let mut battle = battle("2s3z", opponent, 1);
        let (mut scratch, mut dead) = (Scratch::new(), 0);
        for _ in 0..100 {
            let alive = |agent: u32| battle.is_alive(agent);
            let west = |agent: u32| match (alive(agent), Situation::is_available(&battle, agent as usize, 5))
            {
                (false, _) => 0,
                (true, true) => 5,
                (true, false) => 1,
            };
            let actions: Vec<i32> = (0..5).map(west).collect();
            battle.step(&actions, &mut scratch).expect("legal actions");
            dead = battle.dead_allies();
            if battle.is_over() {
                break;
            }
        }
        dead
    };
    assert_eq!(dead(Opponent::AttackNearest), 5);
}

/// Wins and defeats of a policy against itself.
fn results(scenario: &Scenario, name: &str) -> [usize; 2] {
    let opponent = Opponent::from_name(name).expect("an opponent");
    let arena = Arena::new(scenario, Rules::Smaclite).with_opponents(opponent.into());
    let mut battle = Battle::new(Arc::new(arena), 1);
    let mut agents = Agents::new(name, &battle);
    let mut results = [0, 0];
    for _ in 0..30 {
        battle.reset();
        while agents.step(&mut battle) {}
        let n_agents = battle.arena().sizes().n_agents;
        results[0] += usize::from(battle.dead_enemies() == battle.arena().sizes().n_enemies);
        results[1] += usize::from(battle.dead_allies() == n_agents);
    }
    results
}

/// The rules do not favour a side: with the sides of a scenario exchanged, the same units win, episode by
/// episode. Scenarios without healers: enemies do not
/// see all that agents see, and healers show it.
#[test]
fn exchanging_the_sides_exchanges_the_results() {
    for map in ["3m", "8m", "25m", "2s3z", "3s5z", "1c3s5z", "bane_vs_bane"] {
        let scenario = Scenario::standard(map).expect("a standard scenario");
        let exchanged = scenario.exchanged();
        for name in ["nearest", "focus_fire", "spread"] {
            let [wins, defeats] = results(&scenario, name);
            assert!(wins + defeats >= 30, "{map}: {name} does not finish");
            assert_eq!(results(&exchanged, name), [defeats, wins], "{map}: {name} against itself");
        }
    }
}

/// The same as for attack-move: seeds give the same opponents and battles, whatever the threads and batches.
#[test]
fn opponents_are_drawn_by_the_seed_for_every_number_of_threads() {
    let fields = Some(FIELDS.iter().map(|spec| spec.name.to_owned()).collect());
    for (threads, batch_size) in [(1, 6), (3, 6), (2, 2)] {
        let opponents = MIXTURE.parse().expect("opponents");
        let plan = LanePlan::new("2s3z", 6);
        let plan = LanePlan { opponents, batch_size, fields: fields.clone(), ..plan };
        let pool = PoolPlan::new([plan.clone()]).threads(threads);
        let dir = TestDir::new();
        let _pool = dir.start(&pool);
        // A learner compares every field of every frame with battles that are stepped one by one.
        let mut learner = Learner::connect(dir.runtime_dir(), &pool.name, &plan).expect("a lane");
        learner.reset(Some(11), TIMEOUT).expect("a batch");
        let mut seen = BTreeSet::<i32>::new();
        for _ in 0..120 {
            let batch = learner.step(TIMEOUT).expect("the rows of the reference");
            seen.extend(batch.field::<i32>(Field::Opponent).expect("the lane has it"));
        }
        let index = |name| Opponent::from_name(name).expect("an opponent").index() as i32;
        let expected = ["attack_move", "random", "kite"].map(index);
        assert_eq!(seen, BTreeSet::from(expected));
    }
}
