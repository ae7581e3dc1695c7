//! The configuration of a pool: its checks, and all preparations that need no file, process or shared memory.

use super::error::{LaneConfigError, MAX_THREADS, StartError};
use crate::capacity::Capacity;
use crate::control::protocol::LaneDescription;
use crate::name::check_name;
use crate::os::memory::{PORTS, check_room};
use crate::runtime_dir::RuntimeDir;
use smaclite_engine::{Arena, BattleSetup, MAX_LAST_ACTIONS, Sides};
use smaclite_pool::enemy_team::EnemyTeam;
use smaclite_pool::{LaneSettings, LaneSpec, MakeHook, PoolOptions};
use smaclite_scenarios::{Problems, ScenarioFiles};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

/// One lane of a pool.
pub struct LaneConfig {
    /// The name learners attach by.
    pub name: String,
    /// What its battles are played with.
    pub setup: BattleSetup,
    /// The team that plays the enemies. Then the setup has
    /// [mirrored sides](smaclite_engine::Sides::Mirrored), and the lane's learner is that of the agents.
    pub team: Option<EnemyTeam>,
    /// How many there are, and how they are stepped.
    pub settings: LaneSettings,
    /// Batches that a learner may hold at once, 2 to 1024.
    pub max_held_batches: usize,
    /// Spectators at once, 0 to 64.
    pub spectators: usize,
}

/// A whole pool.
pub struct SupervisorConfig {
    /// The name learners connect by.
    pub name: String,
    /// Its lanes, with different names.
    pub lanes: Vec<LaneConfig>,
    /// Threads and waiting.
    pub options: PoolOptions,
    /// The folder of its socket and locks.
    pub runtime_dir: RuntimeDir,
}

/// A pool whose settings are checked and whose maps are computed, which may take a second. It has no file,
/// thread or shared memory yet.
pub struct PreparedPool {
    pub(super) name: String,
    pub(super) runtime_dir: RuntimeDir,
    pub(super) options: PoolOptions,
    pub(super) instance: String,
    pub(super) lanes: Vec<PreparedLane>,
    pub(super) shared_memory: usize,
}

/// A lane whose settings are checked.
pub(super) struct PreparedLane {
    pub(super) spec: LaneSpec,
    pub(super) description: LaneDescription,
    pub(super) files: ScenarioFiles,
}

/// What the descriptions of all lanes of a pool share.
struct PoolInfo<'a> {
    name: &'a str,
    instance: &'a str,
    threads: usize,
    /// Threads that may write to frames of a lane at once.
    writers: usize,
}

/// The arenas of the pool's scenarios, which lanes of the same battles share.
type Arenas = Vec<(BattleSetup, Arc<Arena>, String)>;

impl LaneConfig {
    /// A synchronous lane of battles with every other setting at its default.
    pub fn new(name: impl Into<String>, setup: BattleSetup, num_envs: usize) -> LaneConfig {
        LaneConfig {
            name: name.into(),
            setup,
            team: None,
            settings: LaneSettings::new(num_envs),
            max_held_batches: 4,
            spectators: 1,
        }
    }

    fn check(&self) -> Result<(), LaneConfigError> {
        check_name(&self.name)?;
        self.settings.check()?;
        self.setup.opponents.check(self.setup.sides)?;
        if let Some(team) = &self.team {
            if self.setup.sides != Sides::Mirrored {
                return Err(LaneConfigError::TeamSides);
            }
            if team.last_actions > MAX_LAST_ACTIONS {
                return Err(LaneConfigError::TeamLastActions(team.last_actions));
            }
        }
        if !(2..=1024).contains(&self.max_held_batches) {
            return Err(LaneConfigError::MaxHeldBatches(self.max_held_batches));
        }
        if self.spectators > 64 {
            return Err(LaneConfigError::Spectators(self.spectators));
        }
        Ok(())
    }

    /// Splits the configuration into what the pool builds and what learners receive.
    fn prepare(self, pool: &PoolInfo<'_>, arenas: &mut Arenas) -> Result<PreparedLane, StartError> {
        let (arena, scenario) =
            arena_of(&self.setup, arenas).map_err(|source| in_lane(&self.name, source.into()))?;
        let BattleSetup { files, rules, opponents, sides, .. } = self.setup;
        let mut spec =
            LaneSpec { name: self.name, settings: self.settings, arena, team: self.team, hook: None };
        let (sizes, arena, team) = (spec.sizes(), &spec.arena, spec.team.as_ref());
        spec.settings.fields = spec.settings.frame_fields(sizes);
        spec.settings.team_last_actions = team.map_or(0, |team| team.last_actions);
        let settings = spec.settings;
        // The learner of a lane with a team sees one side.
        let sides = if team.is_none() { sides } else { Sides::default() };
        let description = LaneDescription {
            pool: pool.name.to_owned(),
            pid: std::process::id(),
            instance: pool.instance.to_owned(),
            lane: spec.name.clone(),
            scenario,
            sizes: settings.frame_sizes(sizes),
            settings,
            episode_limit: arena.episode_limit(),
            rules: rules.to_string(),
            opponents,
            opponent_team: team.map(|team| team.name.clone()),
            sides,
            rewards: *arena.rewards(),
            layout_hash: settings.layout(settings.frame_sizes(sizes)).hash(),
            capacity: Capacity::new(&settings, pool.writers, self.max_held_batches, self.spectators),
            threads: pool.threads,
        };
        Ok(PreparedLane { spec, description, files })
    }
}

/// The arena and the name of the scenario.
fn arena_of(setup: &BattleSetup, arenas: &mut Arenas) -> Result<(Arc<Arena>, String), Problems> {
    let known = arenas.iter().position(|(other, ..)| other == setup);
    let index = match known {
        Some(index) => index,
        None => {
            let (scenario, arena) = setup.arena()?;
            arenas.push((setup.clone(), Arc::new(arena), scenario.name));
            arenas.len() - 1
        }
    };
    let (_, arena, scenario) = &arenas[index];
    Ok((Arc::clone(arena), scenario.clone()))
}

impl PreparedPool {
    /// For tests and benchmarks: what environments of a lane, an index, do in place of a battle's step.
    ///
    /// # Panics
    /// If there is no such lane.
    pub fn hook_steps(&mut self, lane: usize, hook: MakeHook) {
        self.lanes[lane].spec.hook = Some(hook);
    }
}

impl SupervisorConfig {
    /// Does everything that needs no file, process or shared memory.
    ///
    /// # Errors
    /// For settings out of range, and if `/dev/shm` is too small for the pool.
    pub fn prepare(self) -> Result<PreparedPool, StartError> {
        let SupervisorConfig { name, lanes, options, runtime_dir } = self;
        check_name(&name)?;
        check_lanes(&lanes)?;
        if !(1..=MAX_THREADS).contains(&options.threads) {
            return Err(StartError::Threads(options.threads));
        }
        let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos());
        let instance = format!("{name}.{}.{since_epoch:x}", std::process::id());
        let threads = options.threads;
        let writers = threads + 1; // a learner of this process works on its lane, too
        let pool = PoolInfo { name: &name, instance: &instance, threads, writers };
        let mut arenas = Arenas::new();
        let lanes = lanes.into_iter().map(|lane| lane.prepare(&pool, &mut arenas));
        let lanes = lanes.collect::<Result<Vec<_>, _>>()?;
        let frames = lanes.iter().map(|lane| lane.description.capacity.frame_memory(&lane.spec.layout()));
        let shared_memory = frames.sum();
        let clients = lanes.iter().map(|PreparedLane { spec, description, .. }| {
            let capacity = description.capacity;
            let requests = capacity.request_memory(&spec.layout(), spec.settings.num_envs);
            requests + (2 + capacity.spectators) * PORTS
        });
        check_room(
            shared_memory + clients.sum::<usize>(),
            "frames of all lanes and their learners' requests",
        )?;
        Ok(PreparedPool { name, runtime_dir, options, instance, lanes, shared_memory })
    }
}

fn check_lanes(lanes: &[LaneConfig]) -> Result<(), StartError> {
    if lanes.is_empty() {
        return Err(StartError::NoLanes);
    }
    for (index, lane) in lanes.iter().enumerate() {
        let is_duplicate = lanes[..index].iter().any(|other| other.name == lane.name);
        let checked = lane.check().and(if is_duplicate { Err(LaneConfigError::SameName) } else { Ok(()) });
        checked.map_err(|source| in_lane(&lane.name, source))?;
    }
    Ok(())
}

fn in_lane(lane: &str, source: LaneConfigError) -> StartError {
    StartError::Lane { lane: lane.to_owned(), source }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(lane: LaneConfig, threads: usize) -> String {
        let options = PoolOptions { threads, ..PoolOptions::default() };
        let folder = tempfile::tempdir().unwrap();
        let runtime_dir = RuntimeDir::at(folder.path().to_owned()).unwrap();
        let config = SupervisorConfig { name: "pool".to_owned(), lanes: vec![lane], options, runtime_dir };
        config.prepare().err().unwrap().to_string()
    }

    /// A team without its side stood still, and one with too many last actions was refused at each attach.
    #[test]
    fn a_team_that_cannot_play_is_refused_before_the_pool_starts() {
        let lane = |sides, last_actions| {
            let setup = BattleSetup::new(ScenarioFiles::resolve("3m").unwrap().1).with_sides(sides);
            let team = EnemyTeam { name: "team".to_owned(), last_actions, make: Arc::new(|| unreachable!()) };
            LaneConfig { team: Some(team), ..LaneConfig::new("lane", setup, 2) }
        };
        for sides in [Sides::Allies, Sides::Both] {
            assert!(
                refused(lane(sides, 1), 1).starts_with("lane `lane`: a team plays the enemies of mirrored")
            );
        }
        assert!(refused(lane(Sides::Mirrored, 17), 1).contains("17 of its own last actions"));
        let lane = lane(Sides::Mirrored, 16);
        assert_eq!(
            refused(lane, usize::MAX),
            format!("threads must be between 1 and 1024, got {}", usize::MAX)
        );
    }

    #[test]
    fn what_a_lane_holds_back_is_accepted_up_to_its_limits() {
        let lane = |max_held_batches, spectators| {
            let setup = BattleSetup::new(ScenarioFiles::resolve("3m").unwrap().1);
            LaneConfig { max_held_batches, spectators, ..LaneConfig::new("lane", setup, 2) }
        };
        assert!([lane(2, 0), lane(1024, 64)].iter().all(|lane| lane.check().is_ok()));
        for wrong in [1, 1025] {
            let error = lane(wrong, 0).check();
            assert!(matches!(error, Err(LaneConfigError::MaxHeldBatches(given)) if given == wrong));
        }
        assert!(matches!(lane(2, 65).check(), Err(LaneConfigError::Spectators(65))));
    }
}
