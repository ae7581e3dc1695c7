//! The `smaclite-pool` program; everything is in the library [`smaclite_cli`].

#![forbid(unsafe_code)]

fn main() {
    std::process::exit(smaclite_cli::run(std::env::args_os(), &[]));
}
