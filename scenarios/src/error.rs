//! Why a scenario could not be had.

use smaclite_units::FileError;

/// Why a scenario was refused; the message is one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScenarioError {
    /// Something is wrong with the scenario file itself.
    #[error(transparent)]
    File(#[from] FileError),
    /// Something is wrong with a unit file that the scenario names.
    #[error("{scenario}: `{key}`: {error}")]
    UnitFile {
        /// The scenario file.
        scenario: String,
        /// Where in it the unit file is named.
        key: String,
        /// What is wrong with the unit file.
        error: FileError,
    },
    /// Neither a standard scenario nor a file.
    #[error("there is no standard scenario `{name}` and no such file; {hint}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// The nearest standard scenario, or all of them, and how a path is given.
        hint: String,
    },
}
