//! The scripted policies: what each of them promises, in battles on every standard map.

use smaclite_engine::policy::{Scripted, Situation, Tactic, UnknownPolicy};
use smaclite_engine::{Arena, Battle, Faction, Rules, Scratch, action};
use smaclite_ipc::{Client, WaitOptions};
use smaclite_pool::fields::Field;
use smaclite_scenarios::Scenario;
use smaclite_tests::{LanePlan, PoolPlan, TestDir};
use std::sync::Arc;

/// Of battles and policies.
const SEED: u64 = 3;

/// Plays `episodes` episodes; `check` sees every joint action before it is played. Returns the wins.
fn play(map: &str, policy: &str, episodes: usize, check: impl FnMut(&Battle, &[i32])) -> usize {
    play_scenario(&Scenario::standard(map).expect("a standard scenario"), policy, episodes, check)
}

fn play_scenario(
    scenario: &Scenario,
    policy: &str,
    episodes: usize,
    mut check: impl FnMut(&Battle, &[i32]),
) -> usize {
    let mut battle = Battle::new(Arc::new(Arena::new(scenario, Rules::default())), SEED);
    let mut policy = Scripted::from_name(policy, SEED).expect("a policy");
    let mut scratch = Scratch::new();
    let mut actions = vec![0; battle.arena().sizes().n_agents];
    let mut wins = 0;
    for _ in 0..episodes {
        battle.reset();
        while !battle.is_over() {
            policy.act(&battle, &mut actions);
            check(&battle, &actions);
            let step = battle.step(&actions, &mut scratch).expect("policies choose available actions");
            wins += usize::from(step.battle_won);
        }
    }
    wins
}

#[test]
fn every_policy_chooses_available_actions_on_every_map() {
    for map in Scenario::standard_names() {
        for policy in Scripted::NAMES {
            play(map, policy, 1, |_, _| {});
        }
    }
}

/// The policies see what a learner sees, so a learner that plays them gets their scores.
#[test]
fn a_learner_chooses_the_actions_that_the_battle_chooses() {
    let mut scenarios: Vec<_> = Scenario::standard_names().filter_map(Scenario::standard).collect();
    // A scenario may hide shields that units have.
    let shown = Scenario::standard("3s5z_vs_3s6z").expect("a standard scenario");
    scenarios.push(Scenario { ally_has_shields: false, enemy_has_shields: false, ..shown });
    for scenario in &scenarios {
        for policy in Scripted::NAMES {
            let mut learner = Learner::new(&Arc::new(Arena::new(scenario, Rules::default())), policy);
            play_scenario(scenario, policy, 2, |battle, actions| learner.check(battle, actions));
        }
    }
}

/// A policy that sees only the fields of a batch.
struct Learner {
    policy: Scripted,
    state: Vec<f32>,
    avail_actions: Vec<u8>,
    actions: Vec<i32>,
}

impl Learner {
    fn new(arena: &Arena, policy: &str) -> Learner {
        let sizes = arena.sizes();
        Learner {
            policy: Scripted::from_name(policy, SEED).expect("a policy"),
            state: vec![0.0; sizes.state_size],
            avail_actions: vec![0; sizes.n_agents * sizes.n_actions],
            actions: vec![0; sizes.n_agents],
        }
    }

    fn check(&mut self, battle: &Battle, expected: &[i32]) {
        battle.write_state(Faction::Ally, &mut self.state);
        battle.write_avail_actions(Faction::Ally, &mut self.avail_actions);
        self.policy.act_batch(battle.arena(), &self.state, &self.avail_actions, &mut self.actions);
        let step = battle.episode_length();
        assert_eq!(self.actions, expected, "{:?}, step {step}", self.policy);
    }
}

#[test]
fn the_actions_of_a_batch_are_those_of_its_battles() {
    let scenario = Scenario::standard("2s3z").expect("a standard scenario");
    let dir = TestDir::new();
    let lane = LanePlan { episode_limit: None, ..LanePlan::new("2s3z", 3) };
    let pool = PoolPlan::new([lane]);
    let _embedded = dir.start(&pool);
    let mut client =
        Client::connect(dir.runtime_dir(), &pool.name, None, Default::default(), WaitOptions::no_wait())
            .expect("a pool");
    let arena = Arc::new(Arena::new(&scenario, Rules::default()));
    let mut battles = [0, 1, 2].map(|env| Battle::new(Arc::clone(&arena), SEED + env));
    let (mut actions, mut scratch) = (vec![0; 3 * arena.sizes().n_agents], Scratch::new());
    let mut policy = Scripted::from_name("focus_fire", SEED).expect("a policy");
    let mut batch = client.reset(Some(SEED), None, WaitOptions::forever()).expect("a batch");
    for _ in 0..40 {
        let (states, masks) = (batch.field(Field::State), batch.field(Field::AvailActions));
        policy.act_batch(&arena, states.expect("a state"), masks.expect("a mask"), &mut actions);
        for (battle, row) in battles.iter_mut().zip(actions.chunks(arena.sizes().n_agents)) {
            let mut expected = vec![0; row.len()];
            policy.act(battle, &mut expected);
            // With next-step autoreset, the step after the end of an episode begins the next one.
            if battle.is_over() {
                battle.reset();
            } else {
                assert_eq!(row, expected);
                battle.step(row, &mut scratch).expect("policies choose available actions");
            }
        }
        batch = client.step(&actions, None, WaitOptions::forever()).expect("a batch");
    }
}

#[test]
#[should_panic = "sizes of states, avail_actions and actions of 2 environments"]
fn a_batch_with_too_few_states_is_refused() {
    let arena = Arena::new(&Scenario::standard("3m").expect("a standard scenario"), Rules::default());
    let sizes = arena.sizes();
    let (state, mask) = (vec![0.0; sizes.state_size], vec![1; 2 * sizes.n_agents * sizes.n_actions]);
    let mut actions = vec![0; 2 * sizes.n_agents];
    Scripted::new(Tactic::FocusFire, 0).act_batch(&arena, &state, &mask, &mut actions);
}

/// Squares between the centres of a marine and its farthest target: range 5 and twice the radius.
const MARINE_REACH: f32 = 5.75;

#[test]
fn focus_fire_aims_at_the_weakest_in_reach_without_wasting_attacks() {
    let (mut n_focused, mut n_spared) = (0, 0);
    play("8m", "focus_fire", 5, |battle, actions| {
        let sizes = battle.arena().sizes();
        let enemies = sizes.n_agents as u32; // 8m lists the allies first
        let in_reach = |agent: usize| {
            let here = battle.position(agent as u32);
            let is_in_reach = move |&enemy: &usize| {
                let enemy = enemies + enemy as u32;
                battle.is_alive(enemy) && battle.position(enemy).distance(here) < MARINE_REACH - 1e-3
            };
            (0..sizes.n_enemies).filter(is_in_reach)
        };
        let points = |enemy: usize| battle.hit_points(enemies + enemy as u32);
        let is_alive = |agent: &usize| battle.is_alive(*agent as u32);
        let target = |agent: usize| (actions[agent] as usize).checked_sub(action::FIRST_TARGET);
        // No attack precedes that of the first agent.
        let first = (0..sizes.n_agents).filter(is_alive).find(|&agent| in_reach(agent).next().is_some());
        if let Some(first) = first {
            let least = in_reach(first).map(points).fold(f64::INFINITY, f64::min);
            assert_eq!(target(first).map(points), Some(least), "agent {first}");
            n_focused += 1;
        }
        // An enemy that one attack kills is left to one agent, if the others have another target.
        for enemy in (0..sizes.n_enemies).filter(|&enemy| (0.1..3.5).contains(&points(enemy))) {
            let attackers = (0..sizes.n_agents).filter(|&agent| target(agent) == Some(enemy));
            let with_choice =
                attackers.filter(|&agent| in_reach(agent).filter(|&e| points(e) > 40.0).count() > 0);
            let n = with_choice.count();
            assert!(n <= 1, "{n} agents attack enemy {enemy}");
            n_spared += n;
        }
    });
    assert!(n_focused > 50 && n_spared > 0, "{n_focused}, {n_spared}");
}

#[test]
fn hold_never_moves() {
    play("MMM", "hold", 3, |_, actions| {
        let is_move = |action: &i32| (action::NORTH..=action::WEST).contains(&(*action as usize));
        assert!(!actions.iter().any(is_move), "{actions:?}");
    });
}

/// Stalkers outrange zealots and are as fast: they win if they kite, and lose if they stand still.
#[test]
fn kiting_stalkers_beat_zealots_that_beat_standing_ones() {
    let (kiting, standing) =
        (play("3s_vs_3z", "kite", 10, |_, _| {}), play("3s_vs_3z", "hold", 10, |_, _| {}));
    assert!(kiting > standing, "{kiting} wins against {standing}");
}

/// It once lost on most maps: all agents aimed at one enemy, and most of their attacks hit a dead one.
#[test]
fn focus_fire_wins_more_than_nearest() {
    for map in ["8m", "27m_vs_30m", "MMM"] {
        let wins = |policy| play(map, policy, 10, |_, _| {});
        let (focus, nearest) = (wins("focus_fire"), wins("nearest"));
        assert!(focus > nearest, "{map}: {focus} wins against {nearest}");
    }
}

#[test]
fn an_unknown_policy_is_named_with_the_known_ones() {
    let error = Scripted::from_name("greedy", 0).unwrap_err();
    assert_eq!(error, UnknownPolicy("greedy".to_owned()));
    let expected = "unknown policy `greedy`; the policies are random, nearest, focus_fire, kite, hold, line, \
                    flank, escort, spread";
    assert_eq!(error.to_string(), expected);
}
