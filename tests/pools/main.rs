//! Pools that work: every way of stepping, sharing, branching and playing both sides shows the bits of a
//! battle that is played alone. What happens when something fails is in `fault_tolerance`. One program, which
//! is linked once.

mod both_sides;
mod branching;
mod caller_runs;
mod chaos;
mod levels;
mod opponents;
mod policies;
mod stepping;

/// Not a test: children start this program again, with a role.
#[test]
#[ignore = "children run it"]
fn role() {
    smaclite_tests::roles::run_if_child();
}
