//! Nodes of killed processes that iceoryx2 0.10.0 never removes: it looks for a node without details, which
//! the process was making or removing when it was killed, where its own configuration would have it; it does
//! not see one without a complete monitor at all, nor a tag of a port or service that is not written to its
//! end, which keeps the folder of the node. Each leaves up to four small files, until the last process of the
//! runtime folder ends.

use super::shm_dir::ShmDir;
use rustix::process::{Pid, test_kill_process};
use std::collections::BTreeMap;
use std::fs::{create_dir_all, read_dir, remove_dir_all, remove_file};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// The folder of nodes below the root path of iceoryx2's configuration. A node makes the folder of its number
/// with its details, and then its monitor: the files of its context, its state and the lock of who owns it.
const NODES: &str = "nodes";
const DETAILS: &str = "iox2_node.details";
const MONITOR: [&str; 3] = ["node_monitor_context", "node_monitor", "node_monitor_owner_lock"];

/// The modes of the context of a monitor, and of a tag, that are being made. What a tag is of is made later.
const UNFINISHED: u32 = 0o200;
const UNFINISHED_TAG: u32 = 0o600;

impl ShmDir {
    /// Lets iceoryx2 remove the nodes of killed processes that lack their details, by those of the node
    /// `own`, and removes others that it would not see.
    pub(crate) fn complete_dead_nodes(&self, own: u128) {
        let nodes = self.folder().join(NODES);
        let folder_of = |node: u128| nodes.join(node.to_string());
        for (node, monitor) in found_in(&nodes) {
            let folder = folder_of(node);
            let details = folder.join(DETAILS);
            let context = path_of(&nodes, node, MONITOR[0]);
            let is_seen = monitor == MONITOR.len() && mode(&context).is_some_and(|mode| mode != UNFINISHED);
            if is_seen && details.exists() || is_alive(node) {
                continue;
            }
            // What fails is done by another supervisor, or when the next one looks.
            if is_seen {
                let _ = create_dir_all(&folder);
                let files = read_dir(&folder).into_iter().flatten().flatten().map(|file| file.path());
                let tags = files.filter(|file| mode(file) == Some(UNFINISHED_TAG));
                tags.for_each(|tag| drop(remove_file(tag)));
                let _ = std::fs::copy(folder_of(own).join(DETAILS), details);
            } else {
                let _ = remove_dir_all(folder);
                MONITOR.iter().for_each(|file| drop(remove_file(path_of(&nodes, node, file))));
            }
        }
    }
}

/// The numbers of all nodes, and how many files of its monitor each has.
fn found_in(nodes: &Path) -> BTreeMap<u128, usize> {
    let mut found = BTreeMap::new();
    for entry in read_dir(nodes).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some(name) = name.to_str() else { continue };
        let (node, file) = match name.strip_prefix("iox2_").and_then(|name| name.split_once('.')) {
            Some((node, file)) => (node, Some(file)),
            None => (name, None),
        };
        if let Ok(node) = node.parse() {
            let of_monitor = file.is_some_and(|file| MONITOR.contains(&file));
            *found.entry(node).or_default() += usize::from(of_monitor);
        }
    }
    found
}

fn path_of(nodes: &Path, node: u128, file: &str) -> PathBuf {
    nodes.join(format!("iox2_{node}.{file}"))
}

/// The permissions of a file that exists.
fn mode(path: &Path) -> Option<u32> {
    path.metadata().ok().map(|found| found.mode() & 0o777)
}

/// Whether the process of a node still runs. One that this process cannot see, in another process namespace,
/// is not served by its pools.
fn is_alive(node: u128) -> bool {
    process_of(node).is_some_and(|pid| test_kill_process(pid) != Err(rustix::io::Errno::SRCH))
}

/// The process that made a node: in the third of the four words of its number.
fn process_of(node: u128) -> Option<Pid> {
    Pid::from_raw((node >> 64) as u32 as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime_dir::RuntimeDir;
    use crate::services::open_node;

    #[test]
    fn the_number_of_a_node_has_its_process() -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let node = open_node(&RuntimeDir::at(folder.path().to_owned())?, "test")?;
        assert_eq!(process_of(node.node.id().value()), Some(rustix::process::getpid()));
        Ok(())
    }
}
