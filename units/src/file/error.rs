//! What can be wrong with a file, and the nearest valid word for a mistyped one.

/// Why a file was refused. Every message is one line: the file, the key, the value and what would be right.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FileError {
    /// The file could not be opened or read as text.
    #[error("{file}: cannot be read: {reason}")]
    Unreadable {
        /// The file as it was named.
        file: String,
        /// Why, in the operating system's words where it was asked.
        reason: String,
    },
    /// The text is not JSON, or has a key twice.
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
    /// A key that the format needs is not there.
    #[error("{file}: `{key}` is missing; it should be {expected}")]
    Missing {
        /// The file as it was named.
        file: String,
        /// Path of the key in the file.
        key: String,
        /// What would be right.
        expected: String,
    },
    /// A value of the wrong type, out of range or at odds with another one.
    #[error("{file}: {} is {value}, but should be {expected}", if key.is_empty() {
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
        /// What would be right.
        expected: String,
    },
    /// A value that is at odds with the rest of the file.
    #[error("{file}: `{key}` {conflict}")]
    Conflict {
        /// The file as it was named.
        file: String,
        /// Path of the key in the file.
        key: String,
        /// What the value does, and what it is at odds with.
        conflict: String,
    },
}

/// ``did you mean `hp`?`` if one of the valid words is near to `word`, else the list of them all.
pub fn did_you_mean<'a>(word: &str, valid: impl IntoIterator<Item = &'a str>) -> String {
    let valid: Vec<&str> = valid.into_iter().collect();
    match nearest(word, &valid) {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => format!("valid are {}", valid.join(", ")),
    }
}

/// The valid word that `word` is a slip of, if there is one.
pub(super) fn nearest<'a>(word: &str, valid: &[&'a str]) -> Option<&'a str> {
    // More than a third of the letters wrong is another word, not a slip.
    let most_slips = |candidate: &str| (candidate.len() / 3).max(1);
    let length = word.chars().count();
    // The lengths of two words differ by no more than their distance, which takes long to work out for long
    // words.
    let similar = valid.iter().filter(|candidate| candidate.len().abs_diff(length) <= most_slips(candidate));
    let lower = word.to_lowercase();
    let distance = |candidate: &str| strsim::damerau_levenshtein(&lower, &candidate.to_lowercase());
    let (distance, nearest) = similar.map(|candidate| (distance(candidate), *candidate)).min()?;
    (distance <= most_slips(nearest)).then_some(nearest)
}
