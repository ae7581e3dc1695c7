//! Control connections within this process: bytes in memory, and who listens at which path.

use crate::os::{Direction, Ready};
use std::collections::{BTreeMap, VecDeque};
use std::convert::Infallible;
use std::io::{ErrorKind, Read, Result, Write};
use std::net::Shutdown;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Connections by the path that they were made to, until they are accepted.
static LISTENERS: Mutex<BTreeMap<PathBuf, VecDeque<Stream>>> = Mutex::new(BTreeMap::new());

/// Held while somebody looks whether there is something to do. What changes that takes it afterwards, for a
/// moment, so that no change is missed between a look and the wait for the next change.
static LOOKING: Mutex<()> = Mutex::new(());
static CHANGED: Condvar = Condvar::new();

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn changed() {
    drop(locked(&LOOKING));
    CHANGED.notify_all();
}

/// Waits until `look` finds something, for at most that long.
fn wait_for<T>(within: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let begin = Instant::now();
    let mut looking = locked(&LOOKING);
    loop {
        let found = look();
        let left = within.saturating_sub(begin.elapsed());
        if found.is_some() || left.is_zero() {
            return found;
        }
        (looking, _) = CHANGED.wait_timeout(looking, left).unwrap_or_else(PoisonError::into_inner);
    }
}

/// One direction of a connection.
#[derive(Default)]
struct Pipe {
    bytes: VecDeque<u8>,
    is_closed: bool,
}

/// An end of a connection.
pub(crate) struct Stream {
    incoming: Arc<Mutex<Pipe>>,
    outgoing: Arc<Mutex<Pipe>>,
}

impl Stream {
    /// Ends the connection; what was sent can still be read.
    pub(crate) fn shutdown(&self, _how: Shutdown) -> Result<()> {
        for pipe in [&self.incoming, &self.outgoing] {
            locked(pipe).is_closed = true;
        }
        changed();
        Ok(())
    }

    /// It always is.
    pub(crate) fn set_nonblocking(&self, _is_nonblocking: bool) -> Result<()> {
        Ok(())
    }

    fn can(&self, direction: Direction) -> bool {
        let incoming = locked(&self.incoming);
        match direction {
            Direction::Read => !incoming.bytes.is_empty() || incoming.is_closed,
            Direction::Write => true,
        }
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        let _ = self.shutdown(Shutdown::Both);
    }
}

impl Read for Stream {
    fn read(&mut self, to: &mut [u8]) -> Result<usize> {
        let mut incoming = locked(&self.incoming);
        if incoming.bytes.is_empty() && !incoming.is_closed {
            return Err(ErrorKind::WouldBlock.into());
        }
        incoming.bytes.read(to)
    }
}

impl Write for Stream {
    fn write(&mut self, from: &[u8]) -> Result<usize> {
        let mut outgoing = locked(&self.outgoing);
        if outgoing.is_closed {
            return Err(ErrorKind::BrokenPipe.into());
        }
        outgoing.bytes.extend(from);
        drop(outgoing);
        changed();
        Ok(from.len())
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Two ends that are connected.
pub(crate) fn pair() -> Result<(Stream, Stream)> {
    let (one, other) = (Arc::<Mutex<Pipe>>::default(), Arc::<Mutex<Pipe>>::default());
    let first = Stream { incoming: Arc::clone(&one), outgoing: Arc::clone(&other) };
    Ok((first, Stream { incoming: other, outgoing: one }))
}

/// Connects to who listens at a path.
pub(crate) fn connect(path: &Path) -> Result<Stream> {
    let (ours, theirs) = pair()?;
    match locked(&LISTENERS).get_mut(path) {
        Some(waiting) => waiting.push_back(theirs),
        None => return Err(ErrorKind::NotFound.into()),
    }
    changed();
    Ok(ours)
}

/// Listens until it is dropped.
pub(crate) struct Listener(PathBuf);

/// Listens at a path that nobody else has.
pub(crate) fn listen_at(path: &Path) -> Result<Listener> {
    locked(&LISTENERS).insert(path.to_owned(), VecDeque::new());
    Ok(Listener(path.to_owned()))
}

/// The paths at which somebody listens, sorted.
pub(super) fn listening() -> Vec<PathBuf> {
    locked(&LISTENERS).keys().cloned().collect()
}

impl Listener {
    fn has_waiting(&self) -> bool {
        locked(&LISTENERS).get(&self.0).is_some_and(|waiting| !waiting.is_empty())
    }

    /// The next connection.
    pub(crate) fn accept(&self) -> Result<Stream> {
        let next = locked(&LISTENERS).get_mut(&self.0).and_then(VecDeque::pop_front);
        next.ok_or(ErrorKind::WouldBlock.into())
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let waiting = locked(&LISTENERS).remove(&self.0);
        drop(waiting); // without the lock
    }
}

/// The process at the other end: this one.
pub(crate) struct Peer {
    pub(crate) pid: Option<u32>,
    pub(crate) uid: u32,
}

impl Peer {
    pub(crate) fn is_ours(&self) -> bool {
        true
    }
}

pub(crate) fn peer_of(_stream: &Stream) -> Result<Peer> {
    Ok(Peer { pid: Some(std::process::id()), uid: 0 })
}

/// Another process, which there is not.
pub(crate) type Process = Infallible;

/// `None`: the end of this process ends both.
pub(crate) fn watch_process(_pid: u32) -> Option<Process> {
    None
}

pub(crate) fn has_ended(process: &Process) -> bool {
    match *process {}
}

/// Waits until a read or a write has something to do, for at most that long.
pub(crate) fn is_ready(stream: &Stream, direction: Direction, within: Duration) -> bool {
    wait_for(within, || stream.can(direction).then_some(())).is_some()
}

/// Whether the other end has not hung up. Never blocks.
pub(crate) fn is_open(stream: &Stream) -> bool {
    let incoming = locked(&stream.incoming);
    !incoming.bytes.is_empty() || !incoming.is_closed
}

/// A connection that [`wait`] waits for.
pub(crate) struct Waiting<'a> {
    pub(crate) stream: &'a Stream,
    pub(crate) direction: Direction,
    pub(crate) process: Option<&'a Process>,
}

/// Waits until something happens, for at most that long.
pub(crate) fn wait<'a>(
    listener: &Listener,
    stop: &Stream,
    connections: impl Iterator<Item = Waiting<'a>>,
    within: Duration,
) -> Ready {
    let connections: Vec<Waiting<'a>> = connections.collect();
    let look = || {
        let ready = connections.iter().enumerate().filter(|(_, waiting)| {
            debug_assert!(waiting.process.is_none());
            waiting.stream.can(waiting.direction)
        });
        let ready = Ready {
            stop: stop.can(Direction::Read),
            listener: listener.has_waiting(),
            connections: ready.map(|(index, _)| index).collect(),
        };
        (ready.stop || ready.listener || !ready.connections.is_empty()).then_some(ready)
    };
    wait_for(within, look).unwrap_or(Ready { stop: false, listener: false, connections: Vec::new() })
}

/// A file descriptor to give up when there is no other: there is no need for one.
pub(crate) struct Spare(());

impl Spare {
    pub(crate) fn new() -> Result<Spare> {
        Ok(Spare(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_carry_bytes_until_they_end() {
        let path = Path::new("a pool.sock");
        assert_eq!(connect(path).err().map(|error| error.kind()), Some(ErrorKind::NotFound));
        let listener = listen_at(path).unwrap();
        assert_eq!(listener.accept().err().map(|error| error.kind()), Some(ErrorKind::WouldBlock));
        let mut client = connect(path).unwrap();
        let mut server = listener.accept().unwrap();
        let mut read = [0; 8];
        assert!(!is_ready(&server, Direction::Read, Duration::ZERO) && is_open(&server));
        assert_eq!(server.read(&mut read).err().map(|error| error.kind()), Some(ErrorKind::WouldBlock));
        client.write_all(b"request").unwrap();
        drop(client);
        assert!(is_ready(&server, Direction::Read, Duration::ZERO) && is_open(&server));
        assert_eq!(server.read(&mut read).unwrap(), 7);
        assert!(!is_open(&server));
        assert_eq!(server.read(&mut read).unwrap(), 0);
        assert_eq!(server.write(b"late").err().map(|error| error.kind()), Some(ErrorKind::BrokenPipe));
    }

    /// What comes between a look and the wait would be noticed only at the end of the wait.
    #[test]
    fn a_wait_ends_when_something_happens() {
        let (mut one, other) = pair().unwrap();
        let sender = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(20));
            one.write_all(b"!").unwrap();
            one
        });
        assert!(is_ready(&other, Direction::Read, Duration::from_secs(600)));
        drop(sender.join().unwrap());
    }

    #[test]
    fn the_end_of_a_listener_ends_what_waits_for_it() {
        let path = Path::new("another pool.sock");
        let listener = listen_at(path).unwrap();
        let client = connect(path).unwrap();
        assert!(wait(&listener, &pair().unwrap().0, std::iter::empty(), Duration::ZERO).listener);
        drop(listener);
        assert!(!is_open(&client));
        assert!(!listening().contains(&path.to_owned()));
    }
}
