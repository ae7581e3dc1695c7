//! A listener with a bound on the number of open connections, so that a program that opens many does not use
//! up the file descriptors of this one, and does not keep others out: a connection that does not show the
//! token in time is closed, and the oldest of those at once where a new one needs its place.

use crate::os;
use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use std::collections::VecDeque;
use std::io;
use std::net::{Shutdown, SocketAddr};
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};

/// Connections that can be open at the same time.
const MAX_CONNECTIONS: usize = 128;

/// How long a connection may be open before it has shown the token.
const GRACE: Duration = Duration::from_secs(10);

/// How long a new connection waits for the place of one that is closed.
const MOST_WAIT: Duration = Duration::from_secs(1);

/// The other end of a connection. Requests have it as connection info.
#[derive(Clone)]
pub(super) struct Visitor(Arc<Visit>);

struct Visit {
    /// Another descriptor of the connection, by which it is closed.
    stream: std::net::TcpStream,
    has_shown_token: AtomicBool,
}

impl Visitor {
    fn new(stream: &TcpStream) -> io::Result<Visitor> {
        Ok(Visitor(Arc::new(Visit {
            stream: os::clone_of(stream)?,
            has_shown_token: AtomicBool::new(false),
        })))
    }

    /// From now on the connection stays open.
    pub(super) fn shows_token(&self) {
        self.0.has_shown_token.store(true, Ordering::Relaxed);
    }
}

impl Visit {
    /// Closes the connection, unless it has shown the token; the server then finds it at its end.
    fn expel(&self) -> bool {
        let expels = !self.has_shown_token.load(Ordering::Relaxed);
        expels && self.stream.shutdown(Shutdown::Both).is_ok()
    }
}

impl Connected<IncomingStream<'_, Connections>> for Visitor {
    fn connect_info(stream: IncomingStream<'_, Connections>) -> Visitor {
        stream.io().visitor.clone()
    }
}

pub(super) struct Connections {
    listener: TcpListener,
    free: Arc<Semaphore>,
    /// The oldest first.
    visits: VecDeque<Weak<Visit>>,
}

impl Connections {
    pub(super) fn new(listener: TcpListener) -> Connections {
        let free = Arc::new(Semaphore::new(MAX_CONNECTIONS));
        Connections { listener, free, visits: VecDeque::new() }
    }

    /// A place for a new connection, if need be that of the oldest one that has not shown the token.
    async fn place(&mut self) -> Option<OwnedSemaphorePermit> {
        self.visits.retain(|visit| visit.strong_count() > 0);
        if let Ok(permit) = Arc::clone(&self.free).try_acquire_owned() {
            return Some(permit);
        }
        let expelled =
            self.visits.iter().position(|visit| visit.upgrade().is_some_and(|visit| visit.expel()))?;
        self.visits.remove(expelled);
        timeout(MOST_WAIT, Arc::clone(&self.free).acquire_owned()).await.ok()?.ok()
    }
}

impl Listener for Connections {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        loop {
            let (stream, address) = Listener::accept(&mut self.listener).await;
            let _ = stream.set_nodelay(true); // a delay is no error
            let Some(permit) = self.place().await else { continue };
            let Ok(visitor) = Visitor::new(&stream) else { continue };
            let visit = Arc::downgrade(&visitor.0);
            self.visits.push_back(Weak::clone(&visit));
            tokio::spawn(async move {
                sleep(GRACE).await;
                if let Some(visit) = visit.upgrade() {
                    visit.expel();
                }
            });
            return (Connection { stream, visitor, _permit: permit }, address);
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A connection; reads and writes are those of its stream.
pub(super) struct Connection {
    stream: TcpStream,
    visitor: Visitor,
    _permit: OwnedSemaphorePermit,
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        into: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, into)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
