//! The nearest valid name for a mistyped one.

/// ``did you mean `hp`?`` if one of the valid names is close to `name`, else the list of all valid names.
pub fn did_you_mean<'a>(name: &str, valid: impl IntoIterator<Item = &'a str>) -> String {
    let valid: Vec<&str> = valid.into_iter().collect();
    match nearest(name, &valid) {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None => format!("expected one of {}", valid.join(", ")),
    }
}

/// ` (did you mean ...?)` for the end of a message that lists the valid names itself; empty if none is near.
pub fn or_did_you_mean<'a>(name: &str, valid: impl IntoIterator<Item = &'a str>) -> String {
    let valid: Vec<&str> = valid.into_iter().collect();
    nearest(name, &valid).map_or_else(String::new, |nearest| format!(" (did you mean `{nearest}`?)"))
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
