//! Following one environment for one page: its log, and the episode that is shown.

use super::battles::Battles;
use super::episodes::{Episode, Episodes};
use crate::web::protocol::{EpisodeInfo, SnapshotFile, Steps};
use crate::web::simulation::{Simulation, SimulationError};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_ipc::{Follower, Piece, RuntimeDir, WaitOptions};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Episodes in the list that a page gets.
const LISTED: usize = 40;

/// For how long a page waits, per list, for episodes that are played to learn how they ended.
const JUDGING: Duration = Duration::from_millis(20);

/// Steps in one response: four seconds at the highest speed of the page.
const STEPS_PER_RESPONSE: usize = 128;

pub(super) struct Follow {
    follower: Follower,
    battles: Arc<Battles>,
    episodes: Episodes,
    /// The episode that is shown, as far as the page has it.
    shown: Option<(u64, Simulation)>,
    /// An episode at the step whose observations or snapshot were requested last.
    observed: Option<(u64, Simulation)>,
}

#[derive(Debug, thiserror::Error)]
pub(super) enum FollowError {
    #[error("no environment is followed")]
    Nothing,
    #[error("episode {0} is not in the log any more")]
    Forgotten(u64),
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    #[error("step {step} is not in the log; episode {number} has {steps}")]
    NoSuchStep { number: u64, step: usize, steps: usize },
    #[error("agent must be below {n_agents}, got {agent}")]
    NoSuchAgent { agent: usize, n_agents: usize },
}

impl Follow {
    pub(super) fn connect(
        runtime_dir: &RuntimeDir,
        pool: &str,
        lane: &str,
        env: usize,
        battles: Arc<Battles>,
    ) -> Result<Follow, String> {
        let follower = Follower::connect(runtime_dir, pool, Some(lane), &[env], WaitOptions::for_response());
        let follower = follower.map_err(|error| error.to_string())?;
        Ok(Follow { follower, battles, episodes: Episodes::default(), shown: None, observed: None })
    }

    /// Reads what happened.
    pub(super) fn read(&mut self) -> Result<(), String> {
        loop {
            let piece = self.follower.read(WaitOptions::for_response());
            let Piece { parts, more } = piece.map_err(|error| error.to_string())?;
            parts.into_iter().for_each(|followed| self.episodes.add(followed));
            if !more {
                break;
            }
        }
        self.episodes.trim(self.shown.as_ref().map(|(number, _)| *number));
        Ok(())
    }

    /// Plays episodes that are over to their ends, the newest first: the log has no results. Those that do
    /// not fit the time are left to the next list.
    fn judge(&mut self) {
        let end = Instant::now() + JUDGING;
        while let Some(episode) = self.episodes.unjudged(LISTED) {
            episode.is_judged = true;
            let Battles { scenario, arena, .. } = &*self.battles;
            let steps = steps_of(episode, &self.battles);
            // One that cannot be played says why when it is opened.
            episode.result =
                Simulation::new(scenario, arena, &episode.start).ok().and_then(|mut simulation| {
                    simulation.play_to(steps, &episode.actions).ok()?;
                    simulation.result()
                });
            if Instant::now() > end {
                break;
            }
        }
    }

    /// The newest episodes, and the one that is shown.
    pub(super) fn list(&mut self) -> Vec<EpisodeInfo> {
        self.judge();
        let shown = self.shown.as_ref().map(|(number, _)| *number);
        let row = |(i, episode): (usize, &Episode)| {
            (i < LISTED || Some(episode.number) == shown).then(|| EpisodeInfo {
                number: episode.number,
                steps: steps_of(episode, &self.battles),
                first_step: episode.start.episode_length,
                is_over: episode.is_over,
                result: episode.result,
                began_s: episode.began.elapsed().as_secs_f64(),
                newest_s: episode.newest.elapsed().as_secs_f64(),
            })
        };
        self.episodes.recent().enumerate().filter_map(row).collect()
    }

    /// Steps of an episode, from one on, as moments and decisions.
    pub(super) fn steps(&mut self, number: u64, step: usize) -> Result<Steps, FollowError> {
        let episode = self.episodes.get(number).ok_or(FollowError::Forgotten(number))?;
        let simulation = at_step(&mut self.shown, &self.battles, episode, step)?;
        let played = simulation.encode(STEPS_PER_RESPONSE, &episode.actions)?;
        let is_over = episode.is_over && simulation.step() == steps_of(episode, &self.battles);
        Ok(Steps { number, is_over, ..played })
    }

    /// What an agent observes before a step.
    pub(super) fn observation(
        &mut self,
        number: u64,
        step: usize,
        agent: usize,
    ) -> Result<Vec<f32>, FollowError> {
        let n_agents = self.battles.arena.sizes().n_agents;
        if agent >= n_agents {
            return Err(FollowError::NoSuchAgent { agent, n_agents });
        }
        let episode = self.episodes.get(number).ok_or(FollowError::Forgotten(number))?;
        let simulation = at_step(&mut self.observed, &self.battles, episode, step)?;
        Ok(simulation.observation(agent))
    }

    /// The state before a step, as a file that environments of this lane restore.
    pub(super) fn snapshot(&mut self, number: u64, step: usize) -> Result<SnapshotFile, FollowError> {
        let Battles { scenario, n_past, .. } = &*self.battles;
        let episode = self.episodes.get(number).ok_or(FollowError::Forgotten(number))?;
        let simulation = at_step(&mut self.observed, &self.battles, episode, step)?;
        let record = STANDARD.encode(simulation.record(*n_past, &episode.actions));
        let played = episode.start.episode_length as usize + step;
        Ok(SnapshotFile { name: format!("{}-step{played}.snapshot", scenario.name), record })
    }
}

fn steps_of(episode: &Episode, battles: &Battles) -> usize {
    episode.actions.len() / battles.arena.sizes().n_actors()
}

/// The simulation of an episode at a step: the one in the slot, played on, or a new one.
fn at_step<'a>(
    slot: &'a mut Option<(u64, Simulation)>,
    battles: &Battles,
    episode: &Episode,
    step: usize,
) -> Result<&'a mut Simulation, FollowError> {
    let (number, steps) = (episode.number, steps_of(episode, battles));
    if step > steps {
        return Err(FollowError::NoSuchStep { number, step, steps });
    }
    let present = slot.take().filter(|(other, simulation)| *other == number && simulation.step() <= step);
    let mut simulation = match present {
        Some((_, simulation)) => simulation,
        None => Simulation::new(&battles.scenario, &battles.arena, &episode.start)?,
    };
    simulation.play_to(step, &episode.actions)?;
    Ok(&mut slot.insert((number, simulation)).1)
}
