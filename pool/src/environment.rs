//! What the pool needs of an environment, as a trait, and its implementation by a battle. Lanes step and
//! observe environments by this trait alone.
//!
//! The trait speaks in types of the engine, because users run battles: every worker has one [`Scratch`] for
//! all its environments. What only battles have is not in the trait: `hosted_env`, `stand_in` and
//! `enemy_player` ask an environment for its [`Battle`] to save and restore it, to begin it with a level, to
//! log it for followers, and for its second side.

use smaclite_engine::{Battle, Faction, Scratch, Sizes, Step};
use std::sync::atomic::{AtomicI32, Ordering};

/// A joint action, one number per agent and, in battles of which it plays both sides, per enemy, in the
/// lane's memory. Nothing writes to it during the step.
#[derive(Clone, Copy, Debug)]
pub struct JointAction<'a>(&'a [AtomicI32]);

impl<'a> JointAction<'a> {
    /// The joint action in this memory, `[n_actors]`.
    pub fn new(actions: &'a [AtomicI32]) -> Self {
        JointAction(actions)
    }

    /// The actions of all agents in order, and then those of the enemies.
    pub fn iter(self) -> impl ExactSizeIterator<Item = i32> + Clone + use<'a> {
        self.0.iter().map(|action| action.load(Ordering::Relaxed))
    }

    /// Sets a number, before the step.
    pub(crate) fn set(self, place: usize, action: i32) {
        self.0[place].store(action, Ordering::Relaxed);
    }
}

/// One environment of a lane: it can be reset, stepped and observed. Batches, autoreset and transport belong
/// to the pool. Users run [`Battle`]s; tests and benches have other environments.
///
/// A lane hosts another implementation by `smaclite_ipc::LaneEnvs::Other`, which has its name, its sizes and
/// a function that makes environment `i`. It has everything that battles have, except what needs a scenario:
/// pictures, replays, followers and a second side.
///
/// # Example
///
/// One agent that may stop (0) or go on (1), and wins after three steps ahead:
///
/// ```
/// use smaclite_engine::{Scratch, Sizes, Step};
/// use smaclite_pool::environment::{Environment, JointAction};
/// use std::sync::atomic::AtomicI32;
///
/// #[derive(Default)]
/// struct Walk {
///     position: u32,
///     length: u32,
/// }
///
/// impl Environment for Walk {
///     fn sizes(&self) -> Sizes {
///         Sizes { n_agents: 1, n_enemies: 0, n_actions: 2, obs_size: 1, state_size: 1, ..Sizes::default() }
///     }
///     fn reseed(&mut self, _seed: u64) {} // nothing is random
///     fn reset(&mut self) {
///         *self = Walk::default();
///     }
///     fn step_checked(&mut self, actions: JointAction<'_>, _: &mut Scratch) -> Step {
///         let ahead: i32 = actions.iter().sum(); // of one agent
///         self.position += ahead as u32;
///         self.length += 1;
///         let terminated = self.position == 3;
///         let (reward, enemy_reward) = (f64::from(ahead), 0.0);
///         Step { reward, enemy_reward, terminated, truncated: false, battle_won: terminated }
///     }
///     fn write_obs(&self, out: &mut [f32], _: &mut Scratch) {
///         out.fill(0.0); // a row may be longer than obs_size
///         out[0] = self.position as f32 / 3.0;
///     }
///     fn write_state(&self, out: &mut [f32]) {
///         out[0] = self.position as f32 / 3.0;
///     }
///     fn write_avail_actions(&self, out: &mut [u8]) {
///         out.fill(1);
///     }
///     fn write_available_bits(&self, out: &mut [u64]) {
///         out[0] = 0b11;
///     }
///     fn write_alive(&self, out: &mut [u8]) {
///         out[0] = 1;
///     }
///     fn dead_allies(&self) -> usize {
///         0
///     }
///     fn dead_enemies(&self) -> usize {
///         0
///     }
///     fn episode_return(&self) -> f64 {
///         f64::from(self.position)
///     }
///     fn episode_length(&self) -> u32 {
///         self.length
///     }
/// }
///
/// let mut walk = Walk::default();
/// let mut step = |action| {
///     walk.step_checked(JointAction::new(&[AtomicI32::new(action)]), &mut Scratch::new())
/// };
/// let steps = [0, 1, 1, 1].map(&mut step);
/// assert!(steps[3].terminated && walk.episode_return() == 3.0);
/// ```
///
/// # At the edges
///
/// Equal seeds and actions must give equal results, and nothing else may influence them: no clock, no global
/// generator. The pool calls an environment from any of its threads, from one at a time. A panic fails the
/// lane: its learner gets an error, and the other lanes continue.
pub trait Environment: Send {
    /// Sizes of everything written below.
    fn sizes(&self) -> Sizes;
    /// Seeds the generator; the next [`reset`](Environment::reset) starts from it.
    fn reseed(&mut self, seed: u64);
    /// Begins a new episode.
    fn reset(&mut self);
    /// One step with a joint action that is [available](Environment::write_available_bits) in
    /// this state.
    fn step_checked(&mut self, actions: JointAction<'_>, scratch: &mut Scratch) -> Step;
    /// Writes `[n_agents, row]`, where a row is `obs_size` long or longer; the rest of each row becomes 0.
    fn write_obs(&self, out: &mut [f32], scratch: &mut Scratch);
    /// Writes `[state_size]`.
    fn write_state(&self, out: &mut [f32]);
    /// Writes `[n_agents, n_actions]`, 0 or 1.
    fn write_avail_actions(&self, out: &mut [u8]);
    /// Writes the same as bits, `[n_agents, n_actions.div_ceil(64)]`: bit `a % 64` of word `a / 64` of an
    /// agent's row is action `a`, and bits of no action are 0. The lane checks joint actions by them.
    fn write_available_bits(&self, out: &mut [u64]);
    /// Writes `[n_agents]`, 0 or 1.
    fn write_alive(&self, out: &mut [u8]);
    /// Agents that died in this episode.
    fn dead_allies(&self) -> usize;
    /// Enemies that died in this episode.
    fn dead_enemies(&self) -> usize;
    /// Sum of this episode's rewards so far.
    fn episode_return(&self) -> f64;
    /// Steps of this episode so far.
    fn episode_length(&self) -> u32;
    /// What plays the enemies in this episode: an index in [`Opponent::ALL`](smaclite_engine::Opponent::ALL).
    fn opponent(&self) -> usize {
        0
    }
    /// The battle that the environment is, if it is one. Only battles can be followed, saved and restored.
    fn battle(&self) -> Option<&Battle> {
        None
    }
    /// As [`battle`](Environment::battle), to restore a snapshot.
    fn battle_mut(&mut self) -> Option<&mut Battle> {
        None
    }
}

impl Environment for Battle {
    fn sizes(&self) -> Sizes {
        self.arena().sizes()
    }
    fn reseed(&mut self, seed: u64) {
        Battle::reseed(self, seed);
    }
    fn reset(&mut self) {
        Battle::reset(self);
    }
    fn step_checked(&mut self, actions: JointAction<'_>, scratch: &mut Scratch) -> Step {
        Battle::step_checked(self, actions.iter(), scratch)
    }
    fn write_obs(&self, out: &mut [f32], scratch: &mut Scratch) {
        Battle::write_obs(self, out, scratch);
    }
    fn write_state(&self, out: &mut [f32]) {
        Battle::write_state(self, out);
    }
    fn write_avail_actions(&self, out: &mut [u8]) {
        Battle::write_avail_actions(self, out);
    }
    fn write_available_bits(&self, out: &mut [u64]) {
        out.copy_from_slice(self.available_bits(Faction::Ally));
    }
    fn write_alive(&self, out: &mut [u8]) {
        Battle::write_alive(self, out);
    }
    fn dead_allies(&self) -> usize {
        Battle::dead_allies(self)
    }
    fn dead_enemies(&self) -> usize {
        Battle::dead_enemies(self)
    }
    fn episode_return(&self) -> f64 {
        Battle::episode_return(self)
    }
    fn episode_length(&self) -> u32 {
        Battle::episode_length(self)
    }
    fn opponent(&self) -> usize {
        Battle::opponent(self).index()
    }
    fn battle(&self) -> Option<&Battle> {
        Some(self)
    }
    fn battle_mut(&mut self) -> Option<&mut Battle> {
        Some(self)
    }
}

/// Makes environment `i` of a lane.
pub type MakeEnvironment = Box<dyn Fn(usize) -> Box<dyn Environment> + Send>;
