//! Contact sheets: many pictures with captions in one.

use glam::Vec2;

use super::{Picture, SizeError};
use crate::render::{Canvas, Font, Place, Theme};

/// The largest side of a sheet, in pixels.
const MAX_SIDE: u32 = 16384;

/// A picture of a sheet.
#[derive(Clone, Copy, Debug)]
pub struct Cell<'a> {
    /// The picture.
    pub picture: &'a Picture,
    /// The text above it; shortened if it is too wide. Characters that are not ASCII become question marks.
    pub caption: &'a str,
}

/// How pictures are put together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sheet {
    /// Pictures per row; 0 for a number that makes the sheet nearly square.
    pub columns: usize,
    /// Background and text.
    pub theme: Theme,
}

impl Sheet {
    /// Puts pictures into rows from left to right, each with its caption above it. All cells are as large as
    /// the largest picture. Without a picture the sheet is empty: [`Picture::MIN_SIDE`] pixels of background.
    ///
    /// # Errors
    /// A sheet that would be wider or higher than 16384 pixels; the error has the size that it would have.
    pub fn compose(&self, cells: &[Cell<'_>]) -> Result<Picture, SizeError> {
        let largest = |side: fn(&Picture) -> u32| cells.iter().map(|cell| side(cell.picture)).max();
        let width = largest(Picture::width).unwrap_or(Picture::MIN_SIDE);
        let height = largest(Picture::height).unwrap_or(Picture::MIN_SIDE);
        let layout = Layout::new(self, cells.len(), width, height);
        let (width, height) = layout.checked_size()?;
        let error = SizeError { width, height, max_side: MAX_SIDE };
        let mut sheet = self.background(width, height).ok_or(error)?;
        for (i, cell) in cells.iter().enumerate() {
            let (x, y) = layout.corner(i);
            let caption = self.caption(cell.caption, &layout).ok_or(error)?;
            sheet.paste(&caption, x, y);
            let (cell_width, cell_height) = layout.cell;
            let x = x + (cell_width - cell.picture.width) / 2;
            let y = y + layout.caption + (cell_height - cell.picture.height) / 2;
            sheet.paste(cell.picture, x, y);
        }
        Ok(sheet)
    }

    /// The width and height in pixels of a sheet of `count` pictures of one size.
    ///
    /// # Errors
    /// As for [`compose`](Self::compose).
    pub fn size(&self, count: usize, width: u32, height: u32) -> Result<(u32, u32), SizeError> {
        Layout::new(self, count, width, height).checked_size()
    }

    fn background(&self, width: u32, height: u32) -> Option<Picture> {
        let [r, g, b, _] = self.theme.palette().void.rgba();
        let rgb = [r, g, b].repeat(width as usize * height as usize);
        Some(Picture { width, height, rgb })
    }

    fn caption(&self, text: &str, layout: &Layout) -> Option<Picture> {
        let palette = self.theme.palette();
        let mut canvas = Canvas::new(layout.cell.0, layout.caption, palette.void)?;
        let height = layout.caption as f32 * 0.42;
        let text = shortened(text, layout.cell.0 as f32, height);
        let base = Vec2::new(0.0, layout.caption as f32 * 0.66);
        canvas.text(&text, Place::Start(base), height, palette.text);
        Some(Picture::from_pixels(canvas.into_pixels()))
    }
}

fn clamped(pixels: u64) -> u32 {
    u32::try_from(pixels).unwrap_or(u32::MAX)
}

/// A text that fits, with dots for what is left out.
fn shortened(text: &str, width: f32, height: f32) -> String {
    let font = Font::embedded();
    if font.width(text, height) <= width {
        return text.into();
    }
    let dots = "...";
    let mut kept = String::new();
    for character in text.chars() {
        kept.push(character);
        if font.width(&kept, height) + font.width(dots, height) > width {
            kept.pop();
            break;
        }
    }
    kept + dots
}

/// The positions of cells, in pixels.
struct Layout {
    columns: usize,
    rows: usize,
    cell: (u32, u32),
    caption: u32,
    gap: u32,
}

impl Layout {
    fn new(sheet: &Sheet, count: usize, width: u32, height: u32) -> Layout {
        let square = count.isqrt() + usize::from(count.isqrt().pow(2) < count);
        let columns = if sheet.columns > 0 { sheet.columns } else { square }.min(count).max(1);
        let gap = (width / 24).clamp(2, 32);
        let caption = (width / 8).clamp(10, 40);
        Layout { columns, rows: count.div_ceil(columns), cell: (width, height), caption, gap }
    }

    fn checked_size(&self) -> Result<(u32, u32), SizeError> {
        let (width, height) = self.size();
        let size = SizeError { width: clamped(width), height: clamped(height), max_side: MAX_SIDE };
        let fits = width.max(height) <= u64::from(MAX_SIDE);
        if fits { Ok((size.width, size.height)) } else { Err(size) }
    }

    fn size(&self) -> (u64, u64) {
        let (width, height) = (u64::from(self.cell.0), u64::from(self.cell.1) + u64::from(self.caption));
        let gap = u64::from(self.gap);
        let sum = |n: usize, side: u64| (n as u64).saturating_mul(side + gap).saturating_add(gap);
        (sum(self.columns, width), sum(self.rows, height))
    }

    /// The upper left corner of a cell, where its caption begins.
    fn corner(&self, i: usize) -> (u32, u32) {
        let (column, row) = ((i % self.columns) as u32, (i / self.columns) as u32);
        let (width, height) = (self.cell.0 + self.gap, self.cell.1 + self.caption + self.gap);
        (self.gap + column * width, self.gap + row * height)
    }
}

impl Picture {
    /// Copies a picture into this one, which is large enough, with its upper left corner at (x, y).
    fn paste(&mut self, picture: &Picture, x: u32, y: u32) {
        let row = self.width as usize * 3;
        let start = x as usize * 3;
        let rows = self.rgb.chunks_exact_mut(row).skip(y as usize);
        for (to, from) in rows.zip(picture.rgb.chunks_exact(picture.width as usize * 3)) {
            to[start..start + from.len()].copy_from_slice(from);
        }
    }
}
