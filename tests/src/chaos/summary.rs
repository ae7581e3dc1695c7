//! What happened in a chaos run.

use std::fmt;
use std::time::Duration;

/// Counts of a run.
#[derive(Debug, Default)]
pub struct Summary {
    /// Client processes that were killed.
    pub killed_clients: u64,
    /// Supervisors that were killed.
    pub killed_supervisors: u64,
    /// Supervisors that were ended normally and started again.
    pub restarted_supervisors: u64,
    /// Processes that were stopped for a while.
    pub stopped: u64,
    /// Frames that learners compared with the reference.
    pub frames: u64,
    /// Sessions of learners.
    pub sessions: u64,
    /// Sessions that ended with the error that the pool is gone.
    pub pools_gone: u64,
    /// Forked children that read a batch of their parent.
    pub forks: u64,
    /// Attempts to attach from another process namespace.
    pub namespace_attempts: u64,
    /// Pools killed at a system call.
    pub crash_points: u64,
    /// The longest time without a message from a process, and its description.
    pub longest_silence: (Duration, String),
    /// Resources of the supervisor that is never killed, at the first and at the last measurement.
    pub resources: String,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "killed: {} clients, {} supervisors", self.killed_clients, self.killed_supervisors)?;
        writeln!(f, "stopped for a while: {} processes", self.stopped)?;
        writeln!(f, "ended and restarted: {} supervisors", self.restarted_supervisors)?;
        writeln!(f, "sessions: {}, of which {} ended with their pool", self.sessions, self.pools_gone)?;
        writeln!(f, "frames compared: {}; none was wrong, lost or repeated", self.frames)?;
        writeln!(f, "forks: {}; crash points: {}", self.forks, self.crash_points)?;
        writeln!(f, "attempts to attach from another process namespace: {}", self.namespace_attempts)?;
        writeln!(f, "longest silence: {:?} ({})", self.longest_silence.0, self.longest_silence.1)?;
        write!(f, "resources of the supervisor that is never killed: {}", self.resources)
    }
}
