//! Whether the processes of iceoryx2's nodes run: each holds a lock of the file of its node, which the system
//! unlocks when it ends. Nothing here waits for a lock for longer than another process needs to look at it.

#![allow(unsafe_code)] // implements unsafe functions of iceoryx2's traits

use super::files::try_lock;
use super::storage::{self, path_beside, path_for, remove_file};
use crate::os::folders::new_file;
use iceoryx2::prelude::{FileName, Path as FolderPath};
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::monitoring::file_lock::FileLockMonitoring;
use iceoryx2_cal::monitoring::{
    self, MonitoringBuilder, MonitoringCleaner, MonitoringCreateCleanerError, MonitoringCreateMonitorError,
    MonitoringCreateTokenError, MonitoringMonitor, MonitoringStateError, MonitoringToken, State,
};
use iceoryx2_cal::named_concept::{
    NamedConcept, NamedConceptBuilder, NamedConceptDoesExistError, NamedConceptListError, NamedConceptMgmt,
    NamedConceptPathHintRemoveError, NamedConceptRemoveError,
};
use std::fs::{File, TryLockError};
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::time::{Duration, Instant};

type Configuration = <FileLockMonitoring as NamedConceptMgmt>::Configuration;

/// How long a cleaner tries to lock a file: others lock it for a moment, to look whether its process runs.
const LOOKS_LAST: Duration = Duration::from_millis(20);

/// Nodes by files that their processes lock.
#[derive(Debug)]
pub struct Monitoring;

/// What a process holds while it runs. Its file is removed when it is dropped.
#[derive(Debug)]
pub struct Token {
    file: LockedFile,
    name: FileName,
}

/// The right to remove what a dead process left. Its file is removed when it is dropped.
#[derive(Debug)]
pub struct Cleaner {
    file: LockedFile,
    name: FileName,
}

/// Says whether a process runs.
#[derive(Debug)]
pub struct Monitor {
    path: PathBuf,
    name: FileName,
}

/// A file that this process has locked.
#[derive(Debug)]
struct LockedFile {
    lock: Option<File>,
    path: PathBuf,
}

impl Drop for LockedFile {
    fn drop(&mut self) {
        if self.lock.is_some() {
            // In this order, because a file without a lock is that of a dead process.
            let _ = remove_file(&self.path);
            self.lock = None;
        }
    }
}

impl LockedFile {
    /// Unlocks it without removing it.
    fn leave(&mut self) {
        self.lock = None;
    }
}

/// The builder of these.
#[derive(Debug)]
pub struct Builder {
    name: FileName,
    config: Configuration,
}

impl Builder {
    fn path(&self) -> PathBuf {
        path_for(&self.name, &self.config)
    }
}

/// A new file that is locked from its beginning: it gets its name when it is.
fn create_locked(path: &Path) -> std::io::Result<LockedFile> {
    if path.try_exists()? {
        return Err(ErrorKind::AlreadyExists.into());
    }
    let made = path_beside(path, "new");
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let file = new_file(&made)?;
    let renamed = match try_lock(&file) {
        Ok(true) => std::fs::rename(&made, path),
        Ok(false) => Err(ErrorKind::WouldBlock.into()),
        Err(error) => Err(error),
    };
    if let Err(error) = renamed {
        drop(file); // Windows removes no file that is open
        let _ = std::fs::remove_file(made);
        return Err(error);
    }
    Ok(LockedFile { lock: Some(file), path: path.to_owned() })
}

fn open(path: &Path) -> std::io::Result<Option<File>> {
    match File::options().read(true).write(true).open(path) {
        Ok(file) => Ok(Some(file)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

fn state(path: &Path) -> std::io::Result<State> {
    let Some(file) = open(path)? else { return Ok(State::DoesNotExist) };
    // Shared, so that two processes that look do not see each other.
    match file.try_lock_shared() {
        Ok(()) => Ok(State::Dead),
        Err(TryLockError::WouldBlock) => Ok(State::Alive),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Locks the file of a process; `None` if that runs, or another cleaner has it.
fn lock_dead(path: &Path) -> std::io::Result<Option<LockedFile>> {
    let Some(file) = open(path)? else { return Err(ErrorKind::NotFound.into()) };
    let begin = Instant::now();
    while !try_lock(&file)? {
        if begin.elapsed() > LOOKS_LAST {
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    if !path.try_exists()? {
        return Err(ErrorKind::NotFound.into()); // another cleaner has removed it
    }
    Ok(Some(LockedFile { lock: Some(file), path: path.to_owned() }))
}

impl NamedConceptBuilder<Monitoring> for Builder {
    fn new(name: &FileName) -> Self {
        Builder { name: *name, config: Configuration::default() }
    }

    fn config(self, config: &Configuration) -> Self {
        Builder { config: config.clone(), ..self }
    }
}

impl MonitoringBuilder<Monitoring> for Builder {
    fn token(self) -> Result<Token, MonitoringCreateTokenError> {
        let file = create_locked(&self.path()).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => MonitoringCreateTokenError::AlreadyExists,
            ErrorKind::PermissionDenied => MonitoringCreateTokenError::InsufficientPermissions,
            _ => MonitoringCreateTokenError::InternalError,
        })?;
        Ok(Token { file, name: self.name })
    }

    fn monitor(self) -> Result<Monitor, MonitoringCreateMonitorError> {
        Ok(Monitor { path: self.path(), name: self.name })
    }

    /// One whose process runs is an error of "another has it" too: iceoryx2 panics at the error for it.
    fn cleaner(self) -> Result<Cleaner, MonitoringCreateCleanerError> {
        match lock_dead(&self.path()) {
            Ok(Some(file)) => Ok(Cleaner { file, name: self.name }),
            Ok(None) => Err(MonitoringCreateCleanerError::AlreadyOwnedByAnotherInstance),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                Err(MonitoringCreateCleanerError::DoesNotExist)
            }
            Err(_) => Err(MonitoringCreateCleanerError::InternalError),
        }
    }
}

impl monitoring::Monitoring for Monitoring {
    type Token = Token;
    type Monitor = Monitor;
    type Cleaner = Cleaner;
    type Builder = Builder;
}

impl MonitoringToken for Token {}

impl MonitoringCleaner for Cleaner {
    fn relinquish(mut self) {
        self.file.leave();
    }
}

impl MonitoringMonitor for Monitor {
    fn state(&self) -> Result<State, MonitoringStateError> {
        state(&self.path).map_err(|error: Error| match error.kind() {
            ErrorKind::PermissionDenied => MonitoringStateError::InsufficientPermissions,
            _ => MonitoringStateError::InternalError,
        })
    }
}

impl NamedConcept for Token {
    fn name(&self) -> &FileName {
        &self.name
    }
}

impl NamedConcept for Cleaner {
    fn name(&self) -> &FileName {
        &self.name
    }
}

impl NamedConcept for Monitor {
    fn name(&self) -> &FileName {
        &self.name
    }
}

impl NamedConceptMgmt for Monitoring {
    type Configuration = Configuration;

    fn does_exist_cfg(name: &FileName, config: &Configuration) -> Result<bool, NamedConceptDoesExistError> {
        storage::exists::<FileLockMonitoring>(name, config)
    }

    fn list_cfg(config: &Configuration) -> Result<Vec<FileName>, NamedConceptListError> {
        storage::list::<FileLockMonitoring>(config)
    }

    unsafe fn remove_cfg(name: &FileName, config: &Configuration) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: the same promise of the caller.
        unsafe { storage::remove::<FileLockMonitoring>(name, config) }
    }

    fn remove_path_hint(path: &FolderPath) -> Result<(), NamedConceptPathHintRemoveError> {
        storage::remove_folder(path)
    }
}

// Abandoned, they are as after the end of their process: unlocked, with their file there.

impl Abandonable for Token {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller has it alone.
        unsafe { this.as_mut() }.file.leave();
    }
}

impl Abandonable for Cleaner {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller has it alone.
        unsafe { this.as_mut() }.file.leave();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iceoryx2::prelude::SemanticString;
    use iceoryx2_cal::named_concept::NamedConceptConfiguration;

    fn builder(folder: &Path) -> Builder {
        let path = FolderPath::new(folder.as_os_str().as_encoded_bytes()).expect("a path");
        let config = Configuration::default().path_hint(&path);
        Builder::new(&FileName::new(b"node").expect("a name")).config(&config)
    }

    fn state_in(folder: &Path) -> State {
        builder(folder).monitor().expect("a monitor").state().expect("a state")
    }

    #[test]
    fn a_process_that_dies_is_seen_as_dead_and_cleaned_up_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let nodes = &folder.path().join("nodes");
        assert_eq!(state_in(nodes), State::DoesNotExist);
        let token = builder(nodes).token().expect("a token");
        assert_eq!(state_in(nodes), State::Alive);
        let again = builder(nodes).token().expect_err("it exists");
        assert_eq!(again, MonitoringCreateTokenError::AlreadyExists);
        let alive = builder(nodes).cleaner().expect_err("it is alive");
        assert_eq!(alive, MonitoringCreateCleanerError::AlreadyOwnedByAnotherInstance);
        assert_eq!(Monitoring::list_cfg(&builder(nodes).config).expect("a folder").len(), 1);
        token.abandon(); // what the system does when a process ends
        assert_eq!(state_in(nodes), State::Dead);
        let cleaner = builder(nodes).cleaner().expect("a dead process");
        let second = builder(nodes).cleaner().expect_err("it is being cleaned up");
        assert_eq!(second, MonitoringCreateCleanerError::AlreadyOwnedByAnotherInstance);
        cleaner.relinquish();
        assert_eq!(state_in(nodes), State::Dead);
        drop(builder(nodes).cleaner().expect("a dead process"));
        assert_eq!(state_in(nodes), State::DoesNotExist);
        let gone = builder(nodes).cleaner().expect_err("it is cleaned up");
        assert_eq!(gone, MonitoringCreateCleanerError::DoesNotExist);
        assert_eq!(std::fs::read_dir(nodes).expect("a folder").count(), 0);
    }

    #[test]
    fn a_process_that_ends_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        drop(builder(folder.path()).token().expect("a token"));
        assert_eq!(state_in(folder.path()), State::DoesNotExist);
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }

    /// Two that looked at the same time saw each other's lock, and so a process that runs.
    #[test]
    fn those_who_look_do_not_see_each_other() {
        let folder = tempfile::tempdir().expect("a folder");
        builder(folder.path()).token().expect("a token").abandon();
        let looking = open(&builder(folder.path()).path()).expect("a file").expect("a file");
        looking.try_lock_shared().expect("it has no lock");
        assert_eq!(state_in(folder.path()), State::Dead);
    }
}
