//! `smaclite-pool play`: what cannot be played, and a step over the WebSocket.

use crate::kit::check_error;
use crate::page_kit::{Place, Url};
use serde_json::{Value, json};

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
    check("play 5m_vs_6m --against zoo:3m", 1, "only of scenarios whose two sides are equal");
    check("play 3m --seed -1", 2, "must be a whole number between 0 and");
}

#[test]
fn a_step_is_played_by_the_orders_of_the_page() {
    let place = Place::new();
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
