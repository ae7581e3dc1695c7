//! What happens at the end of an episode.

use serde::{Deserialize, Serialize};

/// What happens to an environment whose episode ended: the three modes of Gymnasium.
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

impl Autoreset {
    const ALL: [Autoreset; 3] = [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled];

    /// The keyword used in files, options and Python: the value of Gymnasium's `AutoresetMode`.
    pub fn name(self) -> &'static str {
        match self {
            Autoreset::NextStep => "NextStep",
            Autoreset::SameStep => "SameStep",
            Autoreset::Disabled => "Disabled",
        }
    }
}

/// A keyword that names no autoreset mode.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("autoreset_mode must be `NextStep`, `SameStep` or `Disabled`, got `{0}`")]
pub struct UnknownAutoreset(pub String);

impl std::str::FromStr for Autoreset {
    type Err = UnknownAutoreset;

    fn from_str(keyword: &str) -> Result<Self, UnknownAutoreset> {
        let mode = Autoreset::ALL.into_iter().find(|mode| mode.name() == keyword);
        mode.ok_or_else(|| UnknownAutoreset(keyword.to_owned()))
    }
}
