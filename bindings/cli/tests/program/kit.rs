//! Runs the program and checks what it prints.

use std::path::Path;
use std::process::{Command, Output};

/// A command with arguments separated by spaces, in a folder. It finds no other programs, ffmpeg among them.
pub fn program(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_smaclite-pool"));
    command.args(arguments.split(' ')).current_dir(folder).env("PATH", folder);
    command.env(smaclite_ipc::ROOT_VARIABLE, folder.join("pools"));
    command
}

pub fn run(folder: &Path, arguments: &str) -> Output {
    program(folder, arguments).output().expect("the program starts")
}

/// Runs a command that succeeds; returns what it printed.
pub fn output(folder: &Path, arguments: &str) -> String {
    let done = run(folder, arguments);
    assert!(done.status.success(), "{arguments}: {}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8(done.stdout).expect("text")
}

/// Runs a command that fails with this status; returns its message.
pub fn error(folder: &Path, arguments: &str, status: i32) -> String {
    let done = run(folder, arguments);
    let message = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(status), "{arguments}: {message}");
    message
}

/// Runs a command that fails with this status and a message that contains `expected`; lines of the message
/// may be broken.
pub fn check_error(folder: &Path, arguments: &str, status: i32, expected: &str) {
    let message = error(folder, arguments, status).replace("\n  ", " ");
    assert!(message.contains(expected), "{arguments}: expected `{expected}`, got `{message}`");
}

/// Whether a process has begun to handle Ctrl-C and SIGTERM itself.
pub fn catches_interruptions(id: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).expect("the process runs");
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).expect("the signals");
    let both = 1 << 1 | 1 << 14;
    u64::from_str_radix(caught.trim(), 16).expect("a mask") & both == both
}
