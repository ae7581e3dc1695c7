//! Statistics of a benchmark: what can be said of an algorithm from few runs on some tasks.
//!
//! | file | contents |
//! | --- | --- |
//! | `aggregate` | the interquartile mean, performance profiles, the probability of improvement |
//! | `bootstrap` | intervals by the stratified bootstrap |
//! | `wilson` | the interval of a win rate |
//!
//! The definitions are those of Agarwal et al. (2021), "Deep reinforcement learning at the edge of the
//! statistical precipice", and of their package rliable, with which a test compares the numbers.

mod aggregate;
mod bootstrap;
mod wilson;

pub use aggregate::{interquartile_mean, probability_of_improvement, profile};
pub(crate) use bootstrap::quantile;
pub use bootstrap::{Estimate, estimate, estimates};
pub use wilson::wilson_interval;

/// Scores by task: one per run of it. The tasks are the strata of the bootstrap. They may have different
/// numbers of runs.
pub type Scores = Vec<Vec<f64>>;
