//! The lanes of a pool that a team plays on: two of an own pool, so that the workers step one half of the
//! environments while the policy chooses actions for the other, or those of a pool that runs elsewhere.
//!
//! Environment `i` of the run is environment `i` minus the number of environments in the lanes before. Its
//! seed and its actions depend on `i` alone, not on the lanes.

use crate::architecture::Inputs;
use crate::config::{Config, Enemies, ensure};
use crate::lane_error::LaneError;
use crate::view::fields_read;
use smaclite_engine::{BattleSetup, Faction, Sizes};
use smaclite_ipc::{
    Batch, Client, ClientError, ConnectError, LaneConfig, LaneDescription, Order, RuntimeDir, Seeds,
    Supervisor, SupervisorConfig, WaitOptions, WaitStrategy, lane_scenario,
};
use smaclite_pool::fields::Field;
use smaclite_pool::{Autoreset, LaneSettings, PoolOptions};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// How long to wait for a batch. Those of the slowest scenarios take less than a second.
const TIMEOUT: Duration = Duration::from_secs(120);

/// Returns `true` when a wait is to end.
type Interrupted<'a> = &'a mut dyn FnMut() -> bool;

/// Attaches to a lane, of the only lane if none is named.
type Connect<'a> = dyn FnMut(Option<&str>, Interrupted<'_>) -> Result<Client, ConnectError> + 'a;

/// One lane.
struct Lane {
    client: Client,
    /// The environments of the lanes before.
    first_env: usize,
    settings: LaneSettings,
    /// The last batch, until it was acted on.
    batch: Option<Arc<Batch>>,
    /// By environment of the last batch, whether its episode is over.
    over: Vec<bool>,
    /// The next batch answers [`Lanes::restore`], which set `over`: in its batch no episode ends.
    is_restored: bool,
}

/// A batch of a lane.
pub(crate) struct LaneBatch<'a> {
    /// The number of the lane's first environment.
    pub first_env: usize,
    pub batch: &'a Batch,
    /// By environment, whether its episode is over, so that the next step resets it.
    pub over: &'a [bool],
}

/// The states of all environments between two steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SavedEnvs {
    /// u8 `[num_envs, snapshot_size]`.
    pub snapshots: Vec<u8>,
    /// u8 `[num_envs]`: whether the episode is over.
    pub over: Vec<u8>,
}

/// The lanes of a run. Fields are dropped in order: the clients before the pool.
pub struct Lanes {
    lanes: Vec<Lane>,
    inputs: Inputs,
    /// That of all maps of a run.
    _pool: Option<Arc<Supervisor>>,
}

impl Lanes {
    /// Starts a pool in this process, with `threads` worker threads. Agents observe their own last
    /// `last_actions` actions.
    ///
    /// # Errors
    /// As [`Supervisor::start`].
    pub fn start(
        setup: &BattleSetup,
        num_envs: usize,
        last_actions: usize,
        threads: usize,
        runtime_dir: &RuntimeDir,
    ) -> Result<Lanes, LaneError> {
        let mut lanes = Lanes::start_each(&[(setup, num_envs)], last_actions, threads, runtime_dir)?;
        Ok(lanes.remove(0))
    }

    /// The same for a run on several maps: a pool with lanes of each, among which the environments of the
    /// run are divided.
    ///
    /// # Errors
    /// As [`Supervisor::start`], and if the configuration is not one of so many maps.
    pub fn start_maps(
        setups: &[BattleSetup],
        config: &Config,
        threads: usize,
        runtime_dir: &RuntimeDir,
    ) -> Result<Vec<Lanes>, LaneError> {
        config.check_maps(setups.len())?;
        let maps: Vec<_> = setups.iter().zip(config.envs_of_maps(setups.len())).collect();
        Lanes::start_each(&maps, config.last_actions, threads, runtime_dir)
    }

    fn start_each(
        maps: &[(&BattleSetup, usize)],
        last_actions: usize,
        threads: usize,
        runtime_dir: &RuntimeDir,
    ) -> Result<Vec<Lanes>, LaneError> {
        let (mut lanes, mut names) = (Vec::new(), Vec::new());
        for (map, (setup, num_envs)) in maps.iter().enumerate() {
            ensure(*num_envs > 0, "num_envs", "at least 1", num_envs)?;
            let halves = [("first", num_envs.div_ceil(2)), ("second", num_envs / 2)];
            let halves = halves.into_iter().filter(|(_, num_envs)| *num_envs > 0);
            let halves = halves.map(|(half, num_envs)| {
                let mut lane = lane_config(setup, &format!("{half}-{map}"), num_envs);
                lane.settings.obs_last_actions = last_actions;
                lane
            });
            let halves: Vec<LaneConfig> = halves.collect();
            names.push(halves.iter().map(|lane| lane.name.clone()).collect::<Vec<_>>());
            lanes.extend(halves);
        }
        let options = PoolOptions { threads, ..PoolOptions::default() };
        // Several runs in one process, as in tests, need different names.
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed); // publishes nothing
        let name = format!("learn-{}-{count}", std::process::id());
        let config =
            SupervisorConfig { name: name.clone(), lanes, options, runtime_dir: runtime_dir.clone() };
        let pool = Arc::new(Supervisor::start(config)?);
        let mut connect =
            |lane: Option<&str>, _: Interrupted<'_>| pool.connect(lane, WaitStrategy::default());
        let attach = |(&(setup, _), names): (&(&BattleSetup, usize), Vec<String>)| {
            let lanes = Lanes::attach_by(&mut connect, setup, runtime_dir, &name, &names, &mut || false)?;
            Ok(Lanes { _pool: Some(Arc::clone(&pool)), ..lanes })
        };
        maps.iter().zip(names).map(attach).collect()
    }

    /// Attaches to lanes of a running pool, or to its only one if none is named. `interrupted` ends the wait
    /// for its answers.
    ///
    /// # Errors
    /// If a lane cannot be attached to, plays something else than the scenario, or is stepped in another way.
    pub fn attach(
        setup: &BattleSetup,
        runtime_dir: &RuntimeDir,
        pool: &str,
        names: &[String],
        interrupted: Interrupted<'_>,
    ) -> Result<Lanes, LaneError> {
        let mut connect = |lane: Option<&str>, interrupted: Interrupted<'_>| {
            let wait = WaitOptions { timeout: Some(Duration::ZERO), interrupted };
            Client::connect(runtime_dir, pool, lane, WaitStrategy::default(), wait)
        };
        Lanes::attach_by(&mut connect, setup, runtime_dir, pool, names, interrupted)
    }

    fn attach_by(
        connect: &mut Connect<'_>,
        setup: &BattleSetup,
        runtime_dir: &RuntimeDir,
        pool: &str,
        names: &[String],
        interrupted: Interrupted<'_>,
    ) -> Result<Lanes, LaneError> {
        let again = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name));
        if let Some((_, name)) = again {
            return Err(LaneError::Twice { lane: name.clone() });
        }
        let (scenario, arena) = setup.arena()?;
        let expected = BattleSetup { episode_limit: arena.episode_limit().into(), ..setup.clone() };
        let mut sizes = arena.sizes();
        let names: Vec<Option<&str>> = if names.is_empty() {
            vec![None]
        } else {
            names.iter().map(|name| Some(name.as_str())).collect()
        };
        let (mut lanes, mut first_env) = (Vec::new(), 0);
        for name in names {
            let client = connect(name, interrupted)?;
            let description = client.description();
            check_settings(description)?;
            let (_, given) = lane_scenario(
                runtime_dir,
                pool,
                Some(&description.lane),
                WaitOptions::interrupted_by(interrupted),
            )?;
            if given != expected {
                let differences = given.differences(&expected);
                let (lane, given) = (description.lane.clone(), description.scenario.clone());
                return Err(LaneError::OtherScenario { lane, given, name: scenario.name, differences });
            }
            let settings = description.settings;
            sizes = sizes_with_history(arena.sizes(), settings.obs_last_actions);
            let over = vec![false; settings.num_envs];
            lanes.push(Lane { client, first_env, settings, batch: None, over, is_restored: false });
            first_env += settings.num_envs;
        }
        let last_actions = lanes.first().map_or(0, |lane: &Lane| lane.settings.obs_last_actions);
        let inputs = Inputs::new(&setup.rules.figures(&scenario), sizes, last_actions);
        Ok(Lanes { lanes, inputs, _pool: None })
    }

    /// Checks that the lanes have the environments and the observations of a run.
    pub(crate) fn for_run(self, config: &Config) -> Result<Lanes, LaneError> {
        let (given, expected) = (self.num_envs(), config.num_envs);
        if given != expected {
            return Err(LaneError::NumEnvs { given, expected });
        }
        let expected = config.last_actions;
        for Lane { client, settings, .. } in &self.lanes {
            let given = settings.obs_last_actions;
            if given != expected {
                let lane = client.description().lane.clone();
                return Err(LaneError::LastActions { lane, given, expected });
            }
        }
        self.check_sides(&config.enemies)?;
        Ok(self)
    }

    /// Checks that joint actions play the sides that the run has teams for, and that one team can play both.
    fn check_sides(&self, enemies: &Enemies) -> Result<(), LaneError> {
        let Some(Lane { client, .. }) = self.lanes.first() else { return Ok(()) };
        let of_enemies = self.sizes().of(Faction::Enemy);
        if of_enemies.is_some() == enemies.are_scripts() {
            let name = |both| if both { "both" } else { "allies" };
            let (given, expected) = (name(of_enemies.is_some()), name(!enemies.are_scripts()));
            return Err(LaneError::Sides { lane: client.description().lane.clone(), given, expected });
        }
        match (enemies, of_enemies) {
            (Enemies::SelfPlay(_), Some(of_enemies)) if !is_playable(self.sizes(), of_enemies) => {
                let scenario = client.description().scenario.clone();
                let (agents, enemies) = (in_words(self.sizes()), in_words(of_enemies));
                Err(LaneError::UnequalSides { scenario, agents, enemies })
            }
            _ => Ok(()),
        }
    }

    /// Checks that a team that was trained as allies with these sizes can play the enemies.
    pub(crate) fn check_rival(&self, folder: &Path, sizes: Sizes) -> Result<(), LaneError> {
        let (Some(Lane { client, .. }), Some(of_enemies)) =
            (self.lanes.first(), self.sizes().of(Faction::Enemy))
        else {
            return Ok(());
        };
        if is_playable(sizes, of_enemies) {
            return Ok(());
        }
        Err(LaneError::OtherTeam {
            folder: folder.display().to_string(),
            given: in_words(sizes),
            scenario: client.description().scenario.clone(),
            last_actions: self.last_actions(),
            expected: in_words(of_enemies),
        })
    }

    /// Environments of all lanes.
    pub fn num_envs(&self) -> usize {
        self.lanes.iter().map(|lane| lane.settings.num_envs).sum()
    }

    /// The name of the scenario.
    pub(crate) fn scenario(&self) -> &str {
        self.lanes.first().map_or("", |lane| &lane.client.description().scenario)
    }

    /// How many of its own last actions an agent observes.
    pub fn last_actions(&self) -> usize {
        self.lanes.first().map_or(0, |lane| lane.settings.obs_last_actions)
    }

    /// Sizes of an environment; `obs_size` includes the last actions.
    pub fn sizes(&self) -> Sizes {
        self.inputs.sizes
    }

    /// What networks that play on the lanes are built for.
    pub(crate) fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    /// How many lanes there are.
    pub(crate) fn count(&self) -> usize {
        self.lanes.len()
    }

    /// Resets all environments; environment `i` gets the seed `seed + i`.
    pub(crate) fn reset(&mut self, seed: u64) -> Result<(), ClientError> {
        for lane in &mut self.lanes {
            (lane.batch, lane.is_restored) = (None, false);
            let seed = seed.wrapping_add(lane.first_env as u64);
            lane.client.send(Order::reset(Some(seed)), None, WaitOptions::forever())?;
        }
        Ok(())
    }

    /// The next batch of a lane, for which it waits if it is not there yet. It is kept until
    /// [`send`](Lanes::send) replaces it.
    pub(crate) fn batch(
        &mut self,
        lane: usize,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<LaneBatch<'_>, ClientError> {
        self.lanes[lane].next_batch(interrupted)
    }

    /// Whether a run on these lanes can be resumed with the same bits: they serve the field `snapshot`.
    pub fn are_saved(&self) -> bool {
        self.lanes.iter().all(|lane| lane.settings.fields.contains(Field::Snapshot))
    }

    /// The states of all environments; `None` if a lane does not serve the field `snapshot`.
    pub(crate) fn save(
        &mut self,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Option<SavedEnvs>, ClientError> {
        let mut saved = SavedEnvs::default();
        for lane in &mut self.lanes {
            let LaneBatch { batch, over, .. } = lane.next_batch(interrupted)?;
            let Some(snapshots) = batch.field(Field::Snapshot) else { return Ok(None) };
            saved.snapshots.extend_from_slice(snapshots);
            saved.over.extend(over.iter().map(|over| u8::from(*over)));
        }
        Ok(Some(saved))
    }

    /// Begins with the states of [`save`](Lanes::save) on lanes like these.
    pub(crate) fn restore(&mut self, saved: &SavedEnvs) -> Result<(), ClientError> {
        let size = saved.snapshots.len() / self.num_envs();
        for index in 0..self.count() {
            let lane = &mut self.lanes[index];
            let envs = lane.first_env..lane.first_env + lane.settings.num_envs;
            let snapshots = &saved.snapshots[envs.start * size..envs.end * size];
            let restore = Order::Restore { snapshots, seeds: Seeds::Continue };
            lane.client.send(restore, None, WaitOptions::forever())?;
            lane.over = saved.over[envs].iter().map(|over| *over != 0).collect();
            (lane.batch, lane.is_restored) = (None, true);
            self.batch(index, &mut || false)?;
        }
        Ok(())
    }

    /// Sends the actions of a lane, `[environments, n_agents]`.
    pub(crate) fn send(&mut self, lane: usize, actions: &[i32]) -> Result<(), ClientError> {
        let lane = &mut self.lanes[lane];
        lane.batch = None;
        lane.client.send(Order::Step(actions), None, WaitOptions::forever())
    }
}

impl Lane {
    fn next_batch(&mut self, interrupted: &mut dyn FnMut() -> bool) -> Result<LaneBatch<'_>, ClientError> {
        let batch = match self.batch.take() {
            Some(batch) => batch,
            None => {
                let batch = self.client.recv(WaitOptions { timeout: Some(TIMEOUT), interrupted })?;
                if !std::mem::take(&mut self.is_restored) {
                    let ends = batch.terminated().iter().zip(batch.truncated());
                    self.over.clear();
                    self.over.extend(ends.map(|(terminated, truncated)| terminated | truncated != 0));
                }
                batch
            }
        };
        Ok(LaneBatch { first_env: self.first_env, batch: self.batch.insert(batch), over: &self.over })
    }
}

/// The sizes of an environment whose agents also observe their own last actions.
pub(crate) fn sizes_with_history(sizes: Sizes, last_actions: usize) -> Sizes {
    LaneSettings { obs_last_actions: last_actions, ..LaneSettings::new(1) }.frame_sizes(sizes)
}

/// Whether what plays a side with these sizes can play the other side.
fn is_playable(own: Sizes, other: Sizes) -> bool {
    let of_networks = |sizes: Sizes| (sizes.n_agents, sizes.n_actions, sizes.obs_size, sizes.state_size);
    of_networks(own) == of_networks(other)
}

fn in_words(sizes: Sizes) -> String {
    let Sizes { n_agents, n_actions, obs_size, state_size, .. } = sizes;
    format!(
        "{n_agents} units with {n_actions} actions, observations of {obs_size} numbers and a state of \
         {state_size}"
    )
}

/// A lane with the fields that a team reads, and the snapshots by which a run is resumed.
fn lane_config(setup: &BattleSetup, name: &str, num_envs: usize) -> LaneConfig {
    let mut lane = LaneConfig::new(name, setup.clone(), num_envs);
    lane.settings.fields = fields_read(setup.sides.are_both()).chain([Field::Snapshot]).collect();
    lane
}

/// Can a team play on a lane with these settings?
fn check_settings(description: &LaneDescription) -> Result<(), LaneError> {
    let (lane, settings) = (description.lane.clone(), description.settings);
    let mut read = fields_read(description.sizes.enemies.is_some());
    if let Some(field) = read.find(|field| !settings.fields.contains(*field)) {
        return Err(LaneError::MissingField { lane, field: field.spec().name });
    }
    if settings.autoreset != Autoreset::NextStep {
        return Err(LaneError::Autoreset { lane, given: settings.autoreset });
    }
    if !settings.is_synchronous() {
        let (batch_size, num_envs) = (settings.batch_size, settings.num_envs);
        return Err(LaneError::Asynchronous { lane, batch_size, num_envs });
    }
    if settings.obs_agent_id {
        return Err(LaneError::AgentId { lane });
    }
    let Sizes { n_agents, n_actions, .. } = description.sizes;
    if n_agents.max(n_actions) > usize::from(u16::MAX) {
        return Err(LaneError::TooLarge { lane, n_agents, n_actions });
    }
    Ok(())
}
