//! A learner in Rust: proximal policy optimisation (PPO) of a team whose agents share one policy. It runs in
//! a process attached to a pool, as any learner does, and knows nothing of a command line (`smaclite_cli`).
//!
//! One update, in the order of the modules:
//!
//! 1. `collect` plays `horizon` steps of all environments of the `lanes`. `actor` evaluates the policy on the
//!    observations in shared memory, and `policy` draws available actions. What learning needs is copied into
//!    a `rollout`.
//! 2. `ppo` values every state with the critic; `gae` estimates advantages and returns from the values, and
//!    `normaliser` scales them.
//! 3. For some epochs of minibatches, `gradient` computes the gradient: `mlp` the passes through the
//!    networks, `loss` what lies between. `adam` clips it and makes a step.
//!
//! `training` repeats this, `run` adds the files of a folder (`checkpoint`, `log`), and `evaluate` plays a
//! trained team. `team` is what is trained. `random`, `parallel`, `math` and `tensors` serve the others.
//!
//! **Determinism.** The seed and the hyperparameters decide every bit of a run on one machine. They do so for
//! any load and any number of threads, of the learner and of the pool: each random number comes from a
//! generator that is seeded by its purpose; the rows of a minibatch are divided into jobs by their number
//! alone; and the jobs' gradients are added in their order. Between CPUs with different vector instructions,
//! matrix products differ in their last bits, and so do runs.

#![forbid(unsafe_code)]

mod actor;
mod adam;
mod checkpoint;
mod collect;
mod config;
mod evaluate;
mod gae;
mod gradient;
mod lanes;
mod log;
mod loss;
mod math;
mod mlp;
mod normaliser;
mod parallel;
mod policy;
mod ppo;
mod random;
mod rollout;
mod run;
mod team;
mod tensors;
mod training;

pub use config::{Activation, Algorithm, Config, ConfigError, UnknownKeyword};
pub use evaluate::{
    EvaluateError, EvaluatedEpisode, Evaluation, EvaluationEvent, EvaluationResult, evaluate,
};
pub use lanes::{LaneError, Lanes, resolve_scenario};
pub use ppo::{Diverged, UpdateStats};
pub use rollout::Episode;
pub use run::{Run, RunDescription};
pub use tensors::FileError;
pub use training::{Record, TrainError};
