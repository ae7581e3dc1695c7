//! `docs/reference/messages.md`: what is said of files, in tables that users read and tests try.

const PAGE: &str = include_str!("../../../docs/reference/messages.md");

/// The part of the page below a heading, up to the next one.
fn section(heading: &str) -> &'static str {
    let (_, after) = PAGE.split_once(&format!("# {heading}\n")).unwrap_or_else(|| panic!("no {heading}"));
    after.split("\n#").next().unwrap()
}

/// The cells of the rows of a table below a heading; a message has a line per problem.
pub fn rows(heading: &str) -> Vec<Vec<String>> {
    let table = section(heading).lines().filter(|line| line.starts_with("| ")).skip(2);
    let cells = |row: &str| {
        let row = row.trim_start_matches("| ").trim_end_matches(" |");
        row.split(" | ").map(|cell| cell.replace("<br>", "\n")).collect()
    };
    let rows: Vec<Vec<String>> = table.map(cells).collect();
    assert!(!rows.is_empty(), "{heading} has rows");
    rows
}

/// The code of a cell; `↵` is a line break.
pub fn code(cell: &str) -> String {
    cell.trim_matches('`').replace('↵', "\n")
}

/// The keys of the valid file below a heading, with the texts of their values.
pub fn valid(heading: &str) -> Vec<(String, String)> {
    let block = section(heading).split("```json\n{\n").nth(1).expect("a file").split("\n}").next().unwrap();
    let entries = format!("\n{block},").replace("\n    \"", "\n\u{0}");
    let entry = |entry: &str| {
        let (key, value) = entry.split_once("\": ").expect("a key");
        (key.to_owned(), value.trim().trim_end_matches(',').to_owned())
    };
    entries.split('\u{0}').skip(1).map(entry).collect()
}

/// The changes of a cell: keys with the texts of their values, which are empty if the key is left out.
pub fn changes(cell: &str) -> Vec<(String, String)> {
    let mut changes = Vec::new();
    let mut parts = cell.split('`');
    while let (Some(before), Some(code)) = (parts.next(), parts.next()) {
        let (key, value) = match before.trim_start_matches(", ") {
            "no " => (code.trim_matches('"'), ""),
            "" => code.strip_prefix('"').and_then(|code| code.split_once("\": ")).expect("a key and a value"),
            other => panic!("{cell}: {other}"),
        };
        changes.push((key.to_owned(), value.to_owned()));
    }
    assert!(!changes.is_empty(), "{cell} has changes");
    changes
}

/// The text of a file with changes, which come after what they leave.
pub fn file<K: AsRef<str>, V: AsRef<str>>(valid: &[(String, String)], changes: &[(K, V)]) -> String {
    let changed = |key: &str| changes.iter().any(|(name, _)| name.as_ref() == key);
    let kept =
        valid.iter().filter(|(key, _)| !changed(key)).map(|(key, value)| (key.as_str(), value.as_str()));
    let new = changes.iter().map(|(key, value)| (key.as_ref(), value.as_ref()));
    let entries: Vec<String> = kept
        .chain(new.filter(|(_, value)| !value.is_empty()))
        .map(|(key, value)| format!("\"{key}\": {value}"))
        .collect();
    format!("{{{}}}", entries.join(", "))
}
