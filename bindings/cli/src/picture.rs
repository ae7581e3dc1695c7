//! Options of pictures, for the commands that draw.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use smaclite_view::{Picture, Theme};
use std::str::FromStr;

/// Width and height of a picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

#[derive(Debug, thiserror::Error)]
#[error(
    "must be WIDTHxHEIGHT, each between {} and {} pixels, such as 640x480",
    Picture::MIN_SIDE,
    Picture::MAX_SIDE
)]
pub(crate) struct InvalidSize;

impl FromStr for Size {
    type Err = InvalidSize;

    fn from_str(text: &str) -> Result<Size, InvalidSize> {
        let side = |text: &str| {
            let pixels = text.parse::<u32>().ok();
            pixels.filter(|pixels| (Picture::MIN_SIDE..=Picture::MAX_SIDE).contains(pixels))
        };
        let (width, height) = text.split_once('x').ok_or(InvalidSize)?;
        let (width, height) = side(width).zip(side(height)).ok_or(InvalidSize)?;
        Ok(Size { width, height })
    }
}

/// A parser of themes.
pub(crate) fn theme() -> impl TypedValueParser<Value = Theme> {
    let theme = |name: String| if name == "light" { Theme::Light } else { Theme::Dark };
    PossibleValuesParser::new(["dark", "light"]).map(theme)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_numbers_of_pixels() {
        assert_eq!("640x480".parse::<Size>().unwrap(), Size { width: 640, height: 480 });
        for text in ["640", "640x", "x480", "15x480", "640x4097", "640X480", "-640x480", "640x480x3"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
    }
}
