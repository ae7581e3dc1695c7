//! A lane that is watched: the newest frame of its spectator.

use super::cells::Cells;
use serde_json::{Value, json};
use smaclite_engine::{Arena, FeatureBlock, Rules, obs_features};
use smaclite_ipc::{LaneDescription, RuntimeDir, Spectator};
use smaclite_scenarios::Scenario;
use smaclite_view::page::scenario_info;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How often frames are read, for all pages together.
const READ_INTERVAL: Duration = Duration::from_millis(50);

/// What the battles of a lane have in common.
pub(super) struct Battles {
    pub(super) scenario: Scenario,
    pub(super) arena: Arc<Arena>,
}

impl Battles {
    pub(super) fn new(description: &LaneDescription) -> Result<Battles, String> {
        let scenario = Scenario::resolve(&description.scenario).map_err(|error| error.to_string())?;
        let rules = description.rules.parse::<Rules>().map_err(|error| error.to_string())?;
        let arena = Arena::new(&scenario, rules).with_episode_limit(description.episode_limit);
        Ok(Battles { scenario, arena: Arc::new(arena) })
    }
}

pub(super) struct WatchedLane {
    spectator: Spectator,
    battles: Arc<Battles>,
    cells: Cells,
    read: Instant,
    is_alive: bool,
}

impl WatchedLane {
    pub(super) fn connect(runtime_dir: &RuntimeDir, pool: &str, lane: &str) -> Result<WatchedLane, String> {
        let spectator = Spectator::connect(runtime_dir, pool, Some(lane)).map_err(|e| e.to_string())?;
        let battles = Arc::new(Battles::new(spectator.description())?);
        let cells = Cells::new(spectator.description().settings.num_envs);
        Ok(WatchedLane { spectator, battles, cells, read: Instant::now(), is_alive: true })
    }

    /// Whether its pool ran when it was last read.
    pub(super) fn is_alive(&self) -> bool {
        self.is_alive
    }

    pub(super) fn battles(&self) -> &Arc<Battles> {
        &self.battles
    }

    pub(super) fn num_envs(&self) -> usize {
        self.spectator.description().settings.num_envs
    }

    /// What a page needs to know before it shows the lane.
    pub(super) fn info(&self) -> Value {
        let lane = self.spectator.description();
        let blocks = obs_features(&self.battles.scenario);
        json!({
            "scenario": scenario_info(&self.battles.scenario, &self.battles.arena),
            "lane": lane.lane,
            "pid": lane.pid,
            "num_envs": lane.settings.num_envs,
            "batch_size": lane.settings.batch_size,
            "autoreset": lane.settings.autoreset,
            "rules": lane.rules,
            "has_state": self.spectator.description().settings.fields.contains(smaclite_pool::fields::Field::State),
            "features": blocks.iter().map(feature_block).collect::<Vec<_>>(),
        })
    }

    /// Reads the newest frame, if the last reading was long enough ago.
    pub(super) fn read(&mut self) -> Result<&mut Cells, String> {
        if self.read.elapsed() >= READ_INTERVAL {
            self.read = Instant::now();
            match self.spectator.latest() {
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

    /// The sum and the number of the returns that were seen since the last call.
    pub(super) fn take_returns(&mut self) -> (f64, u32) {
        let _ = self.read(); // what fails is said to those who read cells
        self.cells.take_returns()
    }
}

fn feature_block(block: &FeatureBlock) -> Value {
    json!({"name": block.name, "start": block.start, "rows": block.rows, "features": block.features})
}
