//! `smaclite-pool serve`: run a pool until SIGINT or SIGTERM.

use super::{CommandResult, THREADS, completions, megabytes, runtime_dir};
use crate::check::warn_of;
use crate::number::{count, seed, whole};
use crate::opponent::warn_of_other_rules;
use crate::os;
use crate::process::{interrupt_flag, wait_for};
use clap::Args;
use serde_json::value::RawValue;
use smaclite_engine::{BattleSetup, EpisodeLimit, MAX_LAST_ACTIONS, Rules, Sides};
use smaclite_ipc::{
    LaneConfig, RuntimeDir, StartError, Supervisor, SupervisorConfig, WaitStrategy, check_name,
};
use smaclite_learn::LaneOpponents;
use smaclite_pool::fields::{FieldSet, UnknownField};
use smaclite_pool::{Autoreset, MAX_ENVS, PoolOptions};
use smaclite_scenarios::{Scenario, ScenarioFiles};
use smaclite_units::file::{did_you_mean, shortened};
use std::error::Error;
use std::hash::{BuildHasher, RandomState};
use std::path::Path;
use std::str::FromStr;
use std::sync::atomic::Ordering;

#[derive(Args)]
#[command(after_help = "Examples:\n  smaclite-pool serve 2s3z:64 --name train\n  \
    smaclite-pool serve 2s3z:64 MMM2:32 ./mine.json:16 --name train --threads 8\n  \
    smaclite-pool serve easy=3s5z:64 hard=3s5z_vs_3s6z:64\n\n\
    A learner connects with smaclite_pool.connect(\"train\"), to one of several lanes with \
    smaclite_pool.connect(\"train\", lane=\"MMM2\").")]
pub(super) struct Serve {
    /// One lane per argument: a standard scenario or a scenario file, the number of environments N (default
    /// 64), and the lane's name (default: that of the scenario)
    #[arg(required = true, value_name = "[LANE=]SCENARIO[:N]", add = completions::lane())]
    lanes: Vec<GivenLane>,
    /// Name of the pool, by which learners connect
    #[arg(long, default_value = "default")]
    name: String,
    /// Number of worker threads, 1 to 1024 [default: the CPU cores available to this process, minus one for
    /// the learner]
    #[arg(long, value_name = "N", value_parser = count(THREADS))]
    threads: Option<usize>,
    /// Environments per batch; fewer than the lane has means asynchronous stepping [default: all of the lane]
    #[arg(long, value_name = "M", value_parser = count(1..=MAX_ENVS))]
    batch_size: Option<usize>,
    /// Environment i of the pool is seeded with SEED + i; they are numbered through all lanes [default: a
    /// random seed, which `status --json` has]
    #[arg(long, value_parser = seed())]
    seed: Option<u64>,
    /// What happens at the end of an episode: NextStep, SameStep or Disabled
    #[arg(long, default_value = "NextStep", value_name = "MODE")]
    autoreset_mode: Autoreset,
    /// Rules of the battles: smaclite (as the published environment plays), paper (as its paper describes) or
    /// starcraft (nearer to the real battles)
    #[arg(long, default_value = "smaclite")]
    rules: Rules,
    /// Steps after which an episode is truncated, or `none` for no limit [default: the scenario's limit]
    #[arg(long, value_name = "STEPS", value_parser = episode_limit)]
    episode_limit: Option<EpisodeLimit>,
    /// Who plays the enemies: attack_move, attack_nearest, a scripted policy, or a trained team, as zoo:3m or
    /// by the folder of its run; or several with weights, such as attack_move=0.5,focus_fire=0.5, of which
    /// each episode draws one [default: the scenario's own; with --sides both: learner]
    #[arg(long, value_name = "NAME|FOLDER|WEIGHTS", add = completions::player())]
    opponent: Option<LaneOpponents>,
    /// A key of the scenario files with another value, as JSON: `--set 'smacv2={"prob_obs_enemy": 0.5}'`;
    /// null removes a key, and options of smacv2 and rewards are added to those of the file. For all lanes
    #[arg(long, value_name = "KEY=JSON", value_parser = key_and_value)]
    set: Vec<(String, Box<RawValue>)>,
    /// Which sides actions play: allies; both; or mirrored, which is both, and what the enemies see and do is
    /// reflected at the centre of the map
    #[arg(long, default_value = "allies")]
    sides: Sides,
    /// Fields of a batch, separated by commas [default: all]
    #[arg(long, value_delimiter = ',', value_name = "NAME,...", value_parser = field)]
    fields: Option<Vec<String>>,
    /// How many of its own last actions an agent observes, 0 to 16: one-hot vectors after its other features
    #[arg(long, default_value_t = 0, value_name = "K", value_parser = count(0..=MAX_LAST_ACTIONS))]
    obs_last_actions: usize,
    /// Let an agent observe its own number: a one-hot vector at the end
    #[arg(long)]
    obs_agent_id: bool,
    /// Batches that a learner can hold at once, 2 to 1024
    #[arg(long, default_value_t = 4, value_name = "K", value_parser = count(2..=1024))]
    max_held_batches: usize,
    /// Spectators per lane, 0 to 64
    #[arg(long, default_value_t = 1, value_name = "K", value_parser = count(0..=64))]
    spectators: usize,
    /// How idle threads wait: adaptive, spin or block
    #[arg(long, default_value = "adaptive", value_name = "STRATEGY")]
    wait: WaitStrategy,
}

#[derive(Debug, thiserror::Error)]
#[error("must be a number of steps between 1 and {}, or `none`", u32::MAX)]
struct InvalidEpisodeLimit;

fn episode_limit(text: &str) -> Result<EpisodeLimit, InvalidEpisodeLimit> {
    match text {
        "none" => Ok(EpisodeLimit::None),
        _ => whole(1..=u32::MAX)(text).map(EpisodeLimit::Steps).map_err(|_| InvalidEpisodeLimit),
    }
}

/// The name of a field.
fn field(name: &str) -> Result<String, UnknownField> {
    FieldSet::from_names([name]).map(|_| name.to_owned())
}

/// Environments of a lane without a number.
const DEFAULT_ENVS: usize = 64;

/// A lane as it is given.
#[derive(Clone)]
struct GivenLane {
    text: String,
    name: Option<String>,
    scenario: String,
    num_envs: usize,
}

impl FromStr for GivenLane {
    type Err = String;

    fn from_str(text: &str) -> Result<GivenLane, String> {
        // Paths may have both signs.
        let is_file = |text: &str| Path::new(text).is_file();
        let is_path = is_file(text) || text.rsplit_once(':').is_some_and(|(path, _)| is_file(path));
        let (name, rest) = match text.split_once('=') {
            Some((name, rest)) if !is_path => (Some(name.to_owned()), rest),
            _ => (None, text),
        };
        name.as_deref().map_or(Ok(()), |name| check_name(name).map_err(|why| why.to_string()))?;
        let (scenario, num_envs) = match rest.rsplit_once(':') {
            Some((scenario, given)) if !is_file(rest) => {
                let num_envs = count(1..=MAX_ENVS)(given);
                let wrong = |error| format!("the number of environments after `:` {error}; got `{given}`");
                (scenario, num_envs.map_err(wrong)?)
            }
            _ => (rest, DEFAULT_ENVS),
        };
        let (text, scenario) = (text.to_owned(), scenario.to_owned());
        Ok(GivenLane { text, name, scenario, num_envs })
    }
}

impl Serve {
    pub(super) fn run(self) -> CommandResult {
        let prepared = self.config(runtime_dir()?)?.prepare()?;
        os::use_all_descriptors();
        // So far, a signal ends the program at once. From here on there are files to remove first.
        let stop = interrupt_flag()?;
        let started = Supervisor::start_prepared(prepared, &mut || stop.load(Ordering::Relaxed));
        if let Err(StartError::Interrupted) = started {
            return Ok(());
        }
        let supervisor = started?;
        print_start(&supervisor);
        wait_for(&stop);
        let _ = out!("stopping");
        Ok(())
    }

    fn config(&self, runtime_dir: RuntimeDir) -> Result<SupervisorConfig, Box<dyn Error>> {
        let mut lanes = self.lanes.iter().map(|lane| self.lane(lane)).collect::<Result<Vec<_>, _>>()?;
        // Two lanes of one scenario must not play the same battles.
        let mut next_seed = self.seed.unwrap_or_else(random_seed);
        for lane in &mut lanes {
            lane.settings.seed = next_seed;
            next_seed = next_seed.wrapping_add(lane.settings.num_envs as u64);
        }
        let threads = self.threads.unwrap_or(PoolOptions::for_other_processes().threads);
        let options = PoolOptions { threads, wait: self.wait };
        Ok(SupervisorConfig { name: self.name.clone(), lanes, options, runtime_dir })
    }

    fn lane(&self, given: &GivenLane) -> Result<LaneConfig, Box<dyn Error>> {
        let GivenLane { text, name, scenario, num_envs } = given;
        let (mut scenario, mut files) = ScenarioFiles::resolve(scenario)?;
        if !self.set.is_empty() {
            files = files.with_keys(self.set.iter().cloned());
            scenario = files.scenario()?;
        }
        let name = name.clone().unwrap_or_else(|| scenario.name.clone());
        check_name(&name).map_err(|why| format!("lane `{text}`: {why}; choose a name with LANE={text}"))?;
        let episode_limit = self.episode_limit.unwrap_or_default();
        self.sides.check(&scenario)?;
        let setup = BattleSetup::new(files).with_sides(self.sides);
        let setup = BattleSetup { rules: self.rules, episode_limit, ..setup };
        warn_of(&setup);
        let (setup, team) = match self.opponent.clone() {
            Some(opponents) => opponents.open(setup).map_err(|error| format!("lane `{text}`: {error}"))?,
            None => (setup, None),
        };
        if let Some(team) = &team {
            warn_of_other_rules(Path::new(&team.name), self.rules)?;
        }
        let mut lane = LaneConfig { team, ..LaneConfig::new(name, setup, *num_envs) };
        lane.settings.batch_size = self.batch_size.unwrap_or(*num_envs);
        lane.settings.autoreset = self.autoreset_mode;
        lane.settings.obs_last_actions = self.obs_last_actions;
        lane.settings.obs_agent_id = self.obs_agent_id;
        if let Some(names) = &self.fields {
            lane.settings.fields = FieldSet::from_names(names)?;
        }
        lane.max_held_batches = self.max_held_batches;
        lane.spectators = self.spectators;
        Ok(lane)
    }
}

/// 53 random bits, which a number of JSON can have. The hash map's keys are random in every process.
fn random_seed() -> u64 {
    RandomState::new().hash_one(0) >> 11
}

/// A key and its value.
fn key_and_value(text: &str) -> Result<(String, Box<RawValue>), String> {
    let (key, value) = text.split_once('=').ok_or("must be KEY=JSON")?;
    if ScenarioFiles::ONLY_IN_FILES.contains(&key) {
        return Err(format!("{key} is for files, and --set opens none"));
    }
    let keys = Scenario::keys().iter().map(|known| known.name());
    let keys: Vec<&str> = keys.filter(|known| !ScenarioFiles::ONLY_IN_FILES.contains(known)).collect();
    if !keys.contains(&key) {
        return Err(format!("unknown key `{}`; {}", shortened(key), did_you_mean(key, keys)));
    }
    let value = serde_json::from_str(value).map_err(|_| {
        let name = shortened(value);
        let example = match key {
            "start_positions" | "teams" => format!(r#"{key}={{"distribution":"{name}"}}"#),
            "smacv2" | "rewards" => format!(r#"{key}={{"reward_win":100}}"#),
            "attack_point" => format!("{key}=[16,8]"),
            _ => format!(r#"{key}="{name}""#),
        };
        format!("the value of `{key}` must be JSON, got `{name}`; as an example: --set '{example}'")
    })?;
    Ok((key.to_owned(), value))
}

fn print_start(supervisor: &Supervisor) {
    let threads = supervisor.threads();
    let plural = if threads == 1 { "" } else { "s" };
    // A closed output does not stop the pool.
    let _ = out!(
        "pool `{}` (process {}): {threads} worker thread{plural}, {} of shared memory",
        supervisor.name(),
        std::process::id(),
        megabytes(supervisor.shared_memory())
    );
    for lane in supervisor.lanes() {
        let mode = if lane.settings.is_synchronous() {
            "synchronous".to_owned()
        } else {
            format!("asynchronous in batches of {}", lane.settings.batch_size)
        };
        let _ = out!("  lane `{}`: {} x {}, {mode}", lane.lane, lane.settings.num_envs, lane.scenario);
    }
    let lane = match supervisor.lanes() {
        [first, _, ..] => format!(", lane={:?}", first.lane),
        _ => String::new(),
    };
    let _ = out!("connect with smaclite_pool.connect({:?}{lane}); stop with Ctrl-C", supervisor.name());
}
