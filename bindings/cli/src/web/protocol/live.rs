//! What the page of a running pool is sent.

use serde::Serialize;
use smaclite_pool::LaneStats;
use smaclite_view::EpisodeResult;
use smaclite_view::page::{Features, ScenarioInfo};
#[cfg(test)]
use ts_rs::TS;

/// Steps of an episode; `pool/view/page/track.js` decodes moments and decisions.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Steps {
    pub(in crate::web) number: u64,
    /// The first of them, and how many there are.
    pub(in crate::web) step: usize,
    pub(in crate::web) steps: usize,
    pub(in crate::web) n_moments: usize,
    /// In base64.
    pub(in crate::web) moments: String,
    /// In base64.
    pub(in crate::web) decisions: String,
    /// Return and length of the episode after them.
    #[serde(rename = "return")]
    pub(in crate::web) episode_return: f64,
    pub(in crate::web) length: u32,
    /// How the last of them ended the episode, if it did.
    #[cfg_attr(test, ts(type = "EpisodeResult | null"))]
    pub(in crate::web) result: Option<EpisodeResult>,
    /// Whether the episode has no more steps.
    pub(in crate::web) is_over: bool,
}

/// A file from which environments continue.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct SnapshotFile {
    pub(in crate::web) name: String,
    /// In base64.
    pub(in crate::web) record: String,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct LaneInfo {
    #[cfg_attr(test, ts(type = "ScenarioInfo"))]
    pub(in crate::web) scenario: ScenarioInfo,
    pub(in crate::web) lane: String,
    pub(in crate::web) num_envs: usize,
    pub(in crate::web) rules: String,
    /// Why there is no grid, if there is none.
    pub(in crate::web) no_grid: Option<String>,
    pub(in crate::web) has_state: bool,
    #[cfg_attr(test, ts(type = "Array<Features>"))]
    pub(in crate::web) features: Vec<Features>,
}

/// An environment's newest row.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct GridCell {
    pub(in crate::web) env: usize,
    pub(in crate::web) length: Option<i32>,
    #[serde(rename = "return")]
    pub(in crate::web) episode_return: Option<f32>,
    /// How the episode ended that the row shows the end of.
    #[cfg_attr(test, ts(type = "EpisodeResult | null"))]
    pub(in crate::web) outcome: Option<EpisodeResult>,
    /// How the last episode ended whose end was seen.
    #[cfg_attr(test, ts(type = "EpisodeResult | null"))]
    pub(in crate::web) last: Option<EpisodeResult>,
    /// One moment in base64.
    pub(in crate::web) moment: Option<String>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct PoolState {
    pub(in crate::web) points: Vec<Point>,
    /// The pool, or why it does not respond.
    #[serde(flatten)]
    pub(in crate::web) pool: PoolResponse,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(test, derive(TS))]
pub(crate) enum PoolResponse {
    Pool(PoolInfo),
    Error(String),
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct PoolInfo {
    pub(in crate::web) pid: u32,
    pub(in crate::web) threads: usize,
    pub(in crate::web) uptime_s: f64,
    /// The names of all lanes.
    pub(in crate::web) lanes: Vec<String>,
    /// The one that the page shows.
    pub(in crate::web) lane: Option<LaneState>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct LaneState {
    pub(in crate::web) learner_pid: Option<u32>,
    pub(in crate::web) spectators: usize,
    pub(in crate::web) steps_per_s: f64,
    pub(in crate::web) queue_wait_us: f64,
    #[cfg_attr(test, ts(type = "LaneStats"))]
    pub(in crate::web) stats: LaneStats,
    pub(in crate::web) failure: Option<String>,
}

/// A lane at one time.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct Point {
    /// Seconds since this program started.
    pub(in crate::web) time: f64,
    /// Which of the pools of this name it is of, one after the other: counts of another one begin at 0.
    pub(in crate::web) pool: u32,
    pub(in crate::web) steps_per_s: f64,
    pub(in crate::web) steps: u64,
    pub(in crate::web) episodes: u64,
    pub(in crate::web) wins: u64,
    pub(in crate::web) returns: f64,
    pub(in crate::web) lengths: u64,
}

#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(TS))]
pub(crate) struct EpisodeInfo {
    pub(in crate::web) number: u64,
    pub(in crate::web) steps: usize,
    /// The step of the battle with which the log of it begins.
    pub(in crate::web) first_step: u32,
    pub(in crate::web) is_over: bool,
    /// How it ended, if that is known yet.
    #[cfg_attr(test, ts(type = "EpisodeResult | null"))]
    pub(in crate::web) result: Option<EpisodeResult>,
    /// Seconds since its first and its newest step.
    pub(in crate::web) began_s: f64,
    pub(in crate::web) newest_s: f64,
}
