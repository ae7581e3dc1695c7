//! Vectors that keep their memory.

/// Empties a vector and reserves memory for `n` elements.
pub(crate) fn clear_and_reserve<T>(column: &mut Vec<T>, n: usize) {
    column.clear();
    column.reserve(n);
}

/// Replaces the contents of a vector and keeps its memory.
pub(crate) fn refill<T>(column: &mut Vec<T>, values: impl Iterator<Item = T>) {
    column.clear();
    column.extend(values);
}
