//! PNG and GIF, read back.

use smaclite_view::{EncodeError, Options, Picture, Renderer, View, write_gif};

use crate::kit::*;

/// The pixels of a PNG file as RGB; `None` if it is no PNG file.
pub fn png_pixels(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().ok()?;
    let mut pixels = vec![0; reader.output_buffer_size()?];
    let output = reader.next_frame(&mut pixels).ok()?;
    pixels.truncate(output.buffer_size());
    Some(pixels)
}

/// The frames of a GIF as RGB, each drawn over the one before, and their delays in hundredths of a second.
fn gif_frames(bytes: &[u8]) -> Vec<(Vec<u8>, u16)> {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(bytes).unwrap();
    let width = usize::from(decoder.width());
    let mut canvas = vec![0; width * usize::from(decoder.height()) * 3];
    let mut frames = Vec::new();
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        let (left, top) = (usize::from(frame.left), usize::from(frame.top));
        for (i, rgba) in frame.buffer.chunks_exact(4).enumerate().filter(|(_, rgba)| rgba[3] > 0) {
            let (x, y) = (left + i % usize::from(frame.width), top + i / usize::from(frame.width));
            canvas[(y * width + x) * 3..][..3].copy_from_slice(&rgba[..3]);
        }
        frames.push((canvas.clone(), frame.delay));
    }
    frames
}

/// An animation of a battle.
fn pictures() -> Vec<Picture> {
    let scenario = standard("bane_vs_bane");
    let moments = play(&scenario, 9);
    let options = Options { view: View::around(&scenario, &moments[40..], 1.0), ..size(120, 80) };
    let renderer = Renderer::new(&scenario, options).unwrap();
    (40..moments.len()).map(|end| renderer.render_recent(&moments[..end])).collect()
}

#[test]
fn png_is_lossless() {
    let picture = pictures().remove(0);
    let mut png = Vec::new();
    picture.write_png(&mut png).unwrap();
    assert_eq!(png_pixels(&png).as_deref(), Some(picture.rgb()));
}

#[test]
fn gif_frames_are_close() {
    let pictures = pictures();
    let mut file = Vec::new();
    write_gif(&mut file, pictures.len(), &|i| pictures[i].clone(), 16.0).unwrap();
    let frames = gif_frames(&file);
    assert_eq!(frames.len(), pictures.len());
    for (i, ((rgb, delay), picture)) in frames.iter().zip(&pictures).enumerate() {
        let differences = rgb.iter().zip(picture.rgb()).map(|(a, b)| f64::from(a.abs_diff(*b)));
        let (sum, max) = differences.fold((0.0, 0.0), |(sum, max), d| (sum + d, f64::max(max, d)));
        let mean = sum / rgb.len() as f64;
        assert!(mean < 1.5 && max < 64.0, "frame {i} differs by {mean} in the mean, and at most by {max}");
        assert!([6, 7].contains(delay), "frame {i}: {delay} hundredths of a second");
    }
    let mut again = Vec::new();
    write_gif(&mut again, pictures.len(), &|i| pictures[i].clone(), 16.0).unwrap();
    assert!(file == again, "equal frames give equal files");
}

#[test]
fn frames_that_make_no_animation_are_errors() {
    let frames = pictures();
    let scenario = standard("3m");
    let other = render(&scenario, size(64, 64), &[]);
    let mixed = [frames[0].clone(), other];
    let check = |frames: &[Picture], rate: f64, expected: &str| {
        let error = write_gif(&mut Vec::new(), frames.len(), &|i| frames[i].clone(), rate).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    };
    check(&[], 16.0, "at least one frame");
    check(&frames, 0.0, "above 0");
    check(&frames, f64::NAN, "above 0");
    check(&mixed, 16.0, "frame 1 is 64 x 64, frame 0 is 120 x 80");
}

#[test]
fn a_closed_output_is_an_error() {
    struct Closed;
    impl std::io::Write for Closed {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::BrokenPipe.into())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let frames = pictures();
    let gif = write_gif(&mut Closed, frames.len(), &|i| frames[i].clone(), 16.0);
    let results = [frames[0].write_png(&mut Closed), gif];
    for result in results {
        assert!(matches!(result, Err(EncodeError::Io(_))), "{result:?}");
    }
}
