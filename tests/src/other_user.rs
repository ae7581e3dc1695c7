//! Roles of another user of the machine, who opens every file that he can and creates files where a pool may
//! need a name.

use crate::process::{Child, ROLE_ARGS, ROLE_VARIABLE, answer};
use crate::{TestDir, skip};
use rustix::fs::{CWD, FileType, Mode, mknodat};
use smaclite_ipc::ROOT_VARIABLE;
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

const SHM: &str = "/dev/shm";

/// A user that owns no files.
const OTHER_USER: &str = "65534";

impl Child {
    /// Starts a child as another user; as this user, if it is not root. `folder` gets a copy of this program
    /// that the other user may execute. `cp` writes it, not this process: a child that another test starts
    /// meanwhile would have it open for writing, and the kernel executes no such file ("Text file busy").
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn other_user(dir: &TestDir, folder: &Path, role: &str) -> Child {
        let program = std::env::current_exe().expect("a path of this program");
        let mut command = if rustix::process::getuid().is_root() {
            std::fs::set_permissions(folder, PermissionsExt::from_mode(0o755)).expect("own folder");
            let copy = folder.join("program");
            if !copy.exists() {
                let copied = Command::new("cp").arg(program).arg(&copy).status();
                assert!(copied.is_ok_and(|status| status.success()), "a copy of the program");
                std::fs::set_permissions(&copy, PermissionsExt::from_mode(0o755)).expect("own file");
            }
            let mut command = Command::new("setpriv");
            command.args(["--reuid", OTHER_USER, "--regid", OTHER_USER, "--clear-groups"]).arg(copy);
            command
        } else {
            skip("not root: the other user is this one, and checks only the modes of files");
            Command::new(program)
        };
        command.args(ROLE_ARGS).env(ROLE_VARIABLE, role).env(ROOT_VARIABLE, dir.root());
        Child::spawn(&mut command, role)
    }
}

/// Repeatedly opens every file in `/dev/shm` whose name starts with `prefix`, for reading and writing. After
/// a command it answers how many names it saw and which files it could open.
pub fn file_opener(prefix: &str) -> i32 {
    static STOP: AtomicBool = AtomicBool::new(false);
    answer::<_, String>(Ok("watching"));
    std::thread::spawn(|| {
        std::io::stdin().lines().next();
        STOP.store(true, Ordering::Relaxed);
    });
    let (mut seen, mut opened) = (BTreeSet::new(), BTreeSet::new());
    while !STOP.load(Ordering::Relaxed) {
        let names = std::fs::read_dir(SHM).into_iter().flatten().flatten();
        for entry in names.filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix)) {
            if can_open(&entry.path()) {
                opened.insert(entry.path());
            }
            seen.insert(entry.path());
        }
    }
    let opened = if opened.is_empty() { "nothing".to_owned() } else { format!("{opened:?}") };
    answer::<_, String>(Ok(format!("{} {opened}", seen.len())));
    0
}

/// Whether another user can open the file. For its owner only the mode tells.
fn can_open(path: &PathBuf) -> bool {
    let Ok(file) = path.metadata() else { return false };
    let access_modes = [(true, true), (true, false), (false, true)];
    let opens = |(read, write)| std::fs::File::options().read(read).write(write).open(path).is_ok();
    let is_mine = file.uid() == rustix::process::getuid().as_raw();
    file.permissions().mode() & 0o077 != 0 || (!is_mine && access_modes.into_iter().any(opens))
}

/// Creates files in `/dev/shm`: the command `KIND NAME` creates one, `remove` deletes all.
pub fn file_creator() -> i32 {
    let mut created = Vec::new();
    for line in std::io::stdin().lines() {
        let Ok(line) = line else { break };
        let done = match line.split_once(' ') {
            Some((kind, name)) => {
                let path = PathBuf::from(SHM).join(name);
                created.push(path.clone());
                create(kind, &path).map_err(|error| format!("{line}: {error}"))
            }
            None => {
                created.drain(..).for_each(|path| drop(remove(&path)));
                Ok(())
            }
        };
        answer(done.map(|()| ""));
    }
    created.iter().for_each(|path| drop(remove(path)));
    0
}

fn remove(path: &PathBuf) -> std::io::Result<()> {
    std::fs::remove_file(path).or_else(|_| std::fs::remove_dir(path))
}

fn create(kind: &str, path: &PathBuf) -> std::io::Result<()> {
    let open_to_all = Mode::RWXU | Mode::RWXG | Mode::RWXO;
    match kind {
        "fifo" => Ok(mknodat(CWD, path, FileType::Fifo, open_to_all, 0)?),
        "link" => std::os::unix::fs::symlink("/dev/shm/nothing-there", path),
        "folder" => std::fs::create_dir(path),
        "file" | "counter" => {
            // What iceoryx2 0.10.0 writes: its version, and the count of one node.
            let valid = [0, 0, 10, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
            let content: &[u8] = if kind == "counter" { &valid } else { &[] };
            let file = std::fs::File::options().write(true).create_new(true).mode(0o666).open(path)?;
            std::io::Write::write_all(&mut &file, content)?;
            std::fs::set_permissions(path, PermissionsExt::from_mode(0o666))
        }
        other => Err(std::io::Error::new(
            ErrorKind::InvalidInput,
            format!("the kind must be fifo, link, folder, file or counter, got {other}"),
        )),
    }
}
