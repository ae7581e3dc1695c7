//! Tests of `ppo` with a made-up environment of one step: the team's reward is the number of agents that took
//! the right action, which the observation shows.

use super::*;
use crate::architecture::Workspace;
use crate::config::Algorithm;
use crate::math::WIDTH;
use crate::policy::{Choice, choose};
use crate::random::{Purpose, generator, uniform};
use crate::rollout::Rollout;
use crate::team::agent_ids;
use smaclite_engine::Sizes;

fn sizes() -> Sizes {
    Sizes { n_agents: 2, n_actions: 3, obs_size: 3, state_size: 6, ..Sizes::default() }
}

fn config(algorithm: Algorithm) -> Config {
    Config { algorithm, num_envs: 16, horizon: 8, hidden: vec![16], ..Config::for_agents(3) }
}

/// Plays one rollout. The share of right actions is its mean reward, divided by the number of agents.
fn play(team: &Team, config: &Config, update: u64) -> Rollout {
    let mut rollout = Rollout::new(config, sizes());
    let mut generator = generator(config.seed, Purpose::Evaluation, [update, 0]);
    let n_rows = rollout.actions.len();
    for (row, obs) in rollout.obs.chunks_exact_mut(3).enumerate() {
        obs[(uniform(&mut generator) * 3.0) as usize] = 1.0;
        if let Some(state) = rollout.state.chunks_exact_mut(3).nth(row) {
            state.copy_from_slice(obs);
        }
    }
    let mut workspace = Workspace::default();
    team.actor.forward(&rollout.obs[..3 * n_rows], &agent_ids(n_rows, 2), &mut workspace);
    for (row, outputs) in workspace.output().chunks_exact_mut(WIDTH).enumerate() {
        let mask = &mut rollout.masks[row * WIDTH..][..WIDTH];
        mask[..3].fill(1);
        let (action, log_prob) =
            choose(outputs, mask, &mut [0.0; WIDTH], Choice::Sampled, uniform(&mut generator));
        (rollout.actions[row], rollout.log_probs[row]) = (action as u16, log_prob);
        rollout.rewards[row / 2] += rollout.obs[row * 3 + action];
    }
    rollout.terminated.fill(true);
    rollout
}

fn played(rollout: &Rollout) -> Vec<Played<'_>> {
    vec![Played { rollout, on_scenario: None, seed: 0 }]
}

fn share_of_right_actions(rollout: &Rollout) -> f32 {
    rollout.rewards.iter().sum::<f32>() / rollout.actions.len() as f32
}

#[test]
fn right_actions_become_more_probable() {
    for algorithm in [Algorithm::Mappo, Algorithm::Ippo] {
        let config = Config { actor_lr: 5e-3, ..config(algorithm) };
        let mut team = Team::new(&config, &sizes().into());
        let mut ppo = Ppo::new(2);
        assert!(share_of_right_actions(&play(&team, &config, 0)) < 0.5);
        let mut stats = UpdateStats::default();
        for update in 0..20 {
            let rollout = play(&team, &config, update);
            stats = ppo.update(&mut team, played(&rollout), &config, update, 0, &mut || false).unwrap();
        }
        let share = share_of_right_actions(&play(&team, &config, 20));
        assert!(share > 0.9, "{algorithm:?}: {share}, {stats:?}");
        assert!(stats.entropy < 0.5 && stats.policy_rows == 1.0, "{stats:?}");
    }
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let config = config(Algorithm::Mappo);
    let first = Team::new(&config, &sizes().into());
    let rollout = play(&first, &config, 0);
    let train = |threads| {
        let mut team = first.clone();
        let stats =
            Ppo::new(threads).update(&mut team, played(&rollout), &config, 0, 0, &mut || false).unwrap();
        (team, stats)
    };
    assert_eq!(train(1), train(5));
    assert_ne!(train(1).0, first);
}

#[test]
fn an_observation_that_is_no_number_is_reported() {
    let config = config(Algorithm::Mappo);
    let mut team = Team::new(&config, &sizes().into());
    let mut rollout = play(&team, &config, 0);
    rollout.obs[0] = f32::NAN;
    let error = Ppo::new(1).update(&mut team, played(&rollout), &config, 7, 0, &mut || false).unwrap_err();
    let UpdateError::Diverged(error) = error else { panic!("{error:?}") };
    let error = error.to_string();
    assert!(error.contains("the gradient of the actor is not finite in update 7"), "{error}");
    let mut rollout = play(&team, &config, 0);
    rollout.rewards[3] = f32::INFINITY;
    assert!(Ppo::new(1).update(&mut team, played(&rollout), &config, 7, 0, &mut || false).is_err());
}

#[test]
fn a_rollout_without_choices_trains_the_critic_alone() {
    let config = config(Algorithm::Mappo);
    let first = Team::new(&config, &sizes().into());
    let mut rollout = play(&first, &config, 0);
    rollout.masks.chunks_exact_mut(WIDTH).for_each(|mask| mask[1..].fill(0));
    let mut team = first.clone();
    Ppo::new(1).update(&mut team, played(&rollout), &config, 0, 0, &mut || false).unwrap();
    assert_eq!(team.actor, first.actor);
    assert_ne!(team.critic.params, first.critic.params);
}

#[test]
fn advantages_are_scaled_by_their_deviation_or_the_floor() {
    // Rows 0 to 2 are learnt: mean 2, variance 2/3.
    let normalised = |policy_rows: &[u32], agents_per_value, floor| {
        let mut advantages = vec![1.0, 2.0, 3.0, 9.0];
        normalise(&mut advantages, policy_rows, agents_per_value, floor);
        advantages
    };
    let close = |found: Vec<f32>, expected: [f32; 4]| {
        found.iter().zip(expected).for_each(|(x, y)| assert!((x - y).abs() < 1e-5, "{found:?} {expected:?}"));
    };
    let deviation = (2.0f32 / 3.0).sqrt();
    close(normalised(&[0, 1, 2], 1, 0.0), [-1.0, 0.0, 1.0, 7.0].map(|x| x / deviation));
    close(normalised(&[0, 1, 2], 1, 0.5), [-1.0, 0.0, 1.0, 7.0].map(|x| x / deviation));
    close(normalised(&[0, 1, 2], 1, 4.0), [-0.25, 0.0, 0.25, 1.75]);
    // Two agents share an advantage: rows 0 to 3 have those of samples 0 and 1.
    close(normalised(&[0, 1, 2, 3], 2, 0.0), [-1.0, 1.0, 3.0, 15.0]);
}
