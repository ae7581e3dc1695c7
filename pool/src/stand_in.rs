//! Who plays a side of a battle whose learner left: a scripted policy, which sees what that learner saw.

use crate::joint_action::JointAction;
use smaclite_engine::policy::{BattleSide, Scripted, Tactic};
use smaclite_engine::{Battle, Faction};

/// A scripted policy in the place of the learner of a side.
pub(crate) struct StandIn {
    side: Faction,
    policy: Scripted,
    actions: Vec<i32>,
}

impl StandIn {
    /// The seed matters for the policy `random` only.
    pub(crate) fn new(side: Faction, tactic: Tactic, seed: u64) -> StandIn {
        StandIn { side, policy: Scripted::new(tactic, seed), actions: Vec::new() }
    }

    /// Chooses the actions of the side.
    pub(crate) fn act(&mut self, battle: &Battle, joint: JointAction<'_>) {
        let (arena, side) = (battle.arena(), self.side);
        self.actions.resize(arena.sizes_of(side).n_agents, 0);
        self.policy.act(&BattleSide::new(battle, side), &mut self.actions);
        let first = if side == Faction::Ally { 0 } else { arena.sizes().n_agents };
        self.actions.iter().enumerate().for_each(|(unit, action)| joint.set(first + unit, *action));
    }
}
