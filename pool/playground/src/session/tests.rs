//! A session as its page uses it.

use super::*;
use safetensors::{Dtype, tensor::TensorView};
use serde_json::json;
use smaclite_engine::{Arena, BattleSetup, Sizes};
use smaclite_scenarios::{Placement, ScenarioFiles};

mod files;

/// The response to a request, or the error.
fn ask(session: &mut Session, request: Value) -> Value {
    let outcome: Value = serde_json::from_str(&session.respond_json(request.to_string().as_bytes())).unwrap();
    outcome.get("response").or(outcome.get("error")).unwrap().clone()
}

fn begin(scenario: &str, team: &str, actions: &[Value], taken: &[usize]) -> Value {
    let of = json!({"kind": "scenario", "scenario": scenario, "seed": "7", "opponent": "", "rules": ""});
    json!({"type": "begin_battle", "of": of, "team": team, "actions": actions, "taken": taken})
}

/// The start of the first episode of the opened replay, after actions (`null`: those recorded).
fn begin_episode(actions: Value) -> Value {
    let of = json!({"kind": "episode", "episode": 0});
    json!({"type": "begin_battle", "of": of, "team": "nearest", "actions": actions, "taken": []})
}

fn play(session: &mut Session, steps: usize) -> Value {
    ask(session, json!({"type": "play_steps", "steps": steps}))
}

/// A request that adds a team.
fn team(name: &str, run: &str, weights: &str) -> Value {
    json!({"type": "add_team", "name": name, "run": run, "weights": weights})
}

/// One that adds a team of the zoo.
fn zoo_team(name: &str) -> Value {
    let zoo = format!("{}/../../bindings/learn/zoo/{name}", env!("CARGO_MANIFEST_DIR"));
    let run = std::fs::read_to_string(format!("{zoo}/run.json")).unwrap();
    let weights = std::fs::read(format!("{zoo}/best.safetensors")).unwrap();
    team(name, &run, &STANDARD.encode(weights))
}

/// The scenario of the battle on another map.
fn paint(session: &mut Session, rows: &[String]) -> String {
    let painted = ask(session, json!({"type": "paint_map", "rows": rows}));
    painted["scenario"].as_str().unwrap().to_owned()
}

/// Requests that are refused, with a part of the reason.
fn check_refused<const N: usize>(session: &mut Session, requests: [(Value, &str); N]) {
    for (request, expected) in requests {
        let answer = ask(session, request);
        assert!(answer.as_str().is_some_and(|error| error.contains(expected)), "{answer}: {expected}");
    }
}

/// The actions of an episode, from its replay.
fn actions(session: &mut Session) -> Vec<Value> {
    let file = ask(session, json!({"type": "get_replay"}));
    ask(session, json!({"type": "open_replay", "name": "a", "replay": file["replay"]}));
    let replay: Value = serde_json::from_str(file["replay"].as_str().unwrap()).unwrap();
    replay["episodes"][0]["actions"].as_array().unwrap().clone()
}

/// The test of `engine.js` plays the battles of the file that this one writes, in WebAssembly.
#[test]
fn generated_battles_for_the_test_of_the_engine() {
    let battles = Scripted::NAMES.iter().zip(["2s3z", "MMM", "3s_vs_5z", "terran_5_vs_5"].iter().cycle());
    let opponents = Opponent::scripts().map(Opponent::name);
    let mut session = Session::default();
    let played = battles.zip(opponents).map(|((team, scenario), opponent)| {
        let of =
            json!({"kind": "scenario", "scenario": scenario, "seed": "7", "opponent": opponent, "rules": ""});
        let begin = json!({"type": "begin_battle", "of": of, "team": team, "actions": [], "taken": []});
        assert_eq!(ask(&mut session, begin)["type"], "begin_battle");
        let steps = play(&mut session, 1000);
        let file = ask(&mut session, json!({"type": "get_replay"}));
        let obs = ask(&mut session, json!({"type": "get_observation", "step": 3, "agent": 1}));
        let obs = obs["obs"].as_array().unwrap().iter().map(|number| number.as_f64().unwrap() as f32);
        let hash = obs.fold(0u32, |sum, number| sum.wrapping_mul(31).wrapping_add(number.to_bits()));
        json!({"scenario": scenario, "team": team, "opponent": opponent, "steps": steps["steps"],
            "result": steps["result"], "checksum": file["checksum"], "obs": format!("{hash:x}")})
    });
    let played: Vec<String> = played.map(|battle| battle.to_string()).collect();
    let text = format!("[\n{}\n]\n", played.join(",\n"));
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/page/engine.test.json");
    if std::env::var_os("SMACLITE_WRITE").is_some() {
        std::fs::write(file, &text).unwrap();
    }
    let written = std::fs::read_to_string(file).unwrap_or_default();
    assert!(written == text, "it has changed: run `just generate`");
}

#[test]
fn who_takes_an_agent_over_changes_its_actions_alone() {
    let mut session = Session::default();
    ask(&mut session, begin("2s3z", "nearest", &[], &[]));
    play(&mut session, 10);
    let team = actions(&mut session);
    let mut session = Session::default();
    ask(&mut session, begin("2s3z", "nearest", &team[..2 * 5], &[1]));
    let stop = json!({"type": "give_orders", "orders": [{"agent": 1, "order": {"type": "stop"}}]});
    assert_eq!(ask(&mut session, stop)["orders"][1]["type"], "stop");
    play(&mut session, 1);
    let both = actions(&mut session);
    assert_eq!(both.len(), 3 * 5);
    assert_eq!(both[..2 * 5], team[..2 * 5], "the steps before are those that were given");
    for agent in [0, 2, 3, 4] {
        assert_eq!(both[2 * 5 + agent], team[2 * 5 + agent], "agent {agent} is the team's");
    }
    assert_eq!(both[2 * 5 + 1], 1, "stop");
    assert_ne!(team[2 * 5 + 1], 1);
    // An agent that is given back has no order.
    ask(&mut session, json!({"type": "take_agents", "agents": []}));
    let steps = play(&mut session, 1);
    assert_eq!(steps["orders"][1]["type"], "none");
}

#[test]
fn an_episode_of_a_replay_is_played_and_played_on() {
    let mut session = Session::default();
    ask(&mut session, begin("3m", "kite", &[], &[]));
    play(&mut session, 4);
    let recorded = actions(&mut session);
    for (given, steps) in [(json!(recorded[..2 * 3]), 2), (json!([]), 0), (Value::Null, 4)] {
        let begun = ask(&mut session, begin_episode(given));
        assert_eq!((&begun["seed"], &begun["played"]["steps"]), (&json!("7"), &json!(steps)));
        assert_eq!(begun["played"]["n_moments"], 1 + 8 * steps);
    }
    assert_eq!(play(&mut session, 1)["step"], 4);
    let mut other = begin_episode(Value::Null);
    other["of"]["episode"] = json!(1);
    assert_eq!(ask(&mut session, other), "episode must be below 1, got 1");
}

/// A new battle after a replay was one of the standard scenario of the same name, or of none.
#[test]
fn an_episode_of_a_replay_says_which_scenario_a_new_battle_is_played_in() {
    let mut session = Session::default();
    ask(&mut session, begin("2s3z", "nearest", &[], &[]));
    let moved = ask(&mut session, json!({"type": "move_unit", "unit": 0, "x": 3, "y": 20}));
    let moved = moved["scenario"].as_str().unwrap();
    let own = moved.replace("\"2s3z\"", "\"mine\"");
    for scenario in ["2s3z", moved, &own, "terran_5_vs_5"] {
        let begun = ask(&mut session, begin(scenario, "nearest", &[], &[]));
        assert_eq!(begun["source"], scenario);
        play(&mut session, 1);
        actions(&mut session); // opens the replay
        assert_eq!(ask(&mut session, begin_episode(json!([])))["source"], scenario);
    }
}

/// It took the place of the replay that was shown, whose battle could not be begun again then.
#[test]
fn a_replay_without_an_episode_is_refused() {
    let mut session = Session::default();
    ask(&mut session, begin("3m", "nearest", &[], &[]));
    play(&mut session, 2);
    let file = ask(&mut session, json!({"type": "get_replay"}));
    let mut open = json!({"type": "open_replay", "name": "a", "replay": file["replay"]});
    assert_eq!(ask(&mut session, open.clone())["type"], "open_replay");
    let mut replay: Value = serde_json::from_str(file["replay"].as_str().unwrap()).unwrap();
    replay["episodes"] = json!([]);
    open["replay"] = json!(replay.to_string());
    assert_eq!(ask(&mut session, open), "the replay `a` has no episodes");
    assert_eq!(ask(&mut session, begin_episode(json!([])))["type"], "begin_battle");
}

#[test]
fn what_cannot_be_played_is_refused() {
    let mut session = Session::default();
    let refused = [
        (json!({"type": "play_steps", "steps": 1}), "begin a battle first"),
        (json!({"type": "fly"}), "unknown variant `fly`"),
        (begin("3m", "nobody", &[], &[]), "no team is called so, and unknown policy `nobody`"),
        (begin("3m", "nearest", &[json!(1)], &[]), "actions must be 3 per step, got 1 in all"),
        (
            begin("3m", "nearest", &[json!(0), json!(0), json!(0)], &[]),
            "step 0 cannot be played: agent 0: action 0 is not available",
        ),
        (begin("3m", "nearest", &[], &[3]), "agent must be below 3, got 3"),
        (begin("{}", "nearest", &[], &[]), "the scenario is not valid"),
        (team("a", "{", ""), "run.json of the team `a`"),
        (team("a", "{", "?"), "must be base64"),
    ];
    check_refused(&mut session, refused);
    assert!(session.battle.is_none(), "a refused battle begins nothing");
}

/// The weights of a team that observes no actions, with so many hidden units.
fn weights(setup: &BattleSetup, hidden: usize) -> String {
    let Sizes { n_agents, n_actions, obs_size, .. } = setup.arena().unwrap().1.sizes();
    let shapes = [
        ("actor.0.weight", vec![hidden, obs_size]),
        ("actor.0.bias", vec![hidden]),
        ("actor.1.weight", vec![n_actions, hidden]),
        ("actor.1.bias", vec![n_actions]),
        ("actor.id_bias", vec![n_agents, hidden]),
    ];
    let zeros = vec![0; 4 * hidden.max(n_actions) * obs_size];
    let tensors = shapes.map(|(name, shape)| {
        let bytes = &zeros[..4 * shape.iter().product::<usize>()];
        (name, TensorView::new(Dtype::F32, shape, bytes).unwrap())
    });
    STANDARD.encode(safetensors::serialize(tensors, None).unwrap())
}

/// Its first step panicked, and then the page answered nothing any more.
#[test]
fn a_team_whose_layers_are_empty_is_refused() {
    let run = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bindings/learn/zoo/3m/run.json");
    let mut run: Value = serde_json::from_str(&std::fs::read_to_string(run).unwrap()).unwrap();
    run["config"]["last_actions"] = json!(0);
    let mut session = Session::default();
    let setup = BattleSetup::new(ScenarioFiles::resolve("3m").unwrap().1);
    run["config"]["hidden"] = json!([4]);
    ask(&mut session, team("a", &run.to_string(), &weights(&setup, 4)));
    for (network, hidden, refusal) in [
        ("flat", vec![0], "at least one input and output, got the widths"),
        ("graph", vec![4], "network must be `flat`, `units` or `universal`, got `graph`"),
        ("units", vec![4], "a network over units has two widths, got [4]"),
        ("units", vec![4, 4], "cannot be used: tensor `actor."),
    ] {
        (run["config"]["network"], run["config"]["hidden"]) = (json!(network), json!(hidden));
        let added = team("b", &run.to_string(), &weights(&setup, hidden[0]));
        check_refused(&mut session, [(added, refusal)]);
    }
    ask(&mut session, begin("3m", "a", &[], &[]));
    assert_eq!(play(&mut session, 2)["steps"], 2);
}

/// The page has one team, also for maps that a person opens. Types that it never saw are figures to it.
#[test]
fn a_universal_team_plays_every_map() {
    let mut session = Session::default();
    assert_eq!(ask(&mut session, zoo_team("all-maps"))["teams"][0]["is_universal"], true);
    let mut text: Value = serde_json::from_str(&ScenarioFiles::resolve("MMM").unwrap().1.text).unwrap();
    text["name"] = json!("own");
    let units = json!({"MARINE": 3, "HYDRALISK": 2, "MEDIVAC": 1});
    (text["groups"][0]["units"], text["groups"][1]["units"]) = (units.clone(), units);
    text["unit_type_ids"] = json!({"MARINE": 0, "HYDRALISK": 1, "MEDIVAC": 2});
    (text["num_allied_units"], text["num_enemy_units"]) = (json!(6), json!(6));
    let own = text.to_string();
    for (scenario, wins) in [("8m", true), ("MMM", true), ("terran_5_vs_5", false), (&own, false)] {
        assert_eq!(ask(&mut session, begin(scenario, "all-maps", &[], &[]))["type"], "begin_battle");
        let steps = play(&mut session, 1000);
        assert!(steps["steps"].as_u64() > Some(5) && (!wins || steps["result"] == "won"), "{steps}");
    }
    text["smacv2"] = json!({"conic_fov": true});
    let refused = begin(&text.to_string(), "all-maps", &[], &[]);
    check_refused(&mut session, [(refused, "cannot play this scenario")]);
}

/// The rules are those that are asked for, else those of the scenario, which a text may have.
#[test]
fn battles_have_the_rules_that_are_chosen() {
    let mut session = Session::default();
    let setup =
        BattleSetup { rules: Rules::Paper, ..BattleSetup::new(ScenarioFiles::resolve("3m").unwrap().1) };
    let text = serde_json::to_string(&setup).unwrap();
    for (scenario, asked, rules) in [
        ("3m", "", "smaclite"),
        ("3m", "starcraft", "starcraft-1"),
        (&text, "", "paper"),
        (&text, "smaclite", "smaclite"),
    ] {
        let mut begin = begin(scenario, "nearest", &[], &[]);
        begin["of"]["rules"] = json!(asked);
        let begun = ask(&mut session, begin);
        assert_eq!((&begun["rules"], &begun["source"]), (&json!(rules), &json!(scenario)));
    }
    let mut unknown = begin("3m", "nearest", &[], &[]);
    unknown["of"]["rules"] = json!("go");
    assert_eq!(ask(&mut session, unknown), "rules must be 'smaclite', 'paper' or 'starcraft', got 'go'");
}

/// `play --against` had this, and the playground had not.
#[test]
fn a_trained_team_plays_the_enemies() {
    let mut session = Session::default();
    for name in ["all-maps", "3m"] {
        ask(&mut session, zoo_team(name));
    }
    let against = |opponent: &str, scenario: &str, actions: &[Value]| {
        let mut begin = begin(scenario, "random", actions, &[]);
        begin["of"]["opponent"] = json!(opponent);
        begin
    };
    for (opponent, scenario) in [("all-maps", "3m"), ("all-maps", "MMM"), ("3m", "3m")] {
        let begun = ask(&mut session, against(opponent, scenario, &[]));
        assert_eq!((&begun["opponent"], &begun["is_playable"]), (&json!(opponent), &json!(true)), "{begun}");
        let played = play(&mut session, 1000);
        assert_eq!(played["result"], "lost", "{opponent} beats random actions");
        let joint = actions(&mut session); // the replay was verified, too
        let n_agents = begun["scenario"]["n_agents"].as_u64().unwrap() as usize;
        assert_eq!(joint.len(), 2 * n_agents * played["steps"].as_u64().unwrap() as usize);

        // The page knows the actions of its agents alone; the team chooses the same ones again.
        let own: Vec<Value> =
            joint.chunks(2 * n_agents).flat_map(|joint| joint[..n_agents].to_vec()).collect();
        let again = ask(&mut session, against(opponent, scenario, &own));
        for key in ["steps", "return", "result"] {
            assert_eq!(again["played"][key], played[key], "{opponent} on {scenario}: {key}");
        }
    }
    for (opponent, scenario, expected) in [
        ("all-maps", "protoss_5_vs_5", "cannot play the enemies of a scenario with the key `smacv2`"),
        ("3m", "8m", "the enemies of this scenario are 8 with"),
        ("all-maps", "5m_vs_6m", "its sides are not equal"),
        ("all-maps", "3s_vs_3z", "its sides are not equal"),
    ] {
        check_refused(&mut session, [(against(opponent, scenario, &[]), expected)]);
    }
}

/// `play 3s_vs_3z --against zoo:3s_vs_3z` was refused with two descriptions of sizes that were equal, where
/// tournaments and trainings accept it.
#[test]
fn a_team_of_one_map_plays_enemies_of_other_types_if_the_sizes_are_equal() {
    let mut session = Session::default();
    let name = "3s_vs_3z";
    ask(&mut session, zoo_team(name));
    let mut begin = begin(name, "random", &[], &[]);
    begin["of"]["opponent"] = json!(name);
    let begun = ask(&mut session, begin);
    assert_eq!((&begun["opponent"], &begun["is_playable"]), (&json!(name), &json!(true)), "{begun}");
    let played = play(&mut session, 1000);
    assert!(played["result"].is_string(), "{played}");
}

/// A map of 32 x 32 squares whose square (x, y) is blocked if `is_blocked(x, y)`, as a request has it.
fn rows(is_blocked: impl Fn(usize, usize) -> bool) -> Vec<String> {
    (0..32).map(|y| (0..32).map(|x| if is_blocked(x, y) { 'X' } else { '_' }).collect()).collect()
}

#[test]
fn a_painted_map_is_that_of_the_battle_and_of_its_replay() {
    let mut session = Session::default();
    for scenario in ["3m", "so_many_baneling", "terran_5_vs_5"] {
        let before = ask(&mut session, begin(scenario, "nearest", &[], &[]))["scenario"].clone();
        let rows = rows(|x, y| x < 2 || x == 31 && y > 3);
        let text = paint(&mut session, &rows);
        let after = ask(&mut session, begin(&text, "nearest", &[], &[]))["scenario"].clone();
        assert_eq!(after["obstacles"], json!([[0, 0, 2, 32], [31, 4, 32, 32]]), "{scenario}");
        for key in ["name", "width", "height", "units", "types", "attack_point"] {
            assert_eq!(after[key], before[key], "{scenario}: {key}");
        }
        play(&mut session, 1000);
        actions(&mut session); // opens the replay
        let of_replay = ask(&mut session, begin_episode(json!([])));
        assert_eq!(of_replay["scenario"]["obstacles"], after["obstacles"]);
    }
    let small = paint(&mut session, &["_X", "__"].map(String::from));
    check_refused(&mut session, [(begin(&small, "nearest", &[], &[]), "a list of 32 rows")]);
}

#[test]
fn what_is_probably_a_mistake_on_a_painted_map_is_a_warning() {
    let mut session = Session::default();
    let mut warnings = |is_blocked: fn(usize, usize) -> bool| {
        // Three marines start around (9, 16), and three around (23, 16).
        assert_eq!(ask(&mut session, begin("3m", "nearest", &[], &[]))["warnings"], json!([]));
        let painted = paint(&mut session, &rows(is_blocked));
        let begun = ask(&mut session, begin(&painted, "nearest", &[], &[]));
        serde_json::from_value::<Vec<String>>(begun["warnings"].clone()).unwrap()
    };
    assert_eq!(warnings(|x, _| x == 0), Vec::<String>::new());
    let found = warnings(|x, _| x == 15);
    assert!(matches!(&found[..], [one] if one.contains("no path connects the agents")), "{found:?}");
    let found = warnings(|x, _| x < 15);
    assert!(matches!(&found[..], [one] if one.contains("on a blocked square")), "{found:?}");
}

/// The scenario of a link was read as a path by the program that served the page: a link showed the beginning
/// of any file.
#[test]
fn a_scenario_is_named_or_said_and_never_a_path() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/data/3m.json");
    for source in [path, "Cargo.toml", "3mm"] {
        let request = begin(source, "nearest", &[], &[]);
        check_refused(&mut Session::default(), [(request, "is not the name of a standard scenario")]);
    }
}

/// The page showed 9 squares for all, and drew fog over what agents of generated battles observe.
#[test]
fn agents_see_as_far_as_their_observations() {
    for (scenario, unit_type, sight) in
        [("protoss_5_vs_5", "STALKER", 10.0), ("zerg_5_vs_5", "ZERGLING", 8.0), ("2s3z", "STALKER", 9.0)]
    {
        let begun = ask(&mut Session::default(), begin(scenario, "nearest", &[], &[]));
        let types = begun["scenario"]["types"].as_array().unwrap();
        let found = types.iter().find(|found| found["name"] == unit_type).unwrap();
        assert_eq!(found["sight_range"], sight, "{scenario}");
    }
}

#[test]
fn a_unit_that_is_moved_starts_elsewhere_and_no_other() {
    let mut session = Session::default();
    let starts = |text: &str, rules: Rules| -> Vec<_> {
        let files = ScenarioFiles { source: "a".into(), text: text.into(), unit_files: Vec::new() };
        let scenario = files.scenario().unwrap();
        let arena = Arena::new(&scenario, rules);
        let name = |unit: &Placement| scenario.unit_types[unit.unit_type].name.clone();
        let units = scenario.units.iter().enumerate();
        units.map(|(id, unit)| (name(unit), unit.faction, arena.start(id))).collect()
    };
    let all =
        Rules::ALL.iter().flat_map(|rules| ["2s3z", "MMM2", "corridor", "1c3s5z"].map(|name| (name, *rules)));
    for (scenario, rules) in all {
        let mut of = begin(scenario, "nearest", &[], &[]);
        of["of"]["rules"] = json!(rules.to_string());
        ask(&mut session, of.clone());
        let mut expected = starts(&ScenarioFiles::resolve(scenario).unwrap().1.text, rules);
        let moved = ask(&mut session, json!({"type": "move_unit", "unit": 1, "x": 15.25, "y": 20.5}));
        let text = moved["scenario"].as_str().unwrap();
        expected[1].2 = [15.25, 20.5];
        // Under `starcraft` the colossus of 1c3s5z and a stalker begin at one point, which no file can say;
        // where one steps aside, others stand.
        let found = starts(text, rules);
        for ((name, faction, at), (other, other_faction, place)) in found.iter().zip(&expected) {
            assert_eq!((name, faction, at[1]), (other, other_faction, place[1]), "{scenario}, {rules}");
            let aside = if scenario == "1c3s5z" { 0.5 } else { 0.0 };
            assert!(
                (at[0] - place[0]).abs() <= aside,
                "{scenario}, {rules}: {name} at {at:?}, not {place:?}"
            );
        }
        of["of"]["scenario"] = json!(text);
        assert_eq!(ask(&mut session, of)["scenario"]["name"], scenario);
    }
    let refused = [
        ("2s3z", json!({"type": "move_unit", "unit": 10, "x": 3, "y": 3}), "unit must be below 10, got 10"),
        ("terran_5_vs_5", json!({"type": "move_unit", "unit": 0, "x": 3, "y": 3}), "draws where units start"),
    ];
    for (scenario, request, reason) in refused {
        ask(&mut session, begin(scenario, "nearest", &[], &[]));
        check_refused(&mut session, [(request, reason)]);
    }
}
