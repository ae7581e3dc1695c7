//! `smaclite-pool check`: validate scenario and unit files before anything runs.

use super::CommandResult;
use super::schema::Kind;
use clap::Args;
use serde_json::json;
use smaclite_engine::{Arena, BattleSetup, Rules};
use smaclite_scenarios::{Problem, Problems, Scenario, ScenarioFiles};
use smaclite_units::UnitType;
use smaclite_units::file::{
    Document, MAX_SCENARIO_BYTES, Report, Reported, printable_text, read_text, shown_path,
};
use std::path::{Path, PathBuf};

#[derive(Args)]
pub(super) struct Check {
    /// Scenario or unit files (JSON)
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Print one JSON object per file
    #[arg(long)]
    json: bool,
}

impl Check {
    pub(super) fn run(self) -> CommandResult {
        let mut invalid = 0;
        for file in &self.files {
            let (kind, content) = read(file);
            invalid += usize::from(content.is_err());
            if self.json {
                out!("{}", to_json(file, kind, &content))?;
                continue;
            }
            match content {
                Ok(content) => {
                    out!("{}: valid {content}", shown_path(file))?;
                    print_warnings(content.warnings());
                }
                Err(problems) => err!("{problems}"),
            }
        }
        let total = self.files.len();
        if invalid > 0 { Err(format!("invalid files: {invalid} of {total}").into()) } else { Ok(()) }
    }
}

/// What a valid file contains.
pub(super) enum Content {
    /// A scenario, and what is probably a mistake in it.
    Scenario(Box<Scenario>, Vec<Problem>),
    Unit(Box<UnitType>),
}

impl Content {
    fn warnings(&self) -> &[Problem] {
        if let Content::Scenario(_, warnings) = self { warnings } else { &[] }
    }
}

/// Prints what is probably a mistake in a valid scenario, to standard error.
pub(super) fn print_warnings(warnings: &[Problem]) {
    for warning in warnings {
        let warning = Problem { message: format!("warning: {}", warning.message), ..warning.clone() };
        err!("{}", printable_text(&warning.to_string()));
    }
}

/// Prints the warnings of battles that are going to be played.
pub(super) fn warn_of(setup: &BattleSetup) {
    print_warnings(&setup.warnings());
}

/// One line that describes a valid file.
impl std::fmt::Display for Content {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Content::Unit(unit) => write!(
                f,
                "unit type: {} hp, {} damage, range {}, speed {}",
                unit.hp, unit.damage, unit.attack_range, unit.speed
            ),
            Content::Scenario(scenario, _) => {
                let s = Arena::new(scenario, Rules::default()).sizes();
                write!(
                    f,
                    "scenario: {} agents against {} enemies, {} actions, obs size {}, state size {}",
                    s.n_agents, s.n_enemies, s.n_actions, s.obs_size, s.state_size
                )
            }
        }
    }
}

/// Reads a file of either kind; gives the kind if the file is a JSON object.
pub(super) fn read(file: &Path) -> (Option<Kind>, Result<Content, Problems>) {
    let report = Report::default();
    let kind = match kind_of(file, &report) {
        Ok(kind) => kind,
        Err(reported) => return (None, report.finish(Err(reported))),
    };
    // Duplicate keys, which `kind_of` reports too, are found by the reader again.
    let content = match kind {
        Kind::Scenario => ScenarioFiles::load(file)
            .map(|(scenario, files)| Content::Scenario(scenario.into(), files.warnings())),
        Kind::Unit => UnitType::load(file).map(|unit| Content::Unit(unit.into())),
    };
    (Some(kind), content)
}

/// The kind that has more of the file's keys, so that one mistyped or missing key does not change it.
fn kind_of(file: &Path, report: &Report) -> Result<Kind, Reported> {
    let (text, file) = (read_text(file, MAX_SCENARIO_BYTES, report)?, shown_path(file));
    let document = Document::parse(&text, &file, report)?;
    let root = document.root();
    if !root.is_object() {
        return Err(root.invalid("a unit or a scenario, { ... }"));
    }
    let entries = root.entries()?;
    let n_known = |kind: Kind| {
        let schema = kind.schema();
        entries.iter().filter(|(key, _)| schema["properties"].get(key).is_some()).count()
    };
    let is_scenario = n_known(Kind::Scenario) > n_known(Kind::Unit);
    Ok(if is_scenario { Kind::Scenario } else { Kind::Unit })
}

fn to_json(file: &Path, kind: Option<Kind>, content: &Result<Content, Problems>) -> serde_json::Value {
    let mut object = match content {
        Ok(Content::Scenario(scenario, _)) => {
            let arena = Arena::new(scenario, Rules::default());
            let s = arena.sizes();
            json!({
                "n_agents": s.n_agents, "n_enemies": s.n_enemies, "n_actions": s.n_actions,
                "obs_size": s.obs_size, "state_size": s.state_size, "episode_limit": arena.episode_limit(),
            })
        }
        Ok(Content::Unit(unit)) => json!({
            "hp": unit.hp, "damage": unit.damage, "attack_range": unit.attack_range, "speed": unit.speed,
        }),
        Err(_) => json!({}),
    };
    let (problems, n_problems) = match content {
        Ok(_) => (&[][..], 0),
        Err(problems) => (problems.list(), problems.n_problems()),
    };
    object["file"] = shown_path(file).into();
    object["valid"] = content.is_ok().into();
    object["kind"] = json!(kind.map(Kind::name));
    object["problems"] = json!(problems);
    object["n_problems"] = n_problems.into();
    if kind == Some(Kind::Scenario) {
        object["warnings"] = json!(content.as_ref().map_or(&[][..], Content::warnings));
    }
    object
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, FileType, Mode, mknodat};

    /// Checks the kind and the first problem of a file.
    fn check(file: &Path, kind: Option<Kind>, message: &str) {
        let (found, content) = read(file);
        let problems = content.err().expect("problems");
        let first = problems.list()[0].to_string();
        assert_eq!((found, first), (kind, format!("{}:{message}", file.display())));
    }

    /// Files were once read without a limit before they were parsed: /dev/zero filled the memory, and a FIFO
    /// blocked until another process opened it for writing.
    #[test]
    fn files_are_read_with_the_limits_of_their_reader() {
        check(Path::new("/dev/zero"), None, " cannot be read: it is not a regular file");
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo.json");
        mknodat(CWD, &fifo, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        check(&fifo, None, " cannot be read: it is not a regular file");
        let large = folder.path().join("large.json");
        std::fs::File::create(&large).unwrap().set_len(10 << 30).unwrap();
        check(&large, None, " cannot be read: it is larger than 8192 KiB");
    }

    #[test]
    fn files_that_are_neither_a_unit_type_nor_a_scenario() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("one.json");
        let check = |text: &str, kind, message| {
            std::fs::write(&file, text).unwrap();
            check(&file, kind, message);
        };
        check("1", None, "1:1: the whole file is 1, but must be a unit or a scenario, { ... }");
        check("{", None, "1:2: the file ends, but `{` of line 1 is not closed");
        let name = "1:1: `name` is missing; it must be the scenario's name";
        check("{\"groups\": 3}", Some(Kind::Scenario), name);
        // A scenario without its most important key is still one.
        check("{\"attack_point\": 3, \"grups\": 3}", Some(Kind::Scenario), name);
        let hp = "1:1: `hp` is missing; it must be a number from 0.001 to 1000000";
        check("{}", Some(Kind::Unit), hp);
    }
}
