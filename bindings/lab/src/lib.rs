//! What is done with trained teams and their runs: `tournament` lets players meet, `exploit` trains a team
//! against another one, `report` compares runs of several algorithms (`statistics`), `verify` plays recorded
//! evaluations again, `dataset` keeps what teams play, for offline learning, and `action_trace` plays
//! battles whose speed is measured.
//!
//! It uses of the learner (`smaclite_learn`) what any program can, and the learner nothing of it.

#![forbid(unsafe_code)]

mod action_trace;
mod dataset;
mod exploit;
mod report;
mod statistics;
mod tournament;
mod verify;

pub use action_trace::{ActionTrace, AfterEpisode, TracePlayer};
pub use dataset::{
    ARRAYS, Amount, ArrayName, ArraySpec, Card, Dataset, DatasetError, Distribution,
    Episode as RecordedEpisode, PerRow, Policy, PolicyCard, Quality, Recording, SUFFIX as DATASET_SUFFIX,
    Source, UnknownArray, Values,
};
pub use exploit::{Exploit, ExploitError, ExploitResult, Response};
pub use report::{
    Aggregate, AlgorithmRuns, Benchmark, CRITERION_EPISODES, CRITERION_WIN_RATE, Curve, ENVIRONMENT,
    EvaluatedRun, FirstWin, Improvement, Metric, PlayedEvaluation, Profile, Report, ReportError, Spread,
    THRESHOLDS, TimeToWin, marl_eval_json, time_to_win,
};
pub use statistics::{
    Estimate, Scores, estimate, estimates, interquartile_mean, probability_of_improvement, profile,
    wilson_interval,
};
pub use tournament::{PlayerScore, Score, Tournament, TournamentError, TournamentResult};
pub use verify::{Difference, Mismatch, Verification, VerifyError, verify};
