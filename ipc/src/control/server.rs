//! The answering end of the control socket: one thread that owns the pool, accepts connections, notices when a
//! learner's process ends, and has iceoryx2 take back what dead processes left.

use super::client::has_ended;
use super::protocol::{
    Answer, Ask, LaneDescription, LaneStatus, MAX_LINE, PROTOCOL_VERSION, PoolStatus, Refusal,
};
use crate::services::{Guest, LaneServices, WorkEvent};
use crate::transport::Iceoryx;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use smaclite_pool::{LaneFigures, Pool};
use std::io::{ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::{UnixListener, UnixStream};
use std::time::{Duration, Instant};

/// How often dead processes are looked for; nothing else does it for us.
const LOOK_AROUND: Duration = Duration::from_millis(100);

/// Connections at once: enough for any pool, too few to use up the process's file descriptors.
const MAX_CONNECTIONS: usize = 512;

/// What the control thread owns. Fields are dropped in this order: the workers stop before the ports they use go, and
/// the node goes last.
pub(crate) struct Host {
    pub(crate) pool: Pool<Iceoryx>,
    pub(crate) lanes: Vec<HostedLane>,
    pub(crate) name: String,
    pub(crate) threads: usize,
    pub(crate) shared_memory: usize,
    pub(crate) started: Instant,
    /// Kept open so that learners find them.
    pub(crate) _services: (WorkEvent, Vec<LaneServices>),
    pub(crate) guest: Guest,
}

/// A lane as the control thread sees it.
pub(crate) struct HostedLane {
    pub(crate) description: LaneDescription,
    holder: Option<u32>,
    spectators: usize,
    /// Figures and time at the last look, for the rates.
    seen: (LaneFigures, Instant),
    steps_per_s: f64,
    queue_wait_us: f64,
}

impl HostedLane {
    pub(crate) fn new(description: LaneDescription) -> Self {
        HostedLane {
            description,
            holder: None,
            spectators: 0,
            seen: (LaneFigures::default(), Instant::now()),
            steps_per_s: 0.0,
            queue_wait_us: 0.0,
        }
    }
}

struct Connection {
    stream: UnixStream,
    pid: u32,
    /// Readable when the process ends, even if a forked child keeps the socket open.
    process: Option<OwnedFd>,
    received: Vec<u8>,
    role: Role,
}

/// What a connection is besides a questioner; lanes by number.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    None,
    Learner(usize),
    Spectator(usize),
}

/// Serves until `stop` is shut down at the other end.
pub(crate) fn serve(mut host: Host, listener: UnixListener, stop: UnixStream) {
    let mut connections: Vec<Connection> = Vec::new();
    let mut sessions = 0u64;
    let mut last_look = Instant::now();
    loop {
        let ready = wait(&listener, &stop, &connections);
        if ready.stop {
            break;
        }
        for index in ready.connections.into_iter().rev() {
            if !host.converse(&mut connections[index], &mut sessions) {
                host.release(connections.swap_remove(index));
            }
        }
        if ready.listener {
            match listener.accept() {
                Ok((stream, _)) => connections
                    .extend(Connection::new(stream).filter(|_| connections.len() < MAX_CONNECTIONS)),
                // Out of file descriptors, it would be ready again at once.
                Err(_) => std::thread::sleep(Duration::from_millis(10)),
            }
        }
        if last_look.elapsed() >= LOOK_AROUND {
            last_look = Instant::now();
            host.guest.node.try_cleanup_dead_nodes();
            host.measure();
        }
    }
}

struct Ready {
    stop: bool,
    listener: bool,
    connections: Vec<usize>,
}

fn wait(listener: &UnixListener, stop: &UnixStream, connections: &[Connection]) -> Ready {
    let mut fds = vec![PollFd::new(stop, PollFlags::IN), PollFd::new(listener, PollFlags::IN)];
    let mut owner = Vec::new();
    for (index, connection) in connections.iter().enumerate() {
        fds.push(PollFd::new(&connection.stream, PollFlags::IN));
        owner.push(index);
        if let Some(process) = &connection.process {
            fds.push(PollFd::new(process, PollFlags::IN));
            owner.push(index);
        }
    }
    let timeout = Timespec { tv_sec: 0, tv_nsec: LOOK_AROUND.as_nanos() as _ };
    let _ = poll(&mut fds, Some(&timeout)); // an interrupted wait found nothing
    let happened = |fd: &PollFd<'_>| !fd.revents().is_empty();
    let mut connections: Vec<usize> =
        fds[2..].iter().zip(owner).filter(|(fd, _)| happened(fd)).map(|(_, index)| index).collect();
    connections.dedup();
    Ready { stop: happened(&fds[0]), listener: happened(&fds[1]), connections }
}

impl Drop for Connection {
    /// Hangs up at once, even if a forked child of this process holds a copy of the socket.
    fn drop(&mut self) {
        let _ = self.stream.shutdown(std::net::Shutdown::Both);
    }
}

impl Connection {
    /// `None` for a process of another user, should one get past the folder's permissions.
    fn new(stream: UnixStream) -> Option<Connection> {
        let peer = rustix::net::sockopt::socket_peercred(&stream).ok()?;
        if peer.uid != rustix::process::getuid() {
            tracing::warn!(uid = peer.uid.as_raw(), "connection of another user refused");
            return None;
        }
        stream.set_nonblocking(true).ok()?;
        let process = rustix::process::pidfd_open(peer.pid, rustix::process::PidfdFlags::empty()).ok();
        let pid = peer.pid.as_raw_nonzero().get() as u32;
        Some(Connection { stream, pid, process, received: Vec::new(), role: Role::None })
    }

    fn process_ended(&self) -> bool {
        self.process.as_ref().is_some_and(has_ended)
    }

    /// Reads what is there; `false` when the peer hung up.
    fn read(&mut self) -> bool {
        let mut chunk = [0u8; 4096];
        loop {
            match self.stream.read(&mut chunk) {
                Ok(0) => return false,
                Ok(n) if self.received.len() + n > MAX_LINE => return false,
                Ok(n) => self.received.extend_from_slice(&chunk[..n]),
                Err(e) => return matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
            }
        }
    }

    fn expect_no_role(&self) -> Result<(), Refusal> {
        match self.role {
            Role::None => Ok(()),
            _ => Err(Refusal::Malformed { what: "this connection has a lane already".to_owned() }),
        }
    }

    fn next_line(&mut self) -> Option<Vec<u8>> {
        let end = self.received.iter().position(|b| *b == b'\n')?;
        Some(self.received.drain(..=end).collect())
    }

    /// `false` when the peer does not read its answers.
    fn answer(&mut self, answer: &Answer) -> bool {
        let mut line = serde_json::to_vec(answer).expect("answers are plain data");
        line.push(b'\n');
        self.stream.write_all(&line).is_ok()
    }
}

impl Host {
    /// Answers what a connection asked; `false` when it is over.
    fn converse(&mut self, connection: &mut Connection, sessions: &mut u64) -> bool {
        let open = connection.read() && !connection.process_ended();
        while let Some(line) = connection.next_line() {
            let answer = match serde_json::from_slice::<Ask>(&line) {
                Ok(Ask::Status) => Answer::Status(self.status()),
                Ok(Ask::Watch { lane }) => self.watch(connection, lane).unwrap_or_else(Answer::Refused),
                Ok(Ask::Attach { version, lane }) => {
                    self.attach(connection, version, lane, sessions).unwrap_or_else(Answer::Refused)
                }
                Err(error) => Answer::Refused(Refusal::Malformed { what: error.to_string() }),
            };
            if !connection.answer(&answer) {
                return false;
            }
        }
        open
    }

    fn attach(
        &mut self,
        connection: &mut Connection,
        version: u32,
        lane: Option<String>,
        sessions: &mut u64,
    ) -> Result<Answer, Refusal> {
        if version != PROTOCOL_VERSION {
            return Err(Refusal::Version { supervisor: PROTOCOL_VERSION, client: version });
        }
        connection.expect_no_role()?;
        let index = self.find(lane)?;
        let lane = &mut self.lanes[index];
        let name = lane.description.lane.clone();
        if let Some(holder) = lane.holder {
            return Err(Refusal::LaneTaken { lane: name, holder });
        }
        if let Some(text) = self.pool.failure(index) {
            return Err(Refusal::LaneFailed { lane: name, text: text.to_owned() });
        }
        *sessions += 1;
        lane.holder = Some(connection.pid);
        connection.role = Role::Learner(index);
        self.pool.set_session(index, Some(*sessions));
        tracing::info!(lane = name, pid = connection.pid, "learner attached");
        Ok(Answer::Attached { session: *sessions, lane: Box::new(lane.description.clone()) })
    }

    fn watch(&mut self, connection: &mut Connection, lane: Option<String>) -> Result<Answer, Refusal> {
        connection.expect_no_role()?;
        let index = self.find(lane)?;
        let lane = &mut self.lanes[index];
        let limit = lane.description.capacity.spectators;
        if lane.spectators == limit {
            return Err(Refusal::TooManySpectators { lane: lane.description.lane.clone(), limit });
        }
        lane.spectators += 1;
        connection.role = Role::Spectator(index);
        Ok(Answer::Lane(Box::new(lane.description.clone())))
    }

    fn find(&self, lane: Option<String>) -> Result<usize, Refusal> {
        let names = || self.lanes.iter().map(|l| l.description.lane.clone()).collect::<Vec<_>>();
        match lane {
            None if self.lanes.len() == 1 => Ok(0),
            None => Err(Refusal::WhichLane { lanes: names() }),
            Some(lane) => {
                let found = self.lanes.iter().position(|l| l.description.lane == lane);
                found.ok_or_else(|| Refusal::NoSuchLane { lane, lanes: names() })
            }
        }
    }

    /// Frees what a connection held.
    fn release(&mut self, connection: Connection) {
        match connection.role {
            Role::None => {}
            Role::Spectator(index) => self.lanes[index].spectators -= 1,
            Role::Learner(index) => {
                // If it died, its successor shall find the frames that it held.
                self.guest.node.try_cleanup_dead_nodes();
                self.pool.set_session(index, None);
                self.lanes[index].holder = None;
                tracing::info!(
                    lane = self.lanes[index].description.lane,
                    pid = connection.pid,
                    "learner left"
                );
            }
        }
    }

    fn status(&self) -> PoolStatus {
        let lane = |(index, lane): (usize, &HostedLane)| LaneStatus {
            description: lane.description.clone(),
            holder: lane.holder,
            spectators: lane.spectators,
            figures: self.pool.figures(index),
            steps_per_s: lane.steps_per_s,
            queue_wait_us: lane.queue_wait_us,
            failure: self.pool.failure(index).map(str::to_owned),
        };
        PoolStatus {
            pool: self.name.clone(),
            pid: std::process::id(),
            threads: self.threads,
            uptime_s: self.started.elapsed().as_secs_f64(),
            shared_memory: self.shared_memory,
            lanes: self.lanes.iter().enumerate().map(lane).collect(),
        }
    }

    /// Refreshes the rates once a second.
    fn measure(&mut self) {
        for (index, lane) in self.lanes.iter_mut().enumerate() {
            let (before, since) = lane.seen;
            let seconds = since.elapsed().as_secs_f64();
            if seconds >= 1.0 {
                let now = self.pool.figures(index);
                lane.steps_per_s = (now.steps - before.steps) as f64 / seconds;
                let requests = (now.accepted - before.accepted).max(1);
                lane.queue_wait_us = (now.waited_ns - before.waited_ns) as f64 / 1e3 / requests as f64;
                lane.seen = (now, Instant::now());
            }
        }
    }
}
