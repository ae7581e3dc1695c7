//! A place for the pools of one test, and what must not be left in it.

use smaclite_ipc::RuntimeDir;
use std::path::{Path, PathBuf};

/// A private root folder, removed at the end with whatever the test left in `/dev/shm`.
pub struct Room {
    runtime_dir: RuntimeDir,
    folder: tempfile::TempDir,
}

impl Room {
    /// An empty room.
    ///
    /// # Panics
    /// If there is no room in the folder for temporary files.
    pub fn new() -> Room {
        // Directly below /tmp: socket paths must be short.
        let folder = tempfile::Builder::new().prefix("sp-").tempdir_in("/tmp").expect("a temporary folder");
        let runtime_dir = RuntimeDir::at(folder.path().to_owned()).expect("a place for pools");
        Room { runtime_dir, folder }
    }

    /// The place to give to supervisors and clients of this process.
    pub fn runtime_dir(&self) -> &RuntimeDir {
        &self.runtime_dir
    }

    /// The root folder.
    pub fn root(&self) -> &Path {
        self.folder.path()
    }

    /// Files of this room in `/dev/shm` and its folder, and the folders of the former.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = shared_memory_folders(&self.runtime_dir);
        files.clone().iter().for_each(|folder| collect_files(folder, &mut files));
        collect_files(self.root(), &mut files);
        files.sort();
        files
    }

    /// Waits up to a few seconds for the room to be empty.
    ///
    /// # Panics
    /// If files are left, with their names.
    pub fn assert_empty(&self) {
        let empty = super::process::eventually(|| self.files().is_empty());
        assert!(empty, "left behind: {:#?}", self.files());
    }
}

impl Default for Room {
    fn default() -> Self {
        Room::new()
    }
}

impl Drop for Room {
    fn drop(&mut self) {
        shared_memory_folders(&self.runtime_dir)
            .iter()
            .for_each(|folder| drop(std::fs::remove_dir_all(folder)));
    }
}

fn shared_memory_folders(runtime_dir: &RuntimeDir) -> Vec<PathBuf> {
    let entries = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    let ours =
        entries.filter(|e| e.file_name().to_str().is_some_and(|n| n.starts_with(runtime_dir.shm_prefix())));
    ours.map(|e| e.path()).collect()
}

fn collect_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        match entry.file_type() {
            Ok(kind) if kind.is_dir() => collect_files(&entry.path(), files),
            _ => files.push(entry.path()),
        }
    }
}
