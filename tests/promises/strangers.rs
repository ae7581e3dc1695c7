//! Other users of the machine, who see every name in `/dev/shm` and may put files there.
//!
//! Where this test runs as root, the stranger is another user; else it is this user, who cannot tell whether
//! opening a file would be permitted to others but sees the mode that decides it.

use crate::assert_says;
use rustix::fs::{CWD, FileType, Mode, mknodat};
use rustix::process::Signal;
use smaclite_tests::pools::process::SOON;
use smaclite_tests::pools::{Child, LanePlan, PoolPlan, Room};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::time::Instant;

fn plan() -> PoolPlan {
    PoolPlan::new([LanePlan::new("2s3z", 2)])
}

/// iceoryx2's counter of nodes was open to all users for a moment whenever it was made, under a name that was
/// known beforehand: a loop around `open` had it within seconds. The stranger here opens whatever it can
/// while pools come and go.
#[test]
fn no_file_is_open_to_a_stranger_while_pools_come_and_go() {
    let room = Room::new();
    let folder = tempfile::tempdir_in("/tmp").expect("a folder");
    let mut watcher = Child::stranger(folder.path(), &format!("watcher {}", room.runtime_dir().shm_prefix()));
    assert_eq!(watcher.answer(SOON).as_deref(), Ok("watching"));
    for _ in 0..15 {
        let mut supervisor = Child::supervisor(&room, &plan());
        let mut learner = Child::attached(&room, &plan().lanes[0]);
        learner.must("reset");
        learner.end();
        supervisor.end();
    }
    let found = watcher.ask("what did you open?").expect("a report");
    let (seen, opened) = found.split_once(' ').expect("two words");
    assert!(seen.parse::<u64>().expect("a number") > 5, "it saw only {seen} names");
    assert_eq!(opened, "nothing");
}

/// A file, a FIFO and others in the place of the counter made every start hang or fail, and one that looked
/// genuine was used. The stranger knows how iceoryx2 names its files, and sees the name of the pools' folder.
#[test]
fn files_that_a_stranger_puts_into_shared_memory_do_no_harm() {
    if !rustix::process::getuid().is_root() {
        println!("skipped: only root can put files there as another user");
        return;
    }
    let room = Room::new();
    let folder = tempfile::tempdir_in("/tmp").expect("a folder");
    let counter = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";
    for kind in ["file", "fifo", "link", "folder", "counter"] {
        let mut planter = Child::stranger(folder.path(), "planter");
        planter.must(&format!("{kind} iox2_{counter}"));
        planter.must(&format!("{kind} {}{counter}", room.runtime_dir().shm_prefix()));
        let mut supervisor = Child::supervisor(&room, &plan());
        let seen = room.runtime_dir().shm_dir().expect("a pool runs");
        for name in [seen.join(counter), seen.join(format!("iox2_{counter}"))] {
            planter.ask(&format!("{kind} {}", name.display())).expect_err("a private folder");
        }
        planter.must(&format!("{kind} {}_", seen.display()));
        let mut learner = Child::attached(&room, &plan().lanes[0]);
        learner.must("reset");
        learner.kill();
        supervisor.kill();
        let mut clean = Child::start(&room, "program", "smaclite-pool clean");
        assert_eq!(clean.wait(SOON * 2).and_then(|status| status.code()), Some(0), "{kind}");
        // The name of the last folder is occupied; the next pool has another.
        planter.must(&format!("{kind} {}", seen.display()));
        let mut supervisor = Child::supervisor(&room, &plan());
        assert_ne!(room.runtime_dir().shm_dir(), Some(seen));
        supervisor.end();
        planter.must("remove");
        room.assert_empty();
    }
}

/// A truncated file in shared memory was waited for without an end, deaf to Ctrl-C.
#[test]
fn a_truncated_segment_is_an_error_that_names_it_and_clean_removes_it() {
    let room = Room::new();
    let mut supervisor = Child::supervisor(&room, &plan());
    supervisor.signal(Signal::STOP); // it would die of what follows
    let segment = room.files().into_iter().find(|file| file.extension().is_some_and(|e| e == "dynamic"));
    let segment = segment.expect("a service's segment");
    std::fs::File::create(&segment).expect("an own file");
    let owner = segment.metadata().expect("an own file").uid();
    let begin = Instant::now();
    let second = Child::supervisor_refused(&room, &PoolPlan { name: "second".into(), ..plan() });
    let error = second.answer(SOON).expect_err("a broken place");
    println!("after {:?}: {error}", begin.elapsed());
    let named = segment.display().to_string();
    assert_says(&error, &[&named, &format!("user {owner}"), "0 bytes", "smaclite-pool clean"]);
    supervisor.kill();
    let mut clean = Child::start(&room, "program", "smaclite-pool clean");
    assert_eq!(clean.wait(SOON * 2).and_then(|status| status.code()), Some(0));
    room.assert_empty();
}

/// Locks were opened whatever they were: a FIFO is waited for, a link leads elsewhere.
#[test]
fn a_lock_that_is_no_private_file_is_an_error_that_names_it() {
    for name in ["in-use", "train.lock"] {
        let check = |make: &dyn Fn(&Path)| {
            let room = Room::new();
            let path = room.root().join(name);
            make(&path);
            let refused = Child::supervisor_refused(&room, &plan());
            let error = refused.answer(SOON).expect_err("a wrong lock");
            assert_says(&error, &[&path.display().to_string()]);
            println!("{error}");
            std::fs::remove_file(path).expect("an own file");
        };
        check(&|path| {
            mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).expect("a FIFO");
        });
        check(&|path| std::os::unix::fs::symlink("/dev/null", path).expect("a link"));
        check(&|path| {
            std::fs::write(path, "").expect("a file");
            std::fs::set_permissions(path, PermissionsExt::from_mode(0o666)).expect("an own file");
        });
    }
}

/// `clean` looks for the locks of pools; other programs have files of that name too.
#[test]
fn clean_leaves_locks_and_sockets_of_other_programs_alone() {
    let room = Room::new();
    let kept = ["Cargo.lock", "notes.sock"].map(|name| room.root().join(name));
    kept.iter().for_each(|path| std::fs::write(path, "kept").expect("a file"));
    let mut clean = Child::start(&room, "program", "smaclite-pool clean");
    assert_eq!(clean.wait(SOON * 2).and_then(|status| status.code()), Some(0));
    assert_eq!(room.files(), kept);
}
