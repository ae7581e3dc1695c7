//! `smaclite-pool play`: what cannot be played, and a step over the WebSocket.

use crate::kit::{PATIENCE, Place, Program, spawn};
use crate::page_kit::Url;
use serde_json::{Value, json};
use std::fs::{self, Permissions};
use std::io::{BufReader, Read};
use std::os::unix::fs::PermissionsExt;
use std::time::{Duration, Instant};

#[test]
fn what_cannot_be_played_is_an_error() {
    let folder = &Place::new();
    let check = |arguments: &str, status, expected| folder.fails(arguments, status, expected);
    check("play nowhere", 1, "nowhere");
    check("play 3m --against nobody", 2, "unknown opponent `nobody`; the opponents are attack_move");
    check("play 3m --against nobody", 2, "and there is no folder of that name");
    check("play 3m --against learner", 2, "learner");
    check("play 3m --against hold=0", 2, "the weight of opponent `hold` must be a number above 0");
    check("play 3m --against runs/3m", 1, "runs/3m");
    check("play 5m_vs_6m --against zoo:3m", 1, "only of scenarios whose two sides have equal sizes");
}

#[test]
fn a_step_is_played_by_the_orders_of_the_page() {
    let place = &Place::new();
    let mut play = place.start("play 3m --against random=0.5,hold=0.5 --seed 4");
    let url = Url::new(play.line().trim_end());
    let (_, document) = url.page();
    let data = document.split_once(r#"id="data">"#).expect("the data of the page").1;
    let data: Value = serde_json::from_str(data.split_once("</script>").expect("an end").0).expect("JSON");
    let first = &data["first"];
    assert_eq!(
        (&first["seed"], &first["taken"], &data["has_fog"]),
        (&json!("4"), &json!([0, 1, 2]), &json!(true))
    );
    let mut page = url.open();
    let mut session =
        |request: Value| page.request("session", json!({ "request": request }))["outcome"].clone();
    assert_eq!(session(json!({"type": "play_steps", "steps": 1}))["error"], "begin a battle first");
    let of =
        json!({"kind": "scenario", "scenario": first["scenario"], "seed": "4", "opponent": "", "rules": ""});
    let begin =
        json!({"type": "begin_battle", "of": of, "team": "nearest", "actions": [], "taken": [0, 1, 2]});
    assert_eq!(session(begin)["response"]["opponent"], "random=0.5,hold=0.5");
    let to = json!({"type": "move", "x": 12.5, "y": 20.0});
    let given = session(json!({"type": "give_orders", "orders": [{"agent": 1, "order": to}]}));
    assert_eq!(given["response"]["orders"][1], to);
    let played = &session(json!({"type": "play_steps", "steps": 1}))["response"];
    assert_eq!((&played["step"], &played["steps"], &played["orders"][1]), (&json!(0), &json!(1), &to));
    assert_eq!(session(json!({"type": "get_replay"}))["response"]["name"], "3m-seed4.smreplay");
    assert_eq!(page.error("unfollow", json!({})), "this request is one of another page");
    assert_eq!(play.interrupt(), Some(0));
}

/// Other users can read the arguments of a browser: the token of the page must not be among them.
#[test]
fn a_browser_gets_a_file_that_leads_to_the_page() {
    let place = &Place::new();
    let (browser, opened) = (place.join("xdg-open"), place.join("opened"));
    fs::write(&browser, "#!/bin/sh\n/bin/cp \"$1\" part && /bin/mv part opened\n").expect("a script");
    fs::set_permissions(&browser, Permissions::from_mode(0o755)).expect("permissions");
    let mut play = place.start("play 3m --open");
    let url = play.line();
    let begin = Instant::now();
    while !opened.exists() && begin.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(5));
    }
    let file = fs::read_to_string(opened).expect("the browser was started");
    assert!(file.contains(&format!("content=\"0;url={}\"", url.trim_end())), "{file}");
}

#[test]
fn without_a_browser_the_url_can_be_opened() {
    let place = &Place::new();
    let mut child = spawn(place, "play 3m --open");
    let mut messages = child.stderr.take().expect("a pipe");
    let mut play = Program { output: BufReader::new(child.stdout.take().expect("a pipe")), child };
    let (status, _) = Url::new(play.line().trim_end()).page();
    assert_eq!(status, 200);
    play.interrupt();
    let mut text = String::new();
    messages.read_to_string(&mut text).expect("text");
    assert!(text.contains("--open: no program that opens a browser is installed; open the URL"), "{text}");
}
