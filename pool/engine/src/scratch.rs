//! The working memory of a step.

use crate::encode::ObsScratch;
use crate::tick::TickScratch;

/// Working memory of steps and encoders: one per thread, for battles of any arena in turn.
///
/// It holds no state: a step does not depend on what its scratch was used for before. It grows to the largest
/// arena it has served; after that a step allocates nothing.
#[derive(Debug, Default)]
pub struct Scratch {
    pub(crate) tick: TickScratch,
    pub(crate) obs: ObsScratch,
    pub(crate) enemies: EnemyScratch,
}

/// Working memory of the choice of the enemies' actions.
#[derive(Debug, Default)]
pub(crate) struct EnemyScratch {
    pub actions: Vec<i32>,
    /// Which agents the enemies see, by in-faction id.
    pub seen: Vec<bool>,
    pub policy: PolicyScratch,
}

/// Working memory of scripted policies.
#[derive(Clone, Debug, Default)]
pub(crate) struct PolicyScratch {
    /// What will be left of the opponents' health and shield, by in-faction id.
    pub remaining: Vec<f64>,
    /// Which opponents another unit attacks already, by in-faction id.
    pub is_taken: Vec<bool>,
}

impl Scratch {
    /// An empty one.
    pub fn new() -> Scratch {
        Scratch::default()
    }
}
