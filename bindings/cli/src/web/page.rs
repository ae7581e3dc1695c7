//! One open page: its requests, which are queued for the app's thread, and the messages that go back.
//! `protocol` declares both.

use super::protocol::{EventMessage, Outcome, PageEvent, PageRequest, PageResponse, RequestMessage};
use super::protocol::{ResponseMessage, VERSION};
use axum::extract::ws::{Message, WebSocket};
use serde::Serialize;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TrySendError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};
use tokio::sync::mpsc::{Sender, channel};
use tokio::sync::{oneshot, watch};
use tokio::time::timeout;

/// Requests that wait until the app has time; a page that sends more is closed.
const MAX_WAITING: usize = 256;

/// Messages that wait until the browser has time; then the app waits.
const MAX_UNSENT: usize = 4;

/// How long a page that is not served may take to ask for something.
const REFUSAL_WAIT: Duration = Duration::from_secs(3);

/// The page is closed, or the server ends.
#[derive(Debug)]
pub(crate) struct Closed;

/// An open page, as the app's thread sees it.
pub(crate) struct Page {
    requests: Receiver<RequestMessage>,
    messages: Sender<String>,
}

impl Page {
    /// The next request; `None` if there is none until the given time.
    pub(crate) fn receive(&self, until: Option<Instant>) -> Result<Option<RequestMessage>, Closed> {
        let Some(until) = until else {
            return self.requests.recv().map(Some).map_err(|_| Closed);
        };
        match self.requests.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(request) => Ok(Some(request)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(Closed),
        }
    }

    /// Responds to a request.
    pub(crate) fn respond(
        &self,
        id: u64,
        result: Result<PageResponse, impl std::fmt::Display>,
    ) -> Result<(), Closed> {
        self.send(&response(Some(id), result))
    }

    /// Sends an event.
    pub(crate) fn push(&self, event: PageEvent) -> Result<(), Closed> {
        self.send(&EventMessage { event })
    }

    fn send(&self, message: &impl Serialize) -> Result<(), Closed> {
        self.messages.blocking_send(text(message)).map_err(|_| Closed)
    }
}

fn response(id: Option<u64>, result: Result<PageResponse, impl std::fmt::Display>) -> ResponseMessage {
    let outcome = match result {
        Ok(response) => Outcome::Response(Box::new(response)),
        Err(error) => Outcome::Error(error.to_string()),
    };
    ResponseMessage { id, outcome }
}

/// A message as JSON; its types have nothing that JSON cannot say.
fn text(message: &impl Serialize) -> String {
    serde_json::to_string(message).unwrap_or_default()
}

/// Carries messages between a WebSocket and `run`, which runs on another thread, until either or the server
/// ends. If there can be no other thread, the page is closed, and tries again.
pub(super) async fn serve(
    mut socket: WebSocket,
    mut ended: watch::Receiver<()>,
    run: impl FnOnce(Page) + Send + 'static,
) {
    let (request_sender, requests) = sync_channel(MAX_WAITING);
    let (messages, mut unsent) = channel(MAX_UNSENT);
    let (running, ends) = oneshot::channel::<()>();
    let run = move || {
        let _running = running; // dropped at the end, also by a panic, which this thread prints
        run(Page { requests, messages });
    };
    // Not by tokio, which panics without a thread.
    if let Err(error) = thread::Builder::new().name("page".to_owned()).spawn(run) {
        err!("smaclite-pool: cannot start a thread for a page: {error}");
        return;
    }
    let mut version = None;
    loop {
        let message = tokio::select! {
            _ = ended.changed() => break,
            received = socket.recv() => {
                let Some(Ok(message)) = received else { break };
                match understand(message, &mut version) {
                    Understood::Request(request) => match request_sender.try_send(request) {
                        Ok(()) => continue,
                        Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => break,
                    },
                    Understood::Response(response) => text(&response),
                    Understood::Nothing => continue,
                    Understood::Close => break,
                }
            }
            message = unsent.recv() => {
                let Some(message) = message else { break };
                message
            }
        };
        if socket.send(Message::Text(message.into())).await.is_err() {
            break;
        }
    }
    drop((request_sender, unsent)); // ends the run
    let _ = ends.await;
}

/// Responds to the first request of a page that is not served with the reason, which its scripts show.
pub(super) async fn refuse(mut socket: WebSocket, why: String) {
    let refused = async {
        while let Some(Ok(message)) = socket.recv().await {
            if let Message::Text(request) = message {
                let refusal = text(&response(id_of(&request), Err(why)));
                let _sent = socket.send(Message::Text(refusal.into())).await; // unless the page is gone
                let _sent = socket.send(Message::Close(None)).await;
                return;
            }
        }
    };
    let _in_time = timeout(REFUSAL_WAIT, refused).await;
}

/// A message of a page.
enum Understood {
    Request(RequestMessage),
    /// What it gets without the app.
    Response(ResponseMessage),
    Nothing,
    Close,
}

/// Reads a message; `version` is the one of the page, once it has said it.
fn understand(message: Message, version: &mut Option<u32>) -> Understood {
    let refuse = |id, why: String| Understood::Response(response(id, Err(why)));
    let text = match message {
        Message::Text(text) => text,
        Message::Binary(_) => return refuse(None, "expected text, got bytes".to_owned()),
        Message::Ping(_) | Message::Pong(_) => return Understood::Nothing,
        Message::Close(_) => return Understood::Close,
    };
    let message = match serde_json::from_str::<RequestMessage>(&text) {
        Ok(message) => message,
        Err(error) => return refuse(id_of(&text), format!("expected a request: {error}")),
    };
    if let PageRequest::Hello { version: said } = message.request {
        *version = Some(said);
        if said == VERSION {
            return Understood::Response(response(Some(message.id), Ok::<_, String>(PageResponse::Hello {})));
        }
    }
    match version {
        Some(VERSION) => Understood::Request(message),
        Some(other) => refuse(
            Some(message.id),
            format!(
                "this page has version {other} of the messages, the program has {VERSION}: reload the page"
            ),
        ),
        None => refuse(Some(message.id), "the first request must be `hello`".to_owned()),
    }
}

/// The id of a request that is otherwise not understood.
fn id_of(text: &str) -> Option<u64> {
    serde_json::from_str::<serde_json::Value>(text).ok()?.get("id")?.as_u64()
}
