//! Who plays a side of a battle whose learner left: a scripted policy, which sees what that learner saw.

use crate::joint_action::JointAction;
use smaclite_engine::policy::{LearnerView, Scripted, Tactic};
use smaclite_engine::{Battle, Faction};

/// A scripted policy in the place of the learner of a side.
pub(crate) struct StandIn {
    side: Faction,
    policy: Scripted,
    state: Vec<f32>,
    available: Vec<u8>,
    actions: Vec<i32>,
}

impl StandIn {
    /// The seed matters for the policy `random` only.
    pub(crate) fn new(side: Faction, tactic: Tactic, seed: u64) -> StandIn {
        let policy = Scripted::new(tactic, seed);
        StandIn { side, policy, state: Vec::new(), available: Vec::new(), actions: Vec::new() }
    }

    /// Chooses the actions of the side.
    pub(crate) fn act(&mut self, battle: &Battle, joint: JointAction<'_>) {
        let (arena, side) = (battle.arena(), self.side);
        let sizes = arena.sizes_of(side);
        self.state.resize(sizes.state_size, 0.0);
        self.available.resize(sizes.n_agents * sizes.n_actions, 0);
        self.actions.resize(sizes.n_agents, 0);
        battle.write_state_of(side, &mut self.state);
        battle.write_avail_actions_of(side, &mut self.available);
        let view = LearnerView::of(arena, side, &self.state, &self.available);
        self.policy.act(&view, &mut self.actions);
        let first = if side == Faction::Ally { 0 } else { arena.sizes().n_agents };
        self.actions.iter().enumerate().for_each(|(unit, action)| joint.set(first + unit, *action));
    }
}
