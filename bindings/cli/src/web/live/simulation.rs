//! Playing the log of an episode again, to the tick.

use super::battles::Battles;
use crate::web::protocol::{EpisodeResult, Steps};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_engine::{Battle, ExecutionOrder, RecordLayout, RecordSizes, Scratch, Sizes, Snapshot, Step};
use smaclite_view::page::{encode_moments, encode_step};
use smaclite_view::{Moment, Observer};

/// An episode as far as it was played again.
pub(super) struct Simulation {
    battle: Battle,
    observer: Observer,
    scratch: Scratch,
    /// Number of steps that are played.
    step: usize,
    newest: Option<Step>,
}

/// Why a log cannot be played: the pool is of another release, or does not keep its word.
#[derive(Debug, thiserror::Error)]
pub(super) enum SimulationError {
    #[error("the pool's snapshot does not fit its scenario: {0}")]
    Snapshot(#[from] smaclite_engine::SnapshotError),
    #[error("step {step} of the pool's log cannot be played: {error}")]
    Action { step: usize, error: smaclite_engine::IllegalAction },
}

impl Simulation {
    pub(super) fn new(battles: &Battles, start: &Snapshot) -> Result<Simulation, SimulationError> {
        let mut battle = Battle::new(battles.arena.clone(), 0);
        battle.restore(start)?;
        let observer = Observer::new(&battles.scenario, battle.units());
        Ok(Simulation { battle, observer, scratch: Scratch::new(), step: 0, newest: None })
    }

    pub(super) fn step(&self) -> usize {
        self.step
    }

    /// Plays on to a step, of the whole episode's actions.
    pub(super) fn play_to(&mut self, step: usize, actions: &[u16]) -> Result<(), SimulationError> {
        while self.step < step {
            self.play(actions, |_| {})?;
        }
        Ok(())
    }

    /// Plays up to `n_steps` more steps, and encodes them for the page. The number and the end of the episode
    /// are left to the caller.
    pub(super) fn encode(&mut self, n_steps: usize, actions: &[u16]) -> Result<Steps, SimulationError> {
        let first = self.step;
        let n_agents = self.battle.arena().sizes().n_agents;
        let end = (actions.len() / n_agents).min(first + n_steps);
        let mut moments = Vec::new();
        if first == 0 {
            moments.push(self.observer.moment().clone());
        }
        let mut decisions = Vec::new();
        while self.step < end {
            encode_step(&self.battle, actions_of(actions, self.step, n_agents), &mut decisions);
            self.play(actions, |moment| moments.push(moment.clone()))?;
        }
        Ok(Steps {
            number: 0,
            step: first,
            steps: self.step - first,
            n_moments: moments.len(),
            moments: STANDARD.encode(encode_moments(&moments)),
            decisions: STANDARD.encode(&decisions),
            episode_return: self.battle.episode_return(),
            length: self.battle.episode_length(),
            result: self.newest.and_then(result),
            is_over: false,
        })
    }

    fn play(&mut self, actions: &[u16], mut see: impl FnMut(&Moment)) -> Result<(), SimulationError> {
        let n_agents = self.battle.arena().sizes().n_agents;
        let actions = actions_of(actions, self.step, n_agents);
        let actions = actions.iter().map(|&action| action.into()).collect::<Vec<i32>>();
        let (order, observer) = (ExecutionOrder::Drawn, &mut self.observer);
        let observe = |tick: smaclite_engine::Tick<'_>| see(observer.observe(tick.units));
        let played = self.battle.step_observed(&actions, order, &mut self.scratch, observe);
        self.newest = Some(played.map_err(|error| SimulationError::Action { step: self.step, error })?);
        self.step += 1;
        Ok(())
    }

    /// The present state as a record, with the last joint actions, `n_past` at most, of the whole episode's.
    pub(super) fn record(&self, n_past: usize, actions: &[u16]) -> Vec<u8> {
        let Sizes { n_agents, n_enemies, .. } = self.battle.arena().sizes();
        let played = actions.chunks_exact(n_agents).take(self.step);
        let past: Vec<i32> = played.rev().take(n_past).flatten().map(|&action| action.into()).collect();
        let layout = RecordLayout::new(RecordSizes { n_agents, n_enemies, n_past });
        let mut record = vec![0; layout.size()];
        self.battle.write_record(&layout, &past, &mut record);
        record
    }

    /// What an agent observes now.
    pub(super) fn observation(&mut self, agent: usize) -> Vec<f32> {
        let sizes = self.battle.arena().sizes();
        let mut all = vec![0.0; sizes.n_agents * sizes.obs_size];
        self.battle.write_obs(&mut all, &mut self.scratch);
        all.chunks(sizes.obs_size).nth(agent).unwrap_or_default().to_vec()
    }
}

fn actions_of(actions: &[u16], step: usize, n_agents: usize) -> &[u16] {
    actions.chunks_exact(n_agents).nth(step).unwrap_or_default()
}

/// How an episode ended, if the step ended it.
fn result(step: Step) -> Option<EpisodeResult> {
    match step {
        Step { battle_won: true, .. } => Some(EpisodeResult::Won),
        Step { terminated: true, .. } => Some(EpisodeResult::Lost),
        Step { truncated: true, .. } => Some(EpisodeResult::Truncated),
        _ => None,
    }
}
