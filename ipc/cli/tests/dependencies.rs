//! The library for Rust learners does not depend on the command line.

use std::process::Command;

/// Learners that link `smaclite-ipc` once compiled clap, and whatever else only the program needs.
#[test]
fn ipc_does_not_depend_on_the_command_line() {
    let cargo_tree = |package: &str| {
        let mut command = Command::new(env!("CARGO"));
        command.args(["tree", "--offline", "--edges", "normal", "--prefix", "none", "--package", package]);
        let output = command.current_dir(env!("CARGO_MANIFEST_DIR")).output().expect("cargo");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("names of packages")
    };
    let depends =
        |tree: &str, package: &str| tree.lines().any(|line| line.split(' ').next() == Some(package));
    let (ipc, cli) = (cargo_tree("smaclite-ipc"), cargo_tree("smaclite-cli"));
    assert!(depends(&ipc, "smaclite-pool"), "not the tree of smaclite-ipc:\n{ipc}");
    for package in ["clap", "signal-hook", "tracing-subscriber", "smaclite-benches"] {
        assert!(depends(&cli, package), "smaclite-cli does not use {package} any more; delete it here");
        assert!(!depends(&ipc, package), "smaclite-ipc depends on {package}");
    }
}
