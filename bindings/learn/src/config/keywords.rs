//! Hyperparameters that are one of a few keywords.

use serde::{Deserialize, Serialize};
use smaclite_engine::TargetLayout;
use smaclite_scenarios::Scenario;
use smaclite_units::keywords;

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
        let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        text.parse().map_err(serde::de::Error::custom)
    }
}

keywords!(Algorithm, "algorithm", "mappo" => Mappo, "ippo" => Ippo);
keywords!(Activation, "activation", "relu" => Relu, "tanh" => Tanh);
keywords!(NetworkKind, "network", "flat" => Flat, "units" => Units, "universal" => Universal);
