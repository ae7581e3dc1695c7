//! What is measured: one battle, stepped by actions that were chosen beforehand, with everything written out
//! that a pool would write.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use smaclite_engine::{Arena, Battle, Rules, Scratch, TICKS_PER_STEP, policy};
use smaclite_scenarios::Scenario;

/// A battle with its actions and the memory that it writes to.
pub(crate) struct Play {
    start: Battle,
    /// `[steps, n_agents]`.
    actions: Vec<i32>,
    /// Living units at the begin of each step, times the ticks of a step, summed.
    pub(crate) unit_ticks: u64,
    scratch: Scratch,
    obs: Vec<f32>,
    state: Vec<f32>,
    avail: Vec<u8>,
    alive: Vec<u8>,
}

impl Play {
    /// Chooses the actions of that many steps. The policies are "nearest" and "random".
    pub(crate) fn record(scenario: &str, policy: &str, steps: usize) -> Result<Play, String> {
        let scenario = Scenario::resolve(scenario).map_err(|e| e.to_string())?;
        let start = Battle::new(Arc::new(Arena::new(&scenario, Rules::default())), 1);
        let sizes = start.arena().sizes();
        let mut random = policy::Random::new(1);
        let mut act = |battle: &Battle, row: &mut [i32]| match policy {
            "random" => random.act(battle, row),
            _ => policy::nearest(battle, row),
        };
        let mut play = Play {
            actions: Vec::with_capacity(steps * sizes.n_agents),
            unit_ticks: 0,
            scratch: Scratch::new(),
            obs: vec![0.0; sizes.n_agents * sizes.obs_size],
            state: vec![0.0; sizes.state_size],
            avail: vec![0; sizes.n_agents * sizes.n_actions],
            alive: vec![0; sizes.n_agents],
            start,
        };
        let mut battle = play.start.clone();
        let mut row = vec![0; sizes.n_agents];
        for _ in 0..steps {
            if battle.is_over() {
                battle.reset();
            }
            act(&battle, &mut row);
            let living = sizes.n_units() - battle.dead_allies() - battle.dead_enemies();
            play.unit_ticks += (living * TICKS_PER_STEP) as u64;
            play.actions.extend_from_slice(&row);
            battle.step(&row, &mut play.scratch).map_err(|e| e.to_string())?;
        }
        Ok(play)
    }

    pub(crate) fn steps(&self) -> usize {
        self.actions.len() / self.alive.len()
    }

    /// Plays all of it from the start. Not inlined: callgrind collects inside this function alone.
    #[inline(never)]
    pub(crate) fn play_measured(&mut self) {
        let mut battle = self.start.clone();
        for step in 0..self.steps() {
            self.step(&mut battle, step);
        }
    }

    /// Plays all of it from the start and keeps the shortest time that each step has taken so far, in
    /// nanoseconds: other programs may share the processor, and a step is over before they interrupt it more
    /// often than not.
    pub(crate) fn play_timed(&mut self, shortest: &mut [u64]) {
        let mut battle = self.start.clone();
        for (step, shortest) in shortest.iter_mut().enumerate() {
            let begin = Instant::now();
            self.step(&mut battle, step);
            *shortest = (*shortest).min(begin.elapsed().as_nanos() as u64);
        }
    }

    #[inline]
    fn step(&mut self, battle: &mut Battle, step: usize) {
        let n_agents = self.alive.len();
        if battle.is_over() {
            battle.reset();
        }
        let actions = &self.actions[step * n_agents..(step + 1) * n_agents];
        black_box(battle.step(actions, &mut self.scratch).is_ok());
        battle.write_obs(&mut self.obs, &mut self.scratch);
        battle.write_state(&mut self.state);
        battle.write_avail_actions(&mut self.avail);
        battle.write_alive(&mut self.alive);
        black_box((&self.obs, &self.state, &self.avail, &self.alive));
    }
}
