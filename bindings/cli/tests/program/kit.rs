//! Runs the program and checks what it prints.

use rustix::fs::{CWD, FileType, Mode, mknodat};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use smaclite_ipc::RuntimeDir;
use std::fs;
use std::io::{BufRead, BufReader};
use std::ops::Deref;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longer than anything takes on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(30);

/// Options of trainings that take a moment.
pub const SMALL: &str = "--num-envs 8 --horizon 16 --hidden 16,16";

/// A folder for the files of commands; their pools are in the folder `pools` in it. Dropping it removes what
/// killed pools left behind.
pub struct Place(TempDir);

impl Deref for Place {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = program(self, "clean").output();
    }
}

impl Place {
    /// Its path is short, as that of a socket must be.
    pub fn new() -> Place {
        Place(tempfile::Builder::new().prefix("sp").tempdir_in("/tmp").expect("a folder"))
    }

    pub fn runtime_dir(&self) -> RuntimeDir {
        RuntimeDir::at(self.join("pools")).expect("a private folder")
    }

    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.join(name), content).unwrap_or_else(|error| panic!("{name}: {error}"));
    }

    /// Replaces a text by what becomes of it, which differs.
    pub fn change(&self, name: &str, change: impl FnOnce(&str) -> String) {
        let (before, path) = (self.read(name), self.join(name));
        let after = change(&before);
        assert_ne!(before, after, "{}", path.display());
        fs::write(path, after).expect("a file");
    }

    /// The names of what is in a folder, sorted.
    pub fn names_in(&self, name: &str) -> Vec<String> {
        let entries = fs::read_dir(self.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let names = entries.map(|entry| entry.expect("an entry").file_name().into_string().expect("text"));
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    /// Runs a command that fails with this status and a message that contains `expected`; lines of the
    /// message may be broken.
    pub fn fails(&self, arguments: &str, status: i32, expected: &str) {
        let message = error(self, arguments, status).replace("\n  ", " ");
        assert!(message.contains(expected), "{arguments}: expected `{expected}`, got `{message}`");
    }

    pub fn start(&self, arguments: &str) -> Program {
        Program::start(program(self, arguments))
    }

    /// A pool that runs.
    pub fn serve(&self, arguments: &str) -> Program {
        let mut pool = self.start(&format!("serve {arguments}"));
        while !pool.line().starts_with("connect with") {}
        pool
    }
}

/// A program that is interrupted when dropped, and killed if it does not end.
pub struct Program {
    pub child: Child,
    pub output: BufReader<ChildStdout>,
}

impl Program {
    pub fn start(mut command: Command) -> Program {
        let mut child = command.stdout(Stdio::piped()).spawn().expect("the program starts");
        let output = BufReader::new(child.stdout.take().expect("a pipe"));
        Program { child, output }
    }

    pub fn line(&mut self) -> String {
        let mut line = String::new();
        assert!(self.output.read_line(&mut line).expect("text") > 0, "the program ended");
        line
    }

    /// Ends it as Ctrl-C does; returns its exit status.
    pub fn interrupt(&mut self) -> Option<i32> {
        send_signal(&self.child, Signal::INT);
        self.child.wait().expect("it ends").code()
    }

    pub fn kill(&mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it ends");
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            let _ = kill_process(Pid::from_child(&self.child), Signal::INT);
        }
        let begin = Instant::now();
        while matches!(self.child.try_wait(), Ok(None)) && begin.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

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

/// Runs a command that succeeds; returns what it said on standard error.
pub fn warnings(folder: &Path, arguments: &str) -> String {
    let done = run(folder, arguments);
    assert!(done.status.success(), "{arguments}: {done:?}");
    String::from_utf8(done.stderr).expect("text")
}

/// Starts a command whose output is read at its end.
pub fn spawn(folder: &Path, arguments: &str) -> Child {
    let mut command = program(folder, arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
}

/// Runs a command that succeeds; returns what it printed, which is JSON.
pub fn json(folder: &Path, arguments: &str) -> Value {
    parsed(&output(folder, arguments))
}

/// The lines of a text, which are JSON.
pub fn json_lines(text: &str) -> Vec<Value> {
    text.lines().map(parsed).collect()
}

/// A table of evaluations whose last one has another greedy mean return.
pub fn with_other_return(rows: &str) -> String {
    let last = rows.lines().last().expect("a row");
    let fields: Vec<&str> = last.split(',').collect();
    rows.replace(last, &[&fields[..4], &["21"], &fields[5..]].concat().join(","))
}

pub fn parsed(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

pub fn make_pipe(path: &Path) {
    mknodat(CWD, path, FileType::Fifo, Mode::RWXU, 0).expect("a pipe");
}

pub fn send_signal(child: &Child, signal: Signal) {
    kill_process(Pid::from_child(child), signal).expect("it runs");
}

pub fn wait_until(is_so: impl Fn() -> bool) {
    while !is_so() {
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until a process handles Ctrl-C and SIGTERM itself.
pub fn wait_until_caught(child: &Child) {
    let both = 1 << 1 | 1 << 14;
    wait_until(|| {
        let status = fs::read_to_string(format!("/proc/{}/status", child.id())).expect("the process runs");
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).expect("the signals");
        u64::from_str_radix(caught.trim(), 16).expect("a mask") & both == both
    });
}
