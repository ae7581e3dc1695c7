//! The rule sets: the paper's text and its implementation differ in four rules, R1 to R4, which are
//! implemented where they apply (`tick`); comments there refer to R1, R2, R3 or R4. `starcraft` has other
//! figures and ticks of its own (`tick::starcraft`).

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use smaclite_scenarios::Scenario;
use smaclite_units::{Conduct, UnitType};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The rule set of a battle. The first two differ in four rules:
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
    /// Nearer to StarCraft: its clock and its figures, attacks with phases, enemies that look around.
    ///
    /// What is stored names its version, `starcraft-1`: its battles keep their bits when a later version is
    /// nearer. `starcraft` means the newest one.
    #[serde(rename = "starcraft-1", alias = "starcraft")]
    Starcraft,
}

impl Rules {
    /// All of them.
    pub const ALL: [Rules; 3] = [Rules::Smaclite, Rules::Paper, Rules::Starcraft];
}

impl Rules {
    /// The scenario with the figures of these rules: under `starcraft` those of the game for each standard
    /// type, under the others without what only `starcraft` reads.
    pub fn figures(self, scenario: &Scenario) -> Cow<'_, Scenario> {
        let mut scenario = Cow::Borrowed(scenario);
        if self != Rules::Starcraft {
            if scenario.unit_types.iter().any(|unit_type| unit_type.conduct != Conduct::default()) {
                let types = &mut scenario.to_mut().unit_types;
                types.iter_mut().for_each(|unit_type| unit_type.conduct = Conduct::default());
            }
            return scenario;
        }
        for unit_type in &mut scenario.to_mut().unit_types {
            let is_standard = UnitType::standard(&unit_type.name).as_ref() == Some(&*unit_type);
            if let (true, Some(figures)) = (is_standard, UnitType::starcraft(&unit_type.name)) {
                *unit_type = figures;
            }
        }
        scenario
    }
}

impl fmt::Display for Rules {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Rules::Smaclite => "smaclite",
            Rules::Paper => "paper",
            Rules::Starcraft => "starcraft-1",
        })
    }
}

/// A text that names no rule set.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("rules must be 'smaclite', 'paper' or 'starcraft', got '{given}'")]
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
            "starcraft" | "starcraft-1" => Ok(Rules::Starcraft),
            _ => Err(UnknownRules { given: name.to_owned() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_known_by_their_names() {
        assert_eq!(Rules::ALL.map(|rules| rules.to_string()), ["smaclite", "paper", "starcraft-1"]);
        for rules in Rules::ALL {
            assert_eq!(rules.to_string().parse(), Ok(rules));
        }
        assert_eq!("starcraft".parse(), Ok(Rules::Starcraft), "the newest version");
        assert_eq!("starcraft-2".parse::<Rules>(), Err(UnknownRules { given: "starcraft-2".to_owned() }));
    }
}
