//! One character per unit type, different ones within a scenario.

use smaclite_units::UnitType;

/// Characters by which players know standard types whose first letter another type has.
const KNOWN: [(&str, char); 4] =
    [("MARAUDER", 'R'), ("MEDIVAC", '+'), ("SPINE_CRAWLER", 'P'), ("ZERGLING", 'G')];

/// What is left when all letters and digits are used.
const NONE_LEFT: char = '*';

/// The character that stands for each unit type in pictures, in the order of `types`.
///
/// Healers get a plus, other types a letter of their names: the first one that is free, else any free letter
/// or digit. In a scenario with more than 36 types the rest share an asterisk.
///
/// ```
/// use smaclite_scenarios::Scenario;
/// use smaclite_view::type_letters;
///
/// let scenario = Scenario::standard("MMM").unwrap();
/// let names = scenario.unit_types.iter().map(|unit_type| unit_type.name.as_str());
/// let letters: Vec<_> = names.zip(type_letters(&scenario.unit_types)).collect();
/// assert_eq!(letters, [("MEDIVAC", '+'), ("MARINE", 'M'), ("MARAUDER", 'R')]);
/// ```
pub fn type_letters(types: &[UnitType]) -> Vec<char> {
    let mut letters = vec![None; types.len()];
    // Known types first, so that they have their characters whatever other types there are.
    for (i, unit_type) in types.iter().enumerate() {
        let known = KNOWN.iter().find(|(name, _)| *name == unit_type.name);
        letters[i] = known.map(|(_, letter)| *letter).filter(|letter| !letters.contains(&Some(*letter)));
    }
    for (i, unit_type) in types.iter().enumerate() {
        let free = |letter: &char| !letters.contains(&Some(*letter));
        let letter = letters[i].or_else(|| candidates(unit_type).find(free));
        letters[i] = Some(letter.unwrap_or(NONE_LEFT));
    }
    letters.into_iter().flatten().collect()
}

/// The characters that fit a type, best first.
fn candidates(unit_type: &UnitType) -> impl Iterator<Item = char> {
    let plus = unit_type.is_healer().then_some('+');
    let capitals = unit_type.name.chars().map(|letter| letter.to_ascii_uppercase());
    plus.into_iter().chain(capitals.filter(char::is_ascii_alphanumeric)).chain('A'..='Z').chain('0'..='9')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(names: &[&str], expected: &str) {
        let marine = UnitType::standard("MARINE").unwrap();
        let typed = |name: &&str| UnitType { name: name.to_string(), ..marine.clone() };
        let types: Vec<UnitType> = names.iter().map(typed).collect();
        assert_eq!(type_letters(&types).iter().collect::<String>(), expected, "{names:?}");
    }

    #[test]
    fn letters_come_from_the_names() {
        check(&["STALKER", "ZEALOT", "ZERGLING"], "SZG");
        check(&["goat", "ghost", "gg", "ZERGLING"], "OHAG");
        check(&["\u{e9}t\u{e9}", "", "7up"], "TA7");
    }

    #[test]
    fn many_types_share_an_asterisk() {
        let names: Vec<String> = (0..40).map(|i| format!("type{i}")).collect();
        let types: Vec<&str> = names.iter().map(String::as_str).collect();
        let marine = UnitType::standard("MARINE").unwrap();
        let all: Vec<UnitType> =
            types.iter().map(|name| UnitType { name: name.to_string(), ..marine.clone() }).collect();
        let letters = type_letters(&all);
        assert_eq!(letters.iter().filter(|letter| **letter == NONE_LEFT).count(), 4);
    }
}
