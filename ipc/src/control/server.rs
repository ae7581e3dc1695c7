//! The supervisor's end of the control socket: one thread that owns the pool, accepts connections, detects
//! the end of a learner's process, and has iceoryx2 reclaim what dead processes left.

use super::protocol::{
    ControlError, ControlRequest, ControlResponse, MAX_REQUEST, Message, PROTOCOL_VERSION, PoolStatus,
    RELEASE, Sender, release_text,
};
use super::served_lane::ServedLane;
use crate::CHECK_INTERVAL;
use crate::connections::{LanePorts, PeerPorts};
use crate::error::remedy;
use crate::os::Direction;
use crate::os::socket::{Listener, Process, Spare, Stream, Waiting, has_ended, peer_of, wait, watch_process};
use crate::services::{IpcNode, LaneServices, WorkEvent};
use crate::transport::Iceoryx;
use smaclite_pool::Pool;
use smaclite_pool::transport::SessionId;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

mod following;
use following::Followed;

/// The most connections at once that are neither a learner's nor a spectator's: enough for all status
/// requests, too few to use up the process's file descriptors. Learners and spectators have separate
/// limits.
const MAX_UNATTACHED: usize = 128;

/// The most of these that one process may have, so that it cannot displace the others.
const MAX_UNATTACHED_PER_PROCESS: usize = 32;

/// For how long after a peer was active, or ended, dead processes are looked for at every check.
const LOOKED_FOR: Duration = Duration::from_secs(1);

/// How often they are looked for otherwise: each time, every node of the user is looked at, and the user may
/// have hundreds of pools.
const REST: Duration = Duration::from_secs(1);

/// What the control thread owns. Fields are dropped in this order: the workers stop before their ports are
/// closed, and the node is closed last.
pub(crate) struct ControlServer {
    pub(crate) pool: Pool<Iceoryx>,
    /// By lane.
    pub(crate) ports: Vec<LanePorts>,
    pub(crate) lanes: Vec<ServedLane>,
    pub(crate) name: String,
    pub(crate) threads: usize,
    pub(crate) shared_memory: usize,
    pub(crate) started: Instant,
    /// Kept open so that learners can open them.
    pub(crate) _services: (WorkEvent, Vec<LaneServices>),
    pub(crate) ipc_node: IpcNode,
}

struct Connection {
    /// Non-blocking.
    stream: Stream,
    /// The peer's process; `None` if it is in another process namespace.
    pid: Option<u32>,
    /// Readable when the process of a learner or spectator ends, even if a forked child keeps the socket
    /// open.
    process: Option<Process>,
    received: Vec<u8>,
    /// The unwritten rest of the last response. Until it is written no other request is read.
    unwritten: VecDeque<u8>,
    /// When it was last active.
    active: Instant,
    pub(super) role: Role,
}

/// What a connection holds; lanes by index.
#[derive(PartialEq)]
enum Role {
    None,
    Learner(usize),
    Spectator(usize),
    Follower(usize, Followed),
}

/// Serves until `stop` is shut down at the other end. `spare` is given up where there is no other descriptor.
pub(crate) fn serve(mut server: ControlServer, listener: Listener, stop: Stream, spare: Spare) {
    let mut connections: Vec<Connection> = Vec::new();
    let mut sessions = 0u64;
    let begin = Instant::now();
    let (mut last_check, mut last_cleanup, mut last_activity) = (begin, begin, begin);
    let mut spare = Some(spare);
    loop {
        let ready = wait(&listener, &stop, connections.iter().map(Connection::waiting), CHECK_INTERVAL);
        if ready.stop {
            break;
        }
        if ready.listener || !ready.connections.is_empty() {
            last_activity = Instant::now();
        }
        for index in ready.connections.into_iter().rev() {
            if !server.handle(&mut connections[index], &mut sessions) {
                server.release(connections.swap_remove(index));
            }
        }
        if ready.listener {
            match listener.accept() {
                Ok(stream) => admit(&mut connections, stream),
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                // Out of file descriptors, most likely. The listener stays ready: if there is room now, the
                // next round accepts the peer.
                Err(error) => {
                    if !close_idlest(&mut connections, 0, |_| true) {
                        spare = None;
                        server.turn_away(&listener, &error);
                    }
                    std::thread::sleep(Duration::from_millis(10));
                }
            }
            spare = spare.or_else(|| Spare::new().ok());
        }
        if last_check.elapsed() >= CHECK_INTERVAL {
            last_check = Instant::now();
            server.measure();
            if last_activity.elapsed() < LOOKED_FOR || last_cleanup.elapsed() >= REST {
                last_cleanup = last_check;
                server.ipc_node.clean_up_dead_nodes();
            }
        }
    }
}

/// Accepts a new connection; closes an idle one if there are too many.
fn admit(connections: &mut Vec<Connection>, stream: Stream) {
    let Some(connection) = Connection::new(stream) else { return };
    let pid = connection.pid;
    close_idlest(connections, MAX_UNATTACHED_PER_PROCESS - 1, |other| other.pid == pid);
    close_idlest(connections, MAX_UNATTACHED - 1, |_| true);
    connections.push(connection);
}

/// If more than `limit` connections without a role are of that kind, closes the one that was idle longest,
/// and returns `true`.
fn close_idlest(connections: &mut Vec<Connection>, limit: usize, kind: impl Fn(&Connection) -> bool) -> bool {
    let unattached = connections.iter().enumerate().filter(|(_, c)| c.role == Role::None && kind(c));
    if unattached.clone().count() > limit
        && let Some((index, _)) = unattached.min_by_key(|(_, c)| c.active)
    {
        tracing::debug!(pid = connections[index].pid, "idle connection closed in favour of another");
        connections.swap_remove(index);
        return true;
    }
    false
}

impl Drop for Connection {
    /// Ends the connection at once, even if a forked child of this process holds a copy of the socket.
    fn drop(&mut self) {
        let _ = self.stream.shutdown(std::net::Shutdown::Both);
    }
}

impl Connection {
    /// `None` for a process of another user, which the folder's permissions should prevent.
    fn new(stream: Stream) -> Option<Connection> {
        let peer = peer_of(&stream).ok()?;
        if !peer.is_ours() {
            tracing::warn!(uid = peer.uid, "connection of another user refused");
            return None;
        }
        stream.set_nonblocking(true).ok()?;
        let (received, unwritten) = (Vec::new(), VecDeque::new());
        let (pid, process, active, role) = (peer.pid, None, Instant::now(), Role::None);
        Some(Connection { stream, pid, process, received, unwritten, active, role })
    }

    /// What a wait for it looks at.
    fn waiting(&self) -> Waiting<'_> {
        let direction = if self.unwritten.is_empty() { Direction::Read } else { Direction::Write };
        Waiting { stream: &self.stream, direction, process: self.process.as_ref() }
    }

    fn process_ended(&self) -> bool {
        self.process.as_ref().is_some_and(has_ended)
    }

    /// Reads some of what was received; `false` if the peer hung up or its request is too long.
    fn read(&mut self) -> bool {
        let mut chunk = [0u8; 4096];
        match self.stream.read(&mut chunk) {
            Ok(0) => false,
            Ok(n) => {
                self.received.extend_from_slice(&chunk[..n]);
                self.received.len() <= MAX_REQUEST
            }
            Err(e) => matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
        }
    }

    /// Writes as much of the last response as the peer has room for; `false` if it hung up.
    fn write(&mut self) -> bool {
        while !self.unwritten.is_empty() {
            match self.stream.write(self.unwritten.as_slices().0) {
                Ok(n) => drop(self.unwritten.drain(..n)),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return e.kind() == ErrorKind::WouldBlock,
            }
        }
        true
    }

    /// The peer becomes the learner or spectator of a lane: from now on the end of its process is detected.
    pub(super) fn take_role(&mut self, role: Role) {
        self.process = self.pid.and_then(watch_process);
        self.role = role;
    }

    fn next_line(&mut self) -> Option<Vec<u8>> {
        let end = self.received.iter().position(|b| *b == b'\n')?;
        Some(self.received.drain(..=end).collect())
    }
}

/// Reads a request. One of another release is refused before what it asks is read, which may have changed.
fn request(line: &[u8]) -> Result<ControlRequest, ControlError> {
    let malformed = |error: serde_json::Error| ControlError::Malformed { what: error.to_string() };
    let Sender { version, release } = serde_json::from_slice(line).map_err(malformed)?;
    if version != PROTOCOL_VERSION {
        let (theirs, ours) = (release_text(&release, version), release_text(RELEASE, PROTOCOL_VERSION));
        let message = format!("the pool is of {ours}, this program of {theirs}; run the same release");
        return Err(ControlError::OtherRelease { message });
    }
    serde_json::from_slice(line).map_err(malformed)
}

impl ControlServer {
    /// Answers the requests of a connection, each after the previous response is written in full; `false`
    /// if the connection is over.
    fn handle(&mut self, connection: &mut Connection, sessions: &mut u64) -> bool {
        connection.active = Instant::now();
        let reads = connection.unwritten.is_empty();
        let open = (!reads || connection.read()) && !connection.process_ended();
        loop {
            if !connection.write() {
                return false;
            }
            if !connection.unwritten.is_empty() {
                // A peer without a role may have sent its last request, and still read.
                return open || connection.role == Role::None;
            }
            let Some(line) = connection.next_line() else { return open };
            let response = request(&line).and_then(|request| self.answer(connection, request, sessions));
            let response = Message::new(response.unwrap_or_else(ControlResponse::Refused));
            let mut line = serde_json::to_vec(&response).expect("responses are plain data");
            line.push(b'\n');
            connection.unwritten = line.into();
        }
    }

    fn answer(
        &mut self,
        connection: &mut Connection,
        request: ControlRequest,
        sessions: &mut u64,
    ) -> Result<ControlResponse, ControlError> {
        match request {
            ControlRequest::Status => Ok(ControlResponse::Status(self.status())),
            ControlRequest::Attach { lane } => self.attach(connection, lane, sessions),
            ControlRequest::Connect(ports) => self.connect(connection, &ports),
            ControlRequest::Watch { lane } => self.watch(connection, lane),
            ControlRequest::Scenario { lane } => self.scenario(lane),
            ControlRequest::Follow { lane, env_ids } => self.follow(connection, lane, env_ids),
            ControlRequest::ReadEpisodes => self.read_episodes(connection),
            ControlRequest::ReadRefusals => match connection.role {
                Role::Learner(index) => {
                    Ok(ControlResponse::Refusals { refusals: self.ports[index].refusals.take() })
                }
                _ => Err(ControlError::Malformed { what: "only a learner has requests".to_owned() }),
            },
        }
    }

    fn attach(
        &mut self,
        connection: &mut Connection,
        lane: Option<String>,
        sessions: &mut u64,
    ) -> Result<ControlResponse, ControlError> {
        let pid = self.candidate(connection)?;
        let index = self.find(lane)?;
        let lane = &mut self.lanes[index];
        let name = lane.description.lane.clone();
        if let Some(learner_pid) = lane.learner_pid {
            return Err(ControlError::LaneTaken { lane: name, learner_pid });
        }
        if let Some(text) = self.pool.lane(index).failure() {
            return Err(ControlError::LaneFailed { lane: name, text: text.to_owned() });
        }
        *sessions += 1;
        self.pool.lane(index).set_session(Some(SessionId(*sessions)));
        lane.learner_pid = Some(pid);
        connection.take_role(Role::Learner(index));
        tracing::info!(lane = name, pid, "learner attached");
        Ok(ControlResponse::Attached { session: *sessions, lane: Box::new(lane.description.clone()) })
    }

    /// The second half of an attach, when the peer has opened its ports.
    fn connect(
        &mut self,
        connection: &Connection,
        ports: &PeerPorts,
    ) -> Result<ControlResponse, ControlError> {
        let (Role::Learner(index) | Role::Spectator(index)) = connection.role else {
            let what = "only a learner or a spectator has ports to connect to".to_owned();
            return Err(ControlError::Malformed { what });
        };
        self.ports[index].connect_to(ports).map_err(|cause| {
            let (pool, pid) = (self.name.clone(), std::process::id());
            ControlError::NotConnected { pool, pid, cause }
        })?;
        Ok(ControlResponse::Connected)
    }

    fn watch(
        &mut self,
        connection: &mut Connection,
        lane: Option<String>,
    ) -> Result<ControlResponse, ControlError> {
        self.candidate(connection)?;
        let index = self.find(lane)?;
        let lane = &mut self.lanes[index];
        let limit = lane.description.capacity.spectators;
        if lane.spectators == limit {
            return Err(ControlError::TooManySpectators { lane: lane.description.lane.clone(), limit });
        }
        lane.spectators += 1;
        connection.take_role(Role::Spectator(index));
        Ok(ControlResponse::Lane(Box::new(lane.description.clone())))
    }

    /// Tells the next peer why it cannot be served.
    fn turn_away(&self, listener: &Listener, error: &std::io::Error) {
        let Ok(mut stream) = listener.accept() else { return };
        let (pool, pid) = (self.name.clone(), std::process::id());
        let cause = format!("{error}{}", remedy(error));
        tracing::warn!(cause, "a connection was refused");
        let refusal = ControlResponse::Refused(ControlError::NotAccepted { pool, pid, cause });
        let mut line = serde_json::to_vec(&Message::new(refusal)).expect("responses are plain data");
        line.push(b'\n');
        // A short line fits into the new socket's buffer.
        let _ = stream.set_nonblocking(true).and_then(|()| stream.write_all(&line));
    }

    /// The process of a connection that may become a learner or spectator.
    fn candidate(&self, connection: &Connection) -> Result<u32, ControlError> {
        if connection.role != Role::None {
            return Err(ControlError::Malformed { what: "this connection already has a lane".to_owned() });
        }
        connection.pid.ok_or_else(|| ControlError::OtherNamespace { pool: self.name.clone() })
    }

    pub(super) fn find(&self, lane: Option<String>) -> Result<usize, ControlError> {
        let names = || self.lanes.iter().map(|l| l.description.lane.clone()).collect::<Vec<_>>();
        match lane {
            None if self.lanes.len() == 1 => Ok(0),
            None => Err(ControlError::WhichLane { lanes: names() }),
            Some(lane) => {
                let found = self.lanes.iter().position(|l| l.description.lane == lane);
                found.ok_or_else(|| ControlError::NoSuchLane { lane, lanes: names() })
            }
        }
    }

    /// Releases what a connection held.
    fn release(&mut self, connection: Connection) {
        match connection.role {
            Role::None => {}
            Role::Spectator(index) => self.lanes[index].spectators -= 1,
            Role::Follower(index, ref followed) => self.unfollow(index, followed),
            Role::Learner(index) => {
                // If it died, its successor gets the memory of the frames that it held.
                self.ipc_node.clean_up_dead_nodes();
                self.lanes[index].learner_pid = None;
                self.pool.lane(index).set_session(None);
                tracing::info!(
                    lane = self.lanes[index].description.lane,
                    pid = connection.pid,
                    "learner left"
                );
            }
        }
    }

    fn status(&self) -> PoolStatus {
        let lane = |(index, lane): (usize, &ServedLane)| {
            lane.status(self.pool.lane(index).stats(), self.pool.lane(index).failure())
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

    fn measure(&mut self) {
        for (index, lane) in self.lanes.iter_mut().enumerate() {
            lane.measure(self.pool.lane(index).stats());
        }
    }
}
