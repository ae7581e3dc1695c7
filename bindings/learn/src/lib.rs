//! A learner in Rust: proximal policy optimisation (PPO) of a team whose agents share one policy. It runs in
//! a process attached to a pool, as any learner does, and knows nothing of a command line (`smaclite_cli`).
//!
//! One update, in the order of the modules:
//!
//! 1. `collect` plays `horizon` steps of all environments of the `lanes`. `actor` evaluates the policy on the
//!    observations in shared memory, and `policy` draws available actions. What learning needs is copied into
//!    a `rollout`. If teams play the enemies (`enemies`), `enemy_actor` chooses their actions too: those of
//!    the team itself, or of a rival of the `league`. Either side is read through a `view`.
//! 2. `ppo` values every state with the critic; `gae` estimates advantages and returns from the values, and
//!    `normaliser` scales them.
//! 3. For some epochs of minibatches, `gradient` computes the gradient: `architecture` the passes through
//!    the networks (`mlp` or `units_network`, both of `linear` maps), `loss` what lies between. `adam` clips
//!    it and makes a step.
//!
//! `training` repeats this, `run` adds the files of a folder (`checkpoint`, `log`), `evaluations` are played
//! while a run trains, `seeds` trains several runs at a time, `evaluate` plays a trained team in a pool,
//! `battles` without one, and `trained_team` lets it play a single battle. `zoo` has teams that are part of
//! the program. `team` is what is trained. `random`, `parallel`, `math` and `tensors` serve the others.
//!
//! What compares, records or examines trained teams is the crate `smaclite_lab`.
//!
//! **Determinism.** The seed and the hyperparameters decide every bit of a run on one machine. They do so for
//! any load and any number of threads, of the learner and of the pool: each random number comes from a
//! generator that is seeded by its purpose; the rows of a minibatch are divided into jobs by their number
//! alone; and the jobs' gradients are added in their order. Between CPUs with different vector instructions,
//! matrix products differ in their last bits, and so do runs.

#![forbid(unsafe_code)]

mod actor;
mod adam;
mod adapt;
mod architecture;
pub mod battles;
mod checkpoint;
mod collect;
mod config;
mod cpu_timer;
mod description;
mod enemy_actor;
mod evaluate;
mod evaluations;
mod gae;
mod gradient;
#[cfg(test)]
mod gradient_check;
mod lane_error;
mod lane_opponents;
mod lanes;
mod league;
mod linear;
mod log;
mod loss;
mod math;
mod mlp;
mod normaliser;
pub mod parallel;
mod policy;
mod ppo;
pub mod random;
mod rollout;
mod run;
mod run_folders;
mod seeds;
mod setups;
mod team;
mod team_files;
mod tensors;
mod trained_team;
mod training;
mod units_network;
mod universal;
mod view;
mod weights;
mod zoo;
mod zoo_cards;
mod zoo_folders;

pub use adapt::adapt_team;
pub use config::{
    Activation, Algorithm, Config, ConfigError, Enemies, NetworkKind, STATE_CRITIC_AGENTS, SelfPlay,
    TEAM_ENTROPY,
};
pub use description::{
    DESCRIPTIONS, OPPONENT, OtherMap, RunDescription, Weights, holds_run, refuse_undescribed,
};
pub use evaluate::{
    EvaluateError, EvaluatedEpisode, Evaluation, EvaluationEvent, EvaluationResult, evaluate,
};
pub use evaluations::{
    BothEpisodes, EVALUATION_EPISODES, EvaluationFiles, EvaluationRow, Evaluator, FINAL_EPISODES,
    FinalResult, Occasion, Summary, on_map,
};
pub use lane_error::{LaneError, UnequalUnits};
pub use lane_opponents::{LaneOpponents, LaneOpponentsError};
pub use lanes::Lanes;
pub use policy::Choice;
pub use ppo::{Diverged, UpdateStats};
pub use rollout::Episode;
pub use run::{Run, TrainEvent};
pub use run_folders::{held_run, refuse_both, runs_in, seed_folder};
pub use seeds::{OnTrainEvent, Seeds, SeedsError, check_seeds};
pub use setups::{resolve_scenario, with_an_end};
pub use team::Network;
pub use team_files::read_team_files;
pub use tensors::{FileError, read as read_file};
pub use trained_team::{TrainedTeam, UnfitTeam};
pub use training::{Record, SelfPlayRecord, TrainError};
pub use zoo::{names_team, zoo_teams};
pub use zoo_cards::{ZooCard, ZooResult, zoo_card, zoo_cards};
pub use zoo_folders::{ExportError, export_zoo_team, refuse_zoo_team};
