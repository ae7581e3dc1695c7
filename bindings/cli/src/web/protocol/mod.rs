//! What the pages and this program say to each other: JSON in the text messages of a WebSocket, declared here
//! and nowhere else. `pages/protocol.d.ts` describes it to the scripts, which are checked against that file;
//! the test below writes it.
//!
//! A page sends a [`RequestMessage`] and gets one [`ResponseMessage`] with the same `id`. The program sends
//! an [`EventMessage`] whenever there is something new. The first request is [`PageRequest::Hello`].

mod editor;
mod live;

pub(crate) use editor::*;
pub(crate) use live::*;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use smaclite_playground::Answer;
#[cfg(test)]
use ts_rs::TS;

/// The version of these messages. It changes with them, and with those of the playground that they carry,
/// because a page can stay open while the program is replaced; such a page is told to be reloaded.
pub(super) const VERSION: u32 = 8;

#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct RequestMessage {
    pub(super) id: u64,
    pub(super) request: PageRequest,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(TS))]
pub(super) struct ResponseMessage {
    /// None if the message was not understood.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(type = "number", optional))]
    pub(super) id: Option<u64>,
    #[serde(flatten)]
    pub(super) outcome: Outcome,
}

/// What became of a request.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(super) enum Outcome {
    Response(Box<PageResponse>),
    Error(String),
}

#[derive(Serialize)]
#[cfg_attr(test, derive(TS))]
pub(super) struct EventMessage {
    pub(super) event: PageEvent,
}

/// A request of a page.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum PageRequest {
    /// Begins: the version of the page's scripts.
    Hello { version: u32 },
    /// Shows a lane from now on, by [`PageEvent`]s.
    SelectLane { name: String },
    /// Says what is visible; nothing else is sent.
    SetView {
        /// The first environment whose cell is visible.
        first: usize,
        /// How many cells are.
        count: usize,
        /// Whether the page is.
        visible: bool,
    },
    /// Follows one environment instead of any other: sends the list of its episodes.
    Follow { env: usize },
    /// Follows no environment.
    Unfollow {},
    /// Steps of an episode of the followed environment, from `step` on.
    GetSteps { number: u64, step: usize },
    /// What an agent observes before a step.
    GetObservation { number: u64, step: usize, agent: usize },
    /// The state before a step of an episode of the followed environment.
    GetSnapshot { number: u64, step: usize },
    /// The files to begin with.
    OpenFiles {},
    /// Writes the files that the command names.
    SaveFiles(SaveFiles),
    /// A request of the playground or of the editor to its session.
    Session {
        #[cfg_attr(test, ts(type = "SessionRequest"))]
        request: Value,
    },
}

/// The response to the request of the same name.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum PageResponse {
    Hello {},
    SelectLane {},
    SetView {},
    Follow {},
    Unfollow {},
    GetSteps(Steps),
    GetObservation {
        obs: Vec<f32>,
    },
    GetSnapshot(SnapshotFile),
    OpenFiles(OpenedFiles),
    SaveFiles(SavedFiles),
    Session {
        #[cfg_attr(test, ts(type = "SessionOutcome"))]
        outcome: Answer,
    },
}

/// What is new in the pool that a page watches.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum PageEvent {
    /// The lane is connected, at first or again.
    Lane(Box<LaneInfo>),
    /// The lane cannot be read.
    Lost { error: String },
    /// Cells that changed.
    Grid { cells: Vec<GridCell> },
    /// The status of the pool, and points of the history that are new.
    Status(PoolState),
    /// The newest episodes of the followed environment, and the one that is shown; the newest first.
    Episodes { episodes: Vec<EpisodeInfo> },
}

#[cfg(test)]
mod tests;
