//! The page of a running pool, as a browser's requests see it: who gets it, what it is sent, and that nothing
//! that a page sends harms the program or the pool.

use crate::kit::{PATIENCE, Place, Program, run, spawn};
use crate::page_kit::{Url, VERSION, Watched, watch};
use serde_json::{Value, json};
use smaclite_ipc::{Client, Spectator, WaitOptions, status};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::Message;

#[test]
fn what_cannot_be_watched_is_an_error() {
    let place = &Place::new();
    place.fails("watch", 1, "no pool is running; start one with `smaclite-pool serve`");
    place.fails("status", 1, "no pool is running; start one with `smaclite-pool serve`");
    place.fails("watch train", 1, "no pool named `train` runs here; start one with `smaclite-pool serve");
    let _one = place.serve("3m:2 2s3z:2 --name one");
    place.fails("watch two", 1, "no pool named `two` runs here; running: one");
    place.fails("watch --lane 4m", 1, "there is no lane `4m`; the pool has `3m`, `2s3z`");
    // It asked for a pool `default`, though there was only this one.
    let status = run(place, "status");
    assert!(status.stdout.starts_with(b"pool `one`: process "), "{status:?}");
    let _two = place.serve("3m:2 --name two");
    place.fails("status", 1, "several pools run; name one of them: one, two");
    place.fails("watch", 1, "several pools run; name one of them: one, two");
    let (_watch, url) = watch(place, "two");
    let port = url.host.split_once(':').expect("a port").1;
    place.fails(&format!("watch two --port {port}"), 1, &format!("listen on 127.0.0.1:{port}: Address"));
}

#[test]
fn the_page_is_for_those_who_know_the_token() {
    let Watched { url, .. } = &Watched::new("3m:2");
    assert!(url.host.starts_with("127.0.0.1:"), "{}", url.host);
    let other_address = url.host.replace("127.0.0.1", "127.0.0.2");
    assert!(TcpStream::connect(other_address).is_err(), "it listens on one address");

    let Url { host, token } = &url;
    let other_token = token.chars().rev().collect::<String>();
    let localhost = host.replace("127.0.0.1", "localhost");
    let get = |path: &str, headers: &str| format!("GET {path} HTTP/1.1\r\n{headers}");
    let right = format!("/?token={token}");
    let socket =
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==";
    let upgrade = |origin: &str| format!("Host: {host}\r\n{socket}{origin}");
    let ws = format!("/ws?token={token}");
    for (request, status, expected) in [
        (get(&right, &format!("Host: {host}")), 200, "<!doctype html>"),
        (get(&right, &format!("Host: {localhost}")), 200, "<!doctype html>"),
        (get(&right, "Host: localhost:1"), 200, "<!doctype html>"), // a forwarded port
        (get("/", &format!("Host: {host}")), 403, "the token in the URL is missing or wrong"),
        (get("/?token=", &format!("Host: {host}")), 403, "the token"),
        (get(&format!("/?token={other_token}"), &format!("Host: {host}")), 403, "the token"),
        (get(&format!("/?token={}", &token[1..]), &format!("Host: {host}")), 403, "the token"),
        (get("/other", &format!("Host: {host}")), 403, "the token"),
        (get(&format!("/other?token={token}"), &format!("Host: {host}")), 404, ""),
        (get(&right, "Host: evil.example"), 403, "open the page by an IP address or as localhost"),
        (get(&right, "Host: 127.0.0.1.evil.example:80"), 403, "open the page by an IP address"),
        (format!("POST {right} HTTP/1.1\r\nHost: {host}"), 405, ""),
        (get(&ws, &upgrade("")), 403, "the WebSocket is for this server's own page"),
        (get(&ws, &upgrade("\r\nOrigin: http://evil.example")), 403, "the WebSocket is for"),
        (get(&ws, &upgrade("\r\nOrigin: null")), 403, "the WebSocket is for"),
        (get("/ws", &upgrade(&format!("\r\nOrigin: http://{host}"))), 403, "the token"),
        (get(&ws, &format!("Host: {host}\r\nOrigin: http://{host}")), 400, "expected a WebSocket"),
    ] {
        let (answered, response) = url.send(&request);
        assert!(answered == status && response.contains(expected), "{request}: {response:.300}");
        for header in [
            "content-security-policy: default-src 'none'; script-src 'unsafe-inline'; \
             style-src 'unsafe-inline'; img-src data:; connect-src 'self'; frame-src 'self'\r\n",
            "cache-control: no-store\r\n",
            "x-content-type-options: nosniff\r\n",
            "referrer-policy: no-referrer\r\n",
            "content-security-policy: frame-ancestors 'self' http://localhost:* http://127.0.0.1:*\r\n",
        ] {
            assert!(response.contains(header), "{request}: {header}: {response:.300}");
        }
        assert!(!response.contains(token.as_str()), "{request}: the token is in the response");
    }
}

#[test]
fn a_warning_says_that_other_machines_can_connect() {
    let place = &Place::new();
    let _pool = place.serve("3m:2 --name train");
    let mut child = spawn(place, "watch train --host 0.0.0.0");
    let mut errors = BufReader::new(child.stderr.take().expect("a pipe"));
    let output = BufReader::new(child.stdout.take().expect("a pipe"));
    let mut program = Program { child, output };
    assert!(program.line().starts_with("http://0.0.0.0:"));
    let mut warning = String::new();
    errors.read_line(&mut warning).expect("text");
    assert!(warning.contains("warning: other machines can connect"), "{warning}");
}

#[test]
fn requests_that_make_no_sense_are_refused() {
    let Watched { url, watch, .. } = &mut Watched::new("3m:2");
    let mut page = url.open();
    for (text, expected) in [
        ("", "expected a request"),
        ("{", "expected a request"),
        ("[]", "expected a request"),
        (r#"{"request": {"type": "unfollow"}}"#, "missing field `id`"),
        (r#"{"id": -1, "request": {"type": "unfollow"}}"#, "invalid value"),
    ] {
        page.send(text);
        let error = page.receive();
        assert!(error["error"].as_str().is_some_and(|error| error.contains(expected)), "{text}: {error}");
    }
    page.socket.send(Message::binary(vec![1, 2])).expect("it reads");
    assert_eq!(page.receive()["error"], "expected text, got bytes");
    for (name, request, expected) in [
        ("fly", json!({}), "unknown variant `fly`, expected one of `hello`, `select_lane`"),
        ("select_lane", json!({"name": 3}), "invalid type: integer `3`, expected a string"),
        ("set_view", json!({"first": -1}), "invalid value: integer `-1`, expected usize"),
        ("follow", json!({"env": 0}), "select a lane first"),
        ("get_steps", json!({"number": 0, "step": 0}), "no environment is followed"),
        ("get_observation", json!({"number": 0, "step": 0, "agent": 0}), "no environment is followed"),
        ("open_files", json!({}), "this request is one of another page"),
    ] {
        let error = page.error(name, request);
        assert!(error.contains(expected), "{name}: {error}");
    }
    page.show("4m", 0, 1);
    let status = page.event("status", |_| true);
    assert_eq!((&status["pool"]["lanes"], &status["pool"]["lane"]), (&json!(["3m"]), &Value::Null));

    // As many cells as a number can say, and a message that is longer than any valid one.
    page.show("3m", usize::MAX, usize::MAX);
    page.event("lane", |_| true);
    assert!(page.error("follow", json!({"env": 2})).contains("environment"), "there are two");
    page.socket.send(Message::text("x".repeat(1 << 23))).ok();
    assert!((0..1000).any(|_| page.socket.read().is_err()), "the page is closed");
    url.open().show("3m", 0, 2);
    assert_eq!(watch.interrupt(), Some(0));
}

#[test]
fn many_connections_do_not_exhaust_the_program() {
    let Watched { url, .. } = &Watched::new("3m:2");
    let mut page = url.open();
    let others: Vec<_> = (0..1000).map(|_| TcpStream::connect(&url.host)).collect();
    page.show("3m", 0, 2);
    page.event("lane", |_| true);
    page.event("status", |event| event.get("error").is_none());
    drop(others);
    let begin = Instant::now();
    while !url.answers() {
        assert!(begin.elapsed() < PATIENCE, "the closed connections are free again");
    }
    assert_eq!(url.page().0, 200);
}

/// It was refused before the upgrade, and scripts are not told why: it said that it tried again, without end.
#[test]
fn a_page_too_many_is_told_so() {
    let Watched { url, .. } = &Watched::new("3m:2");
    let pages: Vec<_> = (0..16).map(|_| url.open()).collect();
    let mut refused = url.connect();
    let why = refused.error("hello", json!({"version": VERSION}));
    assert!(why.starts_with("16 pages of this program are open, and it has no more"), "{why}");
    assert!(refused.socket.read().is_ok_and(|message| message.is_close()), "the page tries again");
    drop(pages);
    let begin = Instant::now();
    while url.connect().exchange("hello", json!({"version": VERSION})).get("error").is_some() {
        assert!(begin.elapsed() < PATIENCE, "there is room for another page");
    }
}

/// Connections that send half a request and nothing more, which needs no token, kept every page out.
#[test]
fn half_open_connections_keep_no_page_out() {
    let Watched { url, .. } = &Watched::new("3m:2");
    let mut page = url.open();
    let half_open: Vec<TcpStream> = (0..300)
        .map(|_| {
            let mut stream = TcpStream::connect(&url.host).expect("it listens");
            write!(stream, "GET /?tok").ok();
            stream
        })
        .collect();
    for _ in 0..5 {
        assert_eq!(url.page().0, 200);
    }
    url.open().show("3m", 0, 2);
    page.show("3m", 0, 2); // it showed the token and stays
    page.event("lane", |_| true);
    drop(half_open);
}

/// A page can stay open while the program is replaced by another release.
#[test]
fn a_page_of_another_version_is_told_to_be_reloaded() {
    let Watched { url, .. } = &Watched::new("3m:2");
    let mut page = url.open();
    assert!(page.error("hello", json!({"version": 1_000_000})).ends_with("reload the page"));
    assert!(page.error("unfollow", json!({})).ends_with("reload the page"));
    page.request("hello", json!({"version": VERSION}));
    page.request("unfollow", json!({}));
}

/// An attached learner that plays the first legal action of every agent.
struct Learner {
    client: Client,
    actions: Vec<i32>,
}

impl Learner {
    fn new(place: &Place) -> Learner {
        let mut client = Client::connect(
            &place.runtime_dir(),
            "train",
            Some("3m"),
            Default::default(),
            WaitOptions::no_wait(),
        )
        .expect("a lane");
        client.reset(Some(1), None, WaitOptions::forever()).expect("a batch");
        let actions = vec![0; client.description().settings.num_envs * client.description().sizes.n_agents];
        Learner { client, actions }
    }

    /// Steps; returns the observations after it and the episode length of environment 1.
    fn step(&mut self) -> (Vec<f32>, i32) {
        self.client.sample_actions(None, &mut self.actions).expect("actions");
        let batch = self.client.step(&self.actions, None, WaitOptions::forever()).expect("a batch");
        let length = batch.field::<i32>(smaclite_pool::fields::Field::EpisodeLength).expect("a field")[1];
        let row = batch.obs().len() / batch.env_id().len();
        (batch.obs()[row..2 * row].to_vec(), length)
    }
}

#[test]
fn a_page_sees_what_the_learner_does() {
    let place = &Place::new();
    let _pool = place.serve("3m:4 --name train --seed 0");
    let (mut watch, url) = watch(place, "");
    let mut learner = Learner::new(place);
    let mut page = url.open();
    page.show("3m", 1, 2);
    let lane = page.event("lane", |_| true);
    let sizes = learner.client.description().sizes;
    assert_eq!((&lane["num_envs"], &lane["scenario"]["name"]), (&4.into(), &"3m".into()));
    let features = lane["features"].as_array().expect("blocks");
    let n_features = features.iter().map(|block| {
        block["rows"].as_u64().unwrap_or(1) as usize * block["features"].as_array().map_or(0, Vec::len)
    });
    assert_eq!(n_features.sum::<usize>(), sizes.obs_size);

    assert_eq!(page.request("follow", json!({"env": 1}))["type"], "follow");
    let seen: Vec<_> = (0..200).map(|_| learner.step()).collect();
    let grid = page.event("grid", |event| event["cells"][0]["length"] == seen[199].1);
    assert_eq!((&grid["cells"][0]["env"], &grid["cells"][1]["env"]), (&1.into(), &2.into()), "{grid}");
    assert!(grid["cells"].as_array().is_some_and(|cells| cells.len() == 2));
    let status = page.event("status", |event| event["pool"]["lane"]["stats"]["steps"].as_u64() > Some(700));
    assert_eq!(status["pool"]["lane"]["learner_pid"], std::process::id());

    // The log of environment 1 begins after its reset, so its episodes are those that the learner saw.
    let ends = seen.iter().zip(&seen[1..]).filter(|((_, length), (_, next))| next < length).count();
    let is_complete = |event: &Value| event["episodes"][0]["number"] == ends;
    let episodes = page.event("episodes", is_complete)["episodes"].as_array().expect("a list").clone();
    let mut step = 0;
    for episode in episodes.iter().rev() {
        let (number, steps) = (&episode["number"], episode["steps"].as_u64().expect("a number"));
        let played = page.request("get_steps", json!({"number": number, "step": 0}));
        assert_eq!(
            (played["steps"].as_u64(), played["n_moments"].as_u64()),
            (Some(steps), Some(steps * 8 + 1))
        );
        for k in 1..=steps {
            let (obs, length) = &seen[step];
            assert_eq!(u64::try_from(*length), Ok(k), "of episode {number}");
            for (agent, row) in obs.chunks(sizes.obs_size).enumerate() {
                let observed =
                    page.request("get_observation", json!({"number": number, "step": k, "agent": agent}));
                // JSON has the shortest digits that give the same f32; reading them as f64 may round.
                let values = observed["obs"].as_array().expect("a row").iter();
                let values = values.map(|value| value.as_f64().expect("a number") as f32).collect::<Vec<_>>();
                assert_eq!(values, row, "of agent {agent} after step {k} of episode {number}");
            }
            step += 1;
        }
        step += 1; // the reset at the end of an episode is a step of the learner
    }
    assert!(step >= seen.len(), "all steps were compared, got {step}");

    let refused = page.error("get_steps", json!({"number": ends, "step": 1000}));
    assert!(refused.contains("step 1000 is not in the log"), "{refused}");
    assert_eq!(
        page.error("get_steps", json!({"number": 99, "step": 0})),
        "episode 99 is not in the log any more"
    );
    let refused = page.error("get_observation", json!({"number": ends, "step": 0, "agent": 3}));
    assert_eq!(refused, "agent must be below 3, got 3");
    assert_eq!(watch.interrupt(), Some(0));
    let after = status_of(place);
    assert_eq!((after["spectators"].as_u64(), after["stats"]["rejected"].as_u64()), (Some(0), Some(0)));
}

fn status_of(place: &Place) -> Value {
    let pool = status(&place.runtime_dir(), "train", WaitOptions::for_response()).expect("a status");
    serde_json::to_value(&pool.lanes[0]).expect("JSON")
}

#[test]
fn a_hidden_page_is_sent_nothing_and_holds_nothing() {
    let Watched { url, .. } = &Watched::new("3m:2");
    let mut page = url.open_lane();
    page.request("set_view", json!({"first": 0, "count": 2, "visible": false}));
    page.socket.get_mut().set_read_timeout(Some(Duration::from_millis(1500))).expect("a timeout");
    let silence = page.socket.read();
    assert!(matches!(silence, Err(tungstenite::Error::Io(_))), "{silence:?}");
}

#[test]
fn a_lane_without_room_for_a_spectator_can_still_be_followed() {
    let place = &Place::new();
    let _pool = place.serve("3m:2 --name train");
    let _spectator = Spectator::connect(&place.runtime_dir(), "train", None, WaitOptions::for_response())
        .expect("the only one");
    let mut learner = Learner::new(place);
    let (_watch, url) = watch(place, "train");
    let mut page = url.open();
    page.show("3m", 0, 2);
    let lane = page.event("lane", |_| true);
    assert!(
        lane["no_grid"].as_str().is_some_and(|why| why.contains("already has its 1 spectators")),
        "{lane}"
    );
    page.request("follow", json!({"env": 1}));
    learner.step();
    page.event("episodes", |event| event["episodes"][0]["steps"] == 1);
}

#[test]
fn a_pool_that_runs_again_is_shown_again() {
    let Watched { url, pool, place, .. } = &mut Watched::new("3m:2");
    let mut page = url.open();
    page.show("3m", 0, 2);
    page.event("lane", |_| true);
    let first = page.event("status", |event| event["pool"]["pid"].is_u64());
    page.request("follow", json!({"env": 0}));
    page.event("episodes", |_| true);
    assert_eq!(pool.interrupt(), Some(0));
    page.event("lost", |_| true);
    page.event("status", |event| {
        event["error"].as_str().is_some_and(|error| error.contains("no pool named"))
    });
    let _again = place.serve("3m:2 --name train");
    page.event("lane", |_| true);
    let second = page.event("status", |event| event["pool"]["pid"].is_u64());
    assert_ne!(first["pool"]["pid"], second["pool"]["pid"]);
    page.request("follow", json!({"env": 0}));
    page.event("episodes", |_| true);
}

/// The page said that the pool was gone and waited for it, although it ran.
#[test]
fn a_pool_that_runs_again_with_another_lane_is_not_lost() {
    let Watched { url, pool, place, .. } = &mut Watched::new("3m:2");
    let mut page = url.open_lane();
    assert_eq!(pool.interrupt(), Some(0));
    page.event("lost", |_| true);
    let _again = place.serve("2s3z:2 --name train");
    let is_other = |event: &Value| event["pool"]["lanes"] == json!(["2s3z"]);
    assert_eq!(page.event("status", is_other)["pool"]["lane"], Value::Null);
    // Longer than it takes until the lane is tried again.
    for _ in 0..5 {
        let event = page.receive()["event"].clone();
        assert!(event["type"] == "status" && is_other(&event), "{event}");
    }
    page.request("select_lane", json!({"name": "2s3z"}));
    assert_eq!(page.event("lane", |_| true)["lane"], "2s3z");
}

/// The program once waited for its conversations without ending them, and then left the files of its
/// spectator behind.
#[test]
fn an_interrupt_ends_the_program_while_a_page_is_open() {
    let Watched { url, watch, pool, place } = &mut Watched::new("3m:2");
    let mut page = url.open_lane();
    page.request("follow", json!({"env": 0}));
    page.event("episodes", |_| true);
    assert_eq!(status_of(place)["spectators"], 1);
    assert_eq!((pool.interrupt(), watch.interrupt()), (Some(0), Some(0)));
    assert_eq!(place.names_in("pools"), [""; 0]);
}
