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

    /// The documentation links the files in `docs/schemas`; `just schemas` writes them.
    #[test]
    fn the_committed_schemas_are_those_of_the_program() {
        for kind in Kind::value_variants() {
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/schemas");
            let file = format!("{folder}/{}.schema.json", kind.name());
            let committed = std::fs::read_to_string(&file).unwrap();
            assert_eq!(committed, format!("{:#}\n", kind.schema()), "run `just schemas`");
        }
    }
}
