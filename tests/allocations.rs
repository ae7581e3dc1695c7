//! Heap memory of battles and of learners: a step of a battle allocates nothing after the first with a
//! scratch and an arena, a batch only what iceoryx2 does, and a battle needs little memory.

use std::hint::black_box;
use std::sync::Arc;

use smaclite_engine::{Arena, Battle, Faction, Rules, Scratch, policy};
use smaclite_ipc::{WaitOptions, WaitStrategy};
use smaclite_scenarios::Scenario;
use smaclite_tests::heap::{Counting, Heap};
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{LanePlan, PoolPlan, TestDir};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// With rewards for which losses are noted.
fn arena(scenario: &str) -> Arc<Arena> {
    let mut scenario = Scenario::standard(scenario).expect("a standard scenario");
    scenario.rewards.only_positive = false;
    Arc::new(Arena::new(&scenario, Rules::Smaclite))
}

/// A battle with the buffers that a pool provides.
struct HostedBattle {
    battle: Battle,
    random: policy::Random,
    actions: Vec<i32>,
    obs: Vec<f32>,
    state: Vec<f32>,
    avail: Vec<u8>,
    alive: Vec<u8>,
    shares: Vec<f32>,
}

impl HostedBattle {
    fn new(arena: &Arc<Arena>) -> HostedBattle {
        let sizes = arena.sizes();
        let mut battle = Battle::new(arena.clone(), 1);
        battle.keep_shares();
        HostedBattle {
            battle,
            random: policy::Random::new(1),
            actions: vec![0; sizes.n_agents],
            obs: vec![0.0; sizes.n_agents * sizes.obs_size],
            state: vec![0.0; sizes.state_size],
            avail: vec![0; sizes.n_agents * sizes.n_actions],
            alive: vec![0; sizes.n_agents],
            shares: vec![0.0; sizes.n_agents],
        }
    }

    fn step(&mut self, at_random: bool, scratch: &mut Scratch) {
        if self.battle.is_over() {
            self.battle.reset();
        }
        if at_random {
            self.random.act(&self.battle, &mut self.actions);
        } else {
            policy::nearest(&self.battle, &mut self.actions);
        }
        self.battle.step(&self.actions, scratch).expect("legal actions");
        self.battle.write_obs(Faction::Ally, &mut self.obs, scratch);
        self.battle.write_state(Faction::Ally, &mut self.state);
        self.battle.write_avail_actions(Faction::Ally, &mut self.avail);
        self.battle.write_alive(Faction::Ally, &mut self.alive);
        self.battle.write_shares_of(Faction::Ally, &mut self.shares);
    }
}

/// One step is enough warm-up: working memory is allocated for the worst case of its arena.
#[test]
fn steps_allocate_nothing() {
    for scenario in Scenario::standard_names().chain(Scenario::generated_names()) {
        let mut scratch = Scratch::new();
        let mut battle = HostedBattle::new(&arena(scenario));
        battle.step(false, &mut scratch);
        let before = Heap::of_thread().allocations;
        for step in 0..600 {
            battle.step(step >= 300, &mut scratch);
        }
        assert_eq!(Heap::of_thread().allocations - before, 0, "allocations in 600 steps of {scenario}");
    }
}

/// The scratch of a thread is used for battles of all arenas in turn.
#[test]
fn a_change_of_arena_allocates_nothing_the_second_time() {
    let mut scratch = Scratch::new();
    let mut battles: Vec<HostedBattle> =
        Scenario::standard_names().map(|name| HostedBattle::new(&arena(name))).collect();
    battles.iter_mut().for_each(|battle| battle.step(true, &mut scratch));
    let before = Heap::of_thread().allocations;
    for _ in 0..50 {
        battles.iter_mut().for_each(|battle| battle.step(true, &mut scratch));
    }
    assert_eq!(Heap::of_thread().allocations - before, 0);
}

fn wait(interrupted: &mut dyn FnMut() -> bool) -> WaitOptions<'_> {
    WaitOptions { timeout: Some(TIMEOUT), interrupted }
}

/// A learner of the pool's own process, whose thread also steps the environments. iceoryx2 allocates once for
/// the frame that it lends; the other allocation is the batch, which the learner shares with its client. The
/// first steps allocate more: queues and scratch memory grow.
#[test]
fn steps_of_a_learner_allocate_the_batch_and_what_iceoryx2_does() {
    let dir = TestDir::new();
    let plan = LanePlan::new("2s3z", 8);
    let pool = dir.start(&PoolPlan::new([plan.clone()]).threads(1));
    let mut client = pool.connect(Some(&plan.name), WaitStrategy::Adaptive).expect("a client");
    let mut actions = vec![0; 8 * client.layout().sizes().n_agents];
    drop(client.reset(Some(1), None, wait(&mut || false)).expect("a batch"));
    let mut step = |count: usize| {
        for _ in 0..count {
            client.sample_actions(None, &mut actions).expect("a batch came");
            drop(client.step(&actions, None, wait(&mut || false)).expect("a batch"));
        }
    };
    step(50);
    let before = Heap::of_thread().allocations;
    step(300);
    assert_eq!(Heap::of_thread().allocations - before, 2 * 300, "allocations in 300 batches");
}

/// The limit for 27m_vs_30m is 64 KiB per environment, without frames.
#[test]
fn a_battle_is_small() {
    let arena = arena("27m_vs_30m");
    let before = Heap::of_thread().bytes;
    let battles: Vec<Battle> = (0..16).map(|seed| Battle::new(arena.clone(), seed)).collect();
    let each = (Heap::of_thread().bytes - before) / battles.len() as i64;
    println!(
        "{each} bytes per battle of 27m_vs_30m, {} of them on the heap",
        each - size_of::<Battle>() as i64
    );
    assert!((1..=64 * 1024).contains(&each), "{each} bytes per battle");
    black_box(battles);
}

/// If allocations were not counted, the tests above could not fail.
#[test]
fn allocations_are_counted() {
    let before = Heap::of_thread();
    Heap::forget_most();
    drop(black_box(vec![1u8; 500]));
    let bytes = black_box(vec![1u8; 1000]);
    let Heap { allocations, bytes: held, most } = Heap::of_thread();
    assert_eq!((allocations - before.allocations, held - before.bytes, most - before.bytes), (2, 1000, 1000));
    drop(bytes);
    assert_eq!(Heap::of_thread().bytes, before.bytes);
    assert_eq!(Heap::of_thread().most, before.bytes + 1000);
}
