//! A run in memory: from first weights or a checkpoint, update after update.
//!
//! All environments restart every [`RESTART_INTERVAL`] updates, with seeds that the run's seed decides.
//! Between restarts a run is resumed from snapshots of its environments.

use crate::checkpoint::{Checkpoint, Progress};
use crate::collect::{Collector, Draws};
use crate::config::{Config, ConfigError, Enemies};
use crate::cpu_timer::CpuTimer;
use crate::lane_error::LaneError;
use crate::lanes::Lanes;
use crate::league::{League, Rival};
use crate::ppo::{Diverged, Ppo, UpdateError, UpdateStats};
use crate::random::{Purpose, generator, seed};
use crate::rollout::{Against, Ended, Rollout};
use crate::team::{Network, Team};
use crate::tensors::FileError;
use smaclite_ipc::ClientError;
use std::time::{Duration, Instant};

/// Updates between two restarts of the environments.
const RESTART_INTERVAL: u64 = 32;

/// How many episodes the statistics of a record are about.
const RECENT: usize = 200;

/// Why a run could not begin or continue.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[allow(missing_docs)] // the inner errors say it
pub enum TrainError {
    Config(#[from] ConfigError),
    Lane(#[from] LaneError),
    Client(#[from] ClientError),
    Diverged(#[from] Diverged),
    File(#[from] FileError),
    #[error("`{0}` already holds a run; resume it with --resume, or choose another folder")]
    FolderInUse(String),
    #[error("another process trains in `{0}`; wait until it ends, or choose another folder")]
    FolderLocked(String),
    #[error(
        "the checkpoint could not be continued: the environments do not take its snapshots ({0}); it is of \
         another release or another pool"
    )]
    NotRestored(ClientError),
}

/// A run in memory.
pub(crate) struct Training {
    pub config: Config,
    lanes: Lanes,
    state: Checkpoint,
    rollout: Rollout,
    collector: Collector,
    ppo: Ppo,
}

/// What an update did, and how far the run is. Statistics of episodes are of the newest 200; they are NaN
/// before the first episode has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // `columns` has the names, and docs/how-to/training.md their meaning
pub struct Record {
    pub updates: u64,
    pub steps: u64,
    pub episodes: u64,
    pub mean_return: f64,
    pub win_rate: f64,
    pub mean_length: f64,
    pub stats: UpdateStats,
    /// Seconds since the run began, without interruptions.
    pub seconds: f64,
    /// Processor time of the same.
    pub cpu_seconds: f64,
    /// Environment steps per second of this update.
    pub steps_per_s: f64,
    /// Share of the time of this update that was spent waiting for environments.
    pub wait_share: f64,
    /// Share that was spent in the gradient steps.
    pub learn_share: f64,
    /// `None` if the team does not play itself.
    pub self_play: Option<SelfPlayRecord>,
}

/// Win rates by who played the enemies, of the same episodes as the others; and the copies that are drawn
/// from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // as of `Record`
pub struct SelfPlayRecord {
    pub win_rate_self: f64,
    pub win_rate_league: f64,
    pub win_rate_attack_move: f64,
    pub league_size: u64,
}

impl Record {
    /// Names and values, as in the logs. The first three are integers. Those before `seconds`, and those
    /// after
    /// `learn_share`, are the same in every run with this seed.
    pub fn columns(&self) -> Vec<(&'static str, f64)> {
        let stats = &self.stats;
        let mut columns = vec![
            ("update", self.updates as f64),
            ("steps", self.steps as f64),
            ("episodes", self.episodes as f64),
            ("mean_return", self.mean_return),
            ("win_rate", self.win_rate),
            ("mean_length", self.mean_length),
            ("policy_rows", stats.policy_rows),
            ("policy_loss", stats.policy_loss),
            ("value_loss", stats.value_loss),
            ("entropy", stats.entropy),
            ("kl", stats.kl),
            ("clip_fraction", stats.clip_fraction),
            ("actor_grad_norm", stats.actor_grad_norm),
            ("critic_grad_norm", stats.critic_grad_norm),
            ("explained_variance", stats.explained_variance),
            ("actor_lr", stats.actor_lr),
            ("entropy_weight", stats.entropy_weight),
            ("seconds", self.seconds),
            ("cpu_seconds", self.cpu_seconds),
            ("steps_per_s", self.steps_per_s),
            ("wait_share", self.wait_share),
            ("learn_share", self.learn_share),
        ];
        if let Some(self_play) = &self.self_play {
            columns.extend([
                ("win_rate_self", self_play.win_rate_self),
                ("win_rate_league", self_play.win_rate_league),
                ("win_rate_attack_move", self_play.win_rate_attack_move),
                ("league_size", self_play.league_size as f64),
            ]);
        }
        columns
    }
}

impl Training {
    /// Begins a run. `rival` plays the enemies if those are a trained team's.
    pub fn new(
        config: Config,
        lanes: Lanes,
        threads: usize,
        rival: Option<Network>,
    ) -> Result<Training, TrainError> {
        config.check()?;
        let lanes = lanes.for_run(&config)?;
        lanes.inputs().check(&config)?;
        let team = Team::new(&config, lanes.inputs());
        let rivals = rival.map(|actor| Rival::new(0, actor)).into_iter().collect();
        let league = match config.enemies {
            Enemies::Scripts => League::default(),
            Enemies::Team { .. } | Enemies::SelfPlay(_) => League::new(config.num_envs, rivals),
        };
        let (progress, recent) = (Progress::default(), Vec::new());
        let state = Checkpoint { team, progress, recent, envs: None, league };
        Ok(Training::with_state(config, lanes, threads, state))
    }

    /// Continues a run on the lanes of its configuration, in the states of the checkpoint's environments. If
    /// it has none, because a lane does not serve snapshots, the environments begin new episodes.
    pub fn resume(
        config: Config,
        lanes: Lanes,
        threads: usize,
        state: Checkpoint,
    ) -> Result<Training, TrainError> {
        config.check()?;
        let mut training = Training::with_state(config, lanes, threads, state);
        let Training { lanes, state, .. } = &mut training;
        match &state.envs {
            Some(envs) => lanes.restore(envs).map_err(TrainError::NotRestored)?,
            None => training.restart_environments()?,
        }
        Ok(training)
    }

    fn with_state(config: Config, lanes: Lanes, threads: usize, state: Checkpoint) -> Training {
        let rollout = Rollout::new(&config, lanes.sizes());
        let (collector, ppo) = (Collector::default(), Ppo::new(threads));
        Training { config, lanes, state, rollout, collector, ppo }
    }

    /// The state after the last complete update.
    pub fn state(&self) -> &Checkpoint {
        &self.state
    }

    /// Has the run made all its steps?
    pub fn is_complete(&self) -> bool {
        self.state.progress.steps >= self.config.steps
    }

    /// Collects a rollout and learns from it. If that is interrupted, the state is that before the update,
    /// and the run can only be resumed.
    pub fn update(&mut self, interrupted: &mut dyn FnMut() -> bool) -> Result<Record, TrainError> {
        let (begin, cpu) = (Instant::now(), CpuTimer::start());
        let updates = self.state.progress.updates;
        if updates.is_multiple_of(RESTART_INTERVAL) {
            self.restart_environments()?;
        }
        let Training { config, lanes, state, rollout, collector, ppo } = self;
        let (first_step, self_share) = (updates * config.horizon as u64, config.enemies.self_share());
        let draws = Draws { seed: config.seed, first_step, self_share };
        let mut league = state.league.clone(); // the state's stays if this update is interrupted
        let waited = collector.collect(lanes, &state.team.actor, &mut league, rollout, draws, interrupted)?;
        let learn_begin = Instant::now();
        let before = state.team.clone();
        let stats = ppo.update(&mut state.team, rollout, config, updates, state.progress.steps, interrupted);
        let stats = stats.map_err(|error| match error {
            UpdateError::Diverged(diverged) => TrainError::Diverged(diverged),
            UpdateError::Interrupted => {
                state.team = before;
                TrainError::Client(ClientError::Interrupted)
            }
        })?;
        let (learnt, elapsed) = (learn_begin.elapsed(), begin.elapsed());
        state.envs = lanes.save(&mut || false)?;
        state.recent.extend_from_slice(&rollout.episodes);
        state.recent.drain(..state.recent.len().saturating_sub(RECENT));
        state.progress.updates += 1;
        state.league = league;
        if let Enemies::SelfPlay(play) = config.enemies
            && play.copies_after(state.progress.updates)
        {
            let copy = Rival::new(state.progress.updates, state.team.actor.without_optimiser());
            state.league.add(copy, play.league_size);
        }
        state.progress.steps += rollout.steps();
        state.progress.episodes += rollout.episodes.len() as u64;
        state.progress.seconds += elapsed.as_secs_f64();
        state.progress.cpu_seconds += cpu.seconds();
        let share = |time: Duration| time.as_secs_f64() / elapsed.as_secs_f64();
        Ok(Record {
            stats,
            steps_per_s: rollout.steps() as f64 / elapsed.as_secs_f64(),
            wait_share: share(waited),
            learn_share: share(learnt),
            ..self.record()
        })
    }

    /// The state as a record, without an update.
    pub fn record(&self) -> Record {
        let Checkpoint { progress, recent, league, .. } = &self.state;
        let Progress { updates, steps, episodes, seconds, cpu_seconds } = *progress;
        let mean = |value: fn(&Ended) -> f64| recent.iter().map(value).sum::<f64>() / recent.len() as f64;
        Record {
            updates,
            steps,
            episodes,
            mean_return: mean(|ended| f64::from(ended.episode.episode_return)),
            win_rate: mean(won),
            mean_length: mean(|ended| f64::from(ended.episode.length)),
            stats: UpdateStats::default(),
            seconds,
            cpu_seconds,
            steps_per_s: 0.0,
            wait_share: 0.0,
            learn_share: 0.0,
            self_play: matches!(self.config.enemies, Enemies::SelfPlay(_)).then(|| SelfPlayRecord {
                win_rate_self: win_rate(recent, Against::Own),
                win_rate_league: win_rate(recent, Against::Rival),
                win_rate_attack_move: win_rate(recent, Against::Script),
                league_size: league.size() as u64,
            }),
        }
    }

    /// The copy that was made after the last update, if one was.
    pub fn new_copy(&self) -> Option<&Rival> {
        let Checkpoint { progress, league, .. } = &self.state;
        league.rivals.last().filter(|rival| rival.number > 0 && rival.number == progress.updates)
    }

    fn restart_environments(&mut self) -> Result<(), ClientError> {
        let updates = self.state.progress.updates;
        let counters = [updates / RESTART_INTERVAL, updates % RESTART_INTERVAL];
        let (first_step, self_share) =
            (updates * self.config.horizon as u64, self.config.enemies.self_share());
        for env in 0..self.state.league.players.len() {
            let mut generator = generator(self.config.seed, Purpose::Players, [first_step, env as u64]);
            self.state.league.draw(env, self_share, &mut generator);
        }
        self.lanes.reset(seed(self.config.seed, Purpose::Environments, counters))
    }
}

fn won(ended: &Ended) -> f64 {
    f64::from(u8::from(ended.episode.won))
}

/// Of the episodes against such enemies; NaN if there are none.
fn win_rate(recent: &[Ended], against: Against) -> f64 {
    let of_kind = || recent.iter().filter(|ended| ended.against == against);
    of_kind().map(won).sum::<f64>() / of_kind().count() as f64
}
