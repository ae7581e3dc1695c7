//! What another user of the machine does: it opens what it can, and puts files where a pool's may come to be.

use super::Child;
use super::process::ROLE_VARIABLE;
use super::role::answer;
use rustix::fs::{CWD, FileType, Mode, mknodat};
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

const SHM: &str = "/dev/shm";

/// A user that no test machine has.
const STRANGER: &str = "65534";

impl Child {
    /// A child of this role as another user, if this one may become one; else as this user, who cannot tell
    /// whether opening a file would be permitted to others but sees the mode that decides it. A copy of this
    /// program goes into `folder`.
    ///
    /// # Panics
    /// If it cannot be started.
    pub fn stranger(folder: &Path, role: &str) -> Child {
        let program = std::env::current_exe().expect("a path of this program");
        let mut command = if rustix::process::getuid().is_root() {
            std::fs::set_permissions(folder, PermissionsExt::from_mode(0o755)).expect("an own folder");
            let copy = folder.join("program");
            if !copy.exists() {
                std::fs::copy(program, &copy).expect("a copy others can run");
            }
            let mut command = Command::new("setpriv");
            command.args(["--reuid", STRANGER, "--regid", STRANGER, "--clear-groups"]).arg(copy);
            command
        } else {
            println!("not root: the stranger is this user and goes by the modes of files");
            Command::new(program)
        };
        command.args(["--exact", "role", "--ignored", "--nocapture"]).env(ROLE_VARIABLE, role);
        Child::of_command(&mut command, "stranger")
    }
}

/// Opens every file in `/dev/shm` whose name begins so, again and again, in every way there is. Asked, it
/// says how many names it saw and what it could open.
pub fn watcher(prefix: &str) -> i32 {
    static ASKED: AtomicBool = AtomicBool::new(false);
    answer::<_, String>(Ok("watching"));
    std::thread::spawn(|| {
        std::io::stdin().lines().next();
        ASKED.store(true, Ordering::Relaxed);
    });
    let (mut seen, mut opened) = (BTreeSet::new(), BTreeSet::new());
    while !ASKED.load(Ordering::Relaxed) {
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

/// Can a stranger open it? As the user whose file it is, only the mode tells.
fn can_open(path: &PathBuf) -> bool {
    let Ok(file) = path.metadata() else { return false };
    let ways = [(true, true), (true, false), (false, true)];
    let opens = |(read, write)| std::fs::File::options().read(read).write(write).open(path).is_ok();
    let is_mine = std::os::unix::fs::MetadataExt::uid(&file) == rustix::process::getuid().as_raw();
    file.permissions().mode() & 0o077 != 0 || (!is_mine && ways.into_iter().any(opens))
}

/// Puts things into `/dev/shm`, each by a line `KIND NAME`; `remove` takes them away.
pub fn planter() -> i32 {
    let mut planted = Vec::new();
    for line in std::io::stdin().lines() {
        let Ok(line) = line else { break };
        let done = match line.split_once(' ') {
            Some((kind, name)) => {
                let path = PathBuf::from(SHM).join(name);
                planted.push(path.clone());
                plant(kind, &path).map_err(|error| format!("{line}: {error}"))
            }
            None => {
                planted.drain(..).for_each(|path| drop(remove(&path)));
                Ok(())
            }
        };
        answer(done.map(|()| ""));
    }
    planted.iter().for_each(|path| drop(remove(path)));
    0
}

fn remove(path: &PathBuf) -> std::io::Result<()> {
    std::fs::remove_file(path).or_else(|_| std::fs::remove_dir(path))
}

fn plant(kind: &str, path: &PathBuf) -> std::io::Result<()> {
    let open_to_all = Mode::RWXU | Mode::RWXG | Mode::RWXO;
    match kind {
        "fifo" => Ok(mknodat(CWD, path, FileType::Fifo, open_to_all, 0)?),
        "link" => std::os::unix::fs::symlink("/dev/shm/nothing-there", path),
        "folder" => std::fs::create_dir(path),
        "file" | "counter" => {
            // Version 0.10.0 of iceoryx2 and a count of one node.
            let genuine = [0, 0, 10, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0];
            let content: &[u8] = if kind == "counter" { &genuine } else { &[] };
            let file = std::fs::File::options().write(true).create_new(true).mode(0o666).open(path)?;
            std::io::Write::write_all(&mut &file, content)?;
            std::fs::set_permissions(path, PermissionsExt::from_mode(0o666))
        }
        other => Err(std::io::Error::new(ErrorKind::InvalidInput, format!("there is no {other}"))),
    }
}
