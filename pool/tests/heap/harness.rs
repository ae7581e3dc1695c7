//! Pools of [`LaneEnvs`]s, a learner to play with them, and what it should see: the same games played one by one.

use crate::game::{LaneEnvs, Oddity, SIZES};
use crate::transport::{Bell, Ends, Frame, Heap, HeapMessage, lane};
use smaclite_engine::{Battle, Scratch, Step};
use smaclite_pool::environment::Environment;
use smaclite_pool::fields::{Field, FieldSet};
use smaclite_pool::layout::Layout;
use smaclite_pool::transport::{Doorbell, RequestKind};
use smaclite_pool::{Autoreset, LaneSettings, LaneSpec, Pool, PoolOptions, Rejection, WaitStrategy};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Long enough for valgrind and Miri; only a test that fails waits for it.
const PATIENCE: Duration = Duration::from_secs(30);

/// A lane to be.
#[derive(Clone, Copy)]
pub struct LaneSetup {
    pub num_envs: usize,
    pub batch_size: usize,
    pub autoreset: Autoreset,
    pub fields: FieldSet,
    pub seed: u64,
}

impl LaneSetup {
    /// Synchronous, with everything.
    pub fn new(num_envs: usize) -> LaneSetup {
        let autoreset = Autoreset::NextStep;
        LaneSetup { num_envs, batch_size: num_envs, autoreset, fields: FieldSet::ALL, seed: 5 }
    }

    fn spec(self, lane: usize, oddity: impl Fn(usize) -> Oddity + Send + 'static) -> LaneSpec {
        let make = move |env: usize| -> Box<dyn Environment> {
            Box::new(LaneEnvs::new(self.seed + env as u64, oddity(env)))
        };
        let LaneSetup { num_envs, batch_size, autoreset, fields, seed } = self;
        let settings = LaneSettings { num_envs, batch_size, seed, autoreset, fields };
        LaneSpec { name: format!("lane {lane}"), sizes: SIZES, settings, make: Box::new(make) }
    }
}

/// Starts a pool and attaches a learner to each lane; `oddity` says what is special about an environment of a
/// lane.
pub fn start(
    threads: usize,
    lanes: &[LaneSetup],
    oddity: impl Fn(usize, usize) -> Oddity + Clone + Send + 'static,
) -> (Pool<Heap>, Vec<Learner>) {
    start_waiting(WaitStrategy::default(), threads, lanes, oddity)
}

/// [`start`] with a way of waiting.
pub fn start_waiting(
    wait: WaitStrategy,
    threads: usize,
    lanes: &[LaneSetup],
    oddity: impl Fn(usize, usize) -> Oddity + Clone + Send + 'static,
) -> (Pool<Heap>, Vec<Learner>) {
    let bell = Bell::default();
    let mut parts = Vec::new();
    let mut learners = Vec::new();
    for (index, setup) in lanes.iter().enumerate() {
        let oddity = oddity.clone();
        let spec = setup.spec(index, move |env| oddity(index, env));
        let layout = spec.layout();
        let (part, ends) = lane(spec);
        parts.push(part);
        learners.push(Learner { ends, bell: bell.clone(), layout, session: 1, number: 0, epoch: 0 });
    }
    let pool = Pool::start(parts, bell, PoolOptions { threads, wait }).expect("threads can be had");
    (0..lanes.len()).for_each(|lane| pool.set_session(lane, Some(1)));
    (pool, learners)
}

/// Starts a synchronous lane of battles.
pub fn start_battles(
    threads: usize,
    num_envs: usize,
    battle: impl Fn(usize) -> Battle + Send + 'static,
) -> (Pool<Heap>, Learner) {
    let setup = LaneSetup::new(num_envs);
    let sizes = battle(0).arena().sizes();
    let make = move |env: usize| -> Box<dyn Environment> { Box::new(battle(env)) };
    let spec = LaneSpec { sizes, make: Box::new(make), ..setup.spec(0, |_| Oddity::default()) };
    let layout = spec.layout();
    let bell = Bell::default();
    let (part, ends) = lane(spec);
    let options = PoolOptions { threads, wait: WaitStrategy::default() };
    let pool = Pool::start(vec![part], bell.clone(), options).expect("threads can be had");
    pool.set_session(0, Some(1));
    (pool, Learner { ends, bell, layout, session: 1, number: 0, epoch: 0 })
}

/// A learner that need not be honest.
pub struct Learner {
    ends: Ends,
    bell: Bell,
    pub layout: Layout,
    pub session: u64,
    pub number: u64,
    epoch: u64,
}

impl Learner {
    /// Asks for a reset; of all environments, if `num_envs` are given.
    pub fn send_reset(&mut self, seed: Option<u64>, env_ids: &[i32], num_envs: usize) {
        if env_ids.len() == num_envs {
            self.epoch = self.number + 1;
        }
        self.send(RequestKind::Reset { seed }, env_ids, &[]);
    }

    /// Sends actions.
    pub fn send_step(&mut self, env_ids: &[i32], actions: &[i32]) {
        self.send(RequestKind::Step, env_ids, actions);
    }

    fn send(&mut self, kind: RequestKind, env_ids: &[i32], actions: &[i32]) {
        self.number += 1;
        self.send_raw(HeapMessage {
            session: self.session,
            number: self.number,
            kind: Some(kind),
            env_ids: env_ids.to_vec(),
            actions: actions.to_vec(),
        });
    }

    /// Sends anything.
    pub fn send_raw(&self, message: HeapMessage) {
        self.ends.requests.send(message).expect("the pool lives");
        self.bell.ring();
    }

    /// The next frame, whatever it is.
    pub fn frame(&self) -> Frame {
        self.ends.frames.recv_timeout(PATIENCE).expect("the pool never leaves a learner waiting")
    }

    /// The next batch of this round.
    pub fn batch(&self) -> Vec<Row> {
        loop {
            let frame = self.frame();
            if let Some((request, rejection)) = frame.rejection() {
                panic!("request {request} was rejected: {rejection}");
            }
            if (frame.epoch.session, frame.epoch.request) == (self.session, self.epoch) {
                return self.rows(&frame);
            }
        }
    }

    /// The slots of a batch.
    pub fn rows(&self, frame: &Frame) -> Vec<Row> {
        (0..self.layout.slots()).map(|slot| Row::of(frame, &self.layout, slot)).collect()
    }

    /// The rejection that is the answer to the last request.
    pub fn rejection(&self) -> Rejection {
        let (request, rejection) = self.frame().rejection().expect("a rejection, not a batch");
        assert_eq!(request, self.number, "{rejection}");
        rejection
    }

    /// Takes the lane's frames away, or gives them back.
    pub fn set_shortage(&self, on: bool) {
        self.ends.shortage.on.store(on, Ordering::SeqCst);
    }

    /// Waits until a worker asks for a frame in vain.
    pub fn wait_for_shortage(&self) {
        settle("a worker wants a frame", || self.ends.shortage.refused.load(Ordering::SeqCst) > 0);
    }

    /// Is there nothing to receive?
    pub fn hears_nothing(&self) -> bool {
        self.ends.frames.try_recv().is_err()
    }
}

/// One slot of a frame; a field that the lane leaves out is empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub env: i32,
    pub floats: Vec<(Field, Vec<f32>)>,
    pub bytes: Vec<(Field, Vec<u8>)>,
    pub counts: Vec<(Field, i32)>,
}

const FLOATS: [Field; 6] =
    [Field::Obs, Field::State, Field::Reward, Field::EpisodeReturn, Field::FinalObs, Field::FinalState];
const BYTES: [Field; 6] = [
    Field::AvailActions,
    Field::Alive,
    Field::Terminated,
    Field::Truncated,
    Field::BattleWon,
    Field::FinalAvailActions,
];
const COUNTS: [Field; 3] = [Field::DeadAllies, Field::DeadEnemies, Field::EpisodeLength];

impl Row {
    fn of(frame: &Frame, layout: &Layout, slot: usize) -> Row {
        let row = |field: Field| slot * layout.row_len(field)..(slot + 1) * layout.row_len(field);
        let floats = |f: Field| Some((f, frame.field::<f32>(layout, f)?[row(f)].to_vec()));
        let bytes = |f: Field| Some((f, frame.field::<u8>(layout, f)?[row(f)].to_vec()));
        let counts = |f: Field| Some((f, frame.field::<i32>(layout, f)?[slot]));
        let mut row = Row {
            env: frame.field::<i32>(layout, Field::EnvId).expect("always there")[slot],
            floats: FLOATS.into_iter().filter_map(floats).collect(),
            bytes: BYTES.into_iter().filter_map(bytes).collect(),
            counts: COUNTS.into_iter().filter_map(counts).collect(),
        };
        if !row.ended() {
            row.forget_final(); // unspecified there
        }
        row
    }

    fn forget_final(&mut self) {
        self.floats.retain(|(f, _)| !f.is_final());
        self.bytes.retain(|(f, _)| !f.is_final());
    }

    /// Did the step end the episode?
    pub fn ended(&self) -> bool {
        let ends = |f: &Field| matches!(f, Field::Terminated | Field::Truncated);
        self.bytes.iter().any(|(f, value)| ends(f) && value == &[1])
    }

    /// A legal joint action that depends on what is seen.
    pub fn legal_actions(&self) -> Vec<i32> {
        let find = |field| self.bytes.iter().find(|(f, _)| *f == field).map(|(_, mask)| mask);
        let masks = find(Field::AvailActions).expect("the lane has masks");
        let salt = self.counts.iter().map(|(_, count)| *count as usize).sum::<usize>() + self.env as usize;
        let pick = |(agent, mask): (usize, &[u8])| {
            let legal: Vec<_> = (0..mask.len()).filter(|a| mask[*a] == 1).collect();
            legal[(salt + agent) % legal.len()] as i32
        };
        masks.chunks(SIZES.n_actions).enumerate().map(pick).collect()
    }
}

/// The games of a lane, played one after the other on this thread.
pub struct Reference {
    setup: LaneSetup,
    games: Vec<(LaneEnvs, bool)>,
    layout: Layout,
}

impl Reference {
    pub fn new(setup: LaneSetup) -> Reference {
        let game = |env: usize| (LaneEnvs::new(setup.seed + env as u64, Oddity::default()), false);
        let layout = setup.spec(0, |_| Oddity::default()).layout();
        Reference { setup, games: (0..setup.num_envs).map(game).collect(), layout }
    }

    /// What a reset of environment `env` shows.
    pub fn reset(&mut self, env: i32, seed: Option<u64>) -> Row {
        let (game, over) = &mut self.games[env as usize];
        if let Some(seed) = seed {
            game.reseed(seed + env as u64);
        }
        game.reset();
        *over = false;
        self.row(env, None, None)
    }

    /// What a reset of other environments shows of this one.
    pub fn observe(&self, env: i32) -> Row {
        self.row(env, None, None)
    }

    /// What a step of environment `env` shows.
    pub fn step(&mut self, env: i32, actions: &[i32]) -> Row {
        let autoreset = self.setup.autoreset;
        let (game, over) = &mut self.games[env as usize];
        if *over && autoreset == Autoreset::NextStep {
            return self.reset(env, None);
        }
        let step = game.step(actions, &mut Scratch::new()).expect("the learner plays legal actions");
        *over = step.terminated || step.truncated;
        if *over && autoreset == Autoreset::SameStep {
            let last = game.clone();
            game.reset();
            *over = false;
            return self.row(env, Some(step), Some(last));
        }
        self.row(env, Some(step), None)
    }

    /// `last`: the game as it ended, where it was reset since.
    fn row(&self, env: i32, step: Option<Step>, last: Option<LaneEnvs>) -> Row {
        let game = &self.games[env as usize].0;
        let outcome = last.as_ref().unwrap_or(game);
        let floats = |field: Field| {
            let mut out = vec![0.0; self.layout.row_len(field)];
            match field {
                Field::Obs => game.write_obs(&mut out, &mut Scratch::new()),
                Field::State => game.write_state(&mut out),
                Field::Reward => out[0] = step.map_or(0.0, |s| s.reward as f32),
                Field::EpisodeReturn => out[0] = outcome.episode_return() as f32,
                Field::FinalObs => last.as_ref()?.write_obs(&mut out, &mut Scratch::new()),
                _ => last.as_ref()?.write_state(&mut out),
            }
            self.layout.offset(field).map(|_| (field, out))
        };
        let bytes = |field: Field| {
            let mut out = vec![0; self.layout.row_len(field)];
            match field {
                Field::AvailActions => game.write_avail_actions(&mut out),
                Field::Alive => game.write_alive(&mut out),
                Field::Terminated => out[0] = u8::from(step.is_some_and(|s| s.terminated)),
                Field::Truncated => out[0] = u8::from(step.is_some_and(|s| s.truncated)),
                Field::BattleWon => out[0] = u8::from(step.is_some_and(|s| s.battle_won)),
                _ => last.as_ref()?.write_avail_actions(&mut out),
            }
            self.layout.offset(field).map(|_| (field, out))
        };
        let counts = |field: Field| {
            let value = match field {
                Field::DeadAllies => outcome.dead_allies() as i32,
                Field::DeadEnemies => outcome.dead_enemies() as i32,
                _ => outcome.episode_length() as i32,
            };
            self.layout.offset(field).map(|_| (field, value))
        };
        Row {
            env,
            floats: FLOATS.into_iter().filter_map(floats).collect(),
            bytes: BYTES.into_iter().filter_map(bytes).collect(),
            counts: COUNTS.into_iter().filter_map(counts).collect(),
        }
    }
}

/// `0..num_envs` as ids.
pub fn all(num_envs: usize) -> Vec<i32> {
    (0..num_envs as i32).collect()
}

/// Waits until something is so: figures are counted after the frame that they count is sent.
pub fn settle(what: &str, mut is_so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        std::thread::yield_now();
    }
}
