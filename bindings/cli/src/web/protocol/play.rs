//! What the page of a person who plays sends and is sent.

use super::Steps;
use serde::{Deserialize, Serialize};
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

/// What an agent is told. It holds until it is carried out or another one replaces it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum Order {
    /// Nothing: it stands, and attacks the nearest enemy within targeting range; a healer heals.
    #[default]
    None,
    /// Stand, and attack nothing.
    Stop,
    /// Go to a point, in squares.
    Move { x: f32, y: f32 },
    /// Attack or heal a unit, by battle-wide id; an agent that can do neither goes to where the unit is.
    Target { unit: usize },
}

/// An order for an agent.
#[derive(Clone, Copy, Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct AgentOrder {
    pub(in crate::web) agent: usize,
    pub(in crate::web) order: Order,
}

/// Steps of the battle.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct PlayedSteps {
    #[serde(flatten)]
    #[cfg_attr(test, ts(flatten))]
    pub(in crate::web) steps: Steps,
    /// The orders that hold after them, by agent.
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
