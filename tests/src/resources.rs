//! The resources of a process with pools: memory, mappings, file descriptors and files. They must not grow in
//! a run.

use crate::TestDir;
use std::path::{Path, PathBuf};

/// Compares two measurements of a process, at moments when the same clients are attached to it.
pub(crate) struct ResourceMonitor {
    process: PathBuf,
    first: Option<Resources>,
    last: Option<Resources>,
}

struct Resources {
    /// What the file descriptors refer to, sorted.
    descriptors: Vec<String>,
    /// Private memory in kB.
    memory: u64,
    mappings: usize,
    /// Files of its pools, sorted.
    files: Vec<PathBuf>,
}

/// Descriptors of two learners, eight each, that had no session at the first measurement. A leak would show
/// one for each of dozens of killed processes.
const MORE_DESCRIPTORS: usize = 16;

/// The same for mappings: connections and data segments of learners, stacks and heaps of threads.
const MORE_MAPPINGS: usize = 64;

/// The same for files: ports of learners that had no session at the first measurement, and those of a process
/// that was just killed.
const MORE_FILES: usize = 64;

/// kB that are no leak: allocator arenas, and lists that reach their size late.
const MORE_MEMORY: u64 = 4096;

impl ResourceMonitor {
    pub(crate) fn new(pid: u32) -> ResourceMonitor {
        ResourceMonitor { process: PathBuf::from(format!("/proc/{pid}")), first: None, last: None }
    }

    pub(crate) fn measure(&mut self, dir: &TestDir) {
        let measurement = if self.first.is_none() { &mut self.first } else { &mut self.last };
        *measurement = measure(&self.process, dir.files());
    }

    /// The two measurements, as text.
    ///
    /// # Errors
    /// If they show growth.
    pub(crate) fn check(&self) -> Result<String, String> {
        let (Some(first), Some(last)) = (&self.first, &self.last) else {
            return Err("the resources of the process could not be measured".to_owned());
        };
        let text = format!(
            "{} then {} file descriptors, {} then {} kB private memory, {} then {} mappings, \
             {} then {} files",
            first.descriptors.len(),
            last.descriptors.len(),
            first.memory,
            last.memory,
            first.mappings,
            last.mappings,
            first.files.len(),
            last.files.len()
        );
        let is_constant = last.descriptors.len() <= first.descriptors.len() + MORE_DESCRIPTORS
            && last.memory <= first.memory * 11 / 10 + MORE_MEMORY
            && last.mappings <= first.mappings + MORE_MAPPINGS
            && last.files.len() <= first.files.len() + MORE_FILES;
        if is_constant {
            return Ok(text);
        }
        let new_files: Vec<_> =
            last.files.iter().filter(|file| first.files.binary_search(file).is_err()).collect();
        let (first, last) = (&first.descriptors, &last.descriptors);
        Err(format!(
            "the resources of the process grow: {text}; first {first:#?}, last {last:#?}, \
             new files {new_files:#?}"
        ))
    }
}

fn measure(process: &Path, files: Vec<PathBuf>) -> Option<Resources> {
    let links = std::fs::read_dir(process.join("fd")).ok()?.flatten();
    let name = |link: std::fs::DirEntry| Some(link.path().read_link().ok()?.to_string_lossy().into_owned());
    let mut descriptors: Vec<_> = links.filter_map(name).collect();
    descriptors.sort();
    let status = std::fs::read_to_string(process.join("status")).ok()?;
    let anonymous = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    let memory = anonymous.trim().trim_end_matches(" kB").parse().ok()?;
    let mappings = std::fs::read_to_string(process.join("maps")).ok()?.lines().count();
    Some(Resources { descriptors, memory, mappings, files })
}
