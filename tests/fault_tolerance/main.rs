//! What a pool guarantees when processes die, stop, fork or send invalid requests, when resources run out,
//! and when another user is hostile: each guarantee is tested with real processes. How batches are stepped is
//! tested in `stepping`, and random combinations of all this in `chaos`.

mod actions;
mod control;
mod crashes;
mod followers;
mod forks;
mod learners;
mod limits;
mod malformed_requests;
mod memory;
mod other_users;
mod spectators;
mod supervisors;
mod workers;

/// Not a test: children start this program again, with a role.
#[test]
#[ignore = "children run it"]
fn role() {
    smaclite_tests::roles::run_if_child();
}

/// Fails unless the text has all of these parts.
#[track_caller]
fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}
