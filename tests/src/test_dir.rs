//! The directory of one test's pools: starting and attaching to them, and the files that must not remain.

use crate::waiting::eventually;
use crate::{LanePlan, Learner, PoolPlan};
use smaclite_ipc::{Client, ConnectError, PoolStatus, RuntimeDir, Supervisor, WaitOptions, WaitStrategy};
use std::path::{Path, PathBuf};

/// A private root directory, removed at the end together with what the test left in `/dev/shm`.
pub struct TestDir {
    runtime_dir: RuntimeDir,
    root: tempfile::TempDir,
}

impl TestDir {
    /// An empty directory.
    ///
    /// # Panics
    /// If it cannot be created.
    pub fn new() -> TestDir {
        // Directly below /tmp, because paths of sockets must be short.
        let root = tempfile::Builder::new().prefix("sp-").tempdir_in("/tmp").expect("a temporary directory");
        let runtime_dir = RuntimeDir::at(root.path().to_owned()).expect("a directory for pools");
        TestDir { runtime_dir, root }
    }

    /// The directory as supervisors and clients of this process take it.
    pub fn runtime_dir(&self) -> &RuntimeDir {
        &self.runtime_dir
    }

    /// Its path.
    pub fn root(&self) -> &Path {
        self.root.path()
    }

    /// Starts a pool in this process.
    ///
    /// # Panics
    /// If it does not start.
    pub fn start(&self, plan: &PoolPlan) -> Supervisor {
        let prepared = plan.prepare(&self.runtime_dir).expect("a valid plan");
        Supervisor::start_prepared(prepared, &mut || false).expect("a pool")
    }

    /// Attaches a learner of this process to a lane of pool `train`.
    ///
    /// # Panics
    /// If it cannot attach.
    pub fn learner(&self, lane: &LanePlan) -> Learner {
        Learner::connect(&self.runtime_dir, "train", lane).expect("a learner")
    }

    /// Attaches a client of this process to the only lane of pool `train`.
    ///
    /// # Panics
    /// If it cannot attach.
    pub fn client(&self) -> Client {
        self.connect(None, WaitStrategy::default(), WaitOptions::no_wait()).expect("a client")
    }

    /// Attaches a client of this process to a lane of pool `train`.
    ///
    /// # Errors
    /// The client's.
    pub fn connect(
        &self,
        lane: Option<&str>,
        strategy: WaitStrategy,
        wait: WaitOptions<'_>,
    ) -> Result<Client, ConnectError> {
        Client::connect(&self.runtime_dir, "train", lane, strategy, wait)
    }

    /// The status of pool `train`.
    ///
    /// # Panics
    /// If it does not run.
    pub fn status(&self) -> PoolStatus {
        smaclite_ipc::status(&self.runtime_dir, "train", WaitOptions::for_response()).expect("a status")
    }

    /// The files in it, and the files and directories of its pools in `/dev/shm`. Where pools use no
    /// `/dev/shm`, a lock stays.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = shm_dirs(&self.runtime_dir);
        files.clone().iter().for_each(|dir| collect_files(dir, &mut files));
        collect_files(self.root(), &mut files);
        files.retain(|file| *file != self.root().join("lock"));
        files.sort();
        files
    }

    /// Waits until no file is left.
    ///
    /// # Panics
    /// If files are left after [`TIMEOUT`](crate::waiting::TIMEOUT), with their names.
    pub fn assert_empty(&self) {
        let empty = eventually(|| self.files().is_empty());
        assert!(empty, "left behind: {:#?}", self.files());
    }
}

impl Default for TestDir {
    fn default() -> Self {
        TestDir::new()
    }
}

impl Drop for TestDir {
    fn drop(&mut self) {
        shm_dirs(&self.runtime_dir).iter().for_each(|dir| drop(std::fs::remove_dir_all(dir)));
    }
}

fn shm_dirs(runtime_dir: &RuntimeDir) -> Vec<PathBuf> {
    let entries = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let ours =
        entries.filter(|e| e.file_name().to_str().is_some_and(|n| n.starts_with(runtime_dir.shm_prefix())));
    ours.map(|e| e.path()).collect()
}

fn collect_files(dir: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(dir).into_iter().flatten().flatten() {
        match entry.file_type() {
            Ok(kind) if kind.is_dir() => collect_files(&entry.path(), files),
            _ => files.push(entry.path()),
        }
    }
}
