//! The libraries for Rust learners do not depend on the command line.

use std::process::Command;

/// Learners that link `smaclite-ipc` once compiled clap, and whatever else only the program needs.
#[test]
fn ipc_and_learn_do_not_depend_on_the_command_line() {
    let cargo_tree = |package: &str| {
        let mut command = Command::new(env!("CARGO"));
        command.args(["tree", "--offline", "--edges", "normal", "--prefix", "none", "--package", package]);
        let output = command.current_dir(env!("CARGO_MANIFEST_DIR")).output().expect("cargo");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("names of packages")
    };
    let depends =
        |tree: &str, package: &str| tree.lines().any(|line| line.split(' ').next() == Some(package));
    let cli = cargo_tree("smaclite-cli");
    let libraries = ["smaclite-ipc", "smaclite-learn"].map(|library| (library, cargo_tree(library)));
    for (library, tree) in &libraries {
        assert!(depends(tree, "smaclite-pool"), "not the tree of {library}:\n{tree}");
    }
    for package in ["clap", "signal-hook", "tracing-subscriber", "smaclite-benches"] {
        assert!(depends(&cli, package), "smaclite-cli does not use {package} any more; delete it here");
        for (library, tree) in &libraries {
            assert!(!depends(tree, package), "{library} depends on {package}");
        }
    }
}
