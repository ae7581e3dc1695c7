//! Pictures as bytes. `encode` writes PNG files, `gif` animated GIFs, `sheet` puts many pictures into one.

mod encode;
mod gif;
mod palette;
mod sheet;

pub use encode::EncodeError;
pub use gif::write_gif;
pub use sheet::{Cell, Sheet};

use tiny_skia::Pixmap;

/// A picture: rows from top to bottom, pixels from left to right.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct Picture {
    width: u32,
    height: u32,
    rgb: Vec<u8>,
}

/// A width or height that a picture cannot have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "a picture's width and height must be between {} and {max_side} pixels, got {width} x {height}",
    Picture::MIN_SIDE
)]
pub struct SizeError {
    /// The width in pixels.
    pub width: u32,
    /// The height in pixels.
    pub height: u32,
    /// The largest width and height: [`Picture::MAX_SIDE`], or that of a [`Sheet`].
    pub max_side: u32,
}

impl SizeError {
    pub(crate) fn check(width: u32, height: u32) -> Result<(), SizeError> {
        let max_side = Picture::MAX_SIDE;
        let sides = Picture::MIN_SIDE..=max_side;
        let is_valid = sides.contains(&width) && sides.contains(&height);
        if is_valid { Ok(()) } else { Err(SizeError { width, height, max_side }) }
    }
}

impl Picture {
    /// The smallest width and height of a picture of a battle, in pixels.
    pub const MIN_SIDE: u32 = 16;
    /// The largest width and height of a picture of a battle, in pixels: a picture has at most 48 MiB.
    pub const MAX_SIDE: u32 = 4096;

    pub(crate) fn from_pixels(pixels: Pixmap) -> Picture {
        let (width, height) = (pixels.width(), pixels.height());
        // Pictures begin with an opaque background, so the alpha of every pixel is 255.
        let mut rgb = vec![0; pixels.data().len() / 4 * 3];
        for (rgb, rgba) in rgb.chunks_exact_mut(3).zip(pixels.data().chunks_exact(4)) {
            rgb.copy_from_slice(&rgba[..3]);
        }
        Picture { width, height, rgb }
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Red, green and blue of every pixel: u8 `[height, width, 3]`.
    pub fn rgb(&self) -> &[u8] {
        &self.rgb
    }

    /// The same bytes, without a copy.
    pub fn into_rgb(self) -> Vec<u8> {
        self.rgb
    }

    /// The colour at `x` pixels from the left and `y` from the top; `None` outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 3]> {
        let at = (y as usize * self.width as usize + x as usize) * 3;
        let is_inside = x < self.width && y < self.height;
        is_inside.then(|| [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]])
    }

    /// The bytes of a rectangle, row by row.
    fn rows(&self, area: Area) -> impl Iterator<Item = &[u8]> {
        let row = self.width as usize * 3;
        let rows = self.rgb.chunks_exact(row).skip(area.y as usize).take(area.height as usize);
        rows.map(move |row| &row[area.x as usize * 3..(area.x + area.width) as usize * 3])
    }

    /// The smallest rectangle outside of which two pictures of one size are equal; one pixel if they are
    /// equal.
    fn changed_area(&self, before: &Picture) -> Area {
        let row = self.width as usize * 3;
        let pairs = || self.rgb.chunks_exact(row).zip(before.rgb.chunks_exact(row));
        let is_changed = |(a, b): (&[u8], &[u8])| a != b;
        let Some(top) = pairs().position(is_changed) else {
            return Area { x: 0, y: 0, width: 1, height: 1 };
        };
        let bottom = pairs().rposition(is_changed).unwrap_or(top);
        let (mut left, mut right) = (row, 0);
        for (a, b) in pairs().skip(top).take(bottom - top + 1) {
            let mut differences = a.iter().zip(b).enumerate().filter(|(_, (a, b))| a != b).map(|(i, _)| i);
            left = left.min(differences.next().unwrap_or(row));
            right = right.max(a.iter().zip(b).rposition(|(a, b)| a != b).unwrap_or(0));
        }
        let (left, right) = ((left / 3) as u32, (right / 3) as u32);
        Area { x: left, y: top as u32, width: right - left + 1, height: (bottom - top + 1) as u32 }
    }
}

impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Picture").field("width", &self.width).field("height", &self.height).finish()
    }
}

/// A rectangle of a picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Area {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl Area {
    fn whole(picture: &Picture) -> Area {
        Area { x: 0, y: 0, width: picture.width, height: picture.height }
    }
}
