//! Tells the program how it was built, for `doctor`.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    for name in ["TARGET", "PROFILE"] {
        println!("cargo::rustc-env=BUILD_{name}={}", std::env::var(name).unwrap_or_default());
    }
}
