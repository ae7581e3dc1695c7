//! A run in memory: from first weights or a checkpoint, update after update.
//!
//! All environments restart every [`RESTART_INTERVAL`] updates, with seeds that the run's seed decides.
//! Between restarts a run is resumed from snapshots of its environments.

use crate::checkpoint::{Checkpoint, Progress};
use crate::collect::{Draws, Playing, collect};
use crate::config::{Config, ConfigError, Enemies};
use crate::cpu_timer::CpuTimer;
use crate::enemy_actor::BothActors;
use crate::lane_error::LaneError;
use crate::lanes::{Lanes, SavedEnvs};
use crate::league::{League, Rival};
use crate::ppo::{Diverged, Played, Ppo, UpdateError, UpdateStats};
use crate::random::{Purpose, generator, seed};
use crate::rollout::{Against, Ended, Recent, Rollout};
use crate::team::{Network, OnScenario, Team};
use crate::tensors::FileError;
use smaclite_ipc::ClientError;
use std::borrow::Cow;
use std::collections::HashSet;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Updates between two restarts of the environments.
const RESTART_INTERVAL: u64 = 32;

/// How many episodes per map the statistics of a record are about.
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
    #[error(
        "`{}` already holds a run; continue the runs in `{}` with --resume, also with more --seeds, or \
         choose another folder", run.display(), folder.display()
    )]
    SeedsInFolder {
        run: PathBuf,
        folder: PathBuf,
    },
    #[error(
        "the folder of the team that is to play the enemies, `{}`, must have a name that is text in \
         UTF-8, as run.json names it", .0.display()
    )]
    NotText(PathBuf),
    #[error("`{folder}` has made {made} steps: --steps must be at least that many, got {given}")]
    FewerSteps {
        folder: String,
        given: u64,
        made: u64,
    },
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
    maps: Vec<MapOfRun>,
    state: Checkpoint,
    ppo: Ppo,
}

/// What a run plays on a map.
struct MapOfRun {
    lanes: Lanes,
    rollout: Rollout,
    /// By lane.
    actors: Vec<BothActors>,
    on_scenario: Option<OnScenario>,
    /// Of environments, actions and the order of samples; that of the run on the first map.
    seed: u64,
}

impl MapOfRun {
    fn new(config: &Config, number: usize, lanes: Lanes) -> Result<MapOfRun, TrainError> {
        // A run has so many environments on all its maps together.
        let of_map = Config { num_envs: lanes.num_envs(), ..config.clone() };
        let lanes = lanes.for_run(&of_map)?;
        lanes.inputs().check(config)?;
        Ok(MapOfRun {
            rollout: Rollout::new(&of_map, lanes.sizes()),
            actors: Vec::new(),
            on_scenario: OnScenario::new(config, lanes.inputs()),
            seed: if number == 0 {
                config.seed
            } else {
                seed(config.seed, Purpose::Maps, [number as u64, 0])
            },
            lanes,
        })
    }
}

/// What an update did, and how far the run is. Statistics of episodes are of the newest 200, or 200 times the
/// number of maps; they are NaN before the first episode has ended.
#[derive(Clone, Debug, PartialEq)]
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
    /// The win rates by map, of the same episodes; none if there is one map.
    pub win_rates: Vec<(String, f64)>,
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
    pub fn columns(&self) -> Vec<(Cow<'static, str>, f64)> {
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
        let columns = columns.into_iter().map(|(name, value)| (Cow::Borrowed(name), value));
        let of_map = |(map, rate): &(String, f64)| (Cow::Owned(format!("win_rate_{map}")), *rate);
        columns.chain(self.win_rates.iter().map(of_map)).collect()
    }
}

impl Training {
    /// Begins a run on the lanes of each of its maps. `rival` plays the enemies if those are a trained
    /// team's.
    pub fn new(
        config: Config,
        lanes: Vec<Lanes>,
        threads: usize,
        rival: Option<Network>,
    ) -> Result<Training, TrainError> {
        config.check()?;
        let maps = Training::maps(&config, lanes)?;
        let team = Team::new(&config, maps[0].lanes.inputs());
        let rivals = rival.map(|actor| Rival::new(0, actor)).into_iter().collect();
        let league = match config.enemies {
            Enemies::Scripts => League::default(),
            Enemies::Team { .. } | Enemies::SelfPlay(_) => League::new(config.num_envs, rivals),
        };
        let (progress, recent) = (Progress::default(), Vec::new());
        let state = Checkpoint { team, progress, recent, envs: None, league };
        Ok(Training { config, maps, state, ppo: Ppo::new(threads) })
    }

    /// Continues a run on the lanes of its configuration, in the states of the checkpoint's environments. If
    /// it has none, because a lane did not serve snapshots, or if one of these lanes does not, the
    /// environments begin new episodes.
    pub fn resume(
        config: Config,
        lanes: Vec<Lanes>,
        threads: usize,
        state: Checkpoint,
    ) -> Result<Training, TrainError> {
        config.check()?;
        let maps = Training::maps(&config, lanes)?;
        let mut training = Training { config, maps, state, ppo: Ppo::new(threads) };
        let Training { maps, state, .. } = &mut training;
        let counts = |envs: &[SavedEnvs]| envs.iter().map(|envs| envs.over.len()).collect::<Vec<_>>();
        let num_envs: Vec<usize> = maps.iter().map(|map| map.lanes.num_envs()).collect();
        match &state.envs {
            Some(envs) if counts(envs) != num_envs => {
                let (given, expected) = (num_envs, counts(envs));
                return Err(LaneError::EnvsOfMaps { given, expected }.into());
            }
            Some(envs) if maps.iter().all(|map| map.lanes.are_saved()) => {
                for (map, envs) in maps.iter_mut().zip(envs) {
                    map.lanes.restore(envs).map_err(TrainError::NotRestored)?;
                }
            }
            _ => training.restart_environments()?,
        }
        Ok(training)
    }

    fn maps(config: &Config, lanes: Vec<Lanes>) -> Result<Vec<MapOfRun>, TrainError> {
        let (given, expected) = (lanes.iter().map(Lanes::num_envs).sum(), config.num_envs);
        if given != expected {
            return Err(LaneError::NumEnvs { given, expected }.into());
        }
        let mut names = HashSet::new();
        if let Some(map) = lanes.iter().find(|map| !names.insert(map.scenario())) {
            return Err(LaneError::SameName { name: map.scenario().to_owned() }.into());
        }
        lanes.into_iter().enumerate().map(|(number, lanes)| MapOfRun::new(config, number, lanes)).collect()
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
        let Training { config, maps, state, ppo } = self;
        let (first_step, self_share) = (updates * config.horizon as u64, config.enemies.self_share());
        let mut league = state.league.clone(); // the state's stays if this update is interrupted
        let playing = maps.iter_mut().map(|MapOfRun { lanes, rollout, actors, on_scenario, seed }| {
            let team =
                on_scenario.as_mut().map_or(&state.team, |on_scenario| on_scenario.specialise(&state.team));
            let draws = Draws { seed: *seed, first_step, self_share };
            Playing { actors, lanes, network: &team.actor, rollout, draws }
        });
        let waited = collect(&mut playing.collect::<Vec<_>>(), &mut league, interrupted)?;
        let learn_begin = Instant::now();
        let before = state.team.clone();
        let played = maps.iter_mut().map(|MapOfRun { rollout, on_scenario, seed, .. }| Played {
            rollout,
            on_scenario: on_scenario.as_mut(),
            seed: *seed,
        });
        let (played, steps) = (played.collect(), state.progress.steps);
        let stats = ppo.update(&mut state.team, played, config, updates, steps, interrupted);
        let stats = stats.map_err(|error| match error {
            UpdateError::Diverged(diverged) => TrainError::Diverged(diverged),
            UpdateError::Interrupted => {
                state.team = before;
                TrainError::Client(ClientError::Interrupted)
            }
        })?;
        let (learnt, elapsed) = (learn_begin.elapsed(), begin.elapsed());
        let saved = maps.iter_mut().map(|map| map.lanes.save(&mut || false));
        state.envs = saved.collect::<Result<Option<Vec<_>>, _>>()?;
        let rollouts = || maps.iter().map(|map| &map.rollout);
        for (map, rollout) in (0..).zip(rollouts()) {
            state.recent.extend(rollout.episodes.iter().map(|ended| Recent { ended: *ended, map }));
        }
        keep_newest(&mut state.recent, maps.len());
        state.progress.updates += 1;
        state.league = league;
        if let Enemies::SelfPlay(play) = config.enemies
            && play.copies_after(state.progress.updates)
        {
            let copy = Rival::new(state.progress.updates, state.team.actor.without_optimiser());
            state.league.add(copy, play.league_size);
        }
        let steps = rollouts().map(Rollout::steps).sum::<u64>();
        state.progress.steps += steps;
        state.progress.episodes += rollouts().map(|rollout| rollout.episodes.len() as u64).sum::<u64>();
        state.progress.seconds += elapsed.as_secs_f64();
        state.progress.cpu_seconds += cpu.seconds();
        let share = |time: Duration| time.as_secs_f64() / elapsed.as_secs_f64();
        Ok(Record {
            stats,
            steps_per_s: steps as f64 / elapsed.as_secs_f64(),
            wait_share: share(waited),
            learn_share: share(learnt),
            ..self.record()
        })
    }

    /// The state as a record, without an update.
    pub fn record(&self) -> Record {
        let Checkpoint { progress, recent, league, .. } = &self.state;
        let Progress { updates, steps, episodes, seconds, cpu_seconds } = *progress;
        let mean = |value: fn(&Ended) -> f64| mean(recent.iter().map(|recent| value(&recent.ended)));
        let of_map = |(number, map): (usize, &MapOfRun)| {
            let of_map = recent.iter().filter(|recent| recent.map == number as u64);
            (map.lanes.scenario().to_owned(), self::mean(of_map.map(|recent| won(&recent.ended))))
        };
        let is_one = self.maps.len() == 1;
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
            win_rates: self.maps.iter().enumerate().filter(|_| !is_one).map(of_map).collect(),
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
        let seed_of = |map: &MapOfRun| seed(map.seed, Purpose::Environments, counters);
        self.maps.iter_mut().try_for_each(|map| map.lanes.reset(seed_of(map)))
    }
}

/// Keeps the newest episodes of each map: those of maps with short battles would push out the others.
fn keep_newest(recent: &mut Vec<Recent>, n_maps: usize) {
    let mut counts = vec![0; n_maps];
    recent.reverse();
    recent.retain(|recent| {
        let Some(count) = counts.get_mut(recent.map as usize) else { return false };
        *count += 1;
        *count <= RECENT
    });
    recent.reverse();
}

/// NaN of nothing.
fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().sum::<f64>() / values.count() as f64
}

fn won(ended: &Ended) -> f64 {
    f64::from(u8::from(ended.episode.won))
}

/// Of the episodes against such enemies; NaN if there are none.
fn win_rate(recent: &[Recent], against: Against) -> f64 {
    mean(recent.iter().map(|recent| &recent.ended).filter(|ended| ended.against == against).map(won))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rollout::Episode;

    /// Those of a map with short battles pushed out the others.
    #[test]
    fn every_map_has_its_newest_episodes() {
        let of_map = |(map, length): (u64, i32)| {
            let episode = Episode { episode_return: 0.0, length, won: false };
            Recent { ended: Ended { episode, against: Against::Script }, map }
        };
        let ended = (0..300).map(|length| (0, length)).chain((0..40).map(|length| (2, length)));
        let mut recent: Vec<Recent> = ended.map(of_map).collect();
        keep_newest(&mut recent, 3);
        let kept: Vec<_> = recent.iter().map(|recent| (recent.map, recent.ended.episode.length)).collect();
        let expected = (100..300).map(|length| (0, length)).chain((0..40).map(|length| (2, length)));
        assert_eq!(kept, expected.collect::<Vec<_>>());
    }
}
