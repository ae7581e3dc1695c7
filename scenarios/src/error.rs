//! Errors of reading a scenario.

use smaclite_units::FileError;

/// Why a scenario was refused; the message is one line that says where the mistake is and what is accepted.
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
        /// The key in it that names the unit file.
        key: String,
        /// What is wrong with the unit file.
        error: Box<FileError>,
    },
    /// A name that is neither a standard unit type nor a file.
    #[error("{file}: `{key}` is neither a standard unit type nor a unit file (tried {tried}); {hint}")]
    UnknownUnit {
        /// The scenario file.
        file: String,
        /// The key in it that names the unit type.
        key: String,
        /// The nearest standard type, or all of them.
        hint: String,
        /// The paths that were tried.
        tried: String,
    },
    /// Neither a standard scenario nor a file.
    #[error(
        "`{name}` is neither a standard scenario nor the path of a file, as in `./my_scenario.json`; {hint}"
    )]
    Unknown {
        /// The name or path.
        name: String,
        /// The nearest standard scenario, or all of them.
        hint: String,
    },
}
