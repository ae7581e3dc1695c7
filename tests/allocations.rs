//! What a battle takes from the heap: nothing in a step once its scratch has served its arena, and little to
//! exist.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;
use std::sync::Arc;

use smaclite_engine::{Arena, Battle, Rules, Scratch, policy};
use smaclite_scenarios::Scenario;

thread_local! {
    /// How often this thread has asked for memory, and how many bytes it holds.
    static ASKED: Cell<u64> = const { Cell::new(0) };
    static HELD: Cell<i64> = const { Cell::new(0) };
}

/// The system's allocator, with a count of what it is asked for.
struct Counting;

fn count(asked: u64, bytes: i64) {
    ASKED.set(ASKED.get() + asked);
    HELD.set(HELD.get() + bytes);
}

// SAFETY: every call is handed on unchanged to the system's allocator, which keeps the contract. Counting
// touches thread-local cells that are initialised at compile time and have no destructor, so it neither
// allocates nor unwinds.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size() as i64);
        // SAFETY: the caller's promises about `layout` are those that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        count(0, -(layout.size() as i64));
        // SAFETY: `memory` came from `alloc` above with this layout, and so from the system's allocator.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn arena(scenario: &str) -> Arc<Arena> {
    let scenario = Scenario::standard(scenario).expect("a standard scenario");
    Arc::new(Arena::new(&scenario, Rules::Smaclite))
}

/// A battle and everything that a pool would have it write to.
struct Player {
    battle: Battle,
    random: policy::Random,
    actions: Vec<i32>,
    obs: Vec<f32>,
    state: Vec<f32>,
    avail: Vec<u8>,
    alive: Vec<u8>,
}

impl Player {
    fn new(arena: &Arc<Arena>) -> Player {
        let sizes = arena.sizes();
        Player {
            battle: Battle::new(arena.clone(), 1),
            random: policy::Random::new(1),
            actions: vec![0; sizes.n_agents],
            obs: vec![0.0; sizes.n_agents * sizes.obs_size],
            state: vec![0.0; sizes.state_size],
            avail: vec![0; sizes.n_agents * sizes.n_actions],
            alive: vec![0; sizes.n_agents],
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
        self.battle.write_obs(&mut self.obs, scratch);
        self.battle.write_state(&mut self.state);
        self.battle.write_avail_actions(&mut self.avail);
        self.battle.write_alive(&mut self.alive);
    }
}

/// One step is warm-up enough: working memory is made for the worst that its arena can bring.
#[test]
fn steps_allocate_nothing() {
    for scenario in Scenario::standard_names() {
        let mut scratch = Scratch::new();
        let mut player = Player::new(&arena(scenario));
        player.step(false, &mut scratch);
        let before = ASKED.get();
        for step in 0..600 {
            player.step(step >= 300, &mut scratch);
        }
        assert_eq!(ASKED.get() - before, 0, "allocations in 600 steps of {scenario}");
    }
}

/// The scratch of a thread serves battles of all arenas in turn.
#[test]
fn a_change_of_arena_allocates_nothing_the_second_time() {
    let mut scratch = Scratch::new();
    let mut players: Vec<Player> = Scenario::standard_names().map(|name| Player::new(&arena(name))).collect();
    players.iter_mut().for_each(|player| player.step(true, &mut scratch));
    let before = ASKED.get();
    for _ in 0..50 {
        players.iter_mut().for_each(|player| player.step(true, &mut scratch));
    }
    assert_eq!(ASKED.get() - before, 0);
}

/// 64 KiB an environment is promised for 27m_vs_30m, frames aside.
#[test]
fn a_battle_is_small() {
    let arena = arena("27m_vs_30m");
    let before = HELD.get();
    let battles: Vec<Battle> = (0..16).map(|seed| Battle::new(arena.clone(), seed)).collect();
    let each = (HELD.get() - before) / battles.len() as i64;
    println!(
        "{each} bytes a battle of 27m_vs_30m, {} of them on the heap",
        each - size_of::<Battle>() as i64
    );
    assert!((1..=64 * 1024).contains(&each), "{each} bytes a battle");
    black_box(battles);
}

/// If the allocator were not counted, the tests above could not fail.
#[test]
fn allocations_are_counted() {
    let (asked, held) = (ASKED.get(), HELD.get());
    let bytes = black_box(vec![1u8; 1000]);
    assert_eq!((ASKED.get() - asked, HELD.get() - held), (1, 1000));
    drop(bytes);
    assert_eq!(HELD.get(), held);
}
