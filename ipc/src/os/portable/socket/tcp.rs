//! Connections of other processes: TCP on this machine. Who listens writes its port and a secret into a file
//! that only this user can read, and a connection begins with the secret.

use super::{Stream, ends, offer, wait_for};
use crate::os::Direction;
use crate::os::files::{FilesLock, is_held};
use crate::os::folders::private_file;
use serde::{Deserialize, Serialize};
use std::io::{Error, ErrorKind, Read, Result, Write};
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;
use subtle::ConstantTimeEq;

/// The content of the file at a pool's path.
#[derive(Serialize, Deserialize)]
struct Address {
    port: u16,
    pid: u32,
    secret: [u8; SECRET],
}

const SECRET: usize = 16;

/// What a connection begins with: the secret, and the id of the process that connects.
const GREETING: usize = SECRET + 4;
const GREETING_TIMEOUT: Duration = Duration::from_secs(1);

/// How long the system may take to connect: a process that is stopped accepts no connection, and when as many
/// wait as there is room for, the next one would wait for minutes.
const CONNECT_TIMEOUT: Duration = Duration::from_millis(100);

/// The most connections at once whose greeting is not read yet.
const MAX_GREETED: usize = 64;

/// How long a thread waits before it looks again whether its connection has ended.
const FOREVER: Duration = Duration::from_secs(3600);

/// Accepts connections until it is dropped.
pub(super) struct Listener {
    port: u16,
    is_ended: Arc<AtomicBool>,
}

pub(super) fn listen_at(path: &Path) -> Result<Listener> {
    let socket = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    let port = socket.local_addr()?.port();
    let mut secret = [0; SECRET];
    getrandom::fill(&mut secret).map_err(Error::other)?;
    let address = Address { port, pid: std::process::id(), secret };
    // A reader that finds a part of it tries again.
    private_file(path)?.write_all(&serde_json::to_vec(&address)?)?;
    let is_ended = Arc::<AtomicBool>::default();
    let (ended, path) = (Arc::clone(&is_ended), path.to_owned());
    start("smaclite-accept", move || accept(&socket, &path, secret, &ended))?;
    Ok(Listener { port, is_ended })
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.is_ended.store(true, Ordering::Release);
        // Wakes the thread; if it cannot, the thread ends with the process.
        let _ = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port));
    }
}

fn start(name: &str, run: impl FnOnce() + Send + 'static) -> Result<()> {
    std::thread::Builder::new().name(name.to_owned()).spawn(run).map(drop)
}

fn accept(socket: &TcpListener, path: &Path, secret: [u8; SECRET], is_ended: &AtomicBool) {
    let greeted = Arc::<AtomicUsize>::default();
    loop {
        let accepted = socket.accept();
        if is_ended.load(Ordering::Acquire) {
            return;
        }
        let Ok((connection, _)) = accepted else {
            std::thread::sleep(Duration::from_millis(10)); // out of handles, most likely
            continue;
        };
        if greeted.fetch_add(1, Ordering::Relaxed) >= MAX_GREETED {
            greeted.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let (path, counted) = (path.to_owned(), Arc::clone(&greeted));
        let greet = move || {
            let process = greeting(&connection, secret);
            counted.fetch_sub(1, Ordering::Relaxed);
            if let Some(process) = process {
                let _ = admit(connection, &path, process);
            }
        };
        if start("smaclite-greet", greet).is_err() {
            greeted.fetch_sub(1, Ordering::Relaxed);
        }
    }
}

/// The process at the other end, if it knows the secret.
fn greeting(mut connection: &TcpStream, secret: [u8; SECRET]) -> Option<u32> {
    let mut greeting = [0; GREETING];
    connection.set_read_timeout(Some(GREETING_TIMEOUT)).ok()?;
    connection.read_exact(&mut greeting).ok()?;
    connection.set_read_timeout(None).ok()?;
    let (theirs, process) = greeting.split_at(SECRET);
    let is_known: bool = theirs.ct_eq(&secret).into();
    is_known.then(|| u32::from_le_bytes(process.try_into().expect("four bytes")))
}

/// Lets the listener accept the connection of a process.
fn admit(connection: TcpStream, path: &Path, process: u32) -> Result<()> {
    let (ours, theirs) = ends(std::process::id(), process);
    carry(connection, theirs)?;
    offer(ours, path);
    Ok(())
}

/// Connects to a pool of another process.
pub(super) fn connect(path: &Path) -> Result<Stream> {
    let (lock, root) = (path.with_extension("lock"), path.parent().unwrap_or(Path::new("")));
    // A connection to a port without a listener takes seconds on Windows.
    let address = {
        let _files = FilesLock::take(root)?;
        if !is_held(&lock)? {
            return Err(ErrorKind::NotFound.into());
        }
        std::fs::read(path)?
    };
    let Address { port, pid, secret } = match serde_json::from_slice(&address) {
        Ok(address) => address,
        Err(_) => return Err(ErrorKind::WouldBlock.into()), // not written yet
    };
    let connected = TcpStream::connect_timeout(&(Ipv4Addr::LOCALHOST, port).into(), CONNECT_TIMEOUT);
    let mut connection = connected.map_err(|error| match error.kind() {
        ErrorKind::TimedOut => ErrorKind::WouldBlock.into(), // the caller tries again
        _ => error,
    })?;
    let mut greeting = secret.to_vec();
    greeting.extend(std::process::id().to_le_bytes());
    connection.write_all(&greeting)?;
    let (ours, theirs) = ends(std::process::id(), pid);
    carry(connection, theirs)?;
    Ok(ours)
}

/// Carries bytes between a connection and the far end of a [`Stream`], until one of them ends.
fn carry(connection: TcpStream, far: Stream) -> Result<()> {
    let far = Arc::new(far);
    connection.set_nodelay(true)?;
    let (receiver, received) = (connection.try_clone()?, Arc::clone(&far));
    start("smaclite-receive", move || receive(&receiver, &received))?;
    start("smaclite-send", move || {
        send(&connection, &far);
        let _ = far.shutdown(Shutdown::Both);
        let _ = connection.shutdown(Shutdown::Both);
    })
}

fn receive(mut connection: &TcpStream, mut far: &Stream) {
    let mut chunk = [0; 1 << 14];
    while let Ok(read @ 1..) = connection.read(&mut chunk) {
        let mut rest = &chunk[..read];
        while !rest.is_empty() {
            match far.write(rest) {
                Ok(written) => rest = &rest[written..],
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    wait_for(FOREVER, || far.can(Direction::Write).then_some(()));
                }
                Err(_) => return,
            }
        }
    }
    let _ = far.shutdown(Shutdown::Both);
}

fn send(mut connection: &TcpStream, mut far: &Stream) {
    let mut chunk = [0; 1 << 14];
    loop {
        match far.read(&mut chunk) {
            Ok(0) => return,
            Ok(read) if connection.write_all(&chunk[..read]).is_ok() => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                wait_for(FOREVER, || far.can(Direction::Read).then_some(()));
            }
            _ => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    /// Every look at a stopped pool leaves a connection. After some hundred, `list` hung for two minutes.
    #[test]
    fn a_pool_that_accepts_nothing_is_not_waited_for() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pool.sock");
        let lock = private_file(&path.with_extension("lock")).expect("a lock");
        lock.try_lock().expect("it is free");
        let stopped = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let port = stopped.local_addr().expect("an address").port();
        let address = Address { port, pid: std::process::id(), secret: [0; SECRET] };
        std::fs::write(&path, serde_json::to_vec(&address).expect("plain data")).expect("a file");
        let begin = Instant::now();
        let error = (0..10_000).find_map(|_| connect(&path).err()).expect("there is room for few");
        assert_eq!(error.kind(), ErrorKind::WouldBlock, "{error}");
        assert!(begin.elapsed() < Duration::from_secs(30), "{:?}", begin.elapsed());
    }
}
