//! The conversation with one open page: requests `{"id": n, "do": "...", ...}` and their answers
//! `{"id": n, ...}`, and events `{"event": "...", ...}` that are sent unasked. All are JSON in text messages.

use axum::extract::ws::{Message, WebSocket};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TrySendError, sync_channel};
use std::time::Instant;
use tokio::sync::mpsc::{Sender, channel};
use tokio::sync::watch;

/// Requests that wait until the app has time; a page that sends more is closed.
const MAX_WAITING: usize = 256;

/// Messages that wait until the browser has time; then the app waits.
const MAX_UNSENT: usize = 4;

/// A request of a page.
#[derive(Debug, Deserialize)]
pub(crate) struct Request {
    id: u64,
    /// What to do.
    #[serde(rename = "do")]
    pub(crate) action: String,
    /// Everything else in the message.
    #[serde(flatten)]
    pub(crate) arguments: Map<String, Value>,
}

impl Request {
    /// A text among the arguments.
    pub(crate) fn text(&self, key: &str) -> Result<&str, String> {
        let value = self.arguments.get(key).and_then(Value::as_str);
        value.ok_or_else(|| format!("`{key}` must be a text"))
    }

    /// A number among the arguments.
    pub(crate) fn number(&self, key: &str) -> Result<usize, String> {
        let value = self.arguments.get(key).and_then(Value::as_u64);
        let value = value.and_then(|value| usize::try_from(value).ok());
        value.ok_or_else(|| format!("`{key}` must be a whole number, 0 or more"))
    }
}

/// The page is closed, or the server ends.
#[derive(Debug)]
pub(crate) struct Closed;

/// An open page, as the app's thread sees it.
pub(crate) struct Page {
    requests: Receiver<Request>,
    messages: Sender<String>,
}

impl Page {
    /// The next request; `None` if there is none until the given time.
    pub(crate) fn receive(&self, until: Option<Instant>) -> Result<Option<Request>, Closed> {
        let Some(until) = until else {
            return self.requests.recv().map(Some).map_err(|_| Closed);
        };
        match self.requests.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(request) => Ok(Some(request)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(Closed),
        }
    }

    /// Answers a request with the keys of an object.
    pub(crate) fn answer(&self, request: &Request, mut answer: Value) -> Result<(), Closed> {
        answer["id"] = request.id.into();
        self.send(answer)
    }

    /// Answers that a request failed.
    pub(crate) fn refuse(&self, request: &Request, why: impl ToString) -> Result<(), Closed> {
        self.answer(request, json!({"error": why.to_string()}))
    }

    /// Sends an event with the keys of an object.
    pub(crate) fn push(&self, event: &str, mut contents: Value) -> Result<(), Closed> {
        contents["event"] = event.into();
        self.send(contents)
    }

    fn send(&self, message: Value) -> Result<(), Closed> {
        self.messages.blocking_send(message.to_string()).map_err(|_| Closed)
    }
}

/// Carries messages between a WebSocket and `talk`, which runs on another thread, until either or the server
/// ends.
pub(super) async fn converse(
    mut socket: WebSocket,
    mut ended: watch::Receiver<()>,
    talk: impl FnOnce(Page) + Send + 'static,
) {
    let (request_sender, requests) = sync_channel(MAX_WAITING);
    let (messages, mut unsent) = channel(MAX_UNSENT);
    let talking = tokio::task::spawn_blocking(move || talk(Page { requests, messages }));
    loop {
        tokio::select! {
            _ = ended.changed() => break,
            received = socket.recv() => {
                let Some(Ok(message)) = received else { break };
                let refusal = match message {
                    Message::Text(text) => match serde_json::from_str::<Request>(&text) {
                        Ok(request) => match request_sender.try_send(request) {
                            Ok(()) => continue,
                            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => break,
                        },
                        Err(error) => format!("expected a request, {{\"id\": 1, \"do\": \"...\"}}: {error}"),
                    },
                    Message::Binary(_) => "expected text, got bytes".to_owned(),
                    Message::Ping(_) | Message::Pong(_) => continue,
                    Message::Close(_) => break,
                };
                if send(&mut socket, json!({"error": refusal}).to_string()).await.is_err() {
                    break;
                }
            }
            message = unsent.recv() => {
                let Some(message) = message else { break };
                if send(&mut socket, message).await.is_err() {
                    break;
                }
            }
        }
    }
    drop((request_sender, unsent)); // ends the talk
    let _ = talking.await; // a panic is printed by its thread, and this page is closed
}

async fn send(socket: &mut WebSocket, message: String) -> Result<(), axum::Error> {
    socket.send(Message::Text(message.into())).await
}
