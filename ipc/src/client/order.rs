//! What a learner asks of the environments of its lane.

use smaclite_pool::transport::{RequestKind, Seeds, seed_words};
use std::borrow::Cow;

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
        /// How their generators are seeded. Those of a session that were not yet begin with the lane's seed.
        seeds: Seeds<&'a [Option<u64>]>,
        /// The units that the episodes begin with instead of the scenario's, f32 `[count, n_units, 5]` as the
        /// field `level`, which the lane must have. The lane says which level is wrong, and why.
        levels: Option<&'a [f32]>,
    },
    /// Take the states of snapshots. If a session begins with that, the other environments begin new
    /// episodes; in an asynchronous lane it must then be an order to all.
    Restore {
        /// `[count, snapshot_size]`: rows of the field `snapshot`, which the lane must have. The lane says
        /// which snapshot is wrong, and why.
        snapshots: &'a [u8],
        /// From then on they draw execution orders as after a reset with these seeds; without one, those that
        /// they would have drawn.
        seeds: Seeds<&'a [Option<u64>]>,
    },
    /// Take the states of other environments, as they are before the order.
    Fork {
        /// `[count]`: for each environment the one that it becomes a copy of, which may be named several
        /// times.
        from: &'a [i32],
        /// As of a restore.
        seeds: Seeds<&'a [Option<u64>]>,
    },
}

impl Order<'_> {
    /// A reset to the units of the scenario.
    pub fn reset(seed: Option<u64>) -> Self {
        Order::Reset { seeds: seed.into(), levels: None }
    }

    pub(super) fn kind(&self) -> RequestKind {
        let seeds = self.seeds().form();
        match *self {
            Order::Step(_) => RequestKind::Step,
            Order::Reset { levels, .. } => RequestKind::Reset { seeds, levels: levels.is_some() },
            Order::Restore { .. } => RequestKind::Restore { seeds },
            Order::Fork { .. } => RequestKind::Fork { seeds },
        }
    }

    pub(super) fn seeds(&self) -> Seeds<&[Option<u64>]> {
        match *self {
            Order::Step(_) => Seeds::Continue,
            Order::Reset { seeds, .. } | Order::Restore { seeds, .. } | Order::Fork { seeds, .. } => seeds,
        }
    }

    /// What follows the ids of the environments in a request.
    pub(super) fn body(&self) -> Cow<'_, [u8]> {
        let body = match *self {
            Order::Step(actions) => bytemuck::cast_slice(actions),
            Order::Reset { levels, .. } => bytemuck::cast_slice(levels.unwrap_or_default()),
            Order::Restore { snapshots, .. } => snapshots,
            Order::Fork { from, .. } => bytemuck::cast_slice(from),
        };
        let Seeds::Each(seeds) = self.seeds() else { return Cow::Borrowed(body) };
        let words: Vec<_> = seeds.iter().map(|seed| seed_words(*seed)).collect();
        Cow::Owned([bytemuck::cast_slice(&words), body].concat())
    }
}
