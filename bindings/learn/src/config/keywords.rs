//! Hyperparameters that are one of a few keywords.

use serde::{Deserialize, Serialize};
use smaclite_engine::TargetLayout;
use smaclite_scenarios::Scenario;
use smaclite_units::file::shortened;
use std::str::FromStr;

/// What the critic sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Algorithm {
    /// The state: one value per environment.
    Mappo,
    /// The agent's own observation: one value per agent.
    Ippo,
}

/// The non-linearity of hidden layers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// `max(x, 0)`.
    #[default]
    Relu,
    /// Hyperbolic tangent.
    Tanh,
}

/// The network of actor and critic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NetworkKind {
    /// Layers over all features: each has weights of its own.
    #[default]
    Flat,
    /// Over units: all enemies share weights, and so do all allies, and their order does not matter.
    Units,
    /// Over units, which are told by the figures of their types: its weights fit every scenario.
    Universal,
}

impl NetworkKind {
    /// All, in the order of messages.
    pub const ALL: [NetworkKind; 3] = [NetworkKind::Flat, NetworkKind::Units, NetworkKind::Universal];

    /// The keyword in files and options.
    pub fn name(self) -> &'static str {
        match self {
            NetworkKind::Flat => "flat",
            NetworkKind::Units => "units",
            NetworkKind::Universal => "universal",
        }
    }

    pub(super) fn default_hidden(self) -> Vec<usize> {
        match self {
            NetworkKind::Flat => vec![64, 64],
            NetworkKind::Units | NetworkKind::Universal => vec![32, 64],
        }
    }

    /// With 0.0007, networks over units learn 2s3z more slowly than flat ones.
    pub(super) fn default_actor_lr(self) -> f64 {
        match self {
            NetworkKind::Flat => 7e-4,
            NetworkKind::Units | NetworkKind::Universal => 1.4e-3,
        }
    }

    /// Over units where observations have any.
    pub(super) fn for_scenario(scenario: &Scenario) -> NetworkKind {
        let has_units = TargetLayout::new(scenario).is_some();
        if has_units { NetworkKind::Units } else { NetworkKind::Flat }
    }

    pub(super) fn is_flat(&self) -> bool {
        *self == NetworkKind::Flat
    }
}

/// With a message that names the key of `run.json`, which serde's would not.
impl<'de> Deserialize<'de> for NetworkKind {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<NetworkKind, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        let found = NetworkKind::ALL.into_iter().find(|kind| value.as_str() == Some(kind.name()));
        found.ok_or_else(|| {
            let given = shortened(&value.to_string());
            serde::de::Error::custom(format!(
                "`network` must be \"flat\", \"units\" or \"universal\", got {given}"
            ))
        })
    }
}

/// A keyword that is none of those expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {}, got `{given}`", listed(expected))]
pub struct UnknownKeyword {
    expected: Vec<&'static str>,
    given: String,
}

/// With commas, and the last after an "or".
fn listed(keywords: &[&str]) -> String {
    match keywords {
        [] => String::new(),
        [only] => format!("`{only}`"),
        [others @ .., last] => format!("`{}` or `{last}`", others.join("`, `")),
    }
}

impl UnknownKeyword {
    pub(crate) fn new(expected: impl Into<Vec<&'static str>>, given: &str) -> UnknownKeyword {
        UnknownKeyword { expected: expected.into(), given: given.to_owned() }
    }
}

impl FromStr for Algorithm {
    type Err = UnknownKeyword;

    fn from_str(keyword: &str) -> Result<Algorithm, UnknownKeyword> {
        match keyword {
            "mappo" => Ok(Algorithm::Mappo),
            "ippo" => Ok(Algorithm::Ippo),
            _ => Err(UnknownKeyword::new(["mappo", "ippo"], keyword)),
        }
    }
}

impl FromStr for NetworkKind {
    type Err = UnknownKeyword;

    fn from_str(keyword: &str) -> Result<NetworkKind, UnknownKeyword> {
        let found = NetworkKind::ALL.into_iter().find(|kind| kind.name() == keyword);
        found.ok_or_else(|| UnknownKeyword::new(NetworkKind::ALL.map(NetworkKind::name), keyword))
    }
}

impl FromStr for Activation {
    type Err = UnknownKeyword;

    fn from_str(keyword: &str) -> Result<Activation, UnknownKeyword> {
        match keyword {
            "relu" => Ok(Activation::Relu),
            "tanh" => Ok(Activation::Tanh),
            _ => Err(UnknownKeyword::new(["relu", "tanh"], keyword)),
        }
    }
}
