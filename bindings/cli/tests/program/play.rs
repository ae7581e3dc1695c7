//! `smaclite-pool play`: what cannot be played, and a step over the WebSocket.

use crate::kit::check_error;
use crate::page_kit::{Place, Url};
use serde_json::json;

#[test]
fn what_cannot_be_played_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let check = |arguments: &str, status, expected| check_error(folder.path(), arguments, status, expected);
    check("play nowhere", 1, "nowhere");
    check("play 3m --against nobody", 2, "unknown opponent `nobody`; the opponents are attack_move");
    check("play 3m --against nobody", 2, "and there is no folder of that name");
    check("play 3m --against learner", 2, "learner");
    check("play 3m --against hold=0", 2, "the weight of opponent `hold` must be a number above 0");
    check("play 3m --against runs/3m", 1, "runs/3m");
    check("play 3m --seed -1", 2, "must be a whole number between 0 and");
}

#[test]
fn a_step_is_played_by_the_orders_of_the_page() {
    let place = Place::new();
    let mut play = place.start("play 3m --against hold --seed 4");
    let url = Url::new(play.line().trim_end());
    assert!(url.page().1.contains("\"against\":\"hold\""));
    let mut page = url.open();
    assert_eq!(page.error("play_step", json!({})), "begin a battle first");
    let start = page.request("begin_battle", json!({"seed": "4", "actions": []}));
    assert_eq!(start["orders"], json!([{"type": "none"}, {"type": "none"}, {"type": "none"}]));
    let to = json!({"type": "move", "x": 12.5, "y": 20.0});
    let given = page.request("give_orders", json!({"orders": [{"agent": 1, "order": to}]}));
    assert_eq!(given["orders"][1], to);
    let played = page.request("play_step", json!({}));
    assert_eq!((&played["step"], &played["steps"], &played["length"]), (&json!(0), &json!(1), &json!(1)));
    assert_eq!(played["orders"][1], to, "it is not there yet");
    assert_eq!(page.request("get_replay", json!({}))["name"], "3m-seed4.smreplay");
    assert_eq!(play.interrupt(), Some(0));
}
