//! Tests of the program by its commands, output and exit status.

mod dependencies;
mod files;
mod kit;
mod page_kit;
mod recording;
mod training;
mod watch;
