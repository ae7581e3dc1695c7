//! The error of the lookup of a scenario. What is wrong with files is [`Problems`].

use smaclite_units::Problems;

/// Why there is no scenario for a name or path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScenarioError {
    /// The scenario file, or unit files that it names, are invalid.
    #[error(transparent)]
    Invalid(#[from] Problems),
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
