//! What one side has in a batch. Whatever plays, stores or learns reads a side through this, so that
//! nothing is written twice for allies and enemies.

use crate::actor::Rows;
use smaclite_engine::{Faction, Sizes};
use smaclite_ipc::Batch;
use smaclite_pool::fields::Field;

/// The fields that a side is read from.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    /// With sizes as the units of that side have them: its own number is `n_agents`.
    pub rows: Rows<'a>,
    /// `[environments, state_size]`; empty if the lane does not have it.
    pub state: &'a [f32],
    /// `[environments]`.
    pub rewards: &'a [f32],
}

/// The fields of a view in their order.
pub(crate) fn fields_of(side: Faction) -> [Field; 4] {
    match side {
        Faction::Ally => [Field::Obs, Field::AvailActions, Field::State, Field::Reward],
        Faction::Enemy => [Field::EnemyObs, Field::EnemyAvailActions, Field::EnemyState, Field::EnemyReward],
    }
}

/// Fields that a team reads, besides those that every lane has.
const FIELDS: [Field; 6] = [
    Field::Obs,
    Field::State,
    Field::AvailActions,
    Field::BattleWon,
    Field::EpisodeReturn,
    Field::EpisodeLength,
];

/// The fields that a team reads on lanes of these sides.
pub(crate) fn fields_read(both_sides: bool) -> impl Iterator<Item = Field> {
    let of_enemies = fields_of(Faction::Enemy).into_iter().chain([Field::Opponent, Field::DeadAllies]);
    FIELDS.into_iter().chain(of_enemies.filter(move |_| both_sides))
}

impl<'a> View<'a> {
    /// Of a side with these sizes.
    pub fn of(batch: &'a Batch, side: Faction, sizes: Sizes) -> View<'a> {
        let [obs, available, state, rewards] = fields_of(side);
        let floats = |field| batch.field::<f32>(field).unwrap_or(&[]);
        View {
            rows: Rows { sizes, obs: floats(obs), available: batch.field(available).unwrap_or(&[]) },
            state: floats(state),
            rewards: floats(rewards),
        }
    }
}
