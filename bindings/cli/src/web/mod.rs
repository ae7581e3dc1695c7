//! The web server of the commands that show something in a browser: one document, and a WebSocket over which
//! its scripts send requests (`protocol`). It listens on loopback unless another address is given, and
//! answers only those that know the token in the printed URL. What is served is an [`App`].

mod connections;
pub(crate) mod editor;
mod guard;
pub(crate) mod live;
mod page;
mod pages;
pub(crate) mod playground;
mod protocol;
mod simulation;

pub(crate) use page::{Closed, Page};

use crate::CommandResult;
use crate::number::whole;
use crate::process::{LOOK_INTERVAL, interrupt_flag};
use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{FromRequestParts, State};
use axum::http::StatusCode;
use axum::http::request::Parts;
use axum::middleware;
use axum::response::{Html, Response};
use axum::routing::get;
use clap::Args;
use connections::{Connections, Visitor};
use editor::{Editor, Start};
use guard::Guard;
use pages::{EDITOR_PATH, PLAYGROUND_PATH};
use playground::Playground;
use std::io::{Error, ErrorKind, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::TempPath;
use tokio::runtime;
use tokio::sync::{Semaphore, watch};
use tokio::time::timeout;

/// Pages that can be open at the same time.
const MAX_PAGES: usize = 16;

/// Bytes of the longest message that is read from another one.
const MAX_REFUSED: usize = 1 << 12;

/// How long to wait for open pages at the end: one may wait for a response of a pool that is stopped.
const MOST_WAIT: Duration = Duration::from_secs(3);

/// Options of the commands that serve a page.
#[derive(Args)]
pub(crate) struct ServeOptions {
    /// Address to listen on; another one than a loopback address lets other machines connect
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    host: IpAddr,
    /// Port to listen on; 0 means any free one
    #[arg(long, default_value_t = 0, value_parser = whole(0..=u16::MAX))]
    port: u16,
    /// Open the page in the default browser
    #[arg(long)]
    open: bool,
}

/// Bytes of the longest message of pages that open files: a scenario with its unit files, replays, teams.
pub(crate) const LARGEST_FILES: usize = 1 << 26;

/// What is served.
pub(crate) trait App: Send + Sync + 'static {
    /// The HTML document, which loads nothing but the WebSocket.
    fn document(&self) -> String;

    /// Bytes of the longest message of a page.
    fn max_message(&self) -> usize {
        1 << 22
    }

    /// Serves one open page until it is closed. It runs on a separate thread and may block.
    fn run(&self, page: Page);
}

/// Prints the URL and serves an app, and beside it the editor and the playground, to which pages lead, until
/// SIGINT or SIGTERM. Returns after every [`App::run`] has, unless one takes too long.
pub(crate) fn serve(options: &ServeOptions, app: impl App) -> CommandResult {
    let apps: [(&'static str, Box<dyn App>); 3] = [
        ("/", Box::new(app)),
        (EDITOR_PATH, Box::new(Editor::new(Start::New))),
        (PLAYGROUND_PATH, Box::new(Playground::beside_editor()?)),
    ];
    let address = SocketAddr::new(options.host, options.port);
    let listener =
        TcpListener::bind(address).map_err(|error| format!("cannot listen on {address}: {error}"))?;
    listener.set_nonblocking(true)?;
    let token = token()?;
    let url = format!("http://{}/?token={token}", listener.local_addr()?);
    let runtime = runtime::Builder::new_current_thread()
        .enable_io()
        .enable_time() // axum waits with it after errors of accept
        .build()?;
    let pages = Arc::new(Semaphore::new(MAX_PAGES));
    let (end, ended) = watch::channel(());
    let guard = Arc::new(Guard::new(token));
    let mut routes = Router::new();
    for (path, app) in apps {
        let served = Arc::new(Served { app, pages: Arc::clone(&pages), ended: ended.clone() });
        let router = Router::new().route(path, get(document)).route(&format!("{path}ws"), get(web_socket));
        routes = routes.merge(router.with_state(served));
    }
    let routes = routes
        .layer(middleware::from_fn(move |request, next| guard::check(Arc::clone(&guard), request, next)));
    runtime.block_on(async {
        let served = serve_until_signal(listener, routes, &url, options).await;
        drop(end);
        // The end of the program ends the thread of a page that takes too long.
        let _all_ended = timeout(MOST_WAIT, pages.acquire_many(MAX_PAGES as u32)).await;
        served
    })
}

async fn serve_until_signal(
    listener: TcpListener,
    routes: Router,
    url: &str,
    options: &ServeOptions,
) -> CommandResult {
    let stop = interrupt_flag()?;
    let listener = Connections::new(tokio::net::TcpListener::from_std(listener)?);
    out!("{url}")?;
    if !options.host.is_loopback() {
        err!("smaclite-pool: warning: other machines can connect, over HTTP, which is not encrypted");
    }
    let service = routes.into_make_service_with_connect_info::<Visitor>();
    let _opened = options.open.then(|| open_in_browser(url));
    tokio::select! {
        served = axum::serve(listener, service) => Ok(served?),
        () = is_set(&stop) => Ok(()),
    }
}

/// Ends when the flag is set.
async fn is_set(flag: &AtomicBool) {
    while !flag.load(Ordering::Relaxed) {
        tokio::time::sleep(LOOK_INTERVAL).await;
    }
}

struct Served {
    app: Box<dyn App>,
    /// One permit per page that can be opened.
    pages: Arc<Semaphore>,
    /// Changes when the server ends.
    ended: watch::Receiver<()>,
}

async fn document(State(served): State<Arc<Served>>) -> Html<String> {
    Html(served.app.document())
}

async fn web_socket(State(served): State<Arc<Served>>, upgrade: Upgrade) -> Response {
    let Ok(permit) = Arc::clone(&served.pages).try_acquire_owned() else {
        // Not instead of the upgrade: scripts are not told why there is none. The page tries again.
        let why = format!(
            "{MAX_PAGES} pages of this program are open, and it has no more: close one, and this one goes on"
        );
        let upgrade = upgrade.0.max_message_size(MAX_REFUSED).max_frame_size(MAX_REFUSED);
        return upgrade.on_upgrade(|socket| page::refuse(socket, why));
    };
    let max_message = served.app.max_message();
    let upgrade = upgrade.0.max_message_size(max_message).max_frame_size(max_message);
    upgrade.on_upgrade(async move |socket| {
        let ended = served.ended.clone();
        page::serve(socket, ended, move |page| served.app.run(page)).await;
        drop(permit);
    })
}

/// The upgrade of a connection to a WebSocket; without one, an error in the words of this program.
struct Upgrade(WebSocketUpgrade);

impl<S: Send + Sync> FromRequestParts<S> for Upgrade {
    type Rejection = (StatusCode, &'static str);

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Self::Rejection> {
        let upgrade = WebSocketUpgrade::from_request_parts(parts, state).await;
        upgrade.map(Upgrade).map_err(|_| (StatusCode::BAD_REQUEST, "expected a WebSocket\n"))
    }
}

/// The variable with the token of the URL. With a token of its own, a program that is started again serves
/// the pages that are still open.
const TOKEN_VARIABLE: &str = "SMACLITE_POOL_TOKEN";

/// The token that is given, or a random one.
fn token() -> Result<String, Box<dyn std::error::Error>> {
    let Some(token) = std::env::var_os(TOKEN_VARIABLE) else {
        return Ok(random_token()?);
    };
    let is_plain =
        |token: &String| token.len() >= 32 && token.bytes().all(|byte| byte.is_ascii_alphanumeric());
    let token = token.into_string().ok().filter(is_plain);
    token.ok_or_else(|| format!("{TOKEN_VARIABLE} must be 32 or more letters and digits").into())
}

/// 128 random bits of the operating system, as hexadecimal digits.
fn random_token() -> std::io::Result<String> {
    let mut bytes = [0u8; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Returns the file that leads the browser to the page, which is removed when it is dropped.
fn open_in_browser(url: &str) -> Option<TempPath> {
    let opened = write_redirect(url).and_then(|redirect| {
        // Programs that open the default browser, such as xdg-open; the first one that starts.
        let start = |mut command: Command| {
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn()
        };
        let mut started = open::commands(&redirect).into_iter().map(start);
        let missing = || Err(Error::new(ErrorKind::NotFound, "no program that opens a browser is installed"));
        let mut browser = started.find(Result::is_ok).unwrap_or_else(missing)?;
        let wait = move || browser.wait(); // so that it does not stay as a zombie
        let _waiting = std::thread::Builder::new().spawn(wait);
        Ok(redirect)
    });
    opened.inspect_err(|error| err!("smaclite-pool: --open: {error}; open the URL")).ok()
}

/// Other users can read the arguments of a process, but not this file, so the token is in the file.
fn write_redirect(url: &str) -> std::io::Result<TempPath> {
    let mut file = tempfile::Builder::new().prefix("smaclite-pool-").suffix(".html").tempfile()?;
    let page = "<!doctype html><title>smaclite-pool</title><meta http-equiv=\"refresh\" content=\"0;url=";
    write!(file, "{page}{url}\">")?;
    Ok(file.into_temp_path())
}
