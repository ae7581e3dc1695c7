//! Other users of the machine, who see every name in `/dev/shm` and can create files there.
//!
//! If these tests run as root, a child is another user. Otherwise it is this user and checks the modes of
//! files, which decide whether others can open them.

use crate::assert_contains;
use rustix::fs::{CWD, FileType, Mode, mknodat};
use rustix::process::Signal;
use smaclite_ipc::RuntimeDir;
use smaclite_tests::process::TIMEOUT;
use smaclite_tests::{Child, LanePlan, PoolPlan, TestDir, skip};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::time::Instant;

fn plan() -> PoolPlan {
    PoolPlan::new([LanePlan::new("2s3z", 2)])
}

/// iceoryx2's counter of nodes was open to all users for a moment whenever it was created, under a
/// predictable name: a loop around `open` got it within seconds. Here the other user opens every file that it
/// can while pools start and end.
#[test]
fn another_user_can_open_no_file_while_pools_start_and_end() {
    let dir = TestDir::new();
    let folder = tempfile::tempdir_in("/tmp").expect("a folder");
    let role = format!("file_opener {}", dir.runtime_dir().shm_prefix());
    let mut other_user = Child::other_user(&dir, folder.path(), &role);
    assert_eq!(other_user.answer(TIMEOUT).as_deref(), Ok("watching"));
    for _ in 0..15 {
        let mut supervisor = Child::supervisor(&dir, &plan());
        let mut learner = Child::attached(&dir, &plan().lanes[0]);
        learner.must("reset");
        learner.end();
        supervisor.end();
    }
    let report = other_user.ask("report").expect("a report");
    let (seen, opened) = report.split_once(' ').expect("two words");
    assert!(seen.parse::<u64>().expect("a number") > 5, "it saw only {seen} names");
    assert_eq!(opened, "nothing");
}

/// A file, a FIFO and others under the name of the counter made every start hang or fail, and one with valid
/// content was used. The other user knows how iceoryx2 names its files, and sees the name of the pools'
/// folder.
#[test]
fn files_of_another_user_in_shared_memory_do_no_harm() {
    if !rustix::process::getuid().is_root() {
        return skip("only root can create files as another user");
    }
    let dir = TestDir::new();
    let folder = tempfile::tempdir_in("/tmp").expect("a folder");
    let counter = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";
    for kind in ["file", "fifo", "link", "folder", "counter"] {
        let mut creator = Child::other_user(&dir, folder.path(), "file_creator");
        creator.must(&format!("{kind} iox2_{counter}"));
        creator.must(&format!("{kind} {}{counter}", dir.runtime_dir().shm_prefix()));
        let mut supervisor = Child::supervisor(&dir, &plan());
        let seen = dir.runtime_dir().shm_dir().expect("a pool runs");
        for name in [seen.join(counter), seen.join(format!("iox2_{counter}"))] {
            creator.ask(&format!("{kind} {}", name.display())).expect_err("a private folder");
        }
        creator.must(&format!("{kind} {}_", seen.display()));
        let mut learner = Child::attached(&dir, &plan().lanes[0]);
        learner.must("reset");
        learner.kill();
        supervisor.kill();
        let mut clean = Child::program(&dir, "clean");
        assert_eq!(clean.wait(TIMEOUT * 2).and_then(|status| status.code()), Some(0), "{kind}");
        // The name of the last folder is in use; the next pool has another.
        creator.must(&format!("{kind} {}", seen.display()));
        let mut supervisor = Child::supervisor(&dir, &plan());
        assert_ne!(dir.runtime_dir().shm_dir(), Some(seen));
        supervisor.end();
        creator.must("remove");
        dir.assert_empty();
    }
}

/// A start waited for a truncated file in shared memory without end, and could not be interrupted.
#[test]
fn a_truncated_segment_is_an_error_with_its_path_and_clean_removes_it() {
    let dir = TestDir::new();
    let mut supervisor = Child::supervisor(&dir, &plan());
    supervisor.signal(Signal::STOP); // truncating its memory would kill it
    let segment = dir.files().into_iter().find(|file| file.extension().is_some_and(|e| e == "dynamic"));
    let segment = segment.expect("a service's segment");
    std::fs::File::create(&segment).expect("own file");
    let owner = segment.metadata().expect("own file").uid();
    let begin = Instant::now();
    let second = Child::try_supervisor(&dir, &PoolPlan { name: "second".into(), ..plan() });
    let error = second.answer(TIMEOUT).expect_err("a truncated segment");
    println!("after {:?}: {error}", begin.elapsed());
    let named = segment.display().to_string();
    assert_contains(&error, &[&named, &format!("user {owner}"), "0 bytes", "smaclite-pool clean"]);
    supervisor.kill();
    let mut clean = Child::program(&dir, "clean");
    assert_eq!(clean.wait(TIMEOUT * 2).and_then(|status| status.code()), Some(0));
    dir.assert_empty();
}

/// The message said that the folder belongs to the user who made the link to it.
#[test]
fn a_link_of_another_user_is_named_as_what_is_wrong() {
    if !rustix::process::getuid().is_root() {
        return skip("only root can give a link to another user");
    }
    let folder = tempfile::tempdir().expect("a folder");
    let link = folder.path().join("link");
    std::os::unix::fs::symlink(folder.path(), &link).expect("a link");
    assert!(RuntimeDir::at(link.clone()).is_ok());
    std::os::unix::fs::lchown(&link, Some(1234), None).expect("own link");
    let text = RuntimeDir::at(link.clone()).expect_err("a link of another user").to_string();
    assert_contains(&text, &[&format!("{}: is a link that user 1234 made", link.display())]);
}

/// Lock files were opened whatever their type: opening a FIFO blocks, and a link refers to another file.
#[test]
fn a_lock_that_is_no_private_file_is_an_error_with_its_path() {
    for name in ["in-use", "train.lock"] {
        let check = |make: &dyn Fn(&Path)| {
            let dir = TestDir::new();
            let path = dir.root().join(name);
            make(&path);
            let supervisor = Child::try_supervisor(&dir, &plan());
            let error = supervisor.answer(TIMEOUT).expect_err("an invalid lock");
            assert_contains(&error, &[&path.display().to_string()]);
            println!("{error}");
            std::fs::remove_file(path).expect("own file");
        };
        check(&|path| {
            mknodat(CWD, path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).expect("a FIFO");
        });
        check(&|path| std::os::unix::fs::symlink("/dev/null", path).expect("a link"));
        check(&|path| {
            std::fs::write(path, "").expect("a file");
            std::fs::set_permissions(path, PermissionsExt::from_mode(0o666)).expect("own file");
        });
    }
}

/// `clean` searches for the locks of pools; other programs have files with such names too.
#[test]
fn clean_keeps_locks_and_sockets_of_other_programs() {
    let dir = TestDir::new();
    let kept = ["Cargo.lock", "notes.sock"].map(|name| dir.root().join(name));
    kept.iter().for_each(|path| std::fs::write(path, "kept").expect("a file"));
    let mut clean = Child::program(&dir, "clean");
    assert_eq!(clean.wait(TIMEOUT * 2).and_then(|status| status.code()), Some(0));
    assert_eq!(dir.files(), kept);
}
