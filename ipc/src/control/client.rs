//! The client's end of the control socket. Waits are cut into slices, between which the caller can interrupt
//! them: a stopped supervisor must not block its clients.

use super::protocol::{
    ControlRequest, ControlResponse, MAX_REQUEST, MAX_RESPONSE, Message, PROTOCOL_VERSION, RELEASE, Sender,
    release_text,
};
use crate::error::remedy;
use crate::name::{NameError, check_name};
use crate::os::Direction;
use crate::os::socket::{self, END_IS_SEEN_WITHIN, Process, Stream, has_ended, is_ready, watch_process};
use crate::runtime_dir::RuntimeDir;
pub(crate) use crate::wait_options::RESPONSE_TIMEOUT;
use crate::wait_options::WaitOptions;
use smaclite_pool::Deadline;
use std::io::{ErrorKind, Read, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// How often a wait checks whether its caller interrupts it.
const SLICE: Duration = Duration::from_millis(50);

/// How often a place is asked for that may just have become free.
const RETRY_INTERVAL: Duration = Duration::from_millis(2);

/// How long after the end of a connection the end of its process may become visible.
const EXIT_TIMEOUT: Duration = Duration::from_millis(200);

/// A connection to a supervisor. While it is open, each end knows that the other lives.
pub(crate) struct ControlClient {
    /// Non-blocking.
    stream: Stream,
    /// Readable when the supervisor's process ends, even if a forked child of it keeps the socket open.
    process: Option<Process>,
    pid: Option<u32>,
    runtime_dir: RuntimeDir,
    pool: String,
    /// The rest of a request that is not written yet.
    unwritten: Vec<u8>,
    /// The beginning of a response.
    received: Vec<u8>,
    /// A request whose response is still to come: the wait for it ended before.
    is_unanswered: bool,
}

/// Why a request to a supervisor failed.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum ControlSocketError {
    #[error("pool name: {0}")]
    Name(#[from] NameError),
    #[error("no pool named `{pool}` runs here{}", hint(running))]
    NoSuchPool { pool: String, running: Vec<String> },
    #[error(
        "pool `{pool}`{} did not answer within {} s: it is stopped (`kill -CONT` resumes it) or overloaded",
        of_process(*pid), in_seconds(*time)
    )]
    Silent { pool: String, pid: Option<u32>, time: Duration },
    #[error("the supervisor of pool `{pool}` is gone: it ended while this process attached; start it again")]
    Gone { pool: String },
    #[error("pool `{pool}` closed the connection without an answer: too many idle ones are open; try again")]
    Closed { pool: String },
    #[error("pool `{pool}` cannot be reached through {}: {source}{}", socket.display(), remedy(source))]
    Unreachable { pool: String, socket: PathBuf, source: std::io::Error },
    #[error("pool `{pool}` sent a response that this release does not know ({source}); run the same release")]
    UnknownResponse { pool: String, source: serde_json::Error },
    #[error(
        "pool `{pool}` is of {theirs}, this program of {ours}; run the same release", ours = this_release()
    )]
    OtherRelease { pool: String, theirs: String },
    #[error(
        "a request of {bytes} bytes is longer than a pool reads ({MAX_REQUEST}): name fewer environments"
    )]
    TooLong { bytes: usize },
    #[error("the wait for an answer of pool `{pool}` was interrupted")]
    Interrupted { pool: String },
}

fn this_release() -> String {
    release_text(RELEASE, PROTOCOL_VERSION)
}

fn hint(pools: &[String]) -> String {
    if !pools.is_empty() {
        format!("; running: {}", pools.join(", "))
    } else {
        "; start one with `smaclite-pool serve SCENARIO:N --name NAME`".to_owned()
    }
}

/// Seconds, to the millisecond.
pub(crate) fn in_seconds(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e3).round() / 1e3
}

/// ` (process 7)`, if it is known.
pub(crate) fn of_process(pid: Option<u32>) -> String {
    pid.map_or(String::new(), |pid| format!(" (process {pid})"))
}

/// Does the error mean that no process listens at the pool's socket?
fn is_absent(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::NotFound | ErrorKind::ConnectionRefused)
}

/// Names of the pools whose supervisors live, whether or not they answer.
pub(crate) fn running_pools(runtime_dir: &RuntimeDir) -> Vec<String> {
    let mut names = runtime_dir.pool_names();
    names.retain(|name| !socket::connect(&runtime_dir.socket(name)).is_err_and(|error| is_absent(&error)));
    names
}

/// The process of a pool's supervisor, by the kernel: the supervisor need not answer.
pub(crate) fn process_of(runtime_dir: &RuntimeDir, pool: &str) -> Option<u32> {
    socket::peer_of(&socket::connect(&runtime_dir.socket(pool)).ok()?).ok()?.pid
}

/// What is left of a caller's [`WaitOptions`].
struct Waiting<'a> {
    wait: WaitOptions<'a>,
    /// `None` without a timeout.
    deadline: Option<Deadline>,
    pool: String,
    pid: Option<u32>,
}

impl<'a> Waiting<'a> {
    fn new(wait: WaitOptions<'a>, pool: &str) -> Waiting<'a> {
        let deadline = wait.timeout.map(|timeout| Deadline::new(Instant::now(), timeout));
        Waiting { wait, deadline, pool: pool.to_owned(), pid: None }
    }

    /// The length of the next slice, unless the wait is over.
    fn slice(&mut self) -> Result<Duration, ControlSocketError> {
        let pool = self.pool.clone();
        if (self.wait.interrupted)() {
            return Err(ControlSocketError::Interrupted { pool });
        }
        match (self.wait.timeout, &mut self.deadline) {
            (Some(time), Some(deadline)) => match deadline.left(Instant::now()) {
                Duration::ZERO => Err(ControlSocketError::Silent { pool, pid: self.pid, time }),
                left => Ok(left.min(SLICE)),
            },
            _ => Ok(SLICE),
        }
    }
}

impl ControlClient {
    /// Connects to a pool and sends it a request; returns the connection and the response. While whoever has
    /// a place that is asked for may just have left it, it asks again.
    pub(crate) fn request(
        runtime_dir: &RuntimeDir,
        pool: &str,
        request: &ControlRequest,
        wait: WaitOptions<'_>,
    ) -> Result<(ControlClient, ControlResponse), ControlSocketError> {
        check_name(pool)?;
        let mut waiting = Waiting::new(wait, pool);
        let mut refused = None;
        loop {
            let mut client = ControlClient::connect(runtime_dir, &mut waiting)?;
            let response = client.exchange(request, &mut waiting)?;
            let may_be_free = matches!(&response, ControlResponse::Refused(refusal) if refusal.may_be_over())
                && refused.get_or_insert_with(Instant::now).elapsed() < END_IS_SEEN_WITHIN;
            // Not with so little time that there may be no answer to the next one.
            if !may_be_free || !waiting.slice().is_ok_and(|slice| slice == SLICE) {
                return Ok((client, response));
            }
            std::thread::sleep(RETRY_INTERVAL);
        }
    }

    /// Sends the same request again and returns the response. If the wait for the last one ended before it
    /// was answered, that response is returned, without another request; the second value is `true` then.
    pub(crate) fn repeat(
        &mut self,
        request: &ControlRequest,
        wait: WaitOptions<'_>,
    ) -> Result<(ControlResponse, bool), ControlSocketError> {
        let is_late = self.is_unanswered;
        let response = self.exchange(request, &mut Waiting::new(wait, &self.pool.clone()))?;
        Ok((response, is_late))
    }

    fn exchange(
        &mut self,
        request: &ControlRequest,
        waiting: &mut Waiting<'_>,
    ) -> Result<ControlResponse, ControlSocketError> {
        waiting.pid = self.pid;
        if !self.is_unanswered {
            self.unwritten = serde_json::to_vec(&Message::new(request)).expect("requests are plain data");
            self.unwritten.push(b'\n');
            if self.unwritten.len() > MAX_REQUEST {
                let bytes = std::mem::take(&mut self.unwritten).len();
                return Err(ControlSocketError::TooLong { bytes });
            }
            self.is_unanswered = true;
        }
        self.write(waiting)?;
        self.read_line(waiting)?;
        self.is_unanswered = false;
        let line = std::mem::take(&mut self.received);
        self.response(&line)
    }

    /// Reads a response; if it cannot be, or another release sent it, says which.
    fn response(&self, line: &[u8]) -> Result<ControlResponse, ControlSocketError> {
        let pool = self.pool.clone();
        let message = serde_json::from_slice::<Message<ControlResponse>>(line);
        let sender = match &message {
            Ok(message) => Some((message.version, message.release.clone())),
            Err(_) => serde_json::from_slice(line).ok().map(|Sender { version, release }| (version, release)),
        };
        match (sender, message) {
            (Some((version, release)), _) if version != PROTOCOL_VERSION => {
                Err(ControlSocketError::OtherRelease { pool, theirs: release_text(&release, version) })
            }
            (_, Ok(message)) => Ok(message.body),
            (_, Err(source)) => Err(ControlSocketError::UnknownResponse { pool, source }),
        }
    }

    fn connect(
        runtime_dir: &RuntimeDir,
        waiting: &mut Waiting<'_>,
    ) -> Result<ControlClient, ControlSocketError> {
        let pool = waiting.pool.clone();
        let unreachable = |source| ControlSocketError::Unreachable {
            pool: pool.clone(),
            socket: runtime_dir.socket(&pool),
            source,
        };
        let stream = loop {
            match socket::connect(&runtime_dir.socket(&pool)) {
                Ok(stream) => break stream,
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    std::thread::sleep(waiting.slice()?.min(Duration::from_millis(10)));
                }
                Err(error) if is_absent(&error) => {
                    return Err(ControlSocketError::NoSuchPool { pool, running: running_pools(runtime_dir) });
                }
                Err(source) => return Err(unreachable(source)),
            }
        };
        let pid = socket::peer_of(&stream).map_err(unreachable)?.pid;
        Ok(ControlClient {
            stream,
            process: pid.and_then(watch_process),
            pid,
            runtime_dir: runtime_dir.clone(),
            pool,
            unwritten: Vec::new(),
            received: Vec::new(),
            is_unanswered: false,
        })
    }

    fn write(&mut self, waiting: &mut Waiting<'_>) -> Result<(), ControlSocketError> {
        while !self.unwritten.is_empty() {
            match self.stream.write(&self.unwritten) {
                Ok(written) => drop(self.unwritten.drain(..written)),
                // It may have answered before it closed the connection.
                Err(error) if error.kind() == ErrorKind::BrokenPipe => self.unwritten.clear(),
                Err(error) => self.wait_after(error, Direction::Write, waiting)?,
            }
        }
        Ok(())
    }

    fn read_line(&mut self, waiting: &mut Waiting<'_>) -> Result<(), ControlSocketError> {
        let mut chunk = [0; 1 << 16];
        while self.received.last() != Some(&b'\n') {
            match self.stream.read(&mut chunk) {
                Ok(0) => return Err(self.hung_up()),
                Ok(read) => self.received.extend_from_slice(&chunk[..read]),
                Err(error) => self.wait_after(error, Direction::Read, waiting)?,
            }
            if self.received.len() > MAX_RESPONSE {
                let what = format!("its response has more than {MAX_RESPONSE} bytes");
                return Err(self.unreachable(std::io::Error::other(what)));
            }
        }
        Ok(())
    }

    /// After a read or write that could not proceed: waits for a slice, if waiting helps.
    fn wait_after(
        &self,
        error: std::io::Error,
        direction: Direction,
        waiting: &mut Waiting<'_>,
    ) -> Result<(), ControlSocketError> {
        match error.kind() {
            ErrorKind::Interrupted => Ok(()),
            ErrorKind::WouldBlock if self.process.as_ref().is_some_and(has_ended) => Err(self.gone()),
            ErrorKind::WouldBlock => {
                is_ready(&self.stream, direction, waiting.slice()?);
                Ok(())
            }
            ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => Err(self.hung_up()),
            _ => Err(self.unreachable(error)),
        }
    }

    fn unreachable(&self, source: std::io::Error) -> ControlSocketError {
        let socket = self.runtime_dir.socket(&self.pool);
        ControlSocketError::Unreachable { pool: self.pool.clone(), socket, source }
    }

    fn gone(&self) -> ControlSocketError {
        ControlSocketError::Gone { pool: self.pool.clone() }
    }

    /// The cause of an error after the supervisor answered: its end, if it has ended since.
    pub(crate) fn cause_of<E: From<ControlSocketError>>(&self, error: E) -> E {
        if self.is_alive() { error } else { self.gone().into() }
    }

    /// The supervisor closed the connection, because it ended or although it continues. The end of a
    /// process is visible shortly after its files are closed.
    fn hung_up(&self) -> ControlSocketError {
        let begin = Instant::now();
        while begin.elapsed() < EXIT_TIMEOUT {
            let ended = self.process.as_ref().is_some_and(has_ended);
            if ended
                || socket::connect(&self.runtime_dir.socket(&self.pool)).is_err_and(|error| is_absent(&error))
            {
                return self.gone();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        ControlSocketError::Closed { pool: self.pool.clone() }
    }

    /// Does the supervisor still run? Never blocks.
    pub(crate) fn is_alive(&self) -> bool {
        if self.process.as_ref().is_some_and(has_ended) {
            return false;
        }
        socket::is_open(&self.stream)
    }
}

impl Drop for ControlClient {
    /// Ends the connection at once, even if a forked child still holds a copy of the socket.
    fn drop(&mut self) {
        let _ = self.stream.shutdown(std::net::Shutdown::Both);
    }
}
