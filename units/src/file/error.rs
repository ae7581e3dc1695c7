//! Errors of files, and the nearest valid name for a mistyped one.

/// Why a file was refused. Every message is one line: the file, the key, the value and what is accepted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FileError {
    /// The file could not be opened or read as text.
    #[error("{file}: cannot be read: {reason}")]
    Unreadable {
        /// The file as it was named.
        file: String,
        /// Why; the operating system's message if it refused.
        reason: String,
    },
    /// The text is not JSON, or has a duplicate key.
    #[error("{file}: line {line}, column {column}: {reason}")]
    Syntax {
        /// The file as it was named.
        file: String,
        /// Line of the mistake, from 1.
        line: usize,
        /// Column of the mistake, from 1.
        column: usize,
        /// What is wrong there.
        reason: String,
    },
    /// A key that the format does not have.
    #[error("{file}: unknown key `{key}`; {hint}")]
    UnknownKey {
        /// The file as it was named.
        file: String,
        /// Path of the key in the file, as in `groups[1].faction`.
        key: String,
        /// The nearest valid key, or all of them.
        hint: String,
    },
    /// A required key is not there.
    #[error("{file}: `{key}` is missing; it must be {expected}")]
    Missing {
        /// The file as it was named.
        file: String,
        /// Path of the key in the file.
        key: String,
        /// What is accepted.
        expected: String,
    },
    /// A value of the wrong type, out of range, or in contradiction to another one.
    #[error("{file}: {} is {value}, but must be {expected}", if key.is_empty() {
        "the whole file".into()
    } else {
        format!("`{key}`")
    })]
    Invalid {
        /// The file as it was named.
        file: String,
        /// Path of the key in the file; empty for the file's whole content.
        key: String,
        /// The value as the file has it, shortened if long.
        value: String,
        /// What is accepted.
        expected: String,
    },
    /// A value that contradicts the rest of the file.
    #[error("{file}: `{key}` {conflict}")]
    Conflict {
        /// The file as it was named.
        file: String,
        /// Path of the key in the file.
        key: String,
        /// What the value does, and what it contradicts.
        conflict: String,
    },
}

/// ``did you mean `hp`?`` if one of the valid names is close to `name`, else the list of all valid names.
pub fn did_you_mean<'a>(name: &str, valid: impl IntoIterator<Item = &'a str>) -> String {
    let valid: Vec<&str> = valid.into_iter().collect();
    match nearest(name, &valid) {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => format!("expected one of {}", valid.join(", ")),
    }
}

/// The valid name that `name` is most likely a mistyped form of, if there is one.
pub(super) fn nearest<'a>(name: &str, valid: &[&'a str]) -> Option<&'a str> {
    // With more than a third of the letters wrong it is another name, not a typing mistake.
    let max_distance = |candidate: &str| (candidate.len() / 3).max(1);
    let length = name.chars().count();
    // The edit distance is at least the difference of the lengths. Its computation is slow for long names, so
    // names of another length are excluded first.
    let similar =
        valid.iter().filter(|candidate| candidate.len().abs_diff(length) <= max_distance(candidate));
    let lower = name.to_lowercase();
    let distance = |candidate: &str| strsim::damerau_levenshtein(&lower, &candidate.to_lowercase());
    let (distance, nearest) = similar.map(|candidate| (distance(candidate), *candidate)).min()?;
    (distance <= max_distance(nearest)).then_some(nearest)
}
