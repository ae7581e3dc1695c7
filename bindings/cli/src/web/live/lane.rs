//! A lane that is watched: the newest frame of its spectator.

use super::battles::Battles;
use super::cells::Cells;
use crate::web::protocol::LaneInfo;
use smaclite_ipc::{
    ConnectError, ControlError, LaneDescription, PoolStatus, RuntimeDir, Spectator, WaitOptions,
    lane_scenario,
};
use smaclite_pool::fields::Field;
use smaclite_scenarios::Problems;
use smaclite_view::page::{features_info, scenario_info};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How often frames are read, for all pages together.
const READ_INTERVAL: Duration = Duration::from_millis(50);

/// Why a lane cannot be watched.
#[derive(Debug, thiserror::Error)]
pub(super) enum WatchError {
    #[error("{0}")]
    Connect(#[from] ConnectError),
    #[error("the pool is of another release: {0}")]
    Scenario(#[from] Problems),
}

impl WatchError {
    /// Whether the pool runs, but has no lane of this name.
    pub(super) fn is_missing_lane(&self) -> bool {
        matches!(self, WatchError::Connect(ConnectError::Refused(ControlError::NoSuchLane { .. })))
    }
}

pub(super) struct WatchedLane {
    description: LaneDescription,
    /// Reads frames, or says why it cannot: the lane has as many spectators as it may have.
    spectator: Result<Spectator, String>,
    battles: Arc<Battles>,
    cells: Cells,
    read: Instant,
    is_alive: bool,
}

impl WatchedLane {
    pub(super) fn connect(
        runtime_dir: &RuntimeDir,
        pool: &PoolStatus,
        lane: &str,
    ) -> Result<WatchedLane, WatchError> {
        let mut lanes = pool.lanes.iter().map(|status| &status.description);
        let Some(description) = lanes.find(|description| description.lane == lane).cloned() else {
            return Err(WatchedLane::not_found(pool, lane));
        };
        let spectator =
            match Spectator::connect(runtime_dir, &pool.pool, Some(lane), WaitOptions::for_response()) {
                Err(ConnectError::Refused(full @ ControlError::TooManySpectators { .. })) => {
                    Err(full.to_string())
                }
                connected => Ok(connected?),
            };
        let mut never = || false;
        let wait = WaitOptions::interrupted_by(&mut never);
        let (_, setup) = lane_scenario(runtime_dir, &pool.pool, Some(lane), wait)?;
        let battles = Arc::new(Battles::of(&setup, description.settings.n_past())?);
        let cells = Cells::new(description.settings.num_envs);
        Ok(WatchedLane { description, spectator, battles, cells, read: Instant::now(), is_alive: true })
    }

    /// The error that a pool has no lane of this name.
    pub(super) fn not_found(pool: &PoolStatus, lane: &str) -> WatchError {
        let lanes = pool.lanes.iter().map(|status| status.description.lane.clone()).collect();
        ConnectError::from(ControlError::NoSuchLane { lane: lane.to_owned(), lanes }).into()
    }

    /// What tells its pool from others, also of the same name and process.
    pub(super) fn instance(&self) -> &str {
        &self.description.instance
    }

    /// Whether its pool ran when it was last read.
    pub(super) fn is_alive(&self) -> bool {
        self.is_alive
    }

    pub(super) fn battles(&self) -> &Arc<Battles> {
        &self.battles
    }

    /// What a page needs to know before it shows the lane.
    pub(super) fn info(&self) -> LaneInfo {
        let lane = &self.description;
        LaneInfo {
            scenario: scenario_info(&self.battles.scenario, &self.battles.arena),
            lane: lane.lane.clone(),
            num_envs: lane.settings.num_envs,
            rules: lane.rules.to_string(),
            no_grid: self.spectator.as_ref().err().cloned(),
            has_state: lane.settings.fields.contains(Field::State),
            features: features_info(&self.battles.scenario),
        }
    }

    /// Reads the newest frame, if the last reading was long enough ago.
    pub(super) fn read(&mut self) -> Result<&mut Cells, String> {
        if let Ok(spectator) = &mut self.spectator
            && self.read.elapsed() >= READ_INTERVAL
        {
            self.read = Instant::now();
            match spectator.latest() {
                Ok(Some(batch)) => self.cells.take(batch),
                Ok(None) => {}
                Err(error) => {
                    self.is_alive = false;
                    return Err(error.to_string());
                }
            }
        }
        Ok(&mut self.cells)
    }
}
