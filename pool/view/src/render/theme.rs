//! The colours of a picture. Both factions differ in colour and in shape, see `shapes`.
//!
//! Blue and orange are the pair that stays distinct under every common colour vision deficiency (Okabe and
//! Ito, "Color Universal Design", 2008); nothing else in a picture is as saturated as they are.

use smaclite_scenarios::Faction;

/// The background and contrast of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Theme {
    /// Light units on a dark map.
    #[default]
    Dark,
    /// Dark units on a light map.
    Light,
}

/// A colour: red, green, blue, and opacity from 0 to 255.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Ink([u8; 4]);

impl Ink {
    const fn new(rgb: u32) -> Ink {
        let [_, r, g, b] = rgb.to_be_bytes();
        Ink([r, g, b, 255])
    }

    /// The same colour with `share` of its opacity.
    pub fn fade(self, share: f32) -> Ink {
        let Ink([r, g, b, a]) = self;
        Ink([r, g, b, (f32::from(a) * share.clamp(0.0, 1.0)).round() as u8])
    }

    pub fn rgba(self) -> [u8; 4] {
        self.0
    }
}

/// The colours of a faction.
#[derive(Debug)]
pub(crate) struct Side {
    /// The part of a body that stands for health.
    pub body: Ink,
    /// The part of a body that stands for lost health.
    pub lost: Ink,
    /// Lines and marks on the floor.
    pub line: Ink,
}

/// The colours of a theme.
#[derive(Debug)]
pub(crate) struct Palette {
    /// Outside the map.
    pub void: Ink,
    pub blocked: Ink,
    /// The sides of blocked squares that face south, which give the map depth.
    pub wall: Ink,
    /// The outline of blocked squares, and the border of the map.
    pub edge: Ink,
    pub floor: Ink,
    pub grid: Ink,
    ally: Side,
    enemy: Side,
    /// Letters on bodies.
    pub letter: Ink,
    pub text: Ink,
    pub shadow: Ink,
    pub shield: Ink,
    pub energy: Ink,
    pub cooldown: Ink,
    pub heal: Ink,
    pub spark: Ink,
}

impl Palette {
    pub fn side(&self, faction: Faction) -> &Side {
        match faction {
            Faction::Ally => &self.ally,
            Faction::Enemy => &self.enemy,
        }
    }
}

impl Theme {
    pub(crate) fn palette(self) -> &'static Palette {
        match self {
            Theme::Dark => &DARK,
            Theme::Light => &LIGHT,
        }
    }
}

const DARK: Palette = Palette {
    void: Ink::new(0x0d1117),
    blocked: Ink::new(0x141a22),
    wall: Ink::new(0x0f141b),
    edge: Ink::new(0x35404f),
    floor: Ink::new(0x222a35),
    grid: Ink::new(0x28313d),
    ally: Side { body: Ink::new(0x2b8ce6), lost: Ink::new(0x123150), line: Ink::new(0x6db8ff) },
    enemy: Side { body: Ink::new(0xe5731a), lost: Ink::new(0x4d260a), line: Ink::new(0xffa45c) },
    letter: Ink::new(0xffffff),
    text: Ink::new(0xe6edf3),
    shadow: Ink::new(0x000000),
    shield: Ink::new(0x5fe0f0),
    energy: Ink::new(0xc9a2ff),
    cooldown: Ink::new(0xffffff),
    heal: Ink::new(0x7ee8b5),
    spark: Ink::new(0xffe9a8),
};

const LIGHT: Palette = Palette {
    void: Ink::new(0xffffff),
    blocked: Ink::new(0xe1e4e8),
    wall: Ink::new(0xccd1d8),
    edge: Ink::new(0xb4bbc5),
    floor: Ink::new(0xf8f9fb),
    grid: Ink::new(0xeff1f4),
    ally: Side { body: Ink::new(0x1a73c8), lost: Ink::new(0x0f3d69), line: Ink::new(0x1a73c8) },
    enemy: Side { body: Ink::new(0xd95f0e), lost: Ink::new(0x6b3009), line: Ink::new(0xd95f0e) },
    letter: Ink::new(0xffffff),
    text: Ink::new(0x1f2933),
    shadow: Ink::new(0x3a4656),
    shield: Ink::new(0x35b3d9),
    energy: Ink::new(0x8b5cf6),
    cooldown: Ink::new(0xffffff),
    heal: Ink::new(0x12a066),
    spark: Ink::new(0xe8a300),
};

#[cfg(test)]
mod tests {
    use super::*;

    const STYLE: &str = include_str!("../../page/style.css");

    /// The hue of a colour, in degrees.
    fn hue([r, g, b]: [u8; 3]) -> f32 {
        let [r, g, b] = [r, g, b].map(f32::from);
        let (most, least) = (r.max(g).max(b), r.min(g).min(b));
        let sixth = match most {
            _ if most == r => (g - b) / (most - least),
            _ if most == g => (b - r) / (most - least) + 2.0,
            _ => (r - g) / (most - least) + 4.0,
        };
        (sixth * 60.0).rem_euclid(360.0)
    }

    /// A colour of the style sheet's `theme`-th block of rules.
    fn of_page(theme: usize, name: &str) -> [u8; 3] {
        let rules = STYLE.split('}').nth(theme).unwrap();
        let (_, colour) = rules.split_once(&format!("--{name}: #")).unwrap();
        let part = |at| u8::from_str_radix(&colour[at..at + 2], 16).unwrap();
        [part(0), part(2), part(4)]
    }

    /// The tones differ, because a page draws larger units on another ground; a reader must still know them.
    #[test]
    fn pictures_and_pages_have_the_same_hues() {
        for (theme, palette) in [&DARK, &LIGHT].into_iter().enumerate() {
            let colours = [
                ("ally", palette.ally.body),
                ("enemy", palette.enemy.body),
                ("shield", palette.shield),
                ("energy", palette.energy),
                ("heal", palette.heal),
            ];
            for (name, ink) in colours {
                let Ink([r, g, b, _]) = ink;
                let (page, picture) = (hue(of_page(theme, name)), hue([r, g, b]));
                let away = ((page - picture + 540.0).rem_euclid(360.0) - 180.0).abs();
                assert!(away <= 15.0, "{name}: {page} degrees in style.css, {picture} in theme.rs");
            }
        }
    }
}
