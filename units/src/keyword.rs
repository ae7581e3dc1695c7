//! Types whose values have fixed names in files and options.

use crate::file::{or_did_you_mean, shortened};

/// A type whose values have fixed names in files and options.
pub trait Keyword: Copy + PartialEq + 'static {
    /// Every keyword and its value, in the order in which error messages list them.
    const KEYWORDS: &'static [(&'static str, Self)];

    /// The value that a keyword names.
    fn from_name(name: &str) -> Option<Self> {
        Self::KEYWORDS.iter().find(|(keyword, _)| *keyword == name).map(|(_, value)| *value)
    }

    /// The keyword of this value; empty if it has none.
    fn name(self) -> &'static str {
        Self::KEYWORDS.iter().find(|(_, value)| *value == self).map_or("", |(keyword, _)| keyword)
    }

    /// All keywords.
    fn names() -> impl Iterator<Item = &'static str> {
        Self::KEYWORDS.iter().map(|(keyword, _)| *keyword)
    }
}

/// A text that is none of the keywords that an option accepts.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{option} must be {}, got `{}`{}",
    listed(expected),
    shortened(given),
    or_did_you_mean(given, expected.iter().copied())
)]
pub struct UnknownKeyword {
    option: &'static str,
    expected: Vec<&'static str>,
    given: String,
}

impl UnknownKeyword {
    /// The text `given` for an option whose values are those of `T`.
    pub fn new<T: Keyword>(option: &'static str, given: &str) -> UnknownKeyword {
        UnknownKeyword { option, expected: T::names().collect(), given: given.to_owned() }
    }
}

/// With commas, and the last after an "or".
fn listed(keywords: &[&str]) -> String {
    match keywords {
        [] => String::new(),
        [only] => format!("`{only}`"),
        [others @ .., last] => format!("`{}` or `{last}`", others.join("`, `")),
    }
}

/// Gives the type of an option its keywords, and reads and writes it by them. Errors name the option.
///
/// ```
/// use smaclite_units::{Keyword, keywords};
///
/// #[derive(Clone, Copy, Debug, PartialEq)]
/// enum Side {
///     Allies,
///     Both,
/// }
/// keywords!(Side, "sides", "allies" => Allies, "both" => Both);
///
/// assert_eq!((Side::Both.name(), Side::Allies.to_string()), ("both", "allies".to_owned()));
/// assert_eq!("both".parse::<Side>(), Ok(Side::Both));
/// let error = "botth".parse::<Side>().unwrap_err().to_string();
/// assert_eq!(error, "sides must be `allies` or `both`, got `botth` (did you mean `both`?)");
/// ```
#[macro_export]
macro_rules! keywords {
    ($type:ty, $option:literal, $($keyword:literal => $value:ident),+ $(,)?) => {
        impl $crate::Keyword for $type {
            const KEYWORDS: &'static [(&'static str, Self)] = &[$(($keyword, <$type>::$value)),+];
        }

        impl ::std::fmt::Display for $type {
            fn fmt(&self, f: &mut ::std::fmt::Formatter<'_>) -> ::std::fmt::Result {
                f.write_str($crate::Keyword::name(*self))
            }
        }

        impl ::std::str::FromStr for $type {
            type Err = $crate::UnknownKeyword;

            fn from_str(given: &str) -> ::std::result::Result<Self, $crate::UnknownKeyword> {
                let found = <Self as $crate::Keyword>::from_name(given);
                found.ok_or_else(|| $crate::UnknownKeyword::new::<Self>($option, given))
            }
        }
    };
}
