//! Syntax errors of JSON in the words of people who write files by hand. serde_json says what it would have
//! accepted; most often the reason is a comma, a comment or a quotation mark of another language.

use super::shortened;

/// What is wrong with `text`, which is no JSON: serde_json's error is `error`, at the byte `at`.
pub(super) fn explain(text: &str, at: usize, error: &serde_json::Error) -> String {
    let at = (0..=at).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0);
    if error.is_eof() {
        return unfinished(text);
    }
    let message = without_position(error);
    match message.as_str() {
        "trailing characters" => foreign_mark(text, at)
            .unwrap_or_else(|| "the JSON value ends before this; a file holds only one".into()),
        "expected `:`" => "`:` is missing between a key and its value".into(),
        "invalid escape" => "after `\\` this is no escape; a backslash is written `\\\\`".into(),
        message if message.starts_with("control character") => {
            "a string must end in its line: `\"` is missing, or a line break must be written `\\n`".into()
        }
        "expected value"
        | "key must be a string"
        | "trailing comma"
        | "expected ident"
        | "invalid number"
        | "expected `,` or `}`"
        | "expected `,` or `]`" => explain_token(text, at, &message),
        _ => message,
    }
}

/// What is wrong with a token that serde_json did not expect.
fn explain_token(text: &str, at: usize, message: &str) -> String {
    let is_word = message == "invalid number" || text[at..].starts_with(is_of_word);
    let word = if is_word { word_at(text, at) } else { None };
    let word = word.map(|(word, after)| foreign_word(word, after));
    foreign_mark(text, at).or(word).unwrap_or_else(|| here(text, at, message))
}

/// serde_json ends its messages with the line and column.
pub(super) fn without_position(error: &serde_json::Error) -> String {
    let message = error.to_string();
    message.rsplit_once(" at line ").map_or(message.as_str(), |(reason, _)| reason).into()
}

/// What is not closed at the end of a text.
fn unfinished(text: &str) -> String {
    let (mut open, mut string, mut is_escaped) = (Vec::new(), None, false);
    for (at, byte) in text.bytes().enumerate() {
        match (byte, string) {
            _ if is_escaped => is_escaped = false,
            (b'\\', Some(_)) => is_escaped = true,
            (b'"', Some(_)) => string = None,
            (_, Some(_)) => {}
            (b'"', None) => string = Some(at),
            (b'{' | b'[', None) => open.push((byte, at)),
            (b'}' | b']', None) => {
                open.pop();
            }
            _ => {}
        }
    }
    let line = |at: usize| text[..at].matches('\n').count() + 1;
    match (string, open.pop()) {
        (Some(at), _) => format!("the file ends within the string that begins in line {}", line(at)),
        (None, Some((bracket, at))) => {
            format!("the file ends, but `{}` of line {} is not closed", char::from(bracket), line(at))
        }
        (None, None) if text.trim().is_empty() => "the file is empty".into(),
        (None, None) => "the file ends within a value".into(),
    }
}

/// Marks that JSON does not have and other languages do.
fn foreign_mark(text: &str, at: usize) -> Option<String> {
    let (before, rest) = text.split_at(at);
    if rest.starts_with(['}', ']']) && before.trim_end().ends_with(',') {
        return Some(format!("remove the comma before `{}`", &rest[..1]));
    }
    if ["//", "/*", "#"].iter().any(|mark| rest.starts_with(mark)) {
        return Some("JSON has no comments; remove this one".into());
    }
    if rest.starts_with(['\'', '`', '‘', '’', '“', '”']) {
        return Some("strings are written in double quotes, as \"name\"".into());
    }
    None
}

fn is_of_word(c: char) -> bool {
    c.is_alphanumeric() || ['_', '-', '+', '.'].contains(&c)
}

/// The word or number around a byte, and the text after it.
fn word_at(text: &str, at: usize) -> Option<(&str, &str)> {
    let begin = text[..at].trim_end_matches(is_of_word).len();
    let rest = &text[begin..];
    let end = rest.find(|c| !is_of_word(c)).unwrap_or(rest.len());
    (end > 0).then(|| rest.split_at(end))
}

fn foreign_word(word: &str, after: &str) -> String {
    let lower = word.to_lowercase();
    let shown = shortened(word);
    match lower.trim_start_matches(['-', '+']) {
        _ if after.trim_start().starts_with(':') => format!("keys are written in double quotes, \"{shown}\""),
        "nan" | "inf" | "infinity" => format!("JSON has no number `{shown}`"),
        "true" | "false" => format!("write `{lower}` instead of `{shown}`"),
        "none" | "null" | "nil" | "undefined" => format!("write `null` instead of `{shown}`"),
        number if number.starts_with(|c: char| c == '.' || c.is_ascii_digit()) => {
            format!("`{shown}` is no number of JSON; those are written as 12, -0.5 or 1e6")
        }
        _ => format!("strings are written in double quotes, \"{shown}\""),
    }
}

/// What is wrong where the tokens are those of JSON.
fn here(text: &str, at: usize, message: &str) -> String {
    match text[at..].chars().next() {
        Some('"' | '{' | '[') if message.starts_with("expected `,`") => {
            "a comma is missing before this".into()
        }
        Some(found) => {
            let expected = match message {
                "key must be a string" => "a key in double quotes",
                "expected value" | "expected ident" => "a value",
                "expected `,` or `}`" => "`,` or `}`",
                "expected `,` or `]`" => "`,` or `]`",
                _ => return message.into(),
            };
            format!("expected {expected}, got `{}`", shortened(found.encode_utf8(&mut [0; 4])))
        }
        None => message.into(),
    }
}
