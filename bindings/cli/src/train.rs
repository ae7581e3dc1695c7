//! `smaclite-pool train`: train a team and show the progress. The learner is `smaclite_learn`.

use super::{CommandResult, THREADS, completions, runtime_dir};
use crate::check::warn_of;
use crate::number::{count, seed, whole};
use crate::process::interrupt_flag_once;
use clap::Args;
use serde_json::Value;
use smaclite_engine::{BattleSetup, Opponents, Rules};
use smaclite_ipc::{ClientError, RuntimeDir, WaitOptions, lane_scenario, status_within};
use smaclite_learn::{
    Activation, Algorithm, Config, Lanes, Record, Run, RunDescription, TrainError, resolve_scenario,
};
use smaclite_pool::MAX_LAST_ACTIONS;
use std::error::Error;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

#[derive(Args)]
#[command(after_help = "\
Examples:
  smaclite-pool train 2s3z --steps 500000 --seed 1 --out runs/2s3z
  smaclite-pool evaluate runs/2s3z --episodes 200 --seed 1
  smaclite-pool train --resume runs/2s3z --steps 1000000

Ctrl-C writes a checkpoint, a second one ends at once; --resume continues with the same bits as an
uninterrupted run.")]
pub(super) struct Train {
    /// A standard scenario or a scenario file; without an episode limit, its episodes end after 1000 steps
    #[arg(value_name = "MAP", required_unless_present_any = ["resume", "pool"],
        add = completions::scenario())]
    map: Option<String>,
    /// Folder of the run: weights, checkpoint and logs; must not hold a run
    #[arg(long, value_name = "FOLDER", required_unless_present = "resume")]
    out: Option<PathBuf>,
    /// Continue the run in this folder, with its hyperparameters
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["map", "out", "rules", "opponent"])]
    resume: Option<PathBuf>,
    /// Train on this running pool, instead of one in this process; it must play MAP, if MAP is given
    #[arg(long, value_name = "NAME", add = completions::pool())]
    pool: Option<String>,
    /// Lane of the pool, several times for several; their environments are joined [default: its only
    /// lane, or the only one that plays MAP]
    #[arg(long, requires = "pool", value_name = "NAME")]
    lane: Vec<String>,
    /// Rules of the battles: smaclite (as the published environment plays) or paper (as its paper describes)
    /// [default: smaclite]
    #[arg(long, conflicts_with = "pool")]
    rules: Option<Rules>,
    /// Who plays the enemies: attack_move, attack_nearest or a scripted policy; or several with weights, such
    /// as attack_move=0.5,focus_fire=0.5, of which each episode draws one [default: attack_move]
    #[arg(long, conflicts_with = "pool", value_name = "NAME|WEIGHTS")]
    opponent: Option<Opponents>,
    /// Threads of the learner, 1 to 1024; its own pool has one less, but at least one. They change no result
    /// [default: the CPU cores available to this process]
    #[arg(long, value_name = "N", value_parser = count(THREADS))]
    threads: Option<usize>,
    /// Print one JSON object per update
    #[arg(long)]
    json: bool,
    /// Environment steps after which the run is complete, as 1000000, 1e6 or 1M [default: 1000000]
    #[arg(long, value_name = "N", value_parser = whole(1..=1_u64 << 48))]
    steps: Option<u64>,
    #[command(flatten)]
    hyperparameters: Hyperparameters,
}

/// Declares the options of the hyperparameters, each of which replaces a field of [`Config`].
macro_rules! hyperparameters {
    ($($(#[doc = $doc:literal])+ $name:ident: $type:ty $(= $parser:expr)?,)+) => {
        #[derive(Args)]
        #[group(id = "hyperparameters", multiple = true, conflicts_with = "resume")]
        #[command(next_help_heading = "Hyperparameters (docs/tutorials/training.md)")]
        struct Hyperparameters {
            $($(#[doc = $doc])+ #[arg(long $(, value_parser = $parser)?)]
                $name: Option<$type>,)+
            /// Widths of the hidden layers of both networks, separated by commas [default: 64,64]
            #[arg(long, value_delimiter = ',', value_name = "N,...", value_parser = count(2..=4096))]
            hidden: Option<Vec<usize>>,
        }

        impl Hyperparameters {
            fn apply(self, config: &mut Config) {
                $(if let Some(value) = self.$name { config.$name = value; })+
                if let Some(hidden) = self.hidden { config.hidden = hidden; }
            }
        }
    };
}

hyperparameters! {
    /// Seed of weights, environments, actions and minibatches [default: 0]
    seed: u64 = seed(),
    /// What the critic sees: the state (mappo) or the agent's observation (ippo) [default: mappo]
    algorithm: Algorithm,
    /// Number of its own last actions that an agent observes, 0 to 16; as in the pool, if --pool is given
    /// [default: 0]
    last_actions: usize = count(0..=MAX_LAST_ACTIONS),
    /// Number of environments; those of the pool, if --pool is given [default: 64]
    num_envs: usize = count(1..=1 << 16),
    /// Steps of each environment per update [default: 64]
    horizon: usize = count(1..=1 << 16),
    /// Passes over the data of an update [default: 4]
    epochs: usize = count(1..=1000),
    /// Gradient steps per epoch [default: 4]
    minibatches: usize = count(1..=1000),
    /// Non-linearity of the hidden layers: relu or tanh [default: relu]
    activation: Activation,
    /// Step size of the actor [default: 0.0007]
    actor_lr: f64,
    /// Step size of the critic [default: 0.001]
    critic_lr: f64,
    /// Share of the step sizes that is left at the end, falling linearly [default: 1]
    lr_end: f64,
    /// Added to the denominator of Adam [default: 0.00001]
    adam_eps: f64,
    /// Discount per step [default: 0.99]
    gamma: f64,
    /// Decay of the generalised advantage estimate [default: 0.95]
    lambda: f64,
    /// Advantages are divided at least by this share of the standard deviation of the returns [default: 0]
    advantage_floor: f64,
    /// How far the probability ratio may leave 1 [default: 0.2]
    clip: f64,
    /// How far a value may leave its old one, in standard deviations of the returns [default: 0.2]
    value_clip: f64,
    /// Where the Huber loss becomes linear, in standard deviations of the returns [default: 10]
    huber: f64,
    /// Weight of the entropy at the beginning [default: 0.01]
    entropy: f64,
    /// Weight of the entropy at the end [default: that at the beginning]
    entropy_end: f64,
    /// The longest gradient of each network [default: 1]
    max_grad_norm: f64,
}

/// How often a line is printed, if standard output is not a terminal.
const LINE_INTERVAL: Duration = Duration::from_secs(5);

impl Train {
    pub(super) fn run(self) -> CommandResult {
        let cores = std::thread::available_parallelism().map_or(1, |cores| cores.get());
        let threads = self.threads.unwrap_or(cores);
        let json = self.json;
        let interrupted = interrupt_flag_once()?;
        let (mut run, name) = self.open(threads, &mut || interrupted.load(Ordering::Relaxed))?;
        let mut display = Display::new(json, name, run.config().steps);
        loop {
            match run.update(&mut || interrupted.load(Ordering::Relaxed)) {
                Ok(Some(record)) => {
                    if let Err(error) = display.show(&record) {
                        run.checkpoint()?; // the output was closed
                        return Err(error);
                    }
                }
                Ok(None) => break,
                Err(TrainError::Client(ClientError::Interrupted)) => break,
                Err(error) => {
                    if let TrainError::Client(_) = error {
                        run.checkpoint()?; // the pool has ended, but not what was learnt
                    }
                    return Err(error.into());
                }
            }
        }
        run.checkpoint()?;
        display.end(interrupted.load(Ordering::Relaxed))
    }

    /// Begins or resumes the run. Also returns the name of the scenario.
    fn open(
        mut self,
        threads: usize,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<(Run, String), Box<dyn Error>> {
        let runtime_dir = runtime_dir()?;
        if let Some(folder) = self.resume.take() {
            let run = RunDescription::read(&folder)?;
            self.choose_lane(&run.name, &runtime_dir, interrupted)?;
            let Config { num_envs, last_actions, .. } = run.config;
            let lanes = self.lanes(&run.setup, num_envs, last_actions, threads, &runtime_dir, interrupted)?;
            return Ok((Run::resume(&folder, self.steps, lanes, threads)?, run.name));
        }
        if self.out.as_ref().is_some_and(|out| out.exists() && !out.is_dir()) {
            let out = self.out.unwrap_or_default();
            return Err(format!("--out must be a folder, but `{}` is a file", out.display()).into());
        }
        let setup = self.setup(&runtime_dir, interrupted)?;
        let chosen_num_envs = self.hyperparameters.num_envs;
        let num_envs = chosen_num_envs.unwrap_or(Config::default().num_envs);
        let last_actions = self.hyperparameters.last_actions.unwrap_or(0);
        let lanes = self.lanes(&setup, num_envs, last_actions, threads, &runtime_dir, interrupted)?;
        let mut config =
            Config { num_envs: lanes.num_envs(), last_actions: lanes.last_actions(), ..Config::default() };
        config.steps = self.steps.unwrap_or(config.steps);
        config.entropy_end = self.hyperparameters.entropy.unwrap_or(config.entropy_end);
        self.hyperparameters.apply(&mut config);
        let name = setup.files.scenario()?.name;
        let out = self.out.unwrap_or_default();
        Ok((Run::begin(&out, config, &setup, lanes, threads)?, name))
    }

    fn setup(
        &mut self,
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<BattleSetup, Box<dyn Error>> {
        let rules = self.rules.unwrap_or_default();
        let mut of_map = self.map.as_deref().map(|map| resolve_scenario(map, rules)).transpose()?;
        if let Some((setup, opponents)) = of_map.as_mut().zip(self.opponent.clone()) {
            setup.opponents = opponents;
        }
        of_map.iter().for_each(|setup| warn_of(&setup.files));
        let Some(pool) = self.pool.clone() else {
            return of_map.ok_or_else(|| "a MAP or --pool is required".into());
        };
        if let Some(of_map) = &of_map {
            self.choose_lane(&of_map.files.scenario()?.name, runtime_dir, interrupted)?;
        }
        let lane = self.lane.first().map(String::as_str);
        let of_pool = lane_scenario(runtime_dir, &pool, lane, WaitOptions::interrupted_by(interrupted))?;
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
            let status = status_within(runtime_dir, pool, WaitOptions::interrupted_by(interrupted))?;
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
        num_envs: usize,
        last_actions: usize,
        threads: usize,
        runtime_dir: &RuntimeDir,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Lanes, Box<dyn Error>> {
        Ok(match &self.pool {
            Some(pool) => Lanes::attach(setup, runtime_dir, pool, &self.lane, interrupted)?,
            None => Lanes::start(setup, num_envs, last_actions, (threads - 1).max(1), runtime_dir)?,
        })
    }
}

/// Shows the progress: JSON, one changing line in a terminal, or a line every five seconds.
struct Display {
    json: bool,
    terminal: bool,
    name: String,
    total: u64,
    /// Time and steps of the first record, from which the time that is left is estimated.
    first: Option<(Instant, u64)>,
    last_line: Option<Instant>,
    last: Option<String>,
}

impl Display {
    fn new(json: bool, name: String, total: u64) -> Display {
        let terminal = std::io::stdout().is_terminal();
        Display { json, terminal, name, total, first: None, last_line: None, last: None }
    }

    fn show(&mut self, record: &Record) -> CommandResult {
        if self.json {
            let number = |i, value: f64| if i < 3 { Value::from(value as u64) } else { Value::from(value) };
            let columns = record.columns().into_iter().enumerate();
            let object = columns.map(|(i, (name, value))| (name.to_owned(), number(i, value)));
            out!("{}", Value::Object(object.collect()))?;
            return Ok(());
        }
        let line = self.line(record);
        if self.terminal {
            write!(std::io::stdout(), "\r\x1b[K{line}")?;
            std::io::stdout().flush()?;
        } else if self.last_line.is_none_or(|last| last.elapsed() >= LINE_INTERVAL) {
            out!("{line}")?;
            self.last_line = Some(Instant::now());
            self.last = None;
            return Ok(());
        }
        self.last = Some(line);
        Ok(())
    }

    fn line(&mut self, record: &Record) -> String {
        let (begin, first_steps) = *self.first.get_or_insert((Instant::now(), record.steps));
        let (made, left) = (record.steps - first_steps, self.total.saturating_sub(record.steps));
        let per_s = made as f64 / begin.elapsed().as_secs_f64().max(1e-9);
        let (rate, time_left) = if made == 0 {
            (record.steps_per_s, left as f64 / record.steps_per_s)
        } else {
            (per_s, left as f64 / per_s)
        };
        let team = if record.episodes == 0 {
            "no episode yet".to_owned()
        } else {
            format!("return {:5.2}  wins {:5.1} %", record.mean_return, 100.0 * record.win_rate)
        };
        format!(
            "{}: {} of {} steps  {rate:.0} steps/s  {team}  {} left",
            self.name,
            record.steps,
            self.total,
            minutes(time_left)
        )
    }

    /// Shows the last record, if it was not shown, and how the run ended.
    fn end(self, interrupted: bool) -> CommandResult {
        if self.json {
            return Ok(());
        }
        match self.last {
            Some(line) if !self.terminal => out!("{line}")?,
            Some(_) => out!()?,
            None => {}
        }
        out!("{}", if interrupted { "interrupted; resume with --resume" } else { "complete" })?;
        Ok(())
    }
}

/// 95 seconds as `1:35`.
fn minutes(seconds: f64) -> String {
    let seconds = seconds.min(1e9) as u64;
    format!("{}:{:02}", seconds / 60, seconds % 60)
}
