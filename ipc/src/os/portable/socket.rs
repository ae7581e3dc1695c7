//! Control connections as bytes in memory. Another process is connected by TCP on this machine, of which two
//! threads carry the bytes (`tcp`).

mod tcp;

use crate::os::{Direction, Ready};
use std::collections::{BTreeMap, VecDeque};
use std::convert::Infallible;
use std::io::{ErrorKind, Read, Result, Write};
use std::net::Shutdown;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// What the connections of a process share.
struct Shared {
    id: u32,
    /// Connections until they are accepted, by the path that they were made to.
    listeners: Mutex<BTreeMap<PathBuf, VecDeque<Stream>>>,
    /// Held while somebody looks whether there is something to do. What changes that takes it afterwards, for
    /// a moment, so that no change is missed between a look and the wait for the next change.
    looking: Mutex<()>,
    changed: Condvar,
    /// Of a forked child.
    next: OnceLock<Box<Shared>>,
}

/// That of this process. A forked child has its own: a thread that it does not have may hold its parent's
/// locks.
fn shared() -> &'static Shared {
    static FIRST: OnceLock<Box<Shared>> = OnceLock::new();
    let (id, mut place) = (std::process::id(), &FIRST);
    loop {
        let (listeners, looking, changed) = Default::default();
        let new = || Box::new(Shared { id, listeners, looking, changed, next: OnceLock::new() });
        let found = place.get_or_init(new);
        if found.id == id {
            return found;
        }
        place = &found.next;
    }
}

fn listeners() -> MutexGuard<'static, BTreeMap<PathBuf, VecDeque<Stream>>> {
    locked(&shared().listeners)
}

/// Bytes that wait in a direction of a connection, until the other end reads.
const ROOM: usize = 1 << 16;

/// How long after the end of a connection its other end may still take it for open: threads at both ends tell
/// it.
pub(crate) const END_IS_SEEN_WITHIN: Duration = Duration::from_millis(200);

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn changed() {
    let Shared { looking, changed, .. } = shared();
    drop(locked(looking));
    changed.notify_all();
}

/// Waits until `look` finds something, for at most that long.
fn wait_for<T>(within: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let begin = Instant::now();
    let Shared { looking, changed, .. } = shared();
    let mut looking = locked(looking);
    loop {
        let found = look();
        let left = within.saturating_sub(begin.elapsed());
        if found.is_some() || left.is_zero() {
            return found;
        }
        (looking, _) = changed.wait_timeout(looking, left).unwrap_or_else(PoisonError::into_inner);
    }
}

/// One direction of a connection.
#[derive(Default)]
struct Pipe {
    bytes: VecDeque<u8>,
    is_closed: bool,
}

impl Pipe {
    fn room(&self) -> usize {
        ROOM.saturating_sub(self.bytes.len())
    }
}

/// An end of a connection.
pub(crate) struct Stream {
    incoming: Arc<Mutex<Pipe>>,
    outgoing: Arc<Mutex<Pipe>>,
    /// The process at the other end.
    peer: u32,
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
        match direction {
            Direction::Read => {
                let incoming = locked(&self.incoming);
                !incoming.bytes.is_empty() || incoming.is_closed
            }
            Direction::Write => {
                let outgoing = locked(&self.outgoing);
                outgoing.room() > 0 || outgoing.is_closed
            }
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
        (&*self).read(to)
    }
}

impl Read for &Stream {
    fn read(&mut self, to: &mut [u8]) -> Result<usize> {
        let mut incoming = locked(&self.incoming);
        if incoming.bytes.is_empty() && !incoming.is_closed {
            return Err(ErrorKind::WouldBlock.into());
        }
        let read = incoming.bytes.read(to);
        drop(incoming);
        changed(); // there is room to write
        read
    }
}

impl Write for Stream {
    fn write(&mut self, from: &[u8]) -> Result<usize> {
        (&*self).write(from)
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

impl Write for &Stream {
    fn write(&mut self, from: &[u8]) -> Result<usize> {
        let mut outgoing = locked(&self.outgoing);
        if outgoing.is_closed {
            return Err(ErrorKind::BrokenPipe.into());
        }
        let written = from.len().min(outgoing.room());
        if written == 0 && !from.is_empty() {
            return Err(ErrorKind::WouldBlock.into());
        }
        outgoing.bytes.extend(&from[..written]);
        drop(outgoing);
        changed();
        Ok(written)
    }

    fn flush(&mut self) -> Result<()> {
        Ok(())
    }
}

/// Two ends that are connected.
pub(crate) fn pair() -> Result<(Stream, Stream)> {
    let own = std::process::id();
    Ok(ends(own, own))
}

/// Two ends of a connection, and which process is behind the first one, and behind the other.
fn ends(first: u32, second: u32) -> (Stream, Stream) {
    let (one, other) = (Arc::<Mutex<Pipe>>::default(), Arc::<Mutex<Pipe>>::default());
    let end = Stream { incoming: Arc::clone(&one), outgoing: Arc::clone(&other), peer: second };
    (end, Stream { incoming: other, outgoing: one, peer: first })
}

/// Connects to who listens at a path, in this process or in another one.
pub(crate) fn connect(path: &Path) -> Result<Stream> {
    let (ours, theirs) = pair()?;
    if !offer(theirs, path) {
        return tcp::connect(path);
    }
    Ok(ours)
}

/// Offers a connection to the listener of a path in this process; `false` if there is none.
fn offer(connection: Stream, path: &Path) -> bool {
    let is_offered = match listeners().get_mut(path) {
        Some(waiting) => {
            waiting.push_back(connection);
            true
        }
        None => false,
    };
    changed();
    is_offered
}

/// Listens until it is dropped.
pub(crate) struct Listener {
    path: PathBuf,
    _tcp: tcp::Listener,
}

/// Listens at a path that nobody else has.
pub(crate) fn listen_at(path: &Path) -> Result<Listener> {
    listeners().insert(path.to_owned(), VecDeque::new());
    let _tcp = tcp::listen_at(path).inspect_err(|_| drop(listeners().remove(path)))?;
    Ok(Listener { path: path.to_owned(), _tcp })
}

impl Listener {
    fn has_waiting(&self) -> bool {
        listeners().get(&self.path).is_some_and(|waiting| !waiting.is_empty())
    }

    /// The next connection.
    pub(crate) fn accept(&self) -> Result<Stream> {
        let next = listeners().get_mut(&self.path).and_then(VecDeque::pop_front);
        next.ok_or(ErrorKind::WouldBlock.into())
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        let waiting = listeners().remove(&self.path);
        drop(waiting); // without the lock
    }
}

/// The process at the other end.
pub(crate) struct Peer {
    pub(crate) pid: Option<u32>,
    pub(crate) uid: u32,
}

impl Peer {
    /// Whether it is a process of this user: no other one can read what a connection begins with.
    pub(crate) fn is_ours(&self) -> bool {
        true
    }
}

pub(crate) fn peer_of(stream: &Stream) -> Result<Peer> {
    Ok(Peer { pid: Some(stream.peer), uid: 0 })
}

/// A process whose end is watched.
pub(crate) type Process = Infallible;

/// `None`: the end of a process ends its connections.
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
        let folder = tempfile::tempdir().unwrap();
        let path = &folder.path().join("pool.sock");
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
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pool.sock");
        let listener = listen_at(&path).unwrap();
        let client = connect(&path).unwrap();
        assert!(wait(&listener, &pair().unwrap().0, std::iter::empty(), Duration::ZERO).listener);
        drop(listener);
        assert!(!is_open(&client));
        assert_eq!(connect(&path).err().map(|error| error.kind()), Some(ErrorKind::NotFound));
    }

    /// A peer that does not read must not make the other end's memory grow.
    #[test]
    fn a_direction_takes_what_it_has_room_for() {
        let (mut one, mut other) = pair().unwrap();
        let many = vec![7; 3 * ROOM];
        assert_eq!(one.write(&many).unwrap(), ROOM);
        assert_eq!(one.write(&many).err().map(|error| error.kind()), Some(ErrorKind::WouldBlock));
        assert!(!is_ready(&one, Direction::Write, Duration::ZERO));
        assert_eq!(other.read(&mut [0; 100]).unwrap(), 100);
        assert!(is_ready(&one, Direction::Write, Duration::ZERO));
        assert_eq!(one.write(&many).unwrap(), 100);
    }
}
