//! PNG files, and what animations need: checks of frames, and their durations.

use std::io::Write;

use png::{BitDepth, ColorType, Encoder};

use super::Picture;

/// Why a picture or animation was not written.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// Writing to the output failed.
    #[error("cannot write the picture: {0}")]
    Io(#[from] std::io::Error),
    /// The PNG encoder refused the picture.
    #[error("cannot encode the picture as PNG: {0}")]
    Png(#[source] png::EncodingError),
    /// The GIF encoder refused the picture.
    #[error("cannot encode the picture as GIF: {0}")]
    Gif(#[source] ::gif::EncodingError),
    /// There are no frames.
    #[error("an animation needs at least one frame, got none")]
    NoFrames,
    /// A frame has another size than the first.
    #[error(
        "all frames of an animation must have the same size: frame {frame} is {width} x {height}, \
         frame 0 is {first_width} x {first_height} pixels"
    )]
    FrameSize {
        /// The number of the frame, from 0.
        frame: usize,
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
        /// The width of the first frame.
        first_width: u32,
        /// The height of the first frame.
        first_height: u32,
    },
    /// A frame rate that is not a number above 0.
    #[error("the frame rate must be above 0 and at most 1000 frames per second, got {0}")]
    FrameRate(f64),
}

impl From<png::EncodingError> for EncodeError {
    fn from(error: png::EncodingError) -> EncodeError {
        match error {
            png::EncodingError::IoError(error) => EncodeError::Io(error),
            error => EncodeError::Png(error),
        }
    }
}

impl From<::gif::EncodingError> for EncodeError {
    fn from(error: ::gif::EncodingError) -> EncodeError {
        match error {
            ::gif::EncodingError::Io(error) => EncodeError::Io(error),
            error => EncodeError::Gif(error),
        }
    }
}

impl Picture {
    /// Writes a PNG file. Equal pictures give equal files.
    ///
    /// # Errors
    /// [`EncodeError::Io`] if the output cannot be written.
    pub fn write_png(&self, output: &mut dyn Write) -> Result<(), EncodeError> {
        let mut encoder = Encoder::new(output, self.width, self.height);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgb)?;
        Ok(writer.finish()?)
    }
}

pub(super) fn check_size(first: &Picture, frame: &Picture, number: usize) -> Result<(), EncodeError> {
    if (frame.width, frame.height) == (first.width, first.height) {
        return Ok(());
    }
    Err(EncodeError::FrameSize {
        frame: number,
        width: frame.width,
        height: frame.height,
        first_width: first.width,
        first_height: first.height,
    })
}

/// The durations of frames in whole units of time, which add up to the exact time of each frame.
pub(super) struct Delays {
    units_per_frame: f64,
    min: u16,
    frame: u64,
}

impl Delays {
    /// `units` per second; no duration is shorter than `min` units.
    pub fn new(frame_rate: f64, units: f64, min: u16) -> Result<Delays, EncodeError> {
        if !(frame_rate > 0.0 && frame_rate <= 1000.0) {
            return Err(EncodeError::FrameRate(frame_rate));
        }
        Ok(Delays { units_per_frame: units / frame_rate, min, frame: 0 })
    }
}

impl Iterator for Delays {
    type Item = u16;

    fn next(&mut self) -> Option<u16> {
        let end = |frame: u64| (frame as f64 * self.units_per_frame).round();
        let delay = end(self.frame + 1) - end(self.frame);
        self.frame += 1;
        // A number beyond the range of u16 becomes its largest value.
        Some((delay as u16).max(self.min))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_add_up() {
        let delays: Vec<u16> = Delays::new(16.0, 100.0, 2).unwrap().take(16).collect();
        assert_eq!(delays.iter().sum::<u16>(), 100, "{delays:?}");
        assert!(delays.iter().all(|delay| [6, 7].contains(delay)), "{delays:?}");
        assert_eq!(Delays::new(1e-6, 100.0, 2).unwrap().next(), Some(u16::MAX));
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Delays::new(rate, 100.0, 2).is_err(), "{rate}");
        }
    }
}
