//! What a learner asks of the environments of its lane.

use smaclite_pool::transport::RequestKind;

/// An order to environments, which a [`Client`](crate::Client) sends to those that are named with it. In the
/// shapes, `count` is their number.
#[derive(Clone, Copy, Debug)]
pub enum Order<'a> {
    /// Step with these actions, `[count, n_agents]`, or `[count, n_agents + n_enemies]` in a lane whose joint
    /// actions play both sides.
    Step(&'a [i32]),
    /// Begin a new episode. A reset of every environment drops the results of earlier orders that were not
    /// received, also if the lane refuses its levels.
    Reset {
        /// Environment `i` is seeded with `seed + i`. Without one its generator continues, except that a
        /// session's first reset uses the lane's seed.
        seed: Option<u64>,
        /// The units that the episodes begin with instead of the scenario's, f32 `[count, n_units, 5]` as the
        /// field `level`, which the lane must have. The lane says which level is wrong, and why.
        levels: Option<&'a [f32]>,
    },
    /// Take the states of snapshots.
    Restore {
        /// `[count, snapshot_size]`: rows of the field `snapshot`, which the lane must have. The lane says
        /// which snapshot is wrong, and why.
        snapshots: &'a [u8],
        /// Environment `i` draws execution orders from then on as after a reset with `seed + i`; without one,
        /// those that it would have drawn.
        seed: Option<u64>,
    },
    /// Take the states of other environments, as they are before the order.
    Fork {
        /// `[count]`: for each environment the one that it becomes a copy of, which may be named several
        /// times.
        from: &'a [i32],
        /// As of a restore.
        seed: Option<u64>,
    },
}

impl Order<'_> {
    /// A reset to the units of the scenario.
    pub fn reset(seed: Option<u64>) -> Self {
        Order::Reset { seed, levels: None }
    }

    pub(super) fn kind(&self) -> RequestKind {
        match *self {
            Order::Step(_) => RequestKind::Step,
            Order::Reset { seed, levels } => RequestKind::Reset { seed, levels: levels.is_some() },
            Order::Restore { seed, .. } => RequestKind::Restore { seed },
            Order::Fork { seed, .. } => RequestKind::Fork { seed },
        }
    }

    /// What follows the ids of the environments in a request.
    pub(super) fn body(&self) -> &[u8] {
        match *self {
            Order::Step(actions) => bytemuck::cast_slice(actions),
            Order::Reset { levels, .. } => bytemuck::cast_slice(levels.unwrap_or_default()),
            Order::Restore { snapshots, .. } => snapshots,
            Order::Fork { from, .. } => bytemuck::cast_slice(from),
        }
    }
}
