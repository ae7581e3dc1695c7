//! The control thread of a supervisor: its private socket, its start and its end.

use super::error::{StartError, system};
use crate::control::server::{ControlServer, serve, spare_descriptor};
use crate::runtime_dir::PRIVATE;
use rustix::fs::{Mode, fchmod};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, bind, listen, socket_with};
use std::net::Shutdown;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::thread::JoinHandle;

/// Connections to the control socket that may wait to be accepted; the value of the standard library.
const LISTEN_BACKLOG: i32 = 128;

/// A running control thread, which owns the pool. Dropping it stops both.
pub(super) struct ControlThread {
    /// Shut down to stop the thread.
    stop: UnixStream,
    thread: Option<JoinHandle<()>>,
}

impl ControlThread {
    /// Listens at `socket`, whose path only this pool uses.
    pub(super) fn start(server: ControlServer, socket: &Path) -> Result<ControlThread, StartError> {
        let (stop, stopped) = UnixStream::pair().map_err(system("making a socket pair"))?;
        let spare = spare_descriptor().map_err(system("opening /dev/null"))?;
        let _ = std::fs::remove_file(socket); // of a dead pool: this one has the lock of the name
        let opening = format!("opening the control socket {}", socket.display());
        let listener = private_listener(socket).map_err(system(opening))?;
        let thread = std::thread::Builder::new().name("smaclite-control".to_owned());
        let thread = thread.spawn(move || serve(server, listener, stopped, spare));
        Ok(ControlThread { stop, thread: Some(thread.map_err(system("starting a thread"))?) })
    }
}

impl Drop for ControlThread {
    fn drop(&mut self) {
        // Closing it is not enough: a forked child has a copy that keeps the socket open.
        let _ = self.stop.shutdown(Shutdown::Both);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Listens at a path that no other user can ever connect to: Linux gives a socket's file the mode that its
/// descriptor had before it was bound (`unix_bind_bsd` in net/unix/af_unix.c).
fn private_listener(path: &Path) -> std::io::Result<UnixListener> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    let socket = socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
    fchmod(&socket, Mode::from_raw_mode(PRIVATE))?;
    bind(&socket, &SocketAddrUnix::new(path)?)?;
    listen(&socket, LISTEN_BACKLOG)?;
    Ok(UnixListener::from(socket))
}
