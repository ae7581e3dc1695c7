//! Children: this program again, with a role, told what to do by lines on its standard input.

use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process, waitid};
use std::io::{BufRead, BufReader, Write};
use std::process::{ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Names the role of a child; see [`role`](super::role).
pub const ROLE_VARIABLE: &str = "SMACLITE_TEST_ROLE";

/// What begins the lines of a child that are answers; a test harness prints others.
pub const ANSWER: &str = "@ ";

/// What is promised within a second must come within this, be the machine ever so busy. Nothing waits so long
/// for what should not come.
pub const SOON: Duration = Duration::from_secs(15);

/// A child process; killed when it is dropped.
pub struct Child {
    process: std::process::Child,
    input: Option<ChildStdin>,
    answers: Receiver<String>,
    /// For messages.
    role: String,
}

impl Child {
    /// Starts a child of this role at the room's place; `argument` is the role's own.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn start(room: &super::Room, role: &str, argument: &str) -> Child {
        let mut command = Command::new(std::env::current_exe().expect("a path of this program"));
        command.args(["--exact", "role", "--ignored", "--nocapture"]); // for a program with a test harness
        command.env(ROLE_VARIABLE, format!("{role} {argument}"));
        Child::of_command(command.env(smaclite_ipc::ROOT_VARIABLE, room.root()), role)
    }

    /// Starts a child of this role in a process namespace of its own, or in this one if that is not
    /// permitted.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn start_in_namespace(room: &super::Room, role: &str, argument: &str) -> Child {
        // --kill-child: the child dies with `unshare`.
        let namespace = ["--pid", "--fork", "--kill-child"];
        let permitted = Command::new("unshare").args(namespace).arg("true").stderr(Stdio::null()).status();
        if !permitted.is_ok_and(|status| status.success()) {
            println!("no process namespace is permitted here: the {role} is in this one");
            return Child::start(room, role, argument);
        }
        let mut command = Command::new("unshare");
        command.args(namespace).arg(std::env::current_exe().expect("a path of this program"));
        command.args(["--exact", "role", "--ignored", "--nocapture"]);
        command.env(ROLE_VARIABLE, format!("{role} {argument}"));
        Child::of_command(command.env(smaclite_ipc::ROOT_VARIABLE, room.root()), role)
    }

    /// Starts a supervisor and waits until it serves.
    ///
    /// # Panics
    /// If it does not start.
    pub fn supervisor(room: &super::Room, plan: &super::PoolPlan) -> Child {
        let child = Child::start(room, "supervisor", &serde_json::to_string(plan).expect("plain data"));
        let answer = child.answer(SOON * 2);
        assert_eq!(answer.as_deref(), Ok("ok"), "the supervisor did not start");
        child
    }

    /// Starts a supervisor that may not come up; its answer says.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn supervisor_refused(room: &super::Room, plan: &super::PoolPlan) -> Child {
        Child::start(room, "supervisor", &serde_json::to_string(plan).expect("plain data"))
    }

    /// Starts a learner, not yet attached.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn learner(room: &super::Room, lane: &super::LanePlan) -> Child {
        Child::start(room, "learner", &serde_json::to_string(lane).expect("plain data"))
    }

    /// Starts a learner and attaches it to a lane.
    ///
    /// # Panics
    /// If it cannot attach.
    pub fn attached(room: &super::Room, lane: &super::LanePlan) -> Child {
        let mut child = Child::learner(room, lane);
        child.must("connect train");
        child
    }

    /// Starts a prepared command.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn of_command(command: &mut Command, role: &str) -> Child {
        let mut process =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("a child process");
        let output = BufReader::new(process.stdout.take().expect("piped"));
        let (sender, answers) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                // The harness may have left the cursor behind its own words.
                if let Some((_, answer)) = line.split_once(ANSWER)
                    && sender.send(answer.to_owned()).is_err()
                {
                    break;
                }
            }
        });
        let input = process.stdin.take();
        Child { process, input, answers, role: role.to_owned() }
    }

    /// Its process number.
    pub fn pid(&self) -> u32 {
        self.process.id()
    }

    /// Tells it something without waiting for the answer.
    pub fn tell(&mut self, line: &str) {
        if let Some(input) = &mut self.input {
            let _ = writeln!(input, "{line}"); // a dead child's answer will be missed
        }
    }

    /// Its next answer: `Ok` of what follows `ok`, `Err` of what follows `error`.
    ///
    /// # Errors
    /// What the child reports as an error, or that it did not answer.
    pub fn answer(&self, within: Duration) -> Result<String, String> {
        match self.answers.recv_timeout(within) {
            Ok(line) => match line.strip_prefix("error ") {
                Some(error) => Err(error.to_owned()),
                None => Ok(line.strip_prefix("ok ").unwrap_or(&line).to_owned()),
            },
            Err(RecvTimeoutError::Timeout) => {
                Err(format!("no answer of the {} within {within:?}", self.role))
            }
            Err(RecvTimeoutError::Disconnected) => Err(format!("the {} is gone", self.role)),
        }
    }

    /// Tells it something and waits for the answer.
    ///
    /// # Errors
    /// As [`answer`](Child::answer).
    pub fn ask(&mut self, line: &str) -> Result<String, String> {
        self.tell(line);
        self.answer(SOON * 2)
    }

    /// Tells it something that must succeed.
    ///
    /// # Panics
    /// If it does not.
    pub fn must(&mut self, line: &str) -> String {
        self.ask(line).unwrap_or_else(|error| panic!("{} of the {}: {error}", line, self.role))
    }

    /// Sends a signal; one to stop has taken effect in every thread when this returns.
    ///
    /// # Panics
    /// If the system refuses.
    pub fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(self.process.id() as i32).expect("a process number");
        kill_process(pid, signal).expect("a signal to an own child");
        if signal == Signal::STOP {
            let stopped_or_gone = WaitIdOptions::STOPPED | WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
            waitid(WaitId::Pid(pid), stopped_or_gone).expect("the state of an own child");
        }
    }

    /// Ends it with SIGKILL and takes its status from the system.
    pub fn kill(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }

    /// Closes its input and waits for its end; kills it if it does not come.
    pub fn end(&mut self) -> Option<ExitStatus> {
        self.input.take();
        self.wait(SOON * 2)
    }

    /// Waits for its end.
    pub fn wait(&mut self, within: Duration) -> Option<ExitStatus> {
        let mut status = None;
        let ended = eventually_within(within, || {
            status = self.process.try_wait().ok().flatten();
            status.is_some()
        });
        if !ended {
            self.kill();
        }
        status
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Does this become true within what counts as soon?
pub fn eventually(condition: impl FnMut() -> bool) -> bool {
    eventually_within(SOON, condition)
}

/// Does this become true in time?
pub fn eventually_within(time: Duration, mut condition: impl FnMut() -> bool) -> bool {
    let begin = Instant::now();
    loop {
        if condition() {
            return true;
        }
        if begin.elapsed() > time {
            return false;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
