//! The control thread of a supervisor: its private socket, its start and its end.

use super::error::{StartError, at, system};
use crate::control::server::{ControlServer, serve};
use crate::os::socket::{Spare, Stream, listen_at, pair};
use crate::runtime_dir::RuntimeDir;
use std::net::Shutdown;
use std::thread::JoinHandle;

/// A running control thread, which owns the pool. Dropping it stops both.
pub(super) struct ControlThread {
    /// Shut down to stop the thread.
    stop: Stream,
    thread: Option<JoinHandle<()>>,
}

impl ControlThread {
    /// Listens at the socket of this name, which only this pool has.
    pub(super) fn start(
        server: ControlServer,
        runtime_dir: &RuntimeDir,
        name: &str,
    ) -> Result<ControlThread, StartError> {
        let socket = runtime_dir.socket(name);
        let (stop, stopped) = pair().map_err(system("making a socket pair"))?;
        let spare = Spare::new().map_err(system("opening /dev/null"))?;
        let opening = format!("opening the control socket {}", socket.display());
        let listener = listen_at(&socket).map_err(at(runtime_dir, opening))?;
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
