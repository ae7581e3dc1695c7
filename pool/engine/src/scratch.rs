//! The working memory of a step.

use crate::encode::Sights;
use crate::tick::Plan;

/// Working memory of steps and encoders: one for each thread, for battles of any arena in turn.
///
/// It holds no state: a step does not depend on what its scratch was used for before. It grows to the largest
/// arena it has served; after that nothing is allocated in a step.
#[derive(Debug, Default)]
pub struct Scratch {
    pub(crate) plan: Plan,
    pub(crate) sights: Sights,
}

impl Scratch {
    /// An empty one.
    pub fn new() -> Scratch {
        Scratch::default()
    }
}
