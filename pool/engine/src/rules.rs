//! The two rule sets: the paper's text and its implementation differ in four rules, R1 to R4.
//!
//! The rules are implemented where they apply (`tick`); comments there refer to R1, R2, R3 or R4.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The rule set of a battle. The rule sets differ in four rules:
///
/// - R1, an attack-moving unit whose target is not a healer, while an agent is a living healer:
///   [`Smaclite`](Rules::Smaclite) chooses the best target again in every tick, [`Paper`](Rules::Paper)
///   switches only to a healer.
/// - R2, a heal on a unit without health: `Smaclite` applies it, under `Paper` it has no effect.
/// - R3, the speed of an attack-moving healer: under `Smaclite` it is limited only while the healer or a
///   damage dealer of its faction has no target, under `Paper` it is always that of the slowest unit around.
/// - R4, an attack that was declared before the unit was killed and healed in the same tick: `Smaclite` holds
///   it until the unit has a target again; under `Paper` such a unit stays dead (R2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rules {
    /// The published implementation, which produced all results of the paper.
    #[default]
    Smaclite,
    /// The text of the paper.
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

/// A text that names no rule set.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("rules must be 'smaclite' or 'paper', got '{given}'")]
pub struct UnknownRules {
    /// The text.
    pub given: String,
}

impl FromStr for Rules {
    type Err = UnknownRules;

    fn from_str(name: &str) -> Result<Rules, UnknownRules> {
        match name {
            "smaclite" => Ok(Rules::Smaclite),
            "paper" => Ok(Rules::Paper),
            _ => Err(UnknownRules { given: name.to_owned() }),
        }
    }
}
