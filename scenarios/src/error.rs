//! Why a scenario could not be had.

use smaclite_units::FileError;

/// Why a scenario was refused; the message is one line that says where the mistake is and what would be
/// right.
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
        error: Box<FileError>,
    },
    /// A name that is neither a standard unit type nor a file.
    #[error("{file}: `{key}` is neither a standard unit type nor a unit file (looked for {tried}); {hint}")]
    UnknownUnit {
        /// The scenario file.
        file: String,
        /// Where in it the unit type is named.
        key: String,
        /// The nearest standard type, or all of them.
        hint: String,
        /// The files that were looked for.
        tried: String,
    },
    /// Neither a standard scenario nor a file.
    #[error(
        "`{name}` is neither a standard scenario nor a file (give its path, as in `./my_scenario.json`); {hint}"
    )]
    Unknown {
        /// What was asked for.
        name: String,
        /// The nearest standard scenario, or all of them.
        hint: String,
    },
}
