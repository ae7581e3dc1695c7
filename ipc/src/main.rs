//! The `smaclite-pool` program; everything is in [`smaclite_ipc::cli`].

#![forbid(unsafe_code)]

fn main() {
    std::process::exit(smaclite_ipc::cli::run(std::env::args_os()));
}
