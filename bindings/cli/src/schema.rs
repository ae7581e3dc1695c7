//! `smaclite-pool schema`: the JSON Schemas of scenario and unit files.

use super::CommandResult;
use clap::{Args, ValueEnum};
use smaclite_scenarios::Scenario;
use smaclite_units::UnitType;

#[derive(Args)]
pub(super) struct Schema {
    /// The kind of file
    kind: Kind,
}

/// The kinds of files that users write.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(super) enum Kind {
    Scenario,
    Unit,
}

impl Kind {
    pub(super) fn schema(self) -> serde_json::Value {
        match self {
            Kind::Scenario => Scenario::schema(),
            Kind::Unit => UnitType::schema(),
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Kind::Scenario => "scenario",
            Kind::Unit => "unit",
        }
    }
}

impl Schema {
    pub(super) fn run(self) -> CommandResult {
        out!("{:#}", self.kind.schema())?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The documentation links the files in `docs/schemas`.
    #[test]
    fn generated_schemas() {
        for kind in Kind::value_variants() {
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/schemas");
            let (file, text) =
                (format!("{folder}/{}.schema.json", kind.name()), format!("{:#}\n", kind.schema()));
            if std::env::var_os("SMACLITE_WRITE").is_some() {
                std::fs::write(&file, &text).unwrap();
            }
            let committed = std::fs::read_to_string(&file).unwrap_or_default();
            assert_eq!(committed, text, "run `just generate`");
        }
    }
}
