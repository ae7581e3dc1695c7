//! What a learner sees is what the games show when they are played one by one: for any number of threads, any
//! batch size, every autoreset mode, every way of waiting.

use crate::game::{Oddity, SIZES};
use crate::harness::{LaneSetup, Learner, Reference, Row, all, start, start_battles, start_waiting};
use crate::{MANY_THREADS, STEPS};
use smaclite_engine::policy::Random;
use smaclite_engine::{Arena, Battle, Rules, Scratch};
use smaclite_pool::fields::{Field, FieldSet};
use smaclite_pool::{Autoreset, WaitStrategy};
use smaclite_scenarios::Scenario;
use std::sync::Arc;

const MODES: [Autoreset; 3] = [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled];

/// A learner, and what it should see of each environment next.
struct Play {
    setup: LaneSetup,
    learner: Learner,
    reference: Reference,
    expected: Vec<Option<Row>>,
}

/// Plays a lane for a while and compares every row.
fn check(setup: LaneSetup, threads: usize, wait: WaitStrategy) {
    let what = format!("{threads} threads, batches of {}, {:?}", setup.batch_size, setup.autoreset);
    let (_pool, mut learners) = start_waiting(wait, threads, &[setup], |_, _| Oddity::default());
    let expected = vec![None; setup.num_envs];
    let mut play = Play { setup, learner: learners.remove(0), reference: Reference::new(setup), expected };
    play.reset(&all(setup.num_envs), Some(7));
    for _ in 0..STEPS * setup.num_envs / setup.batch_size {
        let rows = play.learner.batch();
        play.compare(&rows, &what);
        play.answer(&rows);
    }
}

impl Play {
    fn compare(&mut self, rows: &[Row], what: &str) {
        for (slot, row) in rows.iter().enumerate() {
            let env = row.env as usize;
            assert!(!self.is_synchronous() || env == slot, "{what}: slot {slot} is environment {env}");
            let expected = self.expected[env].take();
            assert_eq!(expected.as_ref(), Some(row), "{what}");
        }
    }

    /// Steps who goes on, and resets who does not where nothing else does it.
    fn answer(&mut self, rows: &[Row]) {
        let by_hand = self.setup.autoreset == Autoreset::Disabled;
        let (ended, going): (Vec<&Row>, Vec<&Row>) = rows.iter().partition(|row| by_hand && row.ended());
        if !ended.is_empty() {
            self.reset(&ended.iter().map(|row| row.env).collect::<Vec<_>>(), None);
            if self.is_synchronous() {
                // The others come along, as they are; all are stepped next time.
                going
                    .iter()
                    .for_each(|r| self.expected[r.env as usize] = Some(self.reference.observe(r.env)));
                return;
            }
        }
        if !going.is_empty() {
            self.step(&going);
        }
    }

    fn reset(&mut self, env_ids: &[i32], seed: Option<u64>) {
        env_ids.iter().for_each(|e| self.expected[*e as usize] = Some(self.reference.reset(*e, seed)));
        self.learner.send_reset(seed, env_ids, self.setup.num_envs);
    }

    fn step(&mut self, rows: &[&Row]) {
        let env_ids: Vec<_> = rows.iter().map(|row| row.env).collect();
        let actions: Vec<_> = rows.iter().flat_map(|row| row.legal_actions()).collect();
        for (env, actions) in env_ids.iter().zip(actions.chunks(SIZES.n_agents)) {
            self.expected[*env as usize] = Some(self.reference.step(*env, actions));
        }
        self.learner.send_step(&env_ids, &actions);
    }

    fn is_synchronous(&self) -> bool {
        self.setup.batch_size == self.setup.num_envs
    }
}

#[test]
fn a_learner_sees_the_same_bits_for_every_number_of_threads_batch_size_and_mode() {
    for autoreset in MODES {
        for threads in 1..=MANY_THREADS {
            for batch_size in [5, 2, 1] {
                check(
                    LaneSetup { batch_size, autoreset, ..LaneSetup::new(5) },
                    threads,
                    WaitStrategy::default(),
                );
            }
        }
    }
}

#[test]
fn every_way_of_waiting_shows_the_same() {
    for wait in [WaitStrategy::Block, WaitStrategy::Spin] {
        check(LaneSetup::new(5), 2, wait);
        check(LaneSetup { batch_size: 2, ..LaneSetup::new(5) }, 2, wait);
    }
}

#[test]
fn a_batch_larger_than_a_run_comes_in_one_frame() {
    let num_envs = if cfg!(miri) { 18 } else { 100 };
    check(LaneSetup::new(num_envs), 2, WaitStrategy::default());
}

#[test]
fn more_threads_than_environments_do_no_harm() {
    check(LaneSetup::new(1), 4, WaitStrategy::default());
    check(LaneSetup { batch_size: 1, ..LaneSetup::new(3) }, 4, WaitStrategy::default());
}

#[test]
fn fields_that_a_lane_leaves_out_are_not_there_and_the_others_unchanged() {
    for autoreset in MODES {
        let fields = FieldSet::from_names(["avail_actions", "episode_length", "final_state"]).unwrap();
        let setup = LaneSetup { autoreset, fields, ..LaneSetup::new(4) };
        let (_pool, learners) = start(1, &[setup], |_, _| Oddity::default());
        let layout = &learners[0].layout;
        assert_eq!(layout.offset(Field::Obs), None);
        assert_eq!(layout.offset(Field::FinalState).is_some(), autoreset == Autoreset::SameStep);
        check(setup, 2, WaitStrategy::default());
    }
}

/// The other tests play a game made for them; this one the real one.
#[test]
fn battles_in_a_pool_are_those_of_the_bare_engine() {
    const NUM_ENVS: usize = 3;
    let arena = Arc::new(Arena::new(&Scenario::standard("2s3z").expect("a standard one"), Rules::Smaclite));
    let battle = move |env: usize| Battle::new(Arc::clone(&arena), 5 + env as u64);
    let mut bare: Vec<_> = (0..NUM_ENVS).map(&battle).collect();
    let (_pool, mut learner) = start_battles(2, NUM_ENVS, battle);
    learner.send_reset(None, &all(NUM_ENVS), NUM_ENVS);
    let sizes = learner.layout.sizes();
    let mut scratch = Scratch::new();
    let mut player = Random::new(3);
    let (mut obs, mut state) = (vec![0.0; sizes.n_agents * sizes.obs_size], vec![0.0; sizes.state_size]);
    for _ in 0..STEPS {
        let frame = learner.frame();
        let all_obs = frame.field::<f32>(&learner.layout, Field::Obs).expect("all fields are there");
        let all_states = frame.field::<f32>(&learner.layout, Field::State).expect("all fields are there");
        let mut actions = vec![0; NUM_ENVS * sizes.n_agents];
        for (env, battle) in bare.iter_mut().enumerate() {
            battle.write_obs(&mut obs, &mut scratch);
            battle.write_state(&mut state);
            assert_eq!(obs, all_obs[env * obs.len()..][..obs.len()], "environment {env}");
            assert_eq!(state, all_states[env * state.len()..][..state.len()], "environment {env}");
            let actions = &mut actions[env * sizes.n_agents..][..sizes.n_agents];
            player.act(battle, actions);
            if battle.is_over() {
                battle.reset(); // as next-step autoreset does, whatever the action
            } else {
                battle.step(actions, &mut scratch).expect("the player plays what is available");
            }
        }
        learner.send_step(&all(NUM_ENVS), &actions);
    }
}
