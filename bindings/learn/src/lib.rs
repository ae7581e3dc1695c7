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
//! while a run trains, `seeds` trains several runs at a time, `report` compares those of several algorithms
//! (`statistics`), `evaluate` plays a trained team, and `trained_team` lets it play a single battle.
//! `dataset` keeps what teams play, for offline learning. `zoo` has teams that are part of the program.
//! `team` is what is trained. `random`, `parallel`, `math` and `tensors` serve the others.
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
mod checkpoint;
mod collect;
mod config;
mod cpu_timer;
mod dataset;
mod description;
mod enemy_actor;
mod evaluate;
mod evaluations;
mod exploit;
mod gae;
mod gradient;
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
mod parallel;
mod policy;
mod ppo;
mod random;
mod report;
mod rollout;
mod run;
mod seeds;
mod statistics;
mod team;
mod tensors;
mod tournament;
mod trained_team;
mod training;
mod units_network;
mod universal;
mod view;
mod zoo;
mod zoo_cards;
mod zoo_folders;

pub use adapt::adapt_team;
pub use config::{
    Activation, Algorithm, Config, ConfigError, DRAWN_TEAM_ENTROPY, Enemies, NetworkKind,
    STATE_CRITIC_AGENTS, SelfPlay, TEAM_ENTROPY, UnknownKeyword,
};
pub use dataset::{
    ARRAYS, Amount, ArrayName, ArraySpec, Card, Dataset, DatasetError, Distribution,
    Episode as RecordedEpisode, PerRow, Policy, PolicyCard, Quality, Recording, SUFFIX as DATASET_SUFFIX,
    Source, UnknownArray, UnknownQuality, Values,
};
pub use description::{OtherMap, RunDescription, Weights};
pub use evaluate::{
    EvaluateError, EvaluatedEpisode, Evaluation, EvaluationEvent, EvaluationResult, evaluate,
};
pub use evaluations::{
    Difference, EVALUATION_EPISODES, EvaluationRow, FINAL_EPISODES, FinalResult, Summary, Verification,
    VerifyError, verify,
};
pub use exploit::{Exploit, ExploitError, ExploitResult, Response};
pub use lane_error::LaneError;
pub use lane_opponents::{LaneOpponents, LaneOpponentsError};
pub use lanes::{Lanes, resolve_scenario};
pub use policy::Choice;
pub use ppo::{Diverged, UpdateStats};
pub use report::{
    Aggregate, AlgorithmRuns, Benchmark, CRITERION_EPISODES, CRITERION_WIN_RATE, Curve, ENVIRONMENT,
    EvaluatedRun, FirstWin, Improvement, Metric, PlayedEvaluation, Profile, Report, ReportError, Spread,
    THRESHOLDS, TimeToWin, marl_eval_json, time_to_win,
};
pub use rollout::Episode;
pub use run::Run;
pub use seeds::{OnSeedEvent, SeedEvent, Seeds, SeedsError, runs_in};
pub use statistics::{
    Estimate, Scores, estimate, estimates, interquartile_mean, probability_of_improvement, profile,
    wilson_interval,
};
pub use tensors::FileError;
pub use tournament::{PlayerScore, Score, Tournament, TournamentError, TournamentResult};
pub use trained_team::{TeamTensor, TrainedTeam, UnfitTeam};
pub use training::{Record, SelfPlayRecord, TrainError};
pub use zoo::{names_team, zoo_teams};
pub use zoo_cards::{ZooCard, ZooResult, zoo_cards};
pub use zoo_folders::{ExportError, export_zoo_team};
