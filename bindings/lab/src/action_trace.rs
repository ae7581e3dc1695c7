//! Battles with actions that were chosen beforehand, so that only stepping is measured. Equal seeds and
//! actions give equal battles.

use smaclite_engine::{Arena, Battle, Faction, Scratch, TICKS_PER_STEP};
use std::hint::black_box;
use std::sync::Arc;

/// What the step after the end of an episode does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AfterEpisode {
    /// It resets the battle and ignores the actions: next-step autoreset, the default of a pool.
    Reset,
    /// It resets the battle and then plays the actions.
    ResetAndPlay,
}

/// The actions of one battle from its seed on.
pub struct ActionTrace {
    seed: u64,
    n_agents: usize,
    after_episode: AfterEpisode,
    /// `[length, n_agents]`.
    actions: Vec<i32>,
    played: u64,
    unit_ticks: u64,
}

impl ActionTrace {
    /// Plays `length` steps of a battle with this seed and the actions that `choose` writes, one per agent.
    ///
    /// # Panics
    /// If it chooses an unavailable action.
    pub fn new(
        arena: &Arc<Arena>,
        seed: u64,
        length: usize,
        after_episode: AfterEpisode,
        mut choose: impl FnMut(&Battle, &mut [i32]),
    ) -> ActionTrace {
        let sizes = arena.sizes();
        let mut battle = Battle::new(Arc::clone(arena), seed);
        let mut scratch = Scratch::new();
        let mut row = vec![0; sizes.n_agents];
        let actions = Vec::with_capacity(length * sizes.n_agents);
        let mut trace =
            ActionTrace { seed, n_agents: sizes.n_agents, after_episode, actions, played: 0, unit_ticks: 0 };
        for _ in 0..length {
            if begin_step(&mut battle, after_episode) {
                choose(&battle, &mut row);
                let living = sizes.n_units() - battle.dead_allies() - battle.dead_enemies();
                trace.unit_ticks += (living * TICKS_PER_STEP) as u64;
                trace.played += 1;
                battle.step(&row, &mut scratch).expect("chosen actions are available");
            }
            trace.actions.extend_from_slice(&row);
        }
        trace
    }

    /// The actions of each step, one per agent.
    pub fn steps(&self) -> impl Iterator<Item = &[i32]> {
        self.actions.chunks_exact(self.n_agents)
    }

    /// The actions of step `index`, one per agent.
    pub fn step(&self, index: usize) -> &[i32] {
        &self.actions[index * self.n_agents..(index + 1) * self.n_agents]
    }

    /// Steps that play their actions: all but those that only reset.
    pub fn played(&self) -> u64 {
        self.played
    }

    /// Units alive at the start of each played step, times the ticks of a step, summed.
    pub fn unit_ticks(&self) -> u64 {
        self.unit_ticks
    }
}

/// Resets a battle that has ended. Does the step play its actions?
fn begin_step(battle: &mut Battle, after_episode: AfterEpisode) -> bool {
    if !battle.is_over() {
        return true;
    }
    battle.reset();
    after_episode == AfterEpisode::ResetAndPlay
}

/// Plays traces, and writes after each step everything that a pool would write.
pub struct TracePlayer {
    battle: Battle,
    obs: Vec<f32>,
    state: Vec<f32>,
    avail: Vec<u8>,
    alive: Vec<u8>,
}

impl TracePlayer {
    /// A player of traces that were recorded in this arena.
    pub fn new(arena: Arc<Arena>) -> TracePlayer {
        let sizes = arena.sizes();
        TracePlayer {
            battle: Battle::new(arena, 0),
            obs: vec![0.0; sizes.n_agents * sizes.obs_size],
            state: vec![0.0; sizes.state_size],
            avail: vec![0; sizes.n_agents * sizes.n_actions],
            alive: vec![0; sizes.n_agents],
        }
    }

    /// Goes to the start of a trace.
    pub fn rewind(&mut self, trace: &ActionTrace) {
        self.battle.reseed(trace.seed);
        self.battle.forget_episodes();
        self.battle.reset();
    }

    /// The battle as it is.
    pub fn battle(&self) -> &Battle {
        &self.battle
    }

    /// Resets the battle.
    pub fn reset(&mut self) {
        self.battle.reset();
    }

    /// Plays one step of a trace.
    ///
    /// # Panics
    /// If an action is not available.
    pub fn step(&mut self, actions: &[i32], after_episode: AfterEpisode, scratch: &mut Scratch) {
        if begin_step(&mut self.battle, after_episode) {
            let step = self.battle.step(actions, scratch);
            black_box(step.expect("recorded actions are available").reward);
        }
        self.battle.write_obs(Faction::Ally, &mut self.obs, scratch);
        self.battle.write_state(Faction::Ally, &mut self.state);
        self.battle.write_avail_actions(Faction::Ally, &mut self.avail);
        self.battle.write_alive(Faction::Ally, &mut self.alive);
        black_box((&self.obs, &self.state, &self.avail, &self.alive));
    }

    /// Plays all of a trace.
    ///
    /// # Panics
    /// If an action is not available: the trace is of another arena.
    pub fn play(&mut self, trace: &ActionTrace, scratch: &mut Scratch) {
        self.rewind(trace);
        for actions in trace.steps() {
            self.step(actions, trace.after_episode, scratch);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use smaclite_engine::{Rules, policy};
    use smaclite_scenarios::Scenario;

    /// `played` and `unit_ticks` are what rates are computed from: counted wrongly, every result is wrong.
    #[test]
    fn only_played_steps_are_counted() {
        let scenario = Scenario::standard("2s3z").expect("a standard scenario");
        let arena = Arc::new(Arena::new(&scenario, Rules::default()));
        for randomly in [false, true] {
            let with = |after_episode| {
                let mut random = policy::Random::new(1);
                ActionTrace::new(&arena, 1, 300, after_episode, |battle, actions| match randomly {
                    false => policy::nearest(battle, actions),
                    true => random.act(battle, actions),
                })
            };
            let [resetting, playing] = [AfterEpisode::Reset, AfterEpisode::ResetAndPlay].map(with);
            assert_eq!((resetting.steps().count(), playing.steps().count()), (300, 300));
            assert_eq!(playing.played(), 300);
            let mut battle = Battle::new(Arc::clone(&arena), 1);
            let mut scratch = Scratch::new();
            let (mut resets, mut unit_ticks) = (0, 0);
            for actions in resetting.steps() {
                if battle.is_over() {
                    battle.reset();
                    resets += 1;
                } else {
                    let dead = battle.dead_allies() + battle.dead_enemies();
                    unit_ticks += ((arena.sizes().n_units() - dead) * TICKS_PER_STEP) as u64;
                    battle.step(actions, &mut scratch).expect("available actions");
                }
            }
            assert!(resets > 0, "no episode ended");
            assert_eq!((resetting.played(), resetting.unit_ticks()), (300 - resets, unit_ticks));
        }
    }
}
