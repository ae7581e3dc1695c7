//! The scripted policies: what each of them promises, in battles on every standard map.

use smaclite_engine::policy::{Scripted, Situation, UnknownPolicy};
use smaclite_engine::{Arena, Battle, Rules, Scratch, action};
use smaclite_scenarios::Scenario;
use std::sync::Arc;

/// Plays `episodes` episodes; `check` sees every joint action before it is played. Returns the wins.
fn play(map: &str, policy: &str, episodes: usize, mut check: impl FnMut(&Battle, &[i32])) -> usize {
    let scenario = Scenario::standard(map).expect("a standard scenario");
    let mut battle = Battle::new(Arc::new(Arena::new(&scenario, Rules::default())), 3);
    let mut policy = Scripted::from_name(policy, 3).expect("a policy");
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

#[test]
fn focus_fire_aims_every_agent_that_can_at_the_weakest_target() {
    let mut n_focused = 0;
    play("8m", "focus_fire", 5, |battle, actions| {
        let sizes = battle.arena().sizes();
        let enemies = sizes.n_agents as u32..sizes.n_units() as u32; // 8m lists the allies first
        let can_target =
            |agent: usize, enemy: usize| Situation::is_available(battle, agent, action::FIRST_TARGET + enemy);
        let targets = (0..sizes.n_enemies).filter(|&enemy| (0..sizes.n_agents).any(|a| can_target(a, enemy)));
        let points = |enemy: usize| battle.hit_points(enemies.start + enemy as u32);
        let Some(weakest) = targets.min_by(|&a, &b| points(a).total_cmp(&points(b))) else { return };
        for agent in (0..sizes.n_agents).filter(|&agent| can_target(agent, weakest)) {
            assert_eq!(actions[agent] as usize, action::FIRST_TARGET + weakest, "agent {agent}");
            n_focused += 1;
        }
    });
    assert!(n_focused > 100, "{n_focused}");
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

#[test]
fn focus_fire_wins_more_than_random_play() {
    let wins = |policy| play("3m", policy, 20, |_, _| {});
    let (focus, random) = (wins("focus_fire"), wins("random"));
    assert!(focus > random, "{focus} wins against {random}");
}

#[test]
fn an_unknown_policy_is_named_with_the_known_ones() {
    let error = Scripted::from_name("greedy", 0).unwrap_err();
    assert_eq!(error, UnknownPolicy("greedy".to_owned()));
    let expected = "unknown policy `greedy`; the policies are random, nearest, focus_fire, kite, hold";
    assert_eq!(error.to_string(), expected);
}
