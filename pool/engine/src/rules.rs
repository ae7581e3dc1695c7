//! Which of the two rule sets a battle follows where the paper's text and its implementation differ.
//!
//! The rules themselves live where they apply (`tick`); each place names its rule by R1, R2, R3 or R4.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// The rule set of a battle. They differ in four places:
///
/// | | [`Smaclite`](Rules::Smaclite) | [`Paper`](Rules::Paper) |
/// | --- | --- | --- |
/// | R1: an attack-moving unit with a target that is no healer, while an agent is a living healer | picks the best target anew every tick | switches only to a healer |
/// | R2: a heal on a unit without health | is applied | does nothing |
/// | R3: an attack-moving healer's speed | held back only while it looks for a target, or while others do | always that of its slowest neighbour |
/// | R4: an attack that was declared before the unit was killed and healed to life in one tick | is held until the unit next acts on a target | is forgotten; the dead stay dead |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Rules {
    /// What the published implementation does; every number in the paper came from it.
    #[default]
    Smaclite,
    /// What the paper's text says.
    Paper,
}

impl fmt::Display for Rules {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Rules::Smaclite => "smaclite",
            Rules::Paper => "paper",
        })
    }
}

/// A word that names no rule set.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("unknown rules '{given}': use 'smaclite' or 'paper'")]
pub struct UnknownRules {
    /// The word that was given.
    pub given: String,
}

impl FromStr for Rules {
    type Err = UnknownRules;

    fn from_str(word: &str) -> Result<Rules, UnknownRules> {
        match word {
            "smaclite" => Ok(Rules::Smaclite),
            "paper" => Ok(Rules::Paper),
            _ => Err(UnknownRules { given: word.to_owned() }),
        }
    }
}
