//! `smaclite-pool check`: validate scenario and unit files before anything runs.

use super::CommandResult;
use clap::Args;
use smaclite_engine::{Arena, Rules};
use smaclite_scenarios::Scenario;
use smaclite_units::UnitType;
use smaclite_units::file::{Json, MAX_SCENARIO_BYTES, Node, read_text, shown_path};
use std::error::Error;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub(super) struct Check {
    /// Scenario or unit files (JSON)
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

impl Check {
    pub(super) fn run(self) -> CommandResult {
        let mut invalid = 0;
        for file in &self.files {
            match describe(file) {
                Ok(description) => out!("{}: {description}", shown_path(file))?,
                Err(error) => {
                    eprintln!("{error}");
                    invalid += 1;
                }
            }
        }
        let total = self.files.len();
        if invalid > 0 { Err(format!("invalid files: {invalid} of {total}").into()) } else { Ok(()) }
    }
}

/// What a valid file contains. A scenario has `groups`, a unit type does not.
fn describe(file: &Path) -> Result<String, Box<dyn Error>> {
    let json = Json::parse(&read_text(file, MAX_SCENARIO_BYTES)?, &shown_path(file))?;
    let Json::Object(entries) = &json else {
        return Err(Node::root(&shown_path(file), &json).invalid("a unit or a scenario, { ... }").into());
    };
    if !entries.iter().any(|(key, _)| key == "groups") {
        let unit = UnitType::load(file)?;
        return Ok(format!(
            "valid unit type: {} hp, {} damage, range {}, speed {}",
            unit.hp, unit.damage, unit.attack_range, unit.speed
        ));
    }
    let scenario = Scenario::load(file)?;
    let s = Arena::new(&scenario, Rules::default()).sizes();
    Ok(format!(
        "valid scenario: {} agents against {} enemies, {} actions, obs size {}, state size {}",
        s.n_agents, s.n_enemies, s.n_actions, s.obs_size, s.state_size
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, FileType, Mode, mknodat};

    fn check(file: &Path, message: &str) {
        let error = describe(file).unwrap_err().to_string();
        assert_eq!(error, format!("{}: {message}", file.display()));
    }

    /// Files were once read without a limit before they were parsed: /dev/zero filled the memory, and a FIFO
    /// blocked until another process opened it for writing.
    #[test]
    fn files_are_read_with_the_limits_of_their_reader() {
        check(Path::new("/dev/zero"), "cannot be read: it is not a regular file");
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo.json");
        mknodat(CWD, &fifo, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        check(&fifo, "cannot be read: it is not a regular file");
        let large = folder.path().join("large.json");
        std::fs::File::create(&large).unwrap().set_len(10 << 30).unwrap();
        check(&large, "cannot be read: it is larger than 8192 KiB");
    }

    #[test]
    fn files_that_are_neither_a_unit_type_nor_a_scenario() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("one.json");
        std::fs::write(&file, "1").unwrap();
        check(&file, "the whole file is 1, but must be a unit or a scenario, { ... }");
        std::fs::write(&file, "{").unwrap();
        check(&file, "line 1, column 1: EOF while parsing an object");
        std::fs::write(&file, "{\"groups\": 3}").unwrap();
        check(&file, "`name` is missing; it must be the scenario's name");
        std::fs::write(&file, "{}").unwrap();
        check(&file, "`hp` is missing; it must be a number above 0 and at most 1000000");
    }
}
