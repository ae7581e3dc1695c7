//! This program as a second process, whether it runs by itself or within Python.

use super::throughput::Workload;
use std::path::PathBuf;
use std::process::Command;

/// `smaclite-pool serve` for a workload.
pub(crate) fn serve_command(workload: &Workload, name: &str) -> std::io::Result<Command> {
    let mut command = this_program()?;
    let Workload { options, batch_size, num_envs, scenario_argument, rules, .. } = workload;
    command.args(["serve", "--name", name, "--threads", &options.threads.to_string()]);
    command.args(["--batch-size", &batch_size.to_string(), "--wait", &options.wait.to_string()]);
    command.args(["--rules", &rules.to_string()]).arg(format!("bench={scenario_argument}:{num_envs}"));
    Ok(command)
}

/// This program once more.
fn this_program() -> std::io::Result<Command> {
    let Some(interpreter) = python_interpreter() else {
        return Ok(Command::new(std::env::current_exe()?));
    };
    let mut command = Command::new(interpreter);
    command.args(["-m", "smaclite_pool"]);
    Ok(command)
}

/// The interpreter, if this program runs in Python. It is named as this process was: the interpreter of a
/// virtual environment is a link, and knows its packages by the link's path.
pub(crate) fn python_interpreter() -> Option<PathBuf> {
    let executable = std::env::current_exe().ok()?;
    let is_python = executable.file_name()?.to_str()?.starts_with("python");
    is_python.then(|| std::env::args_os().next().map_or(executable, PathBuf::from))
}
