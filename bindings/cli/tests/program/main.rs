//! Tests of the program by its commands, output and exit status.

mod dataset;
mod dependencies;
mod doctor;
mod files;
mod kit;
mod page_kit;
mod play;
mod recording;
mod report;
mod shells;
mod snapshots;
mod tournament;
mod training;
mod watch;
mod zoo;
