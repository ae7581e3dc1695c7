//! `smaclite-pool completions`: the script by which a shell asks this program what can follow. The answers
//! are clap's, except for the values here: scenarios and running pools.

use super::{Cli, CommandResult};
use clap::{Args, CommandFactory};
use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter, ValueCompleter};
use clap_complete::env::{CompleteEnv, Shells};
use smaclite_engine::Opponent;
use smaclite_ipc::{RuntimeDir, running_pools};
use smaclite_learn::zoo_teams;
use smaclite_scenarios::Scenario;
use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::path::Path;

/// The environment variable with which a script asks; its value is the shell.
const VARIABLE: &str = "SMACLITE_POOL_COMPLETE";

const NAME: &str = "smaclite-pool";

#[derive(Args)]
#[command(after_help = "\
To complete commands in every new shell, add the line of your shell to the file:
  ~/.bashrc                   source <(smaclite-pool completions bash)
  ~/.zshrc, after compinit    source <(smaclite-pool completions zsh)
  ~/.config/fish/config.fish  smaclite-pool completions fish | source
  ~/.config/elvish/rc.elv     eval (smaclite-pool completions elvish | slurp)
  $PROFILE of PowerShell      smaclite-pool completions powershell | Out-String | iex")]
pub(super) struct Completions {
    /// The shell
    shell: clap_complete::Shell,
}

impl Completions {
    /// `program`: the name or path by which this program was run, and by which the script will run it.
    pub(super) fn run(self, program: &OsStr) -> CommandResult {
        let shells = Shells::builtins();
        let shell = shells.completer(&self.shell.to_string()).ok_or("no script for this shell")?;
        let mut script = Vec::new();
        shell.write_registration(VARIABLE, NAME, NAME, &absolute(program)?, &mut script)?;
        Ok(crate::output::Output.write_all(&script)?)
    }
}

/// A name stays a name, to be looked up in PATH; a path must not depend on the folder.
fn absolute(program: &OsStr) -> std::io::Result<String> {
    let path = Path::new(program);
    let path = if path.components().count() > 1 { std::path::absolute(path)? } else { path.to_owned() };
    Ok(path.to_string_lossy().into_owned())
}

/// Answers if a script asks, and returns the exit status; `None` if this is a run of the program.
pub(super) fn answer(args: &[OsString]) -> Option<i32> {
    let folder = std::env::current_dir().ok();
    match CompleteEnv::with_factory(Cli::command).var(VARIABLE).try_complete(args, folder.as_deref()) {
        Ok(false) => None,
        Ok(true) => Some(0),
        Err(error) => {
            let _ = error.print(); // fails only if the output is closed
            Some(error.exit_code())
        }
    }
}

/// A standard scenario or a scenario file.
pub(super) fn scenario() -> ArgValueCompleter {
    ArgValueCompleter::new(scenarios)
}

/// `[LANE=]SCENARIO[:N]`.
pub(super) fn lane() -> ArgValueCompleter {
    ArgValueCompleter::new(|current: &OsStr| {
        let text = current.to_string_lossy();
        match text.split_once('=') {
            // A folder may have the sign, too.
            Some((lane, scenario)) if scenarios(current).is_empty() => scenarios(OsStr::new(scenario))
                .into_iter()
                .map(|candidate| candidate.add_prefix(format!("{lane}=")))
                .collect(),
            _ => scenarios(current),
        }
    })
}

/// A running pool.
pub(super) fn pool() -> ArgValueCompleter {
    ArgValueCompleter::new(|current: &OsStr| {
        let pools = RuntimeDir::for_current_user().map_or(Vec::new(), |folder| running_pools(&folder));
        beginning_with(current, pools)
    })
}

/// A script, a team of the zoo, or the folder of a run.
pub(super) fn player() -> ArgValueCompleter {
    ArgValueCompleter::new(|current: &OsStr| {
        let mut found = beginning_with(current, Opponent::scripts().map(Opponent::name));
        found.extend(beginning_with(current, zoo_teams().map(|name| format!("zoo:{name}"))));
        found.extend(PathCompleter::dir().complete(current));
        found
    })
}

fn scenarios(current: &OsStr) -> Vec<CompletionCandidate> {
    let is_json = |path: &Path| path.extension().is_some_and(|suffix| suffix == "json");
    let mut found = beginning_with(current, Scenario::standard_names().chain(Scenario::generated_names()));
    found.extend(PathCompleter::any().filter(is_json).complete(current));
    found
}

fn beginning_with(
    current: &OsStr,
    names: impl IntoIterator<Item = impl Into<OsString>>,
) -> Vec<CompletionCandidate> {
    let names = names.into_iter().map(Into::into);
    let fitting = names.filter(|name| name.as_encoded_bytes().starts_with(current.as_encoded_bytes()));
    fitting.map(CompletionCandidate::new).collect()
}
