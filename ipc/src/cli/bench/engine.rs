//! One bare battle on one thread, with everything that a pool would write.

use super::replay::Replay;
use super::{Measured, Task, resident_bytes};
use smaclite_engine::{Arena, Battle, Rules, Scratch};
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Long enough for several episodes of every standard scenario.
const STEPS: usize = 1000;

pub(super) fn measure(task: &Task<'_>) -> Measured {
    let arena = Arc::new(Arena::new(task.scenario, Rules::default()));
    let replay = Replay::record(&arena, 1, STEPS, task.policy);
    let mut writer = Writer::new(arena);
    writer.play(&replay); // warm caches and scratch memory
    let begin = Instant::now();
    let mut passes = 0;
    while passes == 0 || begin.elapsed() < task.time {
        writer.play(&replay);
        passes += 1;
    }
    Measured {
        steps: replay.steps() * passes,
        unit_ticks: replay.unit_ticks * passes,
        time: begin.elapsed().max(Duration::from_nanos(1)),
        rss_bytes: resident_bytes(std::process::id()),
    }
}

struct Writer {
    battle: Battle,
    scratch: Scratch,
    obs: Vec<f32>,
    state: Vec<f32>,
    avail: Vec<u8>,
    alive: Vec<u8>,
}

impl Writer {
    fn new(arena: Arc<Arena>) -> Writer {
        let s = arena.sizes();
        Writer {
            battle: Battle::new(arena, 1),
            scratch: Scratch::new(),
            obs: vec![0.0; s.n_agents * s.obs_size],
            state: vec![0.0; s.state_size],
            avail: vec![0; s.n_agents * s.n_actions],
            alive: vec![0; s.n_agents],
        }
    }

    fn play(&mut self, replay: &Replay) {
        self.battle.reseed(1);
        self.battle.reset();
        let n_agents = self.alive.len();
        for (row, reset) in replay.actions.chunks_exact(n_agents).zip(&replay.resets) {
            if *reset {
                self.battle.reset();
            } else {
                let step = self.battle.step(row, &mut self.scratch).expect("the replay is legal");
                black_box(step.reward);
            }
            self.battle.write_obs(&mut self.obs, &mut self.scratch);
            self.battle.write_state(&mut self.state);
            self.battle.write_avail_actions(&mut self.avail);
            self.battle.write_alive(&mut self.alive);
            black_box((&self.obs, &self.state, &self.avail, &self.alive));
        }
    }
}
