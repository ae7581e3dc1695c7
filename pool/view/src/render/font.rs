//! Letters as outlines: Inter SemiBold 4.001 (SIL Open Font License, `font/OFL.txt`), reduced to ASCII and
//! without hints by `pyftsubset --unicodes=U+0020-007E --no-hinting --layout-features=`.

use std::sync::LazyLock;

use glam::Vec2;
use tiny_skia::{Path, PathBuilder, Transform};
use ttf_parser::{Face, OutlineBuilder};

static FONT: LazyLock<Font> = LazyLock::new(|| {
    // A test reads every letter, so the embedded font never fails here.
    Font::read(include_bytes!("font/Inter-SemiBold-subset.ttf")).unwrap_or_default()
});

/// The printable ASCII characters.
const CHARACTERS: std::ops::RangeInclusive<char> = ' '..='~';

/// Where a text is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// Centred on a point. A single letter is centred by its own shape.
    Middle(Vec2),
    /// Begins at a point of the base line.
    Start(Vec2),
}

/// The outlines of a font, scaled so that a capital has height 1; y grows downwards from the base line.
#[derive(Default)]
pub(crate) struct Font {
    glyphs: Vec<Glyph>,
}

#[derive(Default)]
struct Glyph {
    /// `None` for the space.
    outline: Option<Path>,
    advance: f32,
}

impl Font {
    pub fn embedded() -> &'static Font {
        &FONT
    }

    fn read(bytes: &[u8]) -> Option<Font> {
        let face = Face::parse(bytes, 0).ok()?;
        let scale = 1.0 / f32::from(face.capital_height()?);
        let glyph = |character| {
            let id = face.glyph_index(character)?;
            let mut outliner = Outliner { path: PathBuilder::new(), scale };
            face.outline_glyph(id, &mut outliner);
            let advance = f32::from(face.glyph_hor_advance(id)?) * scale;
            Some(Glyph { outline: outliner.path.finish(), advance })
        };
        Some(Font { glyphs: CHARACTERS.map(glyph).collect::<Option<_>>()? })
    }

    /// A character that the font lacks looks like a question mark.
    fn glyph(&self, character: char) -> Option<&Glyph> {
        let character = if CHARACTERS.contains(&character) { character } else { '?' };
        self.glyphs.get(character as usize - ' ' as usize)
    }

    /// The width of a text whose capitals are `height` high.
    pub fn width(&self, text: &str, height: f32) -> f32 {
        text.chars().filter_map(|character| self.glyph(character)).map(|glyph| glyph.advance).sum::<f32>()
            * height
    }

    /// The outlines of a text and the transforms that put them into a picture.
    pub fn lay_out(&self, text: &str, place: Place, height: f32) -> impl Iterator<Item = (&Path, Transform)> {
        let mut pen = match place {
            Place::Start(start) => start,
            Place::Middle(middle) => self.start_of_centred(text, middle, height),
        };
        text.chars().filter_map(move |character| {
            let glyph = self.glyph(character)?;
            let transform = Transform::from_row(height, 0.0, 0.0, height, pen.x, pen.y);
            pen.x += glyph.advance * height;
            Some((glyph.outline.as_ref()?, transform))
        })
    }

    fn start_of_centred(&self, text: &str, middle: Vec2, height: f32) -> Vec2 {
        let mut characters = text.chars();
        if let (Some(only), None) = (characters.next(), characters.next())
            && let Some(outline) = self.glyph(only).and_then(|glyph| glyph.outline.as_ref())
        {
            let bounds = outline.bounds();
            let centre = Vec2::new(bounds.left() + bounds.right(), bounds.top() + bounds.bottom()) / 2.0;
            return middle - centre * height;
        }
        middle + Vec2::new(-self.width(text, height), height) / 2.0
    }
}

/// Turns the outlines of a font file into paths.
struct Outliner {
    path: PathBuilder,
    scale: f32,
}

impl OutlineBuilder for Outliner {
    fn move_to(&mut self, x: f32, y: f32) {
        self.path.move_to(x * self.scale, -y * self.scale);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.path.line_to(x * self.scale, -y * self.scale);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let s = self.scale;
        self.path.quad_to(x1 * s, -y1 * s, x * s, -y * s);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let s = self.scale;
        self.path.cubic_to(x1 * s, -y1 * s, x2 * s, -y2 * s, x * s, -y * s);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_embedded_font_has_every_printable_character() {
        let font = Font::embedded();
        for character in CHARACTERS {
            let glyph = font.glyph(character).unwrap();
            assert_eq!(glyph.outline.is_some(), character != ' ', "{character:?}");
            assert!(glyph.advance > 0.0, "{character:?}");
        }
        let capital = font.glyph('H').and_then(|glyph| glyph.outline.as_ref()).unwrap().bounds();
        assert!((capital.height() - 1.0).abs() < 0.02 && capital.bottom().abs() < 0.02);
    }
}
