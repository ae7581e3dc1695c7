//! Tests of the program by its commands, output and exit status.

mod dataset;
mod dependencies;
mod doctor;
mod files;
mod folders;
mod kit;
mod page_kit;
mod play;
mod recording;
mod report;
mod seams;
mod shells;
#[path = "../../../../tests/src/skip.rs"]
mod skip; // the kit of `tests` depends on this crate
mod snapshots;
mod tournament;
mod training;
mod verdicts;
mod watch;
mod zoo;
