//! Pools, the program that serves their page, and requests as a browser sends them.

use crate::kit::program;
use serde_json::{Value, json};
use smaclite_ipc::RuntimeDir;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// Longer than anything takes on a busy machine.
pub const PATIENCE: Duration = Duration::from_secs(30);

/// The version of the messages, as the scripts of the pages say it.
pub const VERSION: u32 = 7;

/// A runtime directory, and the programs that run in it. Dropping it removes what killed pools left behind.
pub struct Place {
    folder: TempDir,
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = self.command("clean").output();
    }
}

/// A program that is interrupted when dropped, and killed if it does not end.
pub struct Program {
    pub child: Child,
    pub output: BufReader<std::process::ChildStdout>,
}

impl Place {
    pub fn new() -> Place {
        Place { folder: tempfile::Builder::new().prefix("sp").tempdir_in("/tmp").expect("a folder") }
    }

    pub fn root(&self) -> &Path {
        self.folder.path()
    }

    pub fn runtime_dir(&self) -> RuntimeDir {
        RuntimeDir::at(self.root().to_owned()).expect("a private folder")
    }

    pub fn command(&self, arguments: &str) -> Command {
        let mut command = program(self.root(), arguments);
        command.env(smaclite_ipc::ROOT_VARIABLE, self.root());
        command
    }

    pub fn output(&self, arguments: &str) -> Output {
        self.command(arguments).output().expect("the program starts")
    }

    pub fn start(&self, arguments: &str) -> Program {
        let mut child = self.command(arguments).stdout(Stdio::piped()).spawn().expect("the program starts");
        let output = BufReader::new(child.stdout.take().expect("a pipe"));
        Program { child, output }
    }

    pub fn serve(&self, arguments: &str) -> Program {
        let mut pool = self.start(&format!("serve {arguments}"));
        while !pool.line().starts_with("connect with") {}
        pool
    }

    pub fn watch(&self, arguments: &str) -> (Program, Url) {
        let mut program = self.start(format!("watch {arguments}").trim_end());
        let url = Url::new(program.line().trim_end());
        (program, url)
    }
}

impl Program {
    pub fn line(&mut self) -> String {
        let mut line = String::new();
        assert!(self.output.read_line(&mut line).expect("text") > 0, "the program ended");
        line
    }

    /// Ends it as Ctrl-C does; returns its exit status.
    pub fn interrupt(&mut self) -> Option<i32> {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, rustix::process::Signal::INT).expect("it runs");
        self.child.wait().expect("it ends").code()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let begin = Instant::now();
        if matches!(self.child.try_wait(), Ok(None)) {
            let pid = rustix::process::Pid::from_child(&self.child);
            let _ = rustix::process::kill_process(pid, rustix::process::Signal::INT);
        }
        while matches!(self.child.try_wait(), Ok(None)) && begin.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
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
