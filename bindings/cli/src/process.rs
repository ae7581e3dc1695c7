//! Processes: signals that end this one, a second one, and how much memory one uses.

use crate::os;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock};
use std::thread::JoinHandle;
use std::time::Duration;

/// In the environment of a second process: the id of the first, with which it ends.
const FIRST_PROCESS: &str = "SMACLITE_POOL_FIRST_PROCESS";

/// A second process, which is asked to end (by SIGTERM, or on Windows by the end of its input) and waited
/// for when this is dropped. On Linux and Windows it also ends when this process is killed, or its pool
/// would never end.
pub struct SecondProcess {
    child: Child,
    /// Hands on what it says on standard error until it ends, and returns the last line.
    errors: Option<JoinHandle<String>>,
    /// That line, after its end.
    said: String,
}

impl SecondProcess {
    /// Starts it without standard output, and without an input that it could read. What it says on standard
    /// error is said by this process.
    ///
    /// # Errors
    /// If the program cannot be started.
    pub fn start(mut command: Command) -> std::io::Result<SecondProcess> {
        command.env(FIRST_PROCESS, std::process::id().to_string());
        command.stdin(os::second_input()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut process = SecondProcess { child: command.spawn()?, errors: None, said: String::new() };
        if let Some(errors) = process.child.stderr.take() {
            process.errors = Some(std::thread::Builder::new().spawn(|| hand_on(errors))?);
        }
        Ok(process)
    }

    /// How it ended, and the last line that it said on standard error; `None` while it runs.
    ///
    /// # Errors
    /// If the system cannot say.
    pub fn end(&mut self) -> std::io::Result<Option<(ExitStatus, &str)>> {
        let Some(status) = self.child.try_wait()? else { return Ok(None) };
        self.hear_the_rest();
        Ok(Some((status, &self.said)))
    }

    /// To be called after its end. It starts no processes, which could keep its standard error open.
    fn hear_the_rest(&mut self) {
        if let Some(said) = self.errors.take().and_then(|errors| errors.join().ok()) {
            self.said = said;
        }
    }

    /// Its process id.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }
}

/// Longer lines are handed on in parts.
const LONGEST_LINE: u64 = 1 << 16;

fn hand_on(errors: ChildStderr) -> String {
    let (mut errors, mut last) = (BufReader::new(errors), Vec::new());
    loop {
        let mut line = Vec::new();
        match errors.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return String::from_utf8_lossy(last.trim_ascii()).into_owned(),
            Ok(_) => {
                let _ = std::io::stderr().write_all(&line); // it may be closed
                if !line.trim_ascii().is_empty() {
                    last = line;
                }
            }
        }
    }
}

impl Drop for SecondProcess {
    fn drop(&mut self) {
        if let Ok(None) = self.child.try_wait() {
            os::end(&mut self.child);
            let _ = self.child.wait();
        }
        self.hear_the_rest();
    }
}

/// Whether the first process of this second one has asked it to end, where that needs no signal.
static FIRST_ENDED: AtomicBool = AtomicBool::new(false);

/// To be called at the start of a program that can be a [`SecondProcess`].
pub fn end_with_first_process() {
    let first = std::env::var(FIRST_PROCESS).ok().and_then(|id| id.parse().ok());
    first.into_iter().for_each(|id| os::end_with_parent(id, &FIRST_ENDED));
}

/// How often a wait for a signal looks.
pub(crate) const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// The signal that a flag of [`interrupt_flag`] was set by last; 0 for none.
static RECEIVED: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);

/// A command was ended by a signal before it was complete, and has said so.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(crate) struct Interrupted;

/// The number of the signal that interrupted a command of this run of the program. A command that fails after
/// it has the exit status 128 + this number, as a program has that the signal ends by itself.
pub(crate) fn received_signal() -> Option<i32> {
    // The handlers publish nothing but the number.
    i32::try_from(RECEIVED.load(Ordering::Relaxed)).ok().filter(|signal| *signal > 0)
}

/// Forgets the signal of an earlier run of the program in this process, as from Python.
pub(crate) fn forget_signals() {
    RECEIVED.store(0, Ordering::Relaxed);
}

/// A flag that the signals set which ask a program to end. With it a command ends its pools before the
/// program ends; otherwise files would remain in shared memory.
///
/// # Errors
/// If the system refuses the signal handlers.
pub fn interrupt_flag() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in os::stop_signals() {
        set_on(signal, &flag)?;
    }
    Ok(flag)
}

/// [`interrupt_flag`] for work that asks now and then whether it is to end.
pub(crate) fn interruption() -> std::io::Result<impl Fn() -> bool> {
    let flag = interrupt_flag()?;
    Ok(move || flag.load(Ordering::Relaxed))
}

/// As [`interrupt_flag`]; the second signal ends the program at once, with files of its pools left until the
/// next start.
///
/// # Errors
/// As [`interrupt_flag`].
pub fn interrupt_flag_once() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in os::stop_signals() {
        // In this order: the first signal finds the flag clear.
        signal_hook::flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&flag))?;
        set_on(signal, &flag)?;
    }
    Ok(flag)
}

fn set_on(signal: i32, flag: &Arc<AtomicBool>) -> std::io::Result<()> {
    // The number first: who sees the flag finds it.
    signal_hook::flag::register_usize(signal, Arc::clone(&RECEIVED), signal as usize)?;
    signal_hook::flag::register(signal, Arc::clone(flag))?;
    Ok(())
}

/// Blocks until a signal asks this process to end. For second processes.
///
/// # Errors
/// If the system refuses the signal handlers.
pub fn wait_for_termination() -> std::io::Result<()> {
    let stop = interrupt_flag()?;
    wait_for(&stop);
    Ok(())
}

/// Blocks until the flag of [`interrupt_flag`] is set, or the first process of this second one ends.
pub(crate) fn wait_for(flag: &AtomicBool) {
    while !flag.load(Ordering::Relaxed) && !FIRST_ENDED.load(Ordering::Relaxed) {
        std::thread::sleep(LOOK_INTERVAL);
    }
}

/// Resident memory of a process in bytes; 0 if it is unknown.
pub fn resident_bytes(pid: u32) -> usize {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<usize>().ok()).map_or(0, |kb| kb * 1024)
}
