//! Fills the rollouts of all maps: lane by lane, a batch is stored, the policy acts on it in place, and its
//! actions are sent. The workers step the other lanes while the policy acts on one.

use crate::actor::{Chosen, Draw};
use crate::enemy_actor::{BothActors, Teams, players};
use crate::lanes::{LaneBatch, Lanes};
use crate::league::{League, Player};
use crate::policy::Choice;
use crate::random::{Purpose, generator};
use crate::rollout::{Against, Ended, Episode, Rollout};
use crate::team::Network;
use crate::view::View;
use smaclite_engine::{Faction, Sizes};
use smaclite_ipc::{Batch, ClientError};
use smaclite_pool::fields::Field;
use std::time::{Duration, Instant};

/// A map that is played on.
pub(crate) struct Playing<'a> {
    /// By lane.
    pub actors: &'a mut Vec<BothActors>,
    pub lanes: &'a mut Lanes,
    pub network: &'a Network,
    pub rollout: &'a mut Rollout,
    pub draws: Draws,
}

/// Where the random numbers of a rollout come from, and how players are drawn.
#[derive(Clone, Copy)]
pub(crate) struct Draws {
    pub seed: u64,
    /// Steps made before.
    pub first_step: u64,
    /// See [`League::draw`].
    pub self_share: f64,
}

/// Plays a rollout's steps of every environment of all maps, each of which has as many. Returns the time that
/// was spent waiting for batches.
pub(crate) fn collect(
    maps: &mut [Playing<'_>],
    league: &mut League,
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<Duration, ClientError> {
    let mut waited = Duration::ZERO;
    maps.iter_mut().for_each(Playing::begin);
    let horizon = maps.first().map_or(0, |map| map.rollout.horizon);
    for t in 0..=horizon {
        for map in &mut *maps {
            if interrupted() {
                return Err(ClientError::Interrupted);
            }
            waited += map.step(t, league, interrupted)?;
        }
    }
    Ok(waited)
}

impl Playing<'_> {
    fn begin(&mut self) {
        self.actors.resize_with(self.lanes.count(), Default::default);
        self.rollout.episodes.clear();
    }

    /// Stores what all environments are like at time `t`, and acts. Returns the time that was spent waiting.
    fn step(
        &mut self,
        t: usize,
        league: &mut League,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Duration, ClientError> {
        let Playing { actors, lanes, network, rollout, draws } = self;
        let Draws { seed, first_step, self_share } = *draws;
        let (mut waited, sizes, step) = (Duration::ZERO, lanes.sizes(), first_step + t as u64);
        for (lane, actors) in actors.iter_mut().enumerate() {
            let begin = Instant::now();
            let lane_batch = lanes.batch(lane, interrupted)?;
            waited += begin.elapsed();
            rollout.store_inputs(t, sizes, &lane_batch);
            if t > 0 {
                rollout.store_outcome(t - 1, sizes, &lane_batch, league);
            }
            if t == rollout.horizon {
                continue;
            }
            let LaneBatch { first_env, batch, over } = lane_batch;
            let of_sides = [Purpose::Actions, Purpose::EnemyActions];
            let of_sides = of_sides.map(|purpose| Draw { seed, purpose, step });
            let teams = Teams { own: network, league };
            actors.act(teams, batch, sizes, first_env, Choice::Sampled, of_sides);
            let BothActors { allies, enemies, .. } = &*actors;
            rollout.store_actions(t, Faction::Ally, first_env, over.iter().copied(), &allies.chosen);
            if league.is_played() {
                let is_skipped = over.iter().enumerate().map(|(env, over)| *over || !enemies.is_own(env));
                rollout.store_actions(t, Faction::Enemy, first_env, is_skipped, &enemies.chosen);
                // The next step resets these; the player stays for the whole episode that it begins.
                for env in (first_env..).zip(over).filter(|(_, over)| **over).map(|(env, _)| env) {
                    league.draw(env, self_share, &mut generator(seed, Purpose::Players, [step, env as u64]));
                }
            }
            lanes.send(lane, actors.actions())?;
        }
        Ok(waited)
    }
}

/// Copies `values` into row `row` of rows of `width`.
fn store<T: Copy>(to: &mut [T], row: usize, width: usize, values: &[T]) {
    to[row * width..][..values.len()].copy_from_slice(values);
}

impl Rollout {
    /// Stores what the networks see at time `t`.
    fn store_inputs(&mut self, t: usize, sizes: Sizes, lane_batch: &LaneBatch<'_>) {
        let LaneBatch { first_env, batch, .. } = *lane_batch;
        for (side, sizes) in self.views(sizes) {
            let view = View::of(batch, side, sizes);
            let sample = self.sample(t, side, first_env);
            store(&mut self.obs, sample, sizes.n_agents * sizes.obs_size, view.rows.obs);
            if !self.state.is_empty() {
                store(&mut self.state, sample, sizes.state_size, view.state);
            }
        }
    }

    /// Stores what a side chose at time `t`. Nothing is learnt from what `is_skipped`.
    fn store_actions(
        &mut self,
        t: usize,
        side: Faction,
        first_env: usize,
        is_skipped: impl Iterator<Item = bool>,
        chosen: &Chosen,
    ) {
        if !self.sides.contains(&side) {
            return;
        }
        let sample = self.sample(t, side, first_env);
        let row = sample * self.sizes.n_agents;
        store(&mut self.masks, row, self.padded_actions, &chosen.masks);
        store(&mut self.log_probs, row, 1, &chosen.log_probs);
        let actions = self.actions[row..].iter_mut().zip(&chosen.actions);
        actions.for_each(|(to, action)| *to = *action as u16);
        self.is_skipped[sample..].iter_mut().zip(is_skipped).for_each(|(to, skipped)| *to = skipped);
    }

    /// Stores what the step of time `t` led to.
    fn store_outcome(&mut self, t: usize, sizes: Sizes, lane_batch: &LaneBatch<'_>, league: &mut League) {
        let LaneBatch { first_env, batch, .. } = *lane_batch;
        for (side, sizes) in self.views(sizes) {
            let sample = self.sample(t, side, first_env);
            store(&mut self.rewards, sample, 1, View::of(batch, side, sizes).rewards);
            let flags = batch.terminated().iter().zip(batch.truncated());
            for (i, (terminated, truncated)) in flags.enumerate() {
                self.terminated[sample + i] = *terminated != 0;
                self.truncated[sample + i] = *truncated != 0;
            }
        }
        self.balance_rewards(t, first_env..first_env + batch.terminated().len());
        if !league.is_played() {
            let ended = ended_episodes(batch, |_| None);
            self.episodes.extend(ended.map(|(_, episode)| Ended { episode, against: Against::Script }));
            return;
        }
        let players: Vec<Option<Player>> = players(batch, league, first_env).collect();
        let against_team = |slot: usize| players[slot].map(|_| sizes.n_agents);
        for (slot, episode) in ended_episodes(batch, against_team) {
            let against = match players[slot] {
                None => Against::Script,
                Some(Player::Own) => Against::Own,
                Some(Player::Rival(_)) => Against::Rival,
            };
            players[slot].into_iter().for_each(|player| league.observe(player, episode.won));
            self.episodes.push(Ended { episode, against });
        }
    }
}

/// The episodes that ended with this batch, with the slots. For an environment whose enemies are a team,
/// `against_team` gives the number of agents: between teams, it is a draw if the last units of both die in
/// the same step.
pub(crate) fn ended_episodes(
    batch: &Batch,
    against_team: impl Fn(usize) -> Option<usize>,
) -> impl Iterator<Item = (usize, Episode)> {
    let (returns, won) = (batch.field(Field::EpisodeReturn), batch.field::<u8>(Field::BattleWon));
    let (lengths, dead) = (batch.field(Field::EpisodeLength), batch.field::<i32>(Field::DeadAllies));
    let are_dead =
        move |slot: usize, n_agents| dead.is_some_and(|dead| dead[slot].cast_unsigned() == n_agents);
    let ends = batch.terminated().iter().zip(batch.truncated()).enumerate();
    let ended = ends.filter(|(_, (terminated, truncated))| **terminated | **truncated != 0);
    ended.map(move |(slot, _)| {
        let is_draw = against_team(slot).is_some_and(|n_agents| are_dead(slot, n_agents as u32));
        let episode = Episode {
            episode_return: returns.map_or(0.0, |returns| returns[slot]),
            length: lengths.map_or(0, |lengths| lengths[slot]),
            won: won.is_some_and(|won| won[slot] != 0) && !is_draw,
        };
        (slot, episode)
    })
}
