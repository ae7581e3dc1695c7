//! The description of the messages for the scripts.

use super::*;
use serde_json::{Value, json};
use smaclite_pool::LaneStats;
use ts_rs::Config;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/web/pages/protocol.d.ts");

/// Types of other crates, whose keys the test below compares, and a type that is only a name.
const FOREIGN: &str = "\
export type LaneStats = Record<
  \"steps\" | \"episodes\" | \"wins\" | \"returns\" | \"lengths\" | \"frames\"
  | \"rejected\" | \"accepted\" | \"waited_ns\",
  number
>;
export type Base = { [file: string]: string };
";

fn description() -> String {
    let config = Config::default().with_large_int("number");
    macro_rules! declarations {
        ($($name:ident),+ $(,)?) => { [$(format!("export {}\n", $name::decl(&config))),+].concat() };
    }
    let declarations = declarations![
        RequestMessage,
        ResponseMessage,
        Outcome,
        EventMessage,
        PageRequest,
        PageResponse,
        PageEvent,
        SaveFiles,
        Steps,
        SnapshotFile,
        OpenedFiles,
        SavedFiles,
        LaneInfo,
        GridCell,
        PoolState,
        PoolResponse,
        PoolInfo,
        LaneState,
        Point,
        EpisodeInfo,
    ];
    format!(
        "// Written by a test of protocol/mod.rs, from the types there: `just generate`\n\
         import type {{ Outcome as SessionOutcome, Request as SessionRequest, ScenarioFiles }} \
         from \"#playground/protocol.d.ts\";\n\
         import type {{ EpisodeResult, Features, ScenarioInfo }} from \"#view/data.d.ts\";\n\n\
         export type Version = {VERSION};\n{FOREIGN}{declarations}"
    )
}

#[test]
fn generated_types_of_messages() {
    if std::env::var_os("SMACLITE_WRITE").is_some() {
        std::fs::write(FILE, description()).unwrap();
    }
    let written = std::fs::read_to_string(FILE).unwrap_or_default();
    assert!(written == description(), "the messages have changed: run `just generate`");
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn types_of_other_crates_are_as_the_scripts_know_them() {
    for key in keys(&json!(LaneStats::default())) {
        assert!(FOREIGN.contains(&format!("\"{key}\"")), "{key}");
    }
}

#[test]
fn a_request_that_is_not_declared_is_an_error_that_names_those_that_are() {
    let parse = |text: &str| serde_json::from_str::<RequestMessage>(text).unwrap_err().to_string();
    assert!(
        parse(r#"{"id": 1, "request": {"type": "delete"}}"#).contains("unknown variant `delete`, expected")
    );
    assert!(parse(r#"{"id": 1, "request": {"type": "follow"}}"#).contains("missing field `env`"));
    assert!(parse(r#"{"request": {"type": "unfollow"}}"#).contains("missing field `id`"));
}
