//! A trained team that plays the enemies of a lane's battles, as the pool needs it. What it is made of is
//! known elsewhere; `enemy_player` lets it play one environment.

use smaclite_engine::StreamPosition;
use std::fmt;
use std::sync::Arc;

/// A team that plays the enemies of a lane in the place of a learner. The battles of the lane have
/// [mirrored sides](smaclite_engine::Sides::Mirrored), of which the learner of the lane sees and plays the
/// agents alone.
#[derive(Clone)]
pub struct EnemyTeam {
    /// How the lane's description calls it.
    pub name: String,
    /// How many of its own last actions a unit of it observes, 0 to
    /// [`MAX_LAST_ACTIONS`](smaclite_engine::MAX_LAST_ACTIONS).
    pub last_actions: usize,
    /// Makes what plays one environment.
    pub make: Arc<dyn Fn() -> Box<dyn EnemyPolicy> + Send + Sync>,
}

impl fmt::Debug for EnemyTeam {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("EnemyTeam").field(&self.name).finish()
    }
}

/// What chooses the actions of the enemies of one environment.
pub trait EnemyPolicy: Send {
    /// Writes an available action for each enemy; another one makes the lane fail, as a panic does. Equal
    /// views must give equal actions, whatever was played before: so threads, snapshots and forks change
    /// nothing.
    fn act(&mut self, view: EnemyView<'_>, actions: &mut [i32]);
}

/// What the enemies of a battle see, and what their actions can be drawn by.
#[derive(Clone, Copy, Debug)]
pub struct EnemyView<'a> {
    /// `[n_enemies, obs_size]`, with the last actions at the end of each row.
    pub obs: &'a [f32],
    /// `[n_enemies, n_actions]`.
    pub avail_actions: &'a [u8],
    /// Where the battle's generator is; it is not advanced, so that the recorded actions alone give the same
    /// battle.
    pub position: StreamPosition,
    /// Steps of this episode so far. The generator draws nothing while a single unit is alive.
    pub episode_length: u32,
}
