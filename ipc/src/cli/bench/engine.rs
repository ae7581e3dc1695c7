//! Bare battles on one thread, with everything that a pool would write: those of a pool's environments, but
//! each is played to its end before the next begins.

use super::replay::{Replay, SEED};
use super::{Measured, Task, resident_bytes};
use smaclite_engine::{Arena, Battle, Rules, Scratch};
use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

pub(super) fn measure(task: &Task<'_>) -> Result<Measured, Box<dyn Error>> {
    let arena = Arc::new(Arena::new(task.scenario, Rules::default()));
    let replays = Replay::of_pool(&arena, task.envs, task.policy);
    let mut writer = Writer::new(arena);
    writer.play(&replays); // warm caches and scratch memory
    let begin = Instant::now();
    let mut passes = 0;
    while passes == 0 || begin.elapsed() < task.time {
        writer.play(&replays);
        passes += 1;
        task.check_on()?;
    }
    Ok(Measured {
        steps: passes * replays.iter().map(Replay::steps).sum::<u64>(),
        unit_ticks: passes * replays.iter().map(|r| r.unit_ticks).sum::<u64>(),
        time: begin.elapsed().max(Duration::from_nanos(1)),
        rss_bytes: resident_bytes(std::process::id()),
    })
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
            battle: Battle::new(arena, SEED),
            scratch: Scratch::new(),
            obs: vec![0.0; s.n_agents * s.obs_size],
            state: vec![0.0; s.state_size],
            avail: vec![0; s.n_agents * s.n_actions],
            alive: vec![0; s.n_agents],
        }
    }

    fn play(&mut self, replays: &[Replay]) {
        replays.iter().zip(SEED..).for_each(|(replay, seed)| self.play_one(replay, seed));
    }

    fn play_one(&mut self, replay: &Replay, seed: u64) {
        self.battle.reseed(seed);
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
