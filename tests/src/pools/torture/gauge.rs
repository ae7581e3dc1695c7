//! What a process holds: memory, mappings and file descriptors, early and late in a run; and files of its
//! room.

use crate::pools::Room;
use std::path::PathBuf;

/// Compares what a process holds at two moments of peace, when the same others are attached to it.
pub(super) struct Gauge {
    process: PathBuf,
    early: Option<Held>,
    late: Option<Held>,
}

struct Held {
    /// What the descriptors are open on, sorted.
    files: Vec<String>,
    kilobytes: u64,
    mappings: usize,
    /// Files of the room.
    shared: usize,
}

/// Descriptors of learners that were between two sessions at the first look, eight each; a leak would show
/// one for each of dozens of killed processes.
const COMING_AND_GOING: usize = 16;

/// The same for mappings: connections and data segments of such learners, and stacks and heaps of threads.
const MAPPINGS_COMING_AND_GOING: usize = 64;

/// The same for files of the room: ports of learners that are there now and were not at the first look, and
/// those of a process killed lately.
const FILES_COMING_AND_GOING: usize = 64;

/// Growth that is no leak: allocator arenas and lists that reach their size late.
const ROOM_TO_GROW: u64 = 4096;

impl Gauge {
    pub(super) fn new(pid: u32) -> Gauge {
        Gauge { process: PathBuf::from(format!("/proc/{pid}")), early: None, late: None }
    }

    /// Looks now. The first look is the early one, the last the late one.
    pub(super) fn look(&mut self, room: &Room) {
        let runtime_dir = if self.early.is_none() { &mut self.early } else { &mut self.late };
        *runtime_dir = held(&self.process, room.files().len());
    }

    pub(super) fn verdict(&self) -> Result<String, String> {
        let (Some(early), Some(late)) = (&self.early, &self.late) else {
            return Err("the surviving supervisor could not be looked at".to_owned());
        };
        let text = format!(
            "{} then {} file descriptors, {} then {} kB private memory, {} then {} mappings, \
             {} then {} files",
            early.files.len(),
            late.files.len(),
            early.kilobytes,
            late.kilobytes,
            early.mappings,
            late.mappings,
            early.shared,
            late.shared
        );
        let flat = late.files.len() <= early.files.len() + COMING_AND_GOING
            && late.kilobytes <= early.kilobytes * 11 / 10 + ROOM_TO_GROW
            && late.mappings <= early.mappings + MAPPINGS_COMING_AND_GOING
            && late.shared <= early.shared + FILES_COMING_AND_GOING;
        if flat {
            return Ok(text);
        }
        Err(format!(
            "the surviving supervisor grows: {text}; early {:#?}, late {:#?}",
            early.files, late.files
        ))
    }
}

/// Open files, and memory that is not shared.
fn held(process: &std::path::Path, shared: usize) -> Option<Held> {
    let links = std::fs::read_dir(process.join("fd")).ok()?.flatten();
    let name = |link: std::fs::DirEntry| Some(link.path().read_link().ok()?.to_string_lossy().into_owned());
    let mut files: Vec<_> = links.filter_map(name).collect();
    files.sort();
    let status = std::fs::read_to_string(process.join("status")).ok()?;
    let anonymous = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    let kilobytes = anonymous.trim().trim_end_matches(" kB").parse().ok()?;
    let mappings = std::fs::read_to_string(process.join("maps")).ok()?.lines().count();
    Some(Held { files, kilobytes, mappings, shared })
}
