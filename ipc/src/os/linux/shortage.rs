//! What the system is short of, by its errors and limits, and how a user gives it more.

use rustix::fs::{StatVfsMountFlags, statvfs};
use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};
use std::cell::Cell;
use std::fmt::Display;
use std::io::Error;
use std::time::{Duration, Instant};

/// Fewer free file descriptors than this were too few: iceoryx2 closes what it opened before it reports a
/// failure.
const FEW_DESCRIPTORS: u64 = 16;

/// How to give shared memory more room.
const MORE_SHM: &str = "give it more (`docker run --shm-size`, `mount -o remount,size=...`)";

/// Fewer bytes than one segment or file of iceoryx2 needs.
const FEW_BYTES: u64 = 64 << 10;

/// How long what the operating system refused counts as the cause of an error of iceoryx2 on the same thread.
const NOTE_LASTS: Duration = Duration::from_secs(1);

thread_local! {
    /// What the operating system refused last.
    static NOTE: Cell<Option<(Errno, Instant)>> = const { Cell::new(None) };
}

/// Notes what the operating system refused to a storage of iceoryx2, which reports it as an internal error.
pub(crate) fn note(error: &Error) {
    if let Some(errno) = Errno::from_io_error(error) {
        NOTE.set(Some((errno, Instant::now())));
    }
}

/// Takes what was noted on this thread.
fn noted() -> Option<Errno> {
    NOTE.take().filter(|(_, at)| at.elapsed() < NOTE_LASTS).map(|(errno, _)| errno)
}

/// The likely cause of an error of iceoryx2 that just happened on this thread, and its remedy.
pub(crate) fn likely() -> Option<String> {
    noted()
        .and_then(|errno| of(&errno.into()))
        .or_else(few_descriptors)
        .or_else(|| full("/dev/shm", MORE_SHM))
        .or_else(limited_files)
}

fn few_descriptors() -> Option<String> {
    let limit = getrlimit(Resource::Nofile).current?;
    // The listing itself uses a file descriptor.
    let open = std::fs::read_dir("/proc/self/fd").map_or(limit, |entries| entries.count() as u64 - 1);
    (open + FEW_DESCRIPTORS > limit).then(|| {
        format!("{open} file descriptors are open, and the limit is {limit}: raise it (`ulimit -n`)")
    })
}

/// What is short, and the remedy, if that is why the operating system refused something.
pub(crate) fn of(error: &Error) -> Option<String> {
    let is = |errno: Errno| error.raw_os_error() == Some(errno.raw_os_error());
    // Errors to which a path was added have no number any more.
    let text = error.to_string();
    if is(Errno::MFILE) || text.contains("Too many open files") {
        let limit = || "the limit on file descriptors is reached: raise it (`ulimit -n`)".to_owned();
        Some(few_descriptors().unwrap_or_else(limit))
    } else if is(Errno::NFILE) {
        Some("all processes of this machine together have too many files open (fs.file-max)".to_owned())
    } else if is(Errno::FBIG) || text.contains("File too large") {
        limited_files()
    } else if is(Errno::NOMEM) {
        Some(too_little_address_space())
    } else if is(Errno::NOSPC) {
        // What the kernel could not reserve in whole, it has given back, so it may have much room now.
        Some(full("/dev/shm", MORE_SHM).unwrap_or_else(|| {
            let free = statvfs("/dev/shm").map_or(0, |stat| stat.f_bavail * stat.f_frsize);
            format!("/dev/shm has only {free} bytes free: {MORE_SHM}")
        }))
    } else if is(Errno::AGAIN) {
        let text = "too many threads or too little memory for one: raise the limit (`ulimit -u`, \
                    `docker run --pids-limit`, `ulimit -v`) or use fewer threads";
        Some(text.to_owned())
    } else {
        None
    }
}

fn too_little_address_space() -> String {
    match getrlimit(Resource::As).current {
        Some(limit) => {
            format!("this process may use {limit} bytes of address space: raise the limit (`ulimit -v`)")
        }
        None => "the system has no memory left for it, or this process has too many mappings \
                 (vm.overcommit_memory, vm.max_map_count)"
            .to_owned(),
    }
}

/// A limit on the size of files counts for shared memory too.
fn limited_files() -> Option<String> {
    let limit = getrlimit(Resource::Fsize).current?;
    Some(format!("this process may write files of at most {limit} bytes: `ulimit -f unlimited`"))
}

pub(crate) fn full(folder: impl Display, remedy: &str) -> Option<String> {
    let stat = statvfs(folder.to_string()).ok()?;
    let free = stat.f_bavail * stat.f_frsize;
    if stat.f_flag.contains(StatVfsMountFlags::RDONLY) {
        Some(format!("{folder} is on a read-only file system: mount it writable"))
    } else if stat.f_files > 0 && stat.f_favail == 0 {
        Some(format!("{folder} has no room for another file: {remedy}"))
    } else if free < FEW_BYTES {
        Some(format!("{folder} has {free} bytes free: {remedy}"))
    } else {
        None
    }
}
