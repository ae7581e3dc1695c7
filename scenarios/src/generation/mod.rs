//! Scenarios whose teams and start positions are drawn anew for each episode.

mod drawer;
pub(crate) mod keys;
mod place;
mod read;

pub use drawer::Drawer;
pub(crate) use read::{lists_of, read_generated, sample};

/// What is drawn at each reset.
#[derive(Clone, Debug, PartialEq)]
pub struct Generation {
    /// The unit types of both factions.
    pub teams: Teams,
    /// Where the units start, before they are spread to free places.
    pub starts: Starts,
}

/// Teams: lists of unit types, as indices into the types of the scenario.
#[derive(Clone, Debug, PartialEq)]
pub enum Teams {
    /// The units of the scenario's groups, in their order.
    OfGroups,
    /// Independent draws with weights; a team of exception types alone is drawn again.
    Weighted {
        /// The types.
        types: Vec<usize>,
        /// Their weights, which sum to 1.
        weights: Vec<f64>,
        /// The types that do not make a team alone.
        exceptions: Vec<usize>,
    },
    /// Uniform over the multisets of types; both factions are equal.
    All {
        /// The types.
        types: Vec<usize>,
        /// The types that do not make a team alone.
        exceptions: Vec<usize>,
    },
    /// One of several teams, uniform, in random order; both factions are equal.
    Fixed {
        /// The teams.
        teams: Vec<Vec<usize>>,
    },
}

/// Start positions.
#[derive(Clone, Debug, PartialEq)]
pub enum Starts {
    /// Those of the scenario's groups.
    OfGroups,
    /// Allies in the west half, enemies mirrored.
    Reflect,
    /// Allies in the centre, enemies in one to four groups on the diagonals.
    Surrounded,
    /// Surrounded with probability `1 - p`, else reflected.
    SurroundedAndReflect {
        /// The probability of reflection.
        p: f64,
    },
    /// Each faction uniform in an area.
    Uniform {
        /// Of the allies: west, south, east, north.
        allies: [f64; 4],
        /// Of the enemies.
        enemies: [f64; 4],
    },
}

/// One unit that was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Index into the types of the scenario.
    pub unit_type: usize,
    /// Start position `[x, y]` in squares.
    pub position: [f64; 2],
}

/// The teams of one episode, in the order of the lists that were drawn. Its memory is kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DrawnTeams {
    /// The allies.
    pub allies: Vec<Drawn>,
    /// The enemies.
    pub enemies: Vec<Drawn>,
}
