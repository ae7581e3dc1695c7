//! Child processes: this program again, with one of the [`roles`](crate::roles). The parent writes commands
//! to the child's standard input, one per line, and reads one answer for each.

pub use crate::waiting::{TIMEOUT, eventually, eventually_within};
use crate::{LanePlan, PoolPlan, TestDir};
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process, waitid};
use smaclite_ipc::ROOT_VARIABLE;
use std::io::{BufRead, BufReader, Read, Seek, Write};
use std::process::{ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// The environment variable with the role of a child.
pub const ROLE_VARIABLE: &str = "SMACLITE_TEST_ROLE";

/// What a test program must be given to run its test `role` and no other; other programs ignore it.
pub const ROLE_ARGS: [&str; 4] = ["--exact", "role", "--ignored", "--nocapture"];

/// Marks the lines of a child's output that are answers; the test harness prints others.
const ANSWER: &str = "@ ";

/// Makes a process namespace. With `--kill-child` the processes in it end with `unshare`.
pub const NEW_PROCESS_NAMESPACE: &[&str] = &["unshare", "--pid", "--fork", "--kill-child"];

/// Whether a program can be started by this command; some need a permission.
pub fn can_launch(launcher: &[&str]) -> bool {
    let status = Command::new(launcher[0]).args(&launcher[1..]).arg("true").stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// A command that runs this program with a role: `NAME ARGUMENT` (see [`roles`](crate::roles)). With a
/// `launcher` it is the launcher's arguments that this program is appended to.
///
/// # Panics
/// If this program has no path.
pub fn role_command(dir: &TestDir, launcher: &[&str], role: &str) -> Command {
    let program = std::env::current_exe().expect("a path of this program");
    let mut command = match launcher {
        [] => Command::new(program),
        [launcher, arguments @ ..] => {
            let mut command = Command::new(launcher);
            command.args(arguments).arg(program);
            command
        }
    };
    command.args(ROLE_ARGS).env(ROLE_VARIABLE, role).env(ROOT_VARIABLE, dir.root());
    command
}

/// Answers the parent. A child whose parent is gone ends.
pub(crate) fn answer<T: std::fmt::Display, E: std::fmt::Display>(result: Result<T, E>) {
    let line = match result {
        Ok(value) => format!("ok {value}"),
        Err(error) => format!("error {error}"),
    };
    let mut out = std::io::stdout().lock();
    if writeln!(out, "{ANSWER}{}", line.trim_end()).and_then(|()| out.flush()).is_err() {
        std::process::exit(0);
    }
}

/// Runs a command to its end; its exit code, standard output and standard error. A command that has not
/// ended after a timeout is killed, and then there is no exit code.
///
/// # Panics
/// If it cannot be started.
pub fn run_to_end(command: &mut Command) -> (Option<i32>, String, String) {
    let mut files = [(); 2].map(|()| tempfile::tempfile().expect("a file"));
    let [stdout, stderr] = files.each_ref().map(|file| file.try_clone().expect("the same file"));
    let process = command.stdin(Stdio::null()).stdout(stdout).stderr(stderr).spawn();
    let status = wait(&mut process.expect("a child process"), TIMEOUT * 2);
    let [stdout, stderr] = files.each_mut().map(|file| {
        let mut text = String::new();
        file.rewind().and_then(|()| file.read_to_string(&mut text)).expect("the output of a command");
        text
    });
    (status.and_then(|status| status.code()), stdout, stderr)
}

/// Waits for the end of a process; kills it after `within`, and then returns `None`.
fn wait(process: &mut std::process::Child, within: Duration) -> Option<ExitStatus> {
    let mut status = None;
    let ended = eventually_within(within, || {
        status = process.try_wait().ok().flatten();
        status.is_some()
    });
    if !ended {
        let _ = process.kill();
        let _ = process.wait();
    }
    status
}

/// A child process; killed when it is dropped.
pub struct Child {
    process: std::process::Child,
    input: Option<ChildStdin>,
    answers: Receiver<String>,
    /// For messages.
    name: String,
}

impl Child {
    /// Starts a child with a role.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn start(dir: &TestDir, role: &str) -> Child {
        Child::launch(dir, &[], role)
    }

    /// Starts a child by a launcher, as [`role_command`].
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn launch(dir: &TestDir, launcher: &[&str], role: &str) -> Child {
        Child::spawn(&mut role_command(dir, launcher, role), role)
    }

    /// Starts `smaclite-pool` with these arguments, separated by spaces.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn program(dir: &TestDir, arguments: &str) -> Child {
        Child::start(dir, &format!("program {arguments}"))
    }

    /// Starts a supervisor and waits until it serves.
    ///
    /// # Panics
    /// If it does not start.
    pub fn supervisor(dir: &TestDir, plan: &PoolPlan) -> Child {
        let child = Child::try_supervisor(dir, plan);
        let answer = child.answer(TIMEOUT * 2);
        assert_eq!(answer.as_deref(), Ok("ok"), "the supervisor did not start");
        child
    }

    /// Starts a supervisor. Its first answer says whether it serves.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn try_supervisor(dir: &TestDir, plan: &PoolPlan) -> Child {
        Child::start(dir, &plan.role())
    }

    /// Starts a learner that is not attached yet.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn learner(dir: &TestDir, lane: &LanePlan) -> Child {
        Child::start(dir, &lane.role())
    }

    /// Starts a learner and attaches it to a lane of pool `train`.
    ///
    /// # Panics
    /// If it cannot attach.
    pub fn attached(dir: &TestDir, lane: &LanePlan) -> Child {
        let mut child = Child::learner(dir, lane);
        child.must("connect train");
        child
    }

    /// Starts a supervisor, and a learner that is attached to its first lane and has reset it.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn supervisor_and_learner(dir: &TestDir, plan: &PoolPlan) -> (Child, Child) {
        let supervisor = Child::supervisor(dir, plan);
        let mut learner = Child::attached(dir, &plan.lanes[0]);
        learner.must("reset");
        (supervisor, learner)
    }

    /// Starts a prepared command; the first word of `name` is its name in messages.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn spawn(command: &mut Command, name: &str) -> Child {
        let mut process =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("a child process");
        let output = BufReader::new(process.stdout.take().expect("piped"));
        let (sender, answers) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                // The test harness may have printed something at the beginning of the line.
                if let Some((_, answer)) = line.split_once(ANSWER)
                    && sender.send(answer.to_owned()).is_err()
                {
                    break;
                }
            }
        });
        let input = process.stdin.take();
        let name = name.split(' ').next().unwrap_or_default().to_owned();
        Child { process, input, answers, name }
    }

    /// Its process id.
    pub fn pid(&self) -> u32 {
        self.process.id()
    }

    /// Sends a command without waiting for the answer.
    pub fn tell(&mut self, line: &str) {
        if let Some(input) = &mut self.input {
            let _ = writeln!(input, "{line}"); // if the child is dead, there will be no answer
        }
    }

    /// The next answer: `Ok` with the text after `ok`, or `Err` with the text after `error`.
    ///
    /// # Errors
    /// The error that the child reports, or that it did not answer.
    pub fn answer(&self, within: Duration) -> Result<String, String> {
        match self.answers.recv_timeout(within) {
            Ok(line) => match line.strip_prefix("error ") {
                Some(error) => Err(error.to_owned()),
                None => Ok(line.strip_prefix("ok ").unwrap_or(&line).to_owned()),
            },
            Err(RecvTimeoutError::Timeout) => {
                Err(format!("no answer from the {} within {within:?}", self.name))
            }
            Err(RecvTimeoutError::Disconnected) => Err(format!("the {} is gone", self.name)),
        }
    }

    /// Sends a command and waits for the answer.
    ///
    /// # Errors
    /// As [`answer`](Child::answer).
    pub fn ask(&mut self, line: &str) -> Result<String, String> {
        self.tell(line);
        self.answer(TIMEOUT * 2)
    }

    /// Sends a command that must succeed and returns the answer.
    ///
    /// # Panics
    /// If it fails.
    pub fn must(&mut self, line: &str) -> String {
        self.ask(line).unwrap_or_else(|error| panic!("{line} of the {}: {error}", self.name))
    }

    /// Sends a signal. When this returns after SIGSTOP, every thread has stopped.
    ///
    /// # Panics
    /// If the system call fails.
    pub fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(self.process.id() as i32).expect("a process id");
        kill_process(pid, signal).expect("a signal to a child");
        if signal == Signal::STOP {
            let stopped_or_gone = WaitIdOptions::STOPPED | WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
            waitid(WaitId::Pid(pid), stopped_or_gone).expect("the state of a child");
        }
    }

    /// Kills it with SIGKILL and waits for its end.
    pub fn kill(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }

    /// Closes its input and waits for its end; kills it after a timeout.
    pub fn end(&mut self) -> Option<ExitStatus> {
        self.input.take();
        self.wait(TIMEOUT * 2)
    }

    /// Waits for its end; kills it after `within`, and then returns `None`.
    pub fn wait(&mut self, within: Duration) -> Option<ExitStatus> {
        wait(&mut self.process, within)
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.kill();
    }
}
