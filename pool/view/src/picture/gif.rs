//! Animated GIFs with one palette for all frames.

use std::io::Write;

use ::gif::{DisposalMethod, Encoder, Frame, Repeat};

use super::encode::{Delays, check_size};
use super::palette::{Colours, Palette};
use super::{Area, EncodeError, Picture};

/// GIF measures time in hundredths of a second, and browsers slow frames down that are shorter than two.
const UNITS_PER_SECOND: f64 = 100.0;
const SHORTEST_FRAME: u16 = 2;

/// Writes an animated GIF of `n_frames` that repeats without end. `frame_rate` is in frames per second;
/// frames are not shown faster than 50 per second.
///
/// The 255 colours of the palette are chosen from all frames, so each frame is drawn twice, instead of being
/// kept in memory. Equal frames give equal files.
///
/// # Errors
/// [`EncodeError`] if there are no frames, their sizes differ, the rate is not usable, or the output
/// cannot be written.
pub fn write_gif(
    output: &mut dyn Write,
    n_frames: usize,
    draw: &dyn Fn(usize) -> Picture,
    frame_rate: f64,
) -> Result<(), EncodeError> {
    let delays = Delays::new(frame_rate, UNITS_PER_SECOND, SHORTEST_FRAME)?;
    if n_frames == 0 {
        return Err(EncodeError::NoFrames);
    }
    let first = draw(0);
    let mut colours = Colours::new();
    colours.count(&first);
    for i in 1..n_frames {
        let frame = draw(i);
        check_size(&first, &frame, i)?;
        colours.count(&frame);
    }
    let palette = colours.palette();
    let side = |pixels: u32| u16::try_from(pixels).unwrap_or(u16::MAX);
    let mut encoder = Encoder::new(output, side(first.width), side(first.height), palette.rgb())?;
    encoder.set_repeat(Repeat::Infinite)?;
    let mut before: Option<Picture> = None;
    for (frame, delay) in (0..n_frames).map(draw).zip(delays) {
        let area = before.as_ref().map_or(Area::whole(&frame), |before| frame.changed_area(before));
        encoder.write_frame(&Frame {
            delay,
            dispose: DisposalMethod::Keep,
            transparent: Some(Palette::TRANSPARENT),
            left: side(area.x),
            top: side(area.y),
            width: side(area.width),
            height: side(area.height),
            buffer: indices(&palette, &frame, before.as_ref(), area).into(),
            ..Frame::default()
        })?;
        before = Some(frame);
    }
    Ok(())
}

/// The palette's indices of a rectangle; pixels that have not changed are transparent, which compresses well.
fn indices(palette: &Palette, frame: &Picture, before: Option<&Picture>, area: Area) -> Vec<u8> {
    let Some(before) = before else {
        return frame.rows(area).flat_map(|row| row.chunks_exact(3)).map(|rgb| palette.index(rgb)).collect();
    };
    let rows = frame.rows(area).zip(before.rows(area));
    let pixels = rows.flat_map(|(row, old)| row.chunks_exact(3).zip(old.chunks_exact(3)));
    let index = |(rgb, old)| if rgb == old { Palette::TRANSPARENT } else { palette.index(rgb) };
    pixels.map(index).collect()
}
