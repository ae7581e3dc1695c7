//! Scripted policies: random, nearest, focus fire, kite and hold.
//!
//! They are part of the public interface: users compare learners with them, and benches and tests play with
//! them. They see a battle through [`Situation`], which a [`Battle`] implements.

mod random;
mod tactics;

use glam::Vec2;

use crate::arena::Arena;
use crate::battle::Battle;

pub use random::Random;
pub use tactics::{focus_fire, hold, kite, nearest};

/// What a policy sees of a battle. Units are given by battle-wide id.
pub trait Situation {
    /// What no battle of the scenario changes.
    fn arena(&self) -> &Arena;
    /// Position in squares.
    fn position(&self, id: u32) -> Vec2;
    /// Health divided by its maximum: 0 to 1.
    fn health_share(&self, id: u32) -> f64;
    /// Health and shield.
    fn hit_points(&self, id: u32) -> f64;
    /// Whether the unit is in the battle.
    fn is_alive(&self, id: u32) -> bool;
    /// Whether the cooldown of an agent's unit is over.
    fn is_ready(&self, id: u32) -> bool;
    /// The actions available to an agent: bit `a % 64` of word `a / 64` for action `a`.
    fn available(&self, agent: usize) -> &[u64];

    /// Whether an action is available to an agent.
    fn is_available(&self, agent: usize, action: usize) -> bool {
        self.available(agent).get(action / 64).is_some_and(|word| word >> (action % 64) & 1 == 1)
    }
}

impl Situation for Battle {
    fn arena(&self) -> &Arena {
        Battle::arena(self)
    }

    fn position(&self, id: u32) -> Vec2 {
        self.units().pos[id as usize]
    }

    fn health_share(&self, id: u32) -> f64 {
        self.units().hp[id as usize] / Battle::arena(self).stats(id).hp
    }

    fn hit_points(&self, id: u32) -> f64 {
        self.units().hp[id as usize] + self.units().shield[id as usize]
    }

    fn is_alive(&self, id: u32) -> bool {
        self.units().alive[id as usize]
    }

    fn is_ready(&self, id: u32) -> bool {
        self.units().cooldown[id as usize] <= 0.0
    }

    fn available(&self, agent: usize) -> &[u64] {
        Battle::available(self, agent)
    }
}

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
}

/// A name that no policy has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown policy `{0}`; the policies are {names}", names = Scripted::NAMES.join(", "))]
pub struct UnknownPolicy(pub String);
