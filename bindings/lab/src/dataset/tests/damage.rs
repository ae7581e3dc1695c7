//! Files that are damaged, changed or contradict themselves.

use super::*;
use serde_json::{Value, json};
use std::io::Write;

fn compressed(text: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(text).unwrap();
    encoder.finish().unwrap()
}

fn inflated(bytes: &[u8]) -> Vec<u8> {
    let mut text = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(bytes), &mut text).unwrap();
    text
}

#[test]
fn damaged_files_are_errors_that_say_what_is_wrong() {
    let bytes = bytes_of(&recorded(2));
    let text = inflated(&bytes);
    let head_len = text.iter().position(|byte| *byte == b'\n').unwrap();
    let with_head = |from: &str, to: &str| {
        let head = std::str::from_utf8(&text[..head_len]).unwrap();
        assert!(head.contains(from), "{from}");
        compressed(&[head.replacen(from, to, 1).as_bytes(), &text[head_len..]].concat())
    };
    let with_byte = |place: usize, byte: u8| {
        let mut text = text.clone();
        text[head_len + 1 + place] = byte;
        compressed(&text)
    };
    let flipped = bytes.iter().enumerate().map(|(i, byte)| byte ^ u8::from(i == bytes.len() / 2));
    let cases = [
        (b"{}".to_vec(), "expected a dataset"),
        (bytes[..bytes.len() - 9].to_vec(), "the file ends too early"),
        (flipped.collect(), "expected a dataset"),
        ([&bytes[..], b"x"].concat(), "bytes follow"),
        (compressed(&text[..text.len() - 1]), "the file ends too early"),
        (compressed(&[&text[..], b"x"].concat()), "more actions follow"),
        (compressed(b"{}"), "missing field `format`"),
        (with_head("smaclite-dataset", "smaclite-replay"), "`format` must be \"smaclite-dataset\""),
        (with_head("\"version\":1", "\"version\":2"), "`version` must be 1, got 2"),
        (
            with_head("\"episodes\":40", "\"episodes\":41"),
            "end` must be 1 (lost), 2 (truncated) or 5 (won), got",
        ),
        (with_head("\"hashes\":{", "\"hashes\":{\"x\":\"\","), "`hashes` must be of the 12 arrays, got 13"),
        (with_head("\"episodes\":40", "\"episodes\":0"), "`episodes` must be 1 to"),
        (with_head("\"steps\":", "\"steps\":99999999"), "`steps` must be 1 to 1073741824"),
        (with_head("\"hash\":\"", "\"hash\":\"0"), "`hash` must be"),
        (with_byte(40 * 8, 200), "episode 0: length` must be 1 to 45, got 200"),
        (with_byte(40 * 12, 9), "episode 0: policy` must be below 1, got 9"),
        (with_byte(40 * 14, 3), "episode 0: end` must be 1 (lost)"),
        (with_byte(40 * 15, 99), "episode 0, step 0: action of agent 0` must be below 11, got 99"),
    ];
    for (bytes, expected) in cases {
        let error = read(&bytes).map(|_| ()).unwrap_err();
        assert!(error.starts_with("3m.smdata: ") && error.contains(expected), "{expected}: {error}");
    }
}

/// The bytes of a dataset whose card has other values at these pointers.
fn with_card(dataset: &Dataset, changes: &[(&str, Value)]) -> Vec<u8> {
    let text = inflated(&bytes_of(dataset));
    let head_len = text.iter().position(|byte| *byte == b'\n').unwrap();
    let mut head: Value = serde_json::from_slice(&text[..head_len]).unwrap();
    for (pointer, value) in changes {
        *head["card"].pointer_mut(pointer).unwrap() = value.clone();
    }
    compressed(&[head.to_string().as_bytes(), &text[head_len..]].concat())
}

/// The card was believed, all but three of its numbers: a file of 3m whose card said 8m let environments be
/// made of other battles.
#[test]
fn a_card_that_contradicts_its_file_is_refused() {
    let dataset = recorded(2);
    let (first, steps) = (json!([dataset.card().policies[0]]), dataset.n_steps());
    assert!(read(&with_card(&dataset, &[("/policies", first)])).is_ok(), "nothing was changed");
    for (pointer, value, expected) in [
        ("/scenario", json!("8m"), "`card.scenario` must be \"2s3z\", got \"8m\""),
        ("/rules", json!("paper"), "`card.rules` must be \"smaclite\", got \"paper\""),
        ("/opponents", json!("kite"), "`card.opponents` must be \"attack_move\", got \"kite\""),
        ("/sizes/n_agents", json!(8), "`card.sizes.n_agents` must be 5, got 8"),
        ("/episodes", json!(41), "`card.episodes` must be 40, got 41"),
        ("/steps", json!(1), "`card.steps` must be"),
        ("/win_rate", json!(0.99), "`card.win_rate` must be"),
        ("/truncated_rate", json!(0.99), "`card.truncated_rate` must be"),
        ("/lengths/median", json!(46.0), "`card.lengths.median` must be"),
        ("/coverage", json!(1e-9), "`card.coverage` must be"),
        ("/policies", json!([]), "`card.policies` must be a list of 1, got 0"),
        ("/policies/0/name", json!("kite"), "`card.policies[0].name` must be \"random\", got \"kite\""),
        ("/policies/0/steps", json!(1), "`card.policies[0].steps` must be"),
        ("/policies/0/win_rate", json!(0.99), "`card.policies[0].win_rate` must be"),
    ] {
        let error = read(&with_card(&dataset, &[(pointer, value)])).map(|_| ()).unwrap_err();
        assert!(error.starts_with("3m.smdata: ") && error.contains(expected), "{expected}: {error}");
    }
    for (changes, arrays, expected) in [
        (vec![("/returns/max", json!(21.0))], vec![ArrayName::Reward], "`card.returns.max` must be"),
        (
            vec![("/policies/0/mean_return", json!(21.0))],
            vec![ArrayName::Reward],
            "`card.policies[0].mean_return` must be",
        ),
        (
            vec![("/unique_pairs", json!(1)), ("/coverage", json!(1.0 / steps as f64))],
            vec![ArrayName::State, ArrayName::Actions],
            "`card.coverage` must be",
        ),
    ] {
        let other = read(&with_card(&dataset, &changes)).unwrap();
        let expand = |arrays: &[ArrayName]| other.expand(arrays, 2, &mut || false);
        assert!(expand(&[ArrayName::Obs]).is_ok(), "observations do not tell");
        let error = expand(&arrays).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
        let folder = tempfile::tempdir().unwrap();
        let written = other.expand_to(&folder.path().join("out"), &arrays, 2, &mut || false);
        assert_eq!(written.unwrap_err().to_string(), error);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left");
    }
}

/// Whatever is changed, reading and expanding end with an error or with arrays.
#[test]
fn no_damage_panics() {
    let bytes = bytes_of(&recorded(2));
    for len in (0..bytes.len()).step_by(37) {
        assert!(read(&bytes[..len]).is_err(), "{len} bytes");
    }
    let text = inflated(&bytes);
    let body = text.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    let mut state = 1_u64;
    for i in 0..300 {
        let mut draw = |n: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % n
        };
        let mut damaged = text.clone();
        // Half of the changes are where JSON says nothing against them.
        let place = if i % 2 == 0 { draw(text.len()) } else { body + draw(text.len() - body) };
        damaged[place] ^= 1 << draw(8);
        if let Ok(dataset) = read(&compressed(&damaged)) {
            let _ = dataset.expand(&[ArrayName::Reward], 2, &mut || false);
        }
    }
}

/// A few bytes that promise the largest dataset are read without memory for it.
#[test]
fn a_promise_of_steps_needs_no_memory() {
    let dataset = recorded(2);
    let text = inflated(&bytes_of(&dataset));
    let head_len = text.iter().position(|byte| *byte == b'\n').unwrap();
    let head = std::str::from_utf8(&text[..head_len]).unwrap();
    let (steps, most) = (dataset.n_steps(), 1 << 30);
    let head = head.replace(&format!("\"steps\":{steps}"), &format!("\"steps\":{most}"));
    let head = head.replace("\"episodes\":40", &format!("\"episodes\":{most}"));
    let error = read(&compressed(format!("{head}\n").as_bytes())).unwrap_err();
    assert!(error.contains("the file ends too early"), "{error}");
}

#[test]
fn arrays_beyond_the_memory_are_an_error() {
    let mut dataset = recorded(2);
    dataset.starts.push(1 << 50);
    let error = dataset.expand(&[ArrayName::Obs], 2, &mut || false).unwrap_err().to_string();
    assert!(error.contains("bytes of memory, more than there is"), "{error}");
}

/// A file whose content was exchanged, with all of gzip's checksums right, is found by playing it.
#[test]
fn what_only_play_can_tell_is_an_error_of_expanding() {
    let dataset = recorded(2);
    let expand = |dataset: &Dataset| {
        dataset.expand(&[ArrayName::Reward], 2, &mut || false).map(|_| ()).unwrap_err().to_string()
    };
    let mut other = dataset.clone();
    other.actions[0] = 0; // the no-op of the dead
    assert!(expand(&other).contains("episode 0, step 0: "), "{}", expand(&other));
    let mut other = dataset.clone();
    other.episodes[3].seed += 1;
    let error = expand(&other);
    assert!(error.contains("recorded by smaclite-pool"), "{error}");
    let mut other = dataset.clone();
    other.hashes[ArrayName::Reward as usize] ^= 1;
    assert!(expand(&other).contains("array `reward` has the hash"), "{}", expand(&other));
    let interrupted = dataset.expand(&ArrayName::ALL, 2, &mut || true).unwrap_err();
    assert!(matches!(interrupted, DatasetError::Interrupted));
}
