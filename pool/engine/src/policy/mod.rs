//! Scripted policies: random, nearest, focus fire, kite and hold.
//!
//! They are part of the public interface: users compare learners with them, and benches and tests play with
//! them. They see a battle through [`Situation`], which a [`Battle`](crate::Battle) implements, and
//! [`LearnerView`] for the fields of a batch.

mod random;
mod situation;
mod tactics;

use crate::arena::Arena;

pub use random::{Random, uniform_below};
pub use situation::{LearnerView, Situation};
pub use tactics::{focus_fire, hold, kite, nearest};

/// A scripted policy, chosen by name.
#[derive(Clone, Debug)]
pub enum Scripted {
    /// Uniformly random available actions.
    Random(Random),
    /// [`nearest`].
    Nearest,
    /// [`focus_fire`].
    FocusFire,
    /// [`kite`].
    Kite,
    /// [`hold`].
    Hold,
}

impl Scripted {
    /// The names of all policies.
    pub const NAMES: [&str; 5] = ["random", "nearest", "focus_fire", "kite", "hold"];

    /// The policy of that name. The seed matters for `random` only.
    ///
    /// # Errors
    /// If there is no policy of that name.
    pub fn from_name(name: &str, seed: u64) -> Result<Scripted, UnknownPolicy> {
        match name {
            "random" => Ok(Scripted::Random(Random::new(seed))),
            "nearest" => Ok(Scripted::Nearest),
            "focus_fire" => Ok(Scripted::FocusFire),
            "kite" => Ok(Scripted::Kite),
            "hold" => Ok(Scripted::Hold),
            _ => Err(UnknownPolicy(name.to_owned())),
        }
    }

    /// Writes an action for each agent.
    ///
    /// # Panics
    /// If `actions` is longer than there are agents.
    pub fn act(&mut self, situation: &impl Situation, actions: &mut [i32]) {
        match self {
            Scripted::Random(random) => random.act(situation, actions),
            Scripted::Nearest => nearest(situation, actions),
            Scripted::FocusFire => focus_fire(situation, actions),
            Scripted::Kite => kite(situation, actions),
            Scripted::Hold => hold(situation, actions),
        }
    }

    /// Writes an action for each agent of every environment of a batch, `[M, n_agents]`, from its fields
    /// `state`, f32 `[M, state_size]`, and `avail_actions`, u8 `[M, n_agents, n_actions]`. The policy
    /// `random` draws for one environment after the other.
    ///
    /// These are the actions that [`act`](Self::act) chooses with the battles themselves.
    ///
    /// # Panics
    /// If the sizes are not those of one number of environments of this arena.
    pub fn act_batch(&mut self, arena: &Arena, states: &[f32], avail_actions: &[u8], actions: &mut [i32]) {
        let sizes = arena.sizes();
        let mut states = states.chunks_exact(sizes.state_size);
        let mut avail_actions = avail_actions.chunks_exact(sizes.n_agents * sizes.n_actions);
        for actions in actions.chunks_exact_mut(sizes.n_agents) {
            let (Some(state), Some(available)) = (states.next(), avail_actions.next()) else {
                panic!("states and avail_actions must have a row per row of actions");
            };
            self.act(&LearnerView::new(arena, state, available), actions);
        }
    }
}

/// A name that no policy has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown policy `{0}`; the policies are {names}", names = Scripted::NAMES.join(", "))]
pub struct UnknownPolicy(pub String);
