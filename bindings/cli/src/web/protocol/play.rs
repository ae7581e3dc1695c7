//! What the page of a person who plays sends and is sent.

use super::Steps;
use serde::{Deserialize, Serialize};
use smaclite_view::Order;
use smaclite_view::page::ScenarioInfo;
#[cfg(test)]
use ts_rs::TS;

/// What the page finds in its document.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct GameInfo {
    #[cfg_attr(test, ts(type = "ScenarioInfo"))]
    pub(in crate::web) scenario: ScenarioInfo,
    pub(in crate::web) rules: String,
    /// Who plays the enemies.
    pub(in crate::web) against: String,
    /// Of the first battle; a text, because JavaScript has no 64-bit integers.
    pub(in crate::web) seed: String,
}

/// The battle of a seed, from its start, or after steps that the page has from a connection that was lost.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct BeginBattle {
    /// A whole number; as a text, because JavaScript has no 64-bit integers.
    pub(in crate::web) seed: String,
    /// The actions of those steps, agent by agent.
    pub(in crate::web) actions: Vec<u16>,
}

/// Steps of the battle.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct PlayedSteps {
    #[serde(flatten)]
    #[cfg_attr(test, ts(flatten))]
    pub(in crate::web) steps: Steps,
    /// The orders that hold after them, by agent.
    #[cfg_attr(test, ts(type = "Array<Order>"))]
    pub(in crate::web) orders: Vec<Order>,
}

/// A replay file.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct ReplayFile {
    pub(in crate::web) name: String,
    /// In base64.
    pub(in crate::web) replay: String,
}
