//! Playing an episode that a pool logged by its actions, to the tick.

use super::protocol::Steps;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use smaclite_engine::{
    Arena, Battle, ExecutionOrder, Faction, RecordLayout, RecordSizes, Scratch, Snapshot, Step,
};
use smaclite_scenarios::Scenario;
use smaclite_view::page::{encode_moments, encode_step};
use smaclite_view::{EpisodeResult, Moment, Observer};
use std::sync::Arc;

/// An episode as far as it was played.
pub(super) struct Simulation {
    battle: Battle,
    observer: Observer,
    scratch: Scratch,
    /// Number of steps that are played.
    step: usize,
    newest: Option<Step>,
}

/// Why actions cannot be played: the pool that logged them is of another release, or does not keep its word.
#[derive(Debug, thiserror::Error)]
pub(super) enum SimulationError {
    #[error("the snapshot does not fit its scenario: {0}")]
    Snapshot(#[from] smaclite_engine::SnapshotError),
    #[error("step {step} cannot be played: {error}")]
    Action { step: usize, error: smaclite_engine::IllegalAction },
}

impl Simulation {
    pub(super) fn new(
        scenario: &Scenario,
        arena: &Arc<Arena>,
        start: &Snapshot,
    ) -> Result<Simulation, SimulationError> {
        let mut battle = Battle::new(Arc::clone(arena), 0);
        battle.restore(start)?;
        let observer = Observer::new(scenario, &battle);
        Ok(Simulation { battle, observer, scratch: Scratch::new(), step: 0, newest: None })
    }

    pub(super) fn step(&self) -> usize {
        self.step
    }

    /// How the last step that was played ended the episode, if it did.
    pub(super) fn result(&self) -> Option<EpisodeResult> {
        self.newest.as_ref().and_then(EpisodeResult::after)
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
        let n_actors = self.battle.arena().sizes().n_actors();
        let end = (actions.len() / n_actors).min(first + n_steps);
        let mut moments = Vec::new();
        if first == 0 {
            moments.push(self.observer.moment().clone());
        }
        let mut decisions = Vec::new();
        while self.step < end {
            encode_step(&self.battle, actions_of(actions, self.step, n_actors), &mut decisions);
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
            result: self.result(),
            is_over: false,
        })
    }

    fn play(&mut self, actions: &[u16], mut see: impl FnMut(&Moment)) -> Result<(), SimulationError> {
        let n_actors = self.battle.arena().sizes().n_actors();
        let actions = actions_of(actions, self.step, n_actors);
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
        let sizes = self.battle.arena().sizes();
        let played = actions.chunks_exact(sizes.n_actors()).take(self.step);
        let past: Vec<i32> = played.rev().take(n_past).flatten().map(|&action| action.into()).collect();
        let layout = RecordLayout::new(RecordSizes::new(&sizes, n_past));
        let mut record = vec![0; layout.size()];
        self.battle.write_record(&layout, &past, &mut record);
        record
    }

    /// What an agent observes now.
    pub(super) fn observation(&mut self, agent: usize) -> Vec<f32> {
        let sizes = self.battle.arena().sizes();
        let mut all = vec![0.0; sizes.n_agents * sizes.obs_size];
        self.battle.write_obs(Faction::Ally, &mut all, &mut self.scratch);
        all.chunks(sizes.obs_size).nth(agent).unwrap_or_default().to_vec()
    }
}

fn actions_of(actions: &[u16], step: usize, n_actors: usize) -> &[u16] {
    actions.chunks_exact(n_actors).nth(step).unwrap_or_default()
}
