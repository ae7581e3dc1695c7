//! Names and positions of features, in blocks that follow one another.

/// Consecutive features that belong together: one row, or one row per unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FeatureBlock {
    /// Which part this is, such as `enemies`; unique within an observation or state.
    pub name: &'static str,
    /// Index of its first feature in the observation or state.
    pub start: usize,
    /// Number of rows, by in-faction id; `None` for a block that is one row and not a list of units.
    pub rows: Option<usize>,
    /// Names of the features of a row.
    pub features: Vec<String>,
}

impl FeatureBlock {
    /// Index after its last feature.
    pub fn end(&self) -> usize {
        self.start + self.rows.unwrap_or(1) * self.features.len()
    }
}

/// The names of all actions, with so many look actions before those that target units.
pub(crate) fn action_names(n_looks: usize, n_actions: usize) -> Vec<String> {
    let mut all = names(&["no_op", "stop", "north", "south", "east", "west"]);
    all.extend((0..n_looks).map(|i| format!("look_{i}")));
    all.extend((0..n_actions.saturating_sub(all.len())).map(|i| format!("target_{i}")));
    all
}

pub(crate) fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

/// Puts blocks one after the other.
pub(crate) fn in_sequence(
    blocks: impl IntoIterator<Item = (&'static str, Option<usize>, Vec<String>)>,
) -> Vec<FeatureBlock> {
    let mut start = 0;
    let place = |(name, rows, features)| {
        let block = FeatureBlock { name, start, rows, features };
        start = block.end();
        block
    };
    blocks.into_iter().map(place).collect()
}
