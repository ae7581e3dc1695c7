//! What happens at the end of an episode.

use serde::{Deserialize, Serialize};

/// What happens to an environment whose episode ended: the three modes of Gymnasium, by its names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Autoreset {
    /// The next step ignores the action, resets, and returns the first observation with reward 0.
    #[default]
    NextStep,
    /// The step that ends an episode returns the first observation of the next episode. The last observation,
    /// state and mask are in `final_*`.
    SameStep,
    /// Nothing: stepping a finished environment is an error until it is reset.
    Disabled,
}

smaclite_units::keywords!(
    Autoreset,
    "autoreset_mode",
    "NextStep" => NextStep,
    "SameStep" => SameStep,
    "Disabled" => Disabled,
);
