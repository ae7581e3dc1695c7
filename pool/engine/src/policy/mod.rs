//! Scripted policies: rules of thumb that choose actions, for the agents or for the enemies.
//!
//! They are part of the public interface: users compare learners with them and play against them, and benches
//! and tests play with them. They see one side of a battle through [`Situation`]: that of the agents in a
//! [`Battle`](crate::Battle), either side in a [`BattleSide`] and, from the fields of a batch, in a
//! [`LearnerView`].
//!
//! | file | contents |
//! | --- | --- |
//! | `choice` | the decision of one unit: what it targets, and where it goes |
//! | `tactics` | policies in which every unit decides for itself, and focus fire |
//! | `formations` | policies in which units keep places in their team |

mod choice;
mod formations;
mod random;
mod situation;
mod tactics;

use crate::arena::Arena;
use crate::encode::types_in_state;
use crate::scratch::PolicyScratch;
use smaclite_scenarios::Faction;
use smaclite_units::file::or_did_you_mean;

pub use crate::tactic::Tactic;
pub use random::{Random, uniform_below};
pub(crate) use situation::EnemySituation;
pub use situation::{BattleSide, LearnerView, Situation};
pub use tactics::nearest;

impl Tactic {
    /// The rule of that name.
    ///
    /// # Errors
    /// If there is no policy of that name.
    pub fn from_name(name: &str) -> Result<Tactic, UnknownPolicy> {
        let found = Tactic::ALL.into_iter().find(|tactic| tactic.name() == name);
        found.ok_or_else(|| UnknownPolicy(name.to_owned()))
    }

    /// Writes an action for each agent; `draw` gives 64 random bits.
    pub(crate) fn act(
        self,
        situation: &impl Situation,
        actions: &mut [i32],
        memory: &mut PolicyScratch,
        draw: impl FnMut() -> u64,
    ) {
        match self {
            Tactic::Random => random::random(situation, actions, draw),
            Tactic::Nearest => nearest(situation, actions),
            Tactic::FocusFire => tactics::focus_fire(situation, actions, &mut memory.remaining),
            Tactic::Kite => tactics::kite(situation, actions, &mut memory.remaining),
            Tactic::Hold => tactics::hold(situation, actions),
            Tactic::Line => formations::line(situation, actions),
            Tactic::Flank => formations::flank(situation, actions),
            Tactic::Escort => formations::escort(situation, actions),
            Tactic::Spread => formations::spread(situation, actions, &mut memory.is_taken),
        }
    }
}

/// A scripted policy, chosen by name.
#[derive(Clone, Debug)]
pub struct Scripted {
    tactic: Tactic,
    random: Random,
    memory: PolicyScratch,
}

impl Scripted {
    /// The names of all policies.
    pub const NAMES: [&str; Tactic::ALL.len()] = {
        let mut names = [""; Tactic::ALL.len()];
        let mut i = 0;
        while i < names.len() {
            names[i] = Tactic::ALL[i].name();
            i += 1;
        }
        names
    };

    /// The policy with that rule. The seed matters for `random` only.
    pub fn new(tactic: Tactic, seed: u64) -> Scripted {
        Scripted { tactic, random: Random::new(seed), memory: PolicyScratch::default() }
    }

    /// The policy of that name.
    ///
    /// # Errors
    /// If there is no policy of that name.
    pub fn from_name(name: &str, seed: u64) -> Result<Scripted, UnknownPolicy> {
        Tactic::from_name(name).map(|tactic| Scripted::new(tactic, seed))
    }

    /// Writes an action for each agent.
    ///
    /// # Panics
    /// If `actions` is longer than there are agents.
    pub fn act(&mut self, situation: &impl Situation, actions: &mut [i32]) {
        let Scripted { tactic, random, memory } = self;
        tactic.act(situation, actions, memory, || random.next());
    }

    /// Writes an action for each agent of every environment of a batch, `[M, n_agents]`, from its fields
    /// `state`, f32 `[M, state_size]`, and `avail_actions`, u8 `[M, n_agents, n_actions]`. The policy
    /// `random` draws for one environment after the other.
    ///
    /// These are the actions that [`act`](Self::act) chooses with the battles themselves, if states tell the
    /// types of drawn units apart (`Scenario::tells_types_apart`).
    ///
    /// # Panics
    /// If the sizes are not those of one number of environments of this arena.
    pub fn act_batch(&mut self, arena: &Arena, states: &[f32], avail_actions: &[u8], actions: &mut [i32]) {
        self.act_batch_of(Faction::Ally, arena, states, avail_actions, actions);
    }

    /// As [`act_batch`](Self::act_batch), for a side: that of the enemies from the fields `enemy_state` and
    /// `enemy_avail_actions`.
    ///
    /// # Panics
    /// As [`act_batch`](Self::act_batch), by the [side's](Arena::sizes_of) sizes.
    pub fn act_batch_of(
        &mut self,
        side: Faction,
        arena: &Arena,
        states: &[f32],
        avail_actions: &[u8],
        actions: &mut [i32],
    ) {
        let sizes = arena.sizes_of(side);
        let n_envs = actions.len() / sizes.n_agents;
        let (given, expected) = (
            [states.len(), avail_actions.len(), actions.len()],
            [sizes.state_size, sizes.n_agents * sizes.n_actions, sizes.n_agents].map(|size| n_envs * size),
        );
        assert_eq!(given, expected, "sizes of states, avail_actions and actions of {n_envs} environments");
        // The units of a generated scenario have the types that the state says.
        let mut own = arena.drawer().map(|_| arena.clone());
        let mut types = Vec::new();
        let states = states.chunks_exact(sizes.state_size);
        let avail_actions = avail_actions.chunks_exact(sizes.n_agents * sizes.n_actions);
        let actions = actions.chunks_exact_mut(sizes.n_agents);
        for ((state, available), actions) in states.zip(avail_actions).zip(actions) {
            if let Some(own) = &mut own {
                types_in_state(arena, side, state, &mut types);
                own.set_types(types.iter().copied());
            }
            let arena = own.as_ref().unwrap_or(arena);
            self.act(&LearnerView::of(arena, side, state, available), actions);
        }
    }
}

/// A name that no policy has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "unknown policy `{0}`; the policies are {names}{hint}",
    names = Scripted::NAMES.join(", "),
    hint = or_did_you_mean(.0, Scripted::NAMES)
)]
pub struct UnknownPolicy(pub String);
