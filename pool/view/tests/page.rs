//! The page of a replay: what is inside it, how large it is, and that hostile names stay text.

use std::io::Read;

use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::read::DeflateDecoder;
use serde_json::Value;
use smaclite_engine::{BattleSetup, policy};
use smaclite_scenarios::{Scenario, ScenarioFiles};
use smaclite_view::{Moment, Recorder, Replay, ReplayError, UnitMoment, export_html};

fn record(files: ScenarioFiles, episodes: usize) -> Replay {
    let mut recorder = Recorder::new(BattleSetup::new(files), 1).unwrap();
    let mut actions = vec![0; recorder.battle().arena().sizes().n_agents];
    for _ in 0..episodes {
        recorder.reset();
        while !recorder.battle().is_over() {
            policy::nearest(recorder.battle(), &mut actions);
            recorder.step(&actions).unwrap();
        }
    }
    recorder.finish()
}

fn standard(name: &str) -> ScenarioFiles {
    ScenarioFiles::resolve(name).unwrap().1
}

/// The data inside a page.
fn data_of(page: &str) -> Value {
    let (_, tail) = page.split_once(r#"<script type="application/json" id="data">"#).unwrap();
    serde_json::from_str(tail.split_once("</script>").unwrap().0).unwrap()
}

fn inflated(value: &Value) -> Vec<u8> {
    let bytes = STANDARD.decode(value.as_str().unwrap()).unwrap();
    let mut out = Vec::new();
    DeflateDecoder::new(&bytes[..]).read_to_end(&mut out).unwrap();
    out
}

/// Reads LEB128 numbers.
fn number(bytes: &mut impl Iterator<Item = u8>) -> u64 {
    let mut value = 0;
    for shift in (0..).step_by(7) {
        let byte = bytes.next().unwrap();
        value |= u64::from(byte & 127) << shift;
        if byte < 128 {
            return value;
        }
    }
    unreachable!()
}

fn signed(bytes: &mut impl Iterator<Item = u8>) -> i64 {
    let value = number(bytes);
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

#[test]
fn pages_of_all_maps_are_small_and_load_nothing() {
    for name in Scenario::standard_names() {
        let page = export_html(&record(standard(name), 1)).unwrap();
        println!("{name}: {} bytes", page.len());
        let limit = if name == "2s3z" { 150_000 } else { 300_000 };
        assert!(page.len() < limit, "{name}: {} bytes", page.len());
        // The only address is the name of the XML namespace of the icon.
        assert_eq!(page.matches("http").count(), page.matches("http-equiv").count() + 1, "{name}");
        for part in ["policy", "title", "style", "body", "scripts", "data", "stage", "details", "transport"] {
            assert!(!page.contains(&format!("{{{{{part}}}}}")), "{name}: {part} is filled in");
        }
    }
}

#[test]
fn the_page_has_every_moment_to_what_can_be_seen() {
    let replay = record(standard("MMM"), 1);
    let moments: Vec<Moment> = replay.play(0).unwrap().map(Result::unwrap).collect();
    let data = data_of(&export_html(&replay).unwrap());
    let (units, episode) = (replay.scenario().units.len(), &data["episodes"][0]);
    assert_eq!(data["scenario"]["units"].as_array().unwrap().len(), units);
    assert_eq!(episode["n_moments"], moments.len());
    assert_eq!(episode["steps"].as_u64().unwrap() as usize * 8 + 1, moments.len());

    let mut bytes = inflated(&episode["moments"]).into_iter();
    for unit in &moments[0].units {
        assert_eq!(number(&mut bytes), unit.unit_type as u64);
    }
    // Values are rounded; health is rounded up, so that a unit that lives has some.
    let mut column = |value: &dyn Fn(&UnitMoment) -> f32, per: f32, error: f32| {
        for id in 0..units {
            let mut decoded = 0;
            for moment in &moments {
                decoded += signed(&mut bytes);
                let (decoded, value) = (decoded as f32 / per, value(&moment.units[id]));
                assert!((decoded - value).abs() <= error / per, "{decoded}, expected {value} (1/{per})");
            }
        }
    };
    column(&|unit| unit.pos.x, 256.0, 0.51);
    column(&|unit| unit.pos.y, 256.0, 0.51);
    column(&|unit| unit.facing.rem_euclid(std::f32::consts::TAU), 256.0 / std::f32::consts::TAU, 0.51);
    column(&|unit| unit.hp, 10.0, 1.01);
    column(&|unit| unit.shield, 10.0, 0.51);
    column(&|unit| unit.energy, 10.0, 0.51);
    column(&|unit| unit.cooldown, 160.0, 0.51);
    column(&|unit| unit.target.map_or(0.0, |id| id as f32 + 1.0), 1.0, 0.0);
    column(&|unit| f32::from(u8::from(unit.alive)), 1.0, 0.0);
    for moment in &moments {
        assert_eq!(number(&mut bytes), moment.attacks.len() as u64);
        for attack in &moment.attacks {
            assert_eq!([number(&mut bytes), number(&mut bytes)], [attack.by, attack.on].map(u64::from));
            if number(&mut bytes) == 0 {
                number(&mut bytes); // a shot's flight
            }
        }
    }
    assert_eq!(bytes.next(), None);
    assert!(moments.iter().any(|moment| !moment.attacks.is_empty()));
}

#[test]
fn units_have_the_letters_of_pictures() {
    for (name, expected) in [("2s3z", "S Z"), ("MMM", "+ M R"), ("3s_vs_3z", "S Z"), ("2s_vs_1sc", "P S")] {
        let data = data_of(&export_html(&record(standard(name), 1)).unwrap());
        let types = data["scenario"]["types"].as_array().unwrap();
        let labels: Vec<&str> = types.iter().map(|unit_type| unit_type["label"].as_str().unwrap()).collect();
        assert_eq!(labels.join(" "), expected, "{name}");
    }
}

#[test]
fn hostile_names_stay_text() {
    let mut files = standard("3m");
    files.text = files.text.replace("\"3m\"", r#""</script><script>alert(1)</script><b>{{data}}""#);
    let page = export_html(&record(files, 1)).unwrap();
    assert!(!page.contains("alert(1)</script>"), "the data cannot end its element");
    assert!(page.contains("<title>&lt;/script&gt;&lt;script&gt;alert(1)"));
    assert_eq!(page.matches("id=\"data\"").count(), 1);
    assert_eq!(data_of(&page)["scenario"]["name"], "</script><script>alert(1)</script><b>{{data}}");
}

#[test]
fn a_replay_that_cannot_be_reproduced_has_no_page() {
    let replay = record(standard("3m"), 1);
    let text = |bytes: &[u8]| {
        let mut json = String::new();
        flate2::read::GzDecoder::new(bytes).read_to_string(&mut json).unwrap();
        json
    };
    let json = text(&replay.to_bytes().unwrap()).replace("\"seed\":1,", "\"seed\":2,");
    let mut gzip = flate2::read::GzEncoder::new(json.as_bytes(), flate2::Compression::fast());
    let mut bytes = Vec::new();
    gzip.read_to_end(&mut bytes).unwrap();
    let error = export_html(&Replay::from_bytes(&bytes, "test").unwrap()).unwrap_err();
    assert!(matches!(error, ReplayError::Diverged { episode: 0, .. }), "{error}");
}
