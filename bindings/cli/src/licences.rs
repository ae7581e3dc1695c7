//! `smaclite-pool licences`: the licences of the crates in this program.

use super::CommandResult;
use clap::Args;
use std::io::Write;

/// `just generate` writes it, and `just lint` checks that it is up to date.
const NOTICES: &str = include_str!("../../../THIRD-PARTY-LICENSES");

#[derive(Args)]
pub(super) struct Licences {}

impl Licences {
    pub(super) fn run(self) -> CommandResult {
        Ok(crate::output::Output.write_all(NOTICES.as_bytes())?)
    }
}
