//! Which sides of a battle are played by joint actions.

use std::fmt;

use serde::{Deserialize, Serialize};
use smaclite_scenarios::{Faction, Scenario};

/// Which sides of a battle a joint action plays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sides {
    /// The agents; a script plays the enemies.
    #[default]
    Allies,
    /// The agents and the enemies.
    Both,
    /// Both, and what the enemies see and do is reflected at the centre of the map: north is south, and east
    /// is west. So what plays the agents of a symmetric scenario can play its enemies. Half a turn is what
    /// maps agents to enemies: formations are placed so, but for rules `starcraft`, and collision avoidance
    /// has no other symmetry.
    Mirrored,
}

smaclite_units::keywords!(Sides, "sides", "allies" => Allies, "both" => Both, "mirrored" => Mirrored);

/// Both sides of a scenario whose interface has agents alone.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("sides must be `allies` in a scenario with the key `smacv2`: its interface is that of agents")]
pub struct SidesError;

impl Sides {
    /// Checks that battles of a scenario can have these sides.
    ///
    /// # Errors
    /// If they are both, and the scenario has SMACv2's interface.
    pub fn check(self, scenario: &Scenario) -> Result<(), SidesError> {
        if self.are_both() && scenario.smacv2.is_some() { Err(SidesError) } else { Ok(()) }
    }

    /// Whether actions play both, mirrored or not.
    pub const fn are_both(self) -> bool {
        !matches!(self, Sides::Allies)
    }

    /// Whether what the enemies see and do is reflected.
    pub const fn are_mirrored(self) -> bool {
        matches!(self, Sides::Mirrored)
    }

    /// Whether this is the default.
    pub fn is_default(&self) -> bool {
        *self == Sides::Allies
    }
}

/// Whose action a number of a joint action is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Actor {
    /// The agent of this number.
    Agent(usize),
    /// The enemy of this number.
    Enemy(usize),
}

impl Actor {
    /// Whose the number at this place of a joint action is: those of the agents precede those of the enemies.
    pub const fn at(place: usize, n_agents: usize) -> Actor {
        if place < n_agents { Actor::Agent(place) } else { Actor::Enemy(place - n_agents) }
    }

    /// Its faction.
    pub const fn faction(self) -> Faction {
        match self {
            Actor::Agent(_) => Faction::Ally,
            Actor::Enemy(_) => Faction::Enemy,
        }
    }

    /// The place of its number in a joint action.
    pub const fn place(self, n_agents: usize) -> usize {
        match self {
            Actor::Agent(agent) => agent,
            Actor::Enemy(enemy) => n_agents + enemy,
        }
    }
}

impl fmt::Display for Actor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Actor::Agent(agent) => write!(f, "agent {agent}"),
            Actor::Enemy(enemy) => write!(f, "enemy {enemy}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_sides_need_an_interface_that_both_have() {
        let scenario = |name| Scenario::standard(name).unwrap();
        for both in [Sides::Both, Sides::Mirrored] {
            assert_eq!(both.check(&scenario("2s3z")), Ok(()));
            assert_eq!(both.check(&scenario("terran_5_vs_5")), Err(SidesError));
            assert!(!both.is_default());
        }
        assert_eq!(Sides::Allies.check(&scenario("terran_5_vs_5")), Ok(()));
        assert!(Sides::Allies.is_default());
    }

    #[test]
    fn a_place_in_a_joint_action_is_that_of_its_actor() {
        let actors = [Actor::Agent(0), Actor::Agent(1), Actor::Enemy(0), Actor::Enemy(1)];
        for (place, actor) in actors.into_iter().enumerate() {
            assert_eq!((Actor::at(place, 2), actor.place(2)), (actor, place));
        }
        assert_eq!(actors.map(Actor::faction).map(|side| side == Faction::Ally), [true, true, false, false]);
    }
}
