//! What a step earns the sides, and the share of each unit. The formula is in the crate's `rewards`.

use smaclite_scenarios::Faction;

use super::Battle;
use crate::KILL_REWARD;
use crate::buffers::refill;
use crate::rewards::{End, Points, divide, scaled};
use crate::tick::{Earned, TickScratch};

impl Battle {
    /// From now on every step computes the [shares](Self::write_shares_of) of all units in its rewards.
    pub fn keep_shares(&mut self) {
        self.shares = Some(vec![0.0; self.units.pos.len()]);
    }

    /// Writes the share of each unit of a side in the side's reward of the last step: `[units of the side]`,
    /// by in-faction id; zeros before the first step of an episode, and unless they are
    /// [kept](Self::keep_shares).
    ///
    /// The share of a unit is what its own hits earned, for damage and kills, less what it lost itself where
    /// losses count, scaled as the side's reward. What no unit of the side earned is divided equally among
    /// all of them, the dead too: the reward for the end, what an enemy gives that destroys itself, what the
    /// other side's reward takes in zero-sum battles, and with SMACv2's interface what enemies regained. So
    /// the shares add up to the reward, up to rounding.
    ///
    /// # Panics
    /// If `out` has another size.
    pub fn write_shares_of(&self, side: Faction, out: &mut [f32]) {
        let ids = self.arena.ids(side);
        assert_eq!(out.len(), ids.len(), "one share per unit");
        let shares = self.shares.as_deref();
        let share = |id: u32| shares.map_or(0.0, |shares| shares[id as usize] as f32);
        out.iter_mut().zip(ids).for_each(|(out, &id)| *out = share(id));
    }

    /// Begins an episode.
    pub(super) fn clear_shares(&mut self) {
        self.shares.iter_mut().for_each(|shares| shares.fill(0.0));
    }

    /// Notes at the start of a step what its rewards and shares depend on.
    pub(super) fn prepare_rewards(&self, scratch: &mut TickScratch) {
        if self.shares.is_some() {
            scratch.credits.resize(self.units.pos.len(), 0.0);
        }
        if !self.arena.rewards().only_positive {
            refill(&mut scratch.before, self.arena.unit_ids().map(|id| self.endurance(id)));
        }
    }

    /// Health and shield; 0 of the dead.
    fn endurance(&self, id: u32) -> f64 {
        let i = id as usize;
        if self.units.alive[i] { self.units.hp[i] + self.units.shield[i] } else { 0.0 }
    }

    /// What a unit lost in the step, and its death, in points as they count.
    fn loss(&self, id: u32, scratch: &TickScratch) -> [f64; 2] {
        let (options, before) = (self.arena.rewards(), scratch.before[id as usize]);
        let died = before > 0.0 && !self.units.alive[id as usize];
        let death = if died { options.death_value } else { 0.0 };
        [before - self.endurance(id), death].map(|points| points * options.negative_scale)
    }

    /// The rewards of the agents and of the enemies by SMAClite's rules; keeps the shares.
    pub(super) fn rewards(&mut self, earned: Earned, scratch: &TickScratch) -> [f64; 2] {
        let rewards = [(Faction::Ally, earned.allies), (Faction::Enemy, earned.enemies)]
            .map(|(side, earned)| self.reward_of(side, earned, scratch));
        if self.shares.is_some() {
            for side in [Faction::Ally, Faction::Enemy] {
                let greatest = self.arena.max_reward_of(side);
                self.share_out(side, rewards[side as usize], greatest, scratch);
            }
        }
        rewards
    }

    /// What a side earned in a step by hits, its losses, and the reward for the end, scaled.
    pub(super) fn reward_of(&self, side: Faction, earned: f64, scratch: &TickScratch) -> f64 {
        let options = self.arena.rewards();
        let killed = f64::from(scratch.killed[side.opponent() as usize]);
        let deaths = (options.death_value - KILL_REWARD) * killed;
        let mut points = Points { damage: earned, deaths, lost: 0.0 };
        if !options.only_positive {
            for &id in self.arena.ids(side) {
                let [lost, death] = self.loss(id, scratch);
                points.lost += lost;
                points.deaths -= death;
            }
        }
        // Both sides win if the last units died in the same tick.
        let end = if self.is_won_by(side) {
            Some(End::Won)
        } else {
            self.is_won_by(side.opponent()).then_some(End::Lost)
        };
        points.reward(options, end, self.arena.max_reward_of(side))
    }

    /// Divides the reward of a side among its units.
    pub(super) fn share_out(&mut self, side: Faction, reward: f64, greatest: f64, scratch: &TickScratch) {
        let Some(mut shares) = self.shares.take() else { return };
        let (options, ids) = (self.arena.rewards(), self.arena.ids(side));
        let own = |id: u32| {
            let loss = if options.only_positive { [0.0; 2] } else { self.loss(id, scratch) };
            scaled(scratch.credits[id as usize] - loss[0] - loss[1], options, greatest)
        };
        for &id in ids {
            shares[id as usize] = if options.sparse { 0.0 } else { own(id) };
        }
        divide(reward, ids, &mut shares);
        self.shares = Some(shares);
    }
}
