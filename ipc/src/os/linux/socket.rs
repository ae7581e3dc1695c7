//! Control sockets: Unix sockets in the runtime folder, and the ends of the processes behind them.

use super::NotInherited;
use super::files::PRIVATE;
use crate::os::{Direction, Ready};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, fchmod};
use rustix::net::{AddressFamily, RecvFlags, SocketAddrUnix, SocketFlags, SocketType, bind, listen};
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use std::fs::File;
use std::io::Result;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::time::Duration;

pub(crate) type Stream = std::os::unix::net::UnixStream;

/// Listens until it is dropped.
pub(crate) struct Listener {
    _not_inherited: NotInherited,
    socket: UnixListener,
}

impl Listener {
    /// The next connection.
    pub(crate) fn accept(&self) -> Result<Stream> {
        Ok(self.socket.accept()?.0)
    }
}

/// Readable when a process ends.
pub(crate) type Process = OwnedFd;

/// Connections to a control socket that may wait to be accepted; the value of the standard library.
const LISTEN_BACKLOG: i32 = 128;

/// How long after the end of a connection its other end may still take it for open.
pub(crate) const END_IS_SEEN_WITHIN: Duration = Duration::ZERO;

/// A non-blocking socket.
fn socket() -> rustix::io::Result<OwnedFd> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    rustix::net::socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)
}

/// Connects without blocking: a supervisor that is stopped leaves its queue of connections full, which is
/// [`WouldBlock`](std::io::ErrorKind::WouldBlock).
pub(crate) fn connect(path: &Path) -> Result<Stream> {
    let socket = socket()?;
    rustix::net::connect(&socket, &SocketAddrUnix::new(path)?)?;
    Ok(Stream::from(socket))
}

/// Listens at a path that no other user can ever connect to: Linux gives a socket's file the mode that its
/// descriptor had before it was bound (`unix_bind_bsd` in net/unix/af_unix.c).
pub(crate) fn listen_at(path: &Path) -> Result<Listener> {
    let _ = std::fs::remove_file(path); // of a dead pool: this one has the lock of the name
    let socket = socket()?;
    fchmod(&socket, Mode::from_raw_mode(PRIVATE))?;
    bind(&socket, &SocketAddrUnix::new(path)?)?;
    listen(&socket, LISTEN_BACKLOG)?;
    Ok(Listener { _not_inherited: NotInherited::new(&socket), socket: socket.into() })
}

/// Two ends that are connected.
pub(crate) fn pair() -> Result<(Stream, Stream)> {
    Stream::pair()
}

/// The process at the other end of a socket.
pub(crate) struct Peer {
    /// `None` if it is in a process namespace whose processes cannot be seen from this one.
    pub(crate) pid: Option<u32>,
    pub(crate) uid: u32,
}

impl Peer {
    /// Whether it is a process of this user.
    pub(crate) fn is_ours(&self) -> bool {
        self.uid == rustix::process::getuid().as_raw()
    }
}

pub(crate) fn peer_of(stream: &Stream) -> Result<Peer> {
    // Not by rustix, whose type for process numbers cannot hold the kernel's 0 for "not in this namespace".
    let peer = nix::sys::socket::getsockopt(&stream.as_fd(), nix::sys::socket::sockopt::PeerCredentials)?;
    Ok(Peer { pid: u32::try_from(peer.pid()).ok().filter(|pid| *pid != 0), uid: peer.uid() })
}

/// Readable when the process ends. `None` for this one, too, whose end ends both.
pub(crate) fn watch_process(pid: u32) -> Option<Process> {
    if pid == std::process::id() {
        return None;
    }
    let pid = Pid::from_raw(i32::try_from(pid).ok()?)?;
    pidfd_open(pid, PidfdFlags::empty()).ok()
}

/// Has this process ended? Never blocks.
pub(crate) fn has_ended(process: &Process) -> bool {
    is_ready(process, Direction::Read, Duration::ZERO)
}

impl From<Direction> for PollFlags {
    fn from(direction: Direction) -> PollFlags {
        match direction {
            Direction::Read => PollFlags::IN,
            Direction::Write => PollFlags::OUT,
        }
    }
}

fn timespec(time: Duration) -> Timespec {
    Timespec { tv_sec: time.as_secs() as _, tv_nsec: time.subsec_nanos().into() }
}

/// Waits until a read or a write has something to do, for at most that long.
pub(crate) fn is_ready(fd: &impl AsFd, direction: Direction, within: Duration) -> bool {
    // An interrupted wait found nothing; its caller checks again.
    poll(&mut [PollFd::new(fd, direction.into())], Some(&timespec(within))).is_ok_and(|ready| ready > 0)
}

/// Whether the other end has not hung up. Never blocks.
pub(crate) fn is_open(stream: &Stream) -> bool {
    let mut byte = [0u8; 1];
    match rustix::net::recv(stream, &mut byte[..], RecvFlags::PEEK | RecvFlags::DONTWAIT) {
        Ok((received, _)) => received > 0,
        Err(e) => matches!(e, rustix::io::Errno::AGAIN | rustix::io::Errno::INTR),
    }
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
    let mut fds = vec![PollFd::new(stop, PollFlags::IN), PollFd::new(&listener.socket, PollFlags::IN)];
    let mut owner = Vec::new();
    for (index, Waiting { stream, direction, process }) in connections.enumerate() {
        fds.push(PollFd::new(stream, direction.into()));
        owner.push(index);
        if let Some(process) = process {
            fds.push(PollFd::new(process, PollFlags::IN));
            owner.push(index);
        }
    }
    let _ = poll(&mut fds, Some(&timespec(within))); // an interrupted wait found nothing
    let happened = |fd: &PollFd<'_>| !fd.revents().is_empty();
    let mut connections: Vec<usize> =
        fds[2..].iter().zip(owner).filter(|(fd, _)| happened(fd)).map(|(_, index)| index).collect();
    connections.dedup();
    Ready { stop: happened(&fds[0]), listener: happened(&fds[1]), connections }
}

/// A file descriptor to give up when there is no other. A pool has it from its start, or a learner of this
/// process could take the last one before it.
pub(crate) struct Spare {
    _descriptor: File,
}

impl Spare {
    pub(crate) fn new() -> Result<Spare> {
        Ok(Spare { _descriptor: File::open("/dev/null")? })
    }
}
