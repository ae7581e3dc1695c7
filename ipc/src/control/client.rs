//! The asking end of the control socket.

use super::protocol::{Answer, Ask, MAX_LINE};
use crate::place::Place;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{PidfdFlags, pidfd_open};
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// A supervisor answers at once or is stopped.
const ANSWER_TIME: Duration = Duration::from_secs(10);

/// A connection to a supervisor. While it is open the supervisor knows that its owner lives, and the other way round.
pub(crate) struct ControlClient {
    stream: BufReader<UnixStream>,
    /// Readable when the supervisor's process ends, even if a forked child of it keeps the socket open.
    process: Option<OwnedFd>,
    pool: String,
}

/// Why a supervisor could not be asked.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)] // the messages say it
pub enum ControlError {
    #[error("no pool named `{pool}` runs here{}", hint(running))]
    NoSuchPool { pool: String, running: Vec<String> },
    #[error("pool `{pool}` did not answer: {source}")]
    NoAnswer { pool: String, source: std::io::Error },
}

fn hint(pools: &[String]) -> String {
    if pools.is_empty() {
        "; start one with `smaclite-pool serve SCENARIO:N --name NAME`".to_owned()
    } else {
        format!("; running: {}", pools.join(", "))
    }
}

impl ControlClient {
    pub(crate) fn connect(place: &Place, pool: &str) -> Result<Self, ControlError> {
        match UnixStream::connect(place.socket(pool)) {
            Ok(stream) => {
                let peer = rustix::net::sockopt::socket_peercred(&stream).ok();
                let process = peer.and_then(|p| pidfd_open(p.pid, PidfdFlags::empty()).ok());
                Ok(ControlClient { stream: BufReader::new(stream), process, pool: pool.to_owned() })
            }
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::ConnectionRefused) => {
                let alive = |name: &String| UnixStream::connect(place.socket(name)).is_ok();
                let running = place.pool_names().into_iter().filter(alive).collect();
                Err(ControlError::NoSuchPool { pool: pool.to_owned(), running })
            }
            Err(source) => Err(ControlError::NoAnswer { pool: pool.to_owned(), source }),
        }
    }

    pub(crate) fn ask(&mut self, question: &Ask) -> Result<Answer, ControlError> {
        let pool = self.pool.clone();
        self.exchange(question).map_err(|source| ControlError::NoAnswer { pool, source })
    }

    fn exchange(&mut self, question: &Ask) -> std::io::Result<Answer> {
        let stream = self.stream.get_mut();
        stream.set_read_timeout(Some(ANSWER_TIME))?;
        let mut line = serde_json::to_vec(question)?;
        line.push(b'\n');
        stream.write_all(&line)?;
        let mut answer = Vec::new();
        (&mut self.stream).take(MAX_LINE as u64).read_until(b'\n', &mut answer)?;
        if answer.last() != Some(&b'\n') {
            return Err(ErrorKind::UnexpectedEof.into());
        }
        Ok(serde_json::from_slice(&answer)?)
    }

    /// Is the supervisor still there? Never blocks.
    pub(crate) fn is_alive(&self) -> bool {
        if self.process.as_ref().is_some_and(has_ended) {
            return false;
        }
        let mut byte = [0u8; 1];
        let flags = rustix::net::RecvFlags::PEEK | rustix::net::RecvFlags::DONTWAIT;
        match rustix::net::recv(self.stream.get_ref(), &mut byte[..], flags) {
            Ok((received, _)) => received > 0,
            Err(e) => matches!(e, rustix::io::Errno::AGAIN | rustix::io::Errno::INTR),
        }
    }
}

/// Is this process over? Never blocks.
pub(crate) fn has_ended(process: &OwnedFd) -> bool {
    let mut fds = [PollFd::new(process, PollFlags::IN)];
    poll(&mut fds, Some(&Timespec { tv_sec: 0, tv_nsec: 0 })).is_ok_and(|ready| ready > 0)
}

impl Drop for ControlClient {
    /// Says good-bye at once, even if a forked child still holds a copy of the socket.
    fn drop(&mut self) {
        let _ = self.stream.get_ref().shutdown(std::net::Shutdown::Both);
    }
}
