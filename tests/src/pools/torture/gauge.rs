//! What a process holds: memory and file descriptors, early and late in a run.

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
}

/// Descriptors of learners that were between two sessions at the first look, eight each; a leak would show one for each of
/// dozens of killed processes.
const COMING_AND_GOING: usize = 16;

/// Growth that is no leak: allocator arenas and lists that reach their size late.
const ROOM_TO_GROW: u64 = 4096;

impl Gauge {
    pub(super) fn new(pid: u32) -> Gauge {
        Gauge { process: PathBuf::from(format!("/proc/{pid}")), early: None, late: None }
    }

    /// Looks now. The first look is the early one, the last the late one.
    pub(super) fn look(&mut self) {
        let place = if self.early.is_none() { &mut self.early } else { &mut self.late };
        *place = held(&self.process);
    }

    pub(super) fn verdict(&self) -> Result<String, String> {
        let (Some(early), Some(late)) = (&self.early, &self.late) else {
            return Err("the surviving supervisor could not be looked at".to_owned());
        };
        let text = format!(
            "{} then {} file descriptors, {} then {} kB private memory",
            early.files.len(),
            late.files.len(),
            early.kilobytes,
            late.kilobytes
        );
        let flat = late.files.len() <= early.files.len() + COMING_AND_GOING
            && late.kilobytes <= early.kilobytes * 11 / 10 + ROOM_TO_GROW;
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
fn held(process: &std::path::Path) -> Option<Held> {
    let links = std::fs::read_dir(process.join("fd")).ok()?.flatten();
    let name = |link: std::fs::DirEntry| Some(link.path().read_link().ok()?.to_string_lossy().into_owned());
    let mut files: Vec<_> = links.filter_map(name).collect();
    files.sort();
    let status = std::fs::read_to_string(process.join("status")).ok()?;
    let anonymous = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    let kilobytes = anonymous.trim().trim_end_matches(" kB").parse().ok()?;
    Some(Held { files, kilobytes })
}
