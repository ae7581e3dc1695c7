//! Runs after their training: evaluations are played again, reports compare them, and runs of other learners
//! are read.

mod evaluations;
mod foreign;
// Runs are made as in the tests of training, and less is asked of them here.
#[allow(dead_code)]
#[path = "../../../learn/tests/training/kit.rs"]
mod kit;
mod maps;
mod report;
