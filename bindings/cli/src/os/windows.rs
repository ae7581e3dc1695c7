//! Windows.

use signal_hook::consts::{SIGINT, SIGTERM};
use std::io::{Read, Result};
use std::os::windows::io::AsSocket;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

/// There is no limit to raise.
pub(crate) fn use_all_descriptors() {}

/// Writing to a full disk is an error.
pub(crate) fn report_large_files() {}

/// The signals that ask a program to end.
pub(crate) fn stop_signals() -> impl Iterator<Item = i32> {
    [SIGINT, SIGTERM].into_iter()
}

/// The standard input of a second process: it ends when the first closes it, also by its own end, because a
/// process can send another no signal.
pub(crate) fn second_input() -> Stdio {
    Stdio::piped()
}

/// Sets a flag when the parent of this process closes its standard input.
pub(crate) fn end_with_parent(_parent: u32, ended: &'static AtomicBool) {
    // If there is no thread for it, the parent waits until this process ends otherwise.
    let _ = std::thread::Builder::new().spawn(|| {
        while std::io::stdin().read(&mut [0]).is_ok_and(|bytes| bytes > 0) {}
        ended.store(true, Ordering::Relaxed); // publishes nothing but itself
    });
}

/// Runs another program in the place of this one.
pub(crate) fn hand_over(command: &mut Command) -> Result<ExitStatus> {
    command.status()
}

/// Asks a process to end, if it has a [`second_input`]; another is ended at once.
pub(crate) fn end(child: &mut Child) {
    if child.stdin.take().is_none() {
        let _ = child.kill();
    }
}

/// Another handle of a connection.
pub(crate) fn clone_of(stream: &tokio::net::TcpStream) -> Result<std::net::TcpStream> {
    Ok(std::net::TcpStream::from(stream.as_socket().try_clone_to_owned()?))
}

/// The system and the machine.
pub(crate) fn kernel() -> Option<String> {
    Some(format!("{} {}", std::env::consts::OS, std::env::consts::ARCH))
}

/// The limits of this process on open files and on address space: none.
pub(crate) fn limits() -> [Option<String>; 2] {
    [None, None]
}

/// The bytes of a file system, and how many of them are free: not known.
pub(crate) fn room(_folder: &str) -> Option<[u64; 2]> {
    None
}
