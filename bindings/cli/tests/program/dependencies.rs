//! Which crate may depend on which, and with which features.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// Every crate depends only on those before it.
const CHAIN: [&str; 12] = [
    "smaclite-units",
    "smaclite-scenarios",
    "smaclite-engine",
    "smaclite-view",
    "smaclite-playground",
    "smaclite-pool",
    "smaclite-ipc",
    "smaclite-recorder",
    "smaclite-learn",
    "smaclite-lab",
    "smaclite-cli",
    "smaclite-bindings",
];

/// They measure and test the others, and no crate depends on them.
const LEAVES: [&str; 2] = ["smaclite-benches", "smaclite-tests"];

fn cargo(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO"));
    command.args(arguments).arg("--offline").current_dir(env!("CARGO_MANIFEST_DIR"));
    let output = command.output().expect("cargo");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// The program once took its handler of Ctrl-C from the benchmarks.
#[test]
fn no_crate_depends_on_a_later_one_or_on_benchmarks_and_tests() {
    let metadata: Value =
        serde_json::from_str(&cargo(&["metadata", "--no-deps", "--format-version", "1"])).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    let position = |name: &Value| CHAIN.iter().position(|other| Some(*other) == name.as_str());
    let mut checked = 0;
    for package in packages {
        let name = &package["name"];
        let Some(own) = position(name) else {
            assert!(LEAVES.iter().any(|leaf| name == leaf), "{name} has no place in the chain");
            continue;
        };
        for dependency in package["dependencies"].as_array().expect("dependencies") {
            let on = &dependency["name"];
            assert!(LEAVES.iter().all(|leaf| on != leaf), "{name} depends on {on}");
            // A crate can be its own dev-dependency, with other features.
            let is_allowed = position(on).is_none_or(|other| other < own || on == name);
            assert!(is_allowed, "{name} depends on {on}, which comes later");
        }
        checked += 1;
    }
    assert_eq!(checked, CHAIN.len(), "a crate of the chain is missing");
}

/// Learners that link `smaclite-ipc` once compiled clap, and whatever else only the program needs.
#[test]
fn libraries_do_not_depend_on_what_only_the_program_needs() {
    let tree =
        |package: &str| cargo(&["tree", "--edges", "normal", "--prefix", "none", "--package", package]);
    let depends =
        |tree: &str, package: &str| tree.lines().any(|line| line.split(' ').next() == Some(package));
    let program = tree("smaclite-cli");
    let libraries = ["smaclite-ipc", "smaclite-learn", "smaclite-lab", "smaclite-recorder"]
        .map(|library| (library, tree(library)));
    for (library, tree) in &libraries {
        assert!(depends(tree, "smaclite-pool"), "not the tree of {library}:\n{tree}");
    }
    for package in ["axum", "clap", "signal-hook", "tokio", "tracing-subscriber"] {
        assert!(depends(&program, package), "smaclite-cli does not use {package} any more; delete it here");
        for (library, tree) in &libraries {
            assert!(!depends(tree, package), "{library} depends on {package}");
        }
    }
}

/// The features with which the crates of other projects are built, for what cargo is asked to build.
fn features(arguments: &[&str]) -> BTreeMap<String, BTreeSet<String>> {
    // In the root folder, where cargo builds what `cargo test` does; here it would be this crate only.
    let options = ["tree", "--locked", "--manifest-path", "../../Cargo.toml"];
    let format = ["--prefix", "none", "--format", "{p}|{f}"];
    let tree = cargo(&[&options[..], &format, arguments].concat());
    let mut found = BTreeMap::<_, BTreeSet<_>>::new();
    for line in tree.lines().filter(|line| !line.contains("(/")) {
        if let Some((package, features)) = line.trim_end_matches(" (*)").split_once('|') {
            found.entry(package.to_owned()).or_default().insert(features.to_owned());
        }
    }
    found
}

/// The extension module, the tests and the programs differed in a feature of rand, serde_json and
/// num-complex. Each of them compiled faer and all of our crates again, for minutes, and the tests read
/// numbers by another algorithm than users did.
#[test]
fn no_crate_is_compiled_again_with_other_features() {
    let all = features(&["--edges", "normal,build,dev"]);
    let extension = features(&["--package", "smaclite-bindings", "--edges", "normal,build"]);
    let program = features(&["--package", "smaclite-cli", "--edges", "normal,build"]);
    assert!(extension.len() > program.len() && program.len() > 100, "not the trees");
    assert!(all.keys().any(|package| package.starts_with("proptest ")), "not the tests");
    for (package, built) in extension.iter().chain(&program) {
        // In the extension only ndarray uses it, and in the tests only a crate of tests.
        let is_small = package.starts_with("num-integer ");
        if let Some(others) = all.get(package).filter(|_| !is_small) {
            assert!(
                built.is_subset(others),
                "{package}: {built:?}, in the tests {others:?}; see bindings/learn"
            );
        }
    }
}
