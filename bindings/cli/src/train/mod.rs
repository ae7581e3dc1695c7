//! `smaclite-pool train`: train a team, or one per seed. The learner is `smaclite_learn`; `progress` shows
//! how far it is.

mod display;
mod maps;
mod progress;

use super::files::refuse_file;
use super::{CommandResult, THREADS, completions, output, runtime_dir};
use crate::check::warn_of;
use crate::number::{count, seed, whole};
use crate::opponent::{OpponentOption, SelfPlayOptions, warn_of_other_rules};
use crate::process::interrupt_flag_once;
use clap::Args;
use maps::name_of;
use smaclite_engine::{BattleSetup, MAX_LAST_ACTIONS, Rules};
use smaclite_ipc::{RuntimeDir, WaitOptions, lane_scenario, status};
use smaclite_learn::{
    Activation, Algorithm, Config, Enemies, Lanes, NetworkKind, Run, RunDescription, Seeds, refuse_both,
    resolve_scenario,
};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool train 2s3z --steps 500000 --seed 1 --out runs/2s3z
  smaclite-pool evaluate runs/2s3z --episodes 200 --seed 1
  smaclite-pool train --resume runs/2s3z --steps 1000000
  smaclite-pool train 2s3z --seeds 10 --evaluate-every 50k --out runs/ten
  smaclite-pool train --resume runs/ten --seeds 20

Ctrl-C writes a checkpoint and ends with exit status 130 (SIGTERM: 143), a second one ends at once; \
--resume continues with the same bits as an uninterrupted run, if --steps is unchanged: step sizes and \
entropy fall over --steps.")]
pub(super) struct Train {
    /// A standard scenario or a scenario file; without an episode limit, its episodes end after 1000 steps
    #[arg(value_name = "MAP", required_unless_present_any = ["resume", "pool", "maps"],
        add = completions::scenario())]
    map: Option<String>,
    /// Train one team on several maps at once: their names or files, separated by commas; `all` are those of
    /// SMAC, `generated` those with drawn teams. Its networks are `universal`, its critic sees the state
    /// unless --algorithm is ippo, and the environments, at least 8 per map by default, are divided among
    /// them, equally or by weights, as in `all,protoss_5_vs_5=2`
    #[arg(long, value_name = "MAP[=WEIGHT],...", value_delimiter = ',', add = completions::scenario(),
        conflicts_with_all = ["map", "pool", "resume", "opponent"])]
    maps: Option<Vec<String>>,
    /// Folder of the run: weights, checkpoint and logs; must not hold a run. With --seeds, each run has a
    /// folder in it, seed-0 and so on
    #[arg(long, value_name = "FOLDER", required_unless_present = "resume")]
    out: Option<PathBuf>,
    /// Continue the run in this folder, or all runs of --seeds, with their hyperparameters
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["map", "out", "rules", "opponent"])]
    resume: Option<PathBuf>,
    /// Train on this running pool, instead of one in this process; it must play MAP, if MAP is given
    #[arg(long, value_name = "NAME", add = completions::pool())]
    pool: Option<String>,
    /// Lane of the pool, several times for several; their environments are joined [default: its only
    /// lane, or the only one that plays MAP]
    #[arg(long, requires = "pool", value_name = "NAME")]
    lane: Vec<String>,
    /// Rules of the battles: smaclite (as the published environment plays), paper (as its paper describes) or
    /// starcraft (nearer to the real battles)
    /// [default: smaclite]
    #[arg(long, conflicts_with = "pool")]
    rules: Option<Rules>,
    /// Who plays the enemies: attack_move, attack_nearest or a scripted policy; several with weights, such as
    /// attack_move=0.5,focus_fire=0.5, of which each episode draws one; the folder of another run or
    /// zoo:SCENARIO, whose team plays them; self, the team itself; or league, the team, copies of it, and
    /// attack_move [default: the scenario's own]
    #[arg(long, conflicts_with = "pool", value_name = "NAME|WEIGHTS|FOLDER|self|league")]
    opponent: Option<OpponentOption>,
    /// Train that many runs in this process, as many at a time as there are threads; their seeds are --seed,
    /// the next number, and so on. With --resume, those of them that are missing begin: also more seeds for
    /// runs that are complete
    #[arg(long, conflicts_with = "pool", value_name = "N", value_parser = count(1..=10_000))]
    seeds: Option<usize>,
    /// Evaluate the team at every multiple of N steps and at the end: 32 greedy and 32 sampled episodes, with
    /// seeds of their own; keep the best weights, and play 320 of each with them at the end; 0 for never.
    /// It changes no bit of the training [default: 0]
    #[arg(long, conflicts_with = "resume", value_name = "N", value_parser = whole(0..=1_u64 << 48))]
    evaluate_every: Option<u64>,
    /// Threads of the learner, 1 to 1024; its own pool has one less, but at least one. They change no result
    /// [default: the CPU cores available to this process]
    #[arg(long, value_name = "N", value_parser = count(THREADS))]
    threads: Option<usize>,
    /// Print one JSON object per update; with --seeds it also has the seed
    #[arg(long)]
    json: bool,
    /// Environment steps after which the run is complete, as 1000000, 1e6 or 1M; step sizes and entropy fall
    /// over them [default: 2000000]
    #[arg(long, value_name = "N", value_parser = whole(1..=1_u64 << 48))]
    steps: Option<u64>,
    // After the other options: its heading is that of all that follow.
    #[command(flatten)]
    self_play: SelfPlayOptions,
    #[command(flatten)]
    hyperparameters: Hyperparameters,
}

/// Declares the options of the hyperparameters, each of which replaces a field of [`Config`].
macro_rules! hyperparameters {
    ($($(#[doc = $doc:literal])+ $name:ident: $type:ty $(= $parser:expr)?,)+) => {
        #[derive(Args, Default)]
        #[group(id = "hyperparameters", multiple = true, conflicts_with = "resume")]
        #[command(next_help_heading = "Hyperparameters (docs/how-to/training.md)")]
        struct Hyperparameters {
            $($(#[doc = $doc])+ #[arg(long $(, value_parser = $parser)?)]
                $name: Option<$type>,)+
            /// Widths of the hidden layers of both networks, separated by commas; over units two, of the
            /// embeddings of units and of the layers behind [default: 64,64, over units 32,64]
            #[arg(long, value_delimiter = ',', value_name = "N,...", value_parser = count(2..=4096))]
            hidden: Option<Vec<usize>>,
        }

        impl Hyperparameters {
            fn apply(self, mut config: Config) -> Config {
                if let Some(network) = self.network {
                    config = config.with_network(network);
                }
                $(if let Some(value) = self.$name { config.$name = value; })+
                Config { hidden: self.hidden.unwrap_or(config.hidden), ..config }
            }
        }
    };
}

hyperparameters! {
    /// Seed of weights, environments, actions and minibatches [default: 0]
    seed: u64 = seed(),
    /// What the critic sees: the state (mappo) or the agent's observation (ippo) [default: mappo for 5 agents
    /// or more and for drawn teams, otherwise ippo]
    algorithm: Algorithm,
    /// Number of its own last actions that an agent observes, 0 to 16; as in the pool, if --pool is given
    /// [default: 4, or 0 for drawn teams]
    last_actions: usize = count(0..=MAX_LAST_ACTIONS),
    /// Number of environments; those of the pool, if --pool is given [default: 64]
    num_envs: usize = count(1..=1 << 16),
    /// Steps of each environment per update [default: 64]
    horizon: usize = count(1..=1 << 16),
    /// Passes over the data of an update [default: 4]
    epochs: usize = count(1..=1000),
    /// Gradient steps per epoch [default: 8]
    minibatches: usize = count(1..=1000),
    /// Networks of actor and critic: flat (layers over all features), units (over units: enemies share
    /// weights, and so do allies, whatever their order) or universal (over units, which are told by the
    /// figures of their types: a team that plays every map) [default: units, or flat where observations have
    /// none]
    network: NetworkKind,
    /// Non-linearity of the hidden layers: relu or tanh [default: relu]
    activation: Activation,
    /// Step size of the actor [default: 0.0007, over units 0.0014]
    actor_lr: f64,
    /// Step size of the critic [default: 0.001]
    critic_lr: f64,
    /// Share of the step sizes that is left at the end, falling linearly [default: 0.05]
    lr_end: f64,
    /// Added to the denominator of Adam [default: 0.00001]
    adam_eps: f64,
    /// Discount per step [default: 0.99]
    gamma: f64,
    /// Decay of the generalised advantage estimate [default: 0.95]
    lambda: f64,
    /// Advantages are divided at least by this share of the standard deviation of the returns [default: 0.3]
    advantage_floor: f64,
    /// How far the probability ratio may leave 1 [default: 0.2]
    clip: f64,
    /// How far a value may leave its old one, in standard deviations of the returns [default: 0.2]
    value_clip: f64,
    /// Where the Huber loss becomes linear, in standard deviations of the returns [default: 10]
    huber: f64,
    /// Weight of the entropy of an agent's actions at the beginning [default: 0.15 divided by the number of
    /// agents]
    entropy: f64,
    /// Weight of the entropy at the end [default: 0]
    entropy_end: f64,
    /// The longest gradient of each network [default: 1]
    max_grad_norm: f64,
}

/// Why a training in this folder ended whose progress could not be shown: unlike a list that `| head` cuts
/// off, it is not complete then.
fn incomplete(error: Box<dyn Error>, folder: &Path) -> Box<dyn Error> {
    if output::is_closed(error.as_ref()) {
        let folder = folder.display();
        return format!("standard output was closed; resume with --resume {folder}").into();
    }
    error
}

/// The worker threads of an own pool beside so many threads of the learner.
fn workers(threads: usize) -> usize {
    (threads - 1).max(1)
}

/// What is trained.
enum Opened {
    /// A run in the scenario of this name.
    One(Box<Run>, String),
    Several(Seeds),
}

impl Train {
    pub(super) fn run(mut self) -> CommandResult {
        let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
        let threads = self.threads.unwrap_or(cores);
        let (json, steps) = (self.json, self.steps);
        let folder = self.resume.as_ref().or(self.out.as_ref()).cloned().unwrap_or_default();
        let interrupted = interrupt_flag_once()?;
        let stop = || interrupted.load(Ordering::Relaxed);
        let runtime_dir = runtime_dir()?;
        let opened = match self.resume.take() {
            Some(folder) => self.resume(&folder, threads, &runtime_dir, &mut || stop())?,
            None => self.begin(threads, &runtime_dir, &mut || stop())?,
        };
        progress::train(opened, steps, threads, json, &folder, &stop)
    }

    fn resume(
        mut self,
        folder: &Path,
        threads: usize,
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Opened, Box<dyn Error>> {
        refuse_both(folder)?;
        if self.pool.is_none()
            && folder.is_dir()
            && !folder.join("run.json").exists()
            && let Some(runs) = Seeds::open(folder, self.steps)?
        {
            let runs = match self.seeds {
                Some(count) => runs.complete(count as u64, runtime_dir, interrupted)?,
                None => runs,
            };
            return Ok(Opened::Several(runs));
        }
        if self.seeds.is_some() {
            return Err(format!(
                "--seeds continues the folder of runs that it began, with folders such as seed-1 in it; `{}` \
                 is none",
                folder.display()
            )
            .into());
        }
        let run = RunDescription::read(folder)?;
        if run.map_count() > 1 {
            if self.pool.is_some() {
                return Err("a run on several maps plays in a pool of its own: leave --pool out".into());
            }
            let lanes = Lanes::start_maps(&run.lanes_setups(), &run.config, workers(threads), runtime_dir)?;
            let resumed = Run::resume_on_maps(folder, self.steps, lanes, threads)?;
            return Ok(Opened::One(Box::new(resumed), name_of(&run)));
        }
        self.choose_lane(&run.name, runtime_dir, interrupted)?;
        let lanes = self.lanes(&run.lanes_setup(), &run.config, threads, runtime_dir, interrupted)?;
        let are_saved = lanes.are_saved();
        let resumed = Run::resume(folder, self.steps, lanes, threads)?;
        self.warn_of_snapshots(are_saved);
        Ok(Opened::One(Box::new(resumed), run.name))
    }

    fn begin(
        mut self,
        threads: usize,
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Opened, Box<dyn Error>> {
        let out = self.out.take().unwrap_or_default();
        refuse_file("--out", &out)?;
        let enemies = self.self_play.enemies(self.opponent.clone())?;
        let (mut setups, mut config) = match self.maps.take() {
            Some(names) => self.maps_to_train(&names)?,
            None => {
                let setup = self.setup(runtime_dir, interrupted)?;
                if let Enemies::Team { folder } = &enemies {
                    warn_of_other_rules(folder, setup.rules)?;
                }
                let config = Config { enemies, ..Config::for_scenario(&setup.files.scenario()?) };
                (vec![setup], config)
            }
        };
        config.steps = self.steps.unwrap_or(config.steps);
        config.evaluate_every = self.evaluate_every.filter(|every| *every > 0);
        let Hyperparameters { num_envs, last_actions, .. } = self.hyperparameters;
        config = std::mem::take(&mut self.hyperparameters).apply(config);
        if let Some(count) = self.seeds {
            let seeds = Seeds::begin(&out, &config, count as u64, &setups, runtime_dir, interrupted)?;
            return Ok(Opened::Several(seeds));
        }
        if setups.len() > 1 {
            config.check()?;
            let lanes = Lanes::start_maps(&setups, &config, workers(threads), runtime_dir)?;
            let name = maps::in_words(setups.len());
            let maps = setups.into_iter().zip(lanes).collect();
            return Ok(Opened::One(Box::new(Run::begin_on_maps(&out, config, maps, threads)?), name));
        }
        let setup = setups.remove(0);
        let name = setup.files.scenario()?.name;
        let lanes = self.lanes(&config.enemies.setup(&setup), &config, threads, runtime_dir, interrupted)?;
        // A pool has its own; others that were asked for are refused.
        config.num_envs = num_envs.unwrap_or(lanes.num_envs());
        config.last_actions = last_actions.unwrap_or(lanes.last_actions());
        let are_saved = lanes.are_saved();
        let run = Run::begin(&out, config, &setup, lanes, threads)?;
        self.warn_of_snapshots(are_saved);
        Ok(Opened::One(Box::new(run), name))
    }

    fn setup(
        &mut self,
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<BattleSetup, Box<dyn Error>> {
        let rules = self.rules.unwrap_or_default();
        let mut of_map = self.map.as_deref().map(|map| resolve_scenario(map, rules)).transpose()?;
        if let (Some(setup), Some(OpponentOption::Scripts(scripts))) = (of_map.as_mut(), &self.opponent) {
            setup.opponents = scripts.clone();
        }
        of_map.iter().for_each(warn_of);
        let Some(pool) = self.pool.clone() else {
            return of_map.ok_or_else(|| "a MAP or --pool is required".into());
        };
        if let Some(of_map) = &of_map {
            self.choose_lane(&of_map.files.scenario()?.name, runtime_dir, interrupted)?;
        }
        let lane = self.lane.first().map(String::as_str);
        let (_, of_pool) = lane_scenario(runtime_dir, &pool, lane, WaitOptions::interrupted_by(interrupted))?;
        if of_pool.sides.are_both() {
            return Err(format!(
                "learners or a trained team play the enemies in pool `{pool}`, but `train --pool` trains \
                 agents whose enemies are played by scripts; serve it with `--sides allies` and without a \
                 team, or train with --opponent self or the team, and without --pool"
            )
            .into());
        }
        // Rules, episode limit and opponents are those of the pool, which may have its own.
        Ok(match of_map {
            Some(BattleSetup { files, .. }) => BattleSetup { files, ..of_pool },
            None => of_pool,
        })
    }

    /// If no lane was named, takes the one of the pool that plays this scenario, unless several do.
    fn choose_lane(
        &mut self,
        scenario: &str,
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> CommandResult {
        if let (Some(pool), []) = (&self.pool, &self.lane[..]) {
            let status = status(runtime_dir, pool, WaitOptions::interrupted_by(interrupted))?;
            let lanes = status.lanes.into_iter().map(|lane| lane.description);
            let mut fitting = lanes.filter(|lane| lane.scenario == scenario).map(|lane| lane.lane);
            if let (Some(lane), None) = (fitting.next(), fitting.next()) {
                self.lane = vec![lane];
            }
        }
        Ok(())
    }

    fn lanes(
        &self,
        setup: &BattleSetup,
        config: &Config,
        threads: usize,
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Lanes, Box<dyn Error>> {
        let Config { num_envs, last_actions, .. } = *config;
        Ok(match &self.pool {
            Some(pool) => Lanes::attach(setup, runtime_dir, pool, &self.lane, interrupted)?,
            None => Lanes::start(setup, num_envs, last_actions, workers(threads), runtime_dir)?,
        })
    }

    /// Says what a run on lanes without snapshots loses; to be called when nothing can refuse the run any
    /// more.
    fn warn_of_snapshots(&self, are_saved: bool) {
        if let Some(pool) = self.pool.as_ref().filter(|_| !are_saved) {
            err!(
                "smaclite-pool: warning: pool `{pool}` does not serve the field `snapshot`: where the run is \
                 resumed, environments begin anew, and it has other bits than one that was not interrupted"
            );
        }
    }
}
