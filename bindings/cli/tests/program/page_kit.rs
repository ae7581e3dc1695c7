//! The page of a pool, and requests as a browser sends them.

use crate::kit::{PATIENCE, Place, Program};
use serde_json::{Value, json};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Instant;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// The version of the messages, as the scripts of the pages say it.
pub const VERSION: u32 = 8;

/// A pool `train` whose page is served.
pub struct Watched {
    pub url: Url,
    pub watch: Program,
    pub pool: Program,
    pub place: Place,
}

impl Watched {
    pub fn new(lane: &str) -> Watched {
        let place = Place::new();
        let pool = place.serve(&format!("{lane} --name train"));
        let (watch, url) = watch(&place, "train");
        Watched { url, watch, pool, place }
    }
}

pub fn watch(place: &Place, arguments: &str) -> (Program, Url) {
    let mut program = place.start(format!("watch {arguments}").trim_end());
    let url = Url::new(program.line().trim_end());
    (program, url)
}

/// The printed URL in parts.
pub struct Url {
    /// Address and port.
    pub host: String,
    pub token: String,
}

impl Url {
    pub fn new(text: &str) -> Url {
        let rest = text.strip_prefix("http://").expect("a URL");
        let (host, token) = rest.split_once("/?token=").expect("a token");
        assert!(token.len() == 32 && token.bytes().all(|byte| byte.is_ascii_hexdigit()), "{token}");
        Url { host: host.to_owned(), token: token.to_owned() }
    }

    /// The response to a request: its status, and all of it.
    pub fn send(&self, request: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.host).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        write!(stream, "{request}\r\nConnection: close\r\n\r\n").expect("it reads");
        let mut response = String::new();
        stream.read_to_string(&mut response).expect("it answers");
        let status = response.split(' ').nth(1).and_then(|status| status.parse().ok());
        (status.unwrap_or_else(|| panic!("{request}: {response}")), response)
    }

    pub fn get(&self, path: &str) -> (u16, String) {
        self.send(&format!("GET {path} HTTP/1.1\r\nHost: {}", self.host))
    }

    /// Whether a connection is served and not closed at once.
    pub fn answers(&self) -> bool {
        let mut stream = TcpStream::connect(&self.host).expect("it listens");
        let asked = write!(stream, "GET / HTTP/1.1\r\n\r\n");
        asked.and_then(|()| stream.read(&mut [0])).is_ok_and(|read| read > 0)
    }

    pub fn page(&self) -> (u16, String) {
        self.get(&format!("/?token={}", self.token))
    }

    pub fn open(&self) -> OpenPage {
        let mut page = self.connect();
        page.request("hello", json!({"version": VERSION}));
        page
    }

    /// A page that shows the two environments of the lane `3m`.
    pub fn open_lane(&self) -> OpenPage {
        let mut page = self.open();
        page.show("3m", 0, 2);
        page.event("lane", |_| true);
        page
    }

    /// A page that has not said its version yet.
    pub fn connect(&self) -> OpenPage {
        let mut request =
            format!("ws://{}/ws?token={}", self.host, self.token).into_client_request().unwrap();
        let origin = format!("http://{}", self.host).parse().expect("a header");
        request.headers_mut().insert("Origin", origin);
        let stream = TcpStream::connect(&self.host).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
        let (socket, _) = tungstenite::client(request, stream).expect("a WebSocket");
        OpenPage { socket, next: 1, events: Vec::new() }
    }
}

/// What the scripts of a page do.
pub struct OpenPage {
    pub socket: WebSocket<TcpStream>,
    next: u64,
    /// Events that came while a response was awaited.
    events: Vec<Value>,
}

impl OpenPage {
    pub fn send(&mut self, text: &str) {
        self.socket.send(Message::text(text)).expect("it reads");
    }

    pub fn receive(&mut self) -> Value {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => return serde_json::from_str(&text).expect("JSON"),
                // This process was suspended for a while.
                Err(tungstenite::Error::Io(error)) if error.kind() == ErrorKind::Interrupted => {}
                read => _ = read.expect("it is open"),
            }
        }
    }

    /// Sends a request; returns the message that responds to it.
    pub fn exchange(&mut self, name: &str, mut request: Value) -> Value {
        request["type"] = name.into();
        self.send(&json!({"id": self.next, "request": request}).to_string());
        loop {
            let message = self.receive();
            if message.get("event").is_none() {
                assert_eq!(message["id"], self.next, "{message}");
                self.next += 1;
                return message;
            }
            self.events.push(message["event"].clone());
        }
    }

    pub fn request(&mut self, name: &str, request: Value) -> Value {
        let message = self.exchange(name, request);
        assert_eq!(message["response"]["type"], name, "{message}");
        message["response"].clone()
    }

    pub fn error(&mut self, name: &str, request: Value) -> String {
        let message = self.exchange(name, request);
        message["error"].as_str().unwrap_or_else(|| panic!("{name}: {message}")).to_owned()
    }

    /// The next event of a name that fulfils a condition.
    pub fn event(&mut self, name: &str, fits: impl Fn(&Value) -> bool) -> Value {
        let fits = |event: &Value| event["type"] == name && fits(event);
        if let Some(at) = self.events.iter().position(fits) {
            return self.events.drain(..=at).next_back().expect("an event");
        }
        self.events.clear();
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            let event = self.receive()["event"].clone();
            if fits(&event) {
                return event;
            }
        }
        panic!("no event {name}")
    }

    pub fn show(&mut self, lane: &str, first: usize, count: usize) {
        self.request("select_lane", json!({"name": lane}));
        self.request("set_view", json!({"first": first, "count": count, "visible": true}));
    }
}
