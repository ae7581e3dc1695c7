//! What is promised when processes die, stop, fork or lie: every promise is made to happen with real
//! processes. The promises on how batches are stepped are in `stepping`, those of long disturbance in
//! `torture`.

#[path = "promises/actions.rs"]
mod actions;
#[path = "promises/control.rs"]
mod control;
#[path = "promises/crashes.rs"]
mod crashes;
#[path = "promises/forks.rs"]
mod forks;
#[path = "promises/learners.rs"]
mod learners;
#[path = "promises/lies.rs"]
mod lies;
#[path = "promises/limits.rs"]
mod limits;
#[path = "promises/memory.rs"]
mod memory;
#[path = "promises/spectators.rs"]
mod spectators;
#[path = "promises/strangers.rs"]
mod strangers;
#[path = "promises/supervisors.rs"]
mod supervisors;
#[path = "promises/workers.rs"]
mod workers;

/// Not a test: what children run, which are this program with a role.
#[test]
#[ignore = "children run it"]
fn role() {
    smaclite_tests::pools::role::play_if_asked();
}

/// Fails unless the text has all of these parts.
#[track_caller]
fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}
