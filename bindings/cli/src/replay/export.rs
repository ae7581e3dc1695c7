//! The files that a replay can be converted to.

use super::super::CommandResult;
use super::super::files::{check_file_of, check_folder_of, write_file};
use super::super::process::{Interrupted, interruption};
use super::super::snapshot;
use smaclite_scenarios::Scenario;
use smaclite_units::file::os::partial_folder;
use smaclite_units::file::partial_file;
use smaclite_view::{Moment, Options, Picture, Renderer, write_gif};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// A page for browsers.
    Page,
    /// An animated GIF.
    Gif,
    /// A film, by ffmpeg.
    Mp4,
    /// A folder of PNG files.
    Frames,
    /// The state before a step.
    Snapshot,
}

/// A file or folder to write, and the format that its name says.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub path: PathBuf,
    pub format: Format,
}

impl Target {
    pub(super) fn new(path: PathBuf) -> Result<Target, &'static str> {
        let format = match path.extension().map(|suffix| suffix.to_string_lossy()).as_deref() {
            Some("html") => Format::Page,
            Some("gif") => Format::Gif,
            Some("mp4") => Format::Mp4,
            Some(snapshot::SUFFIX) => Format::Snapshot,
            None if path.file_name().is_some() => Format::Frames,
            _ => {
                return Err(
                    "must end in .html, .gif, .mp4 or .snapshot, or be a new folder without a suffix",
                );
            }
        };
        Ok(Target { path, format })
    }
}

impl Format {
    /// Its name in messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Format::Page => "a page, which plays all episodes",
            Format::Gif => "a GIF",
            Format::Mp4 => "an MP4 file",
            Format::Frames => "a folder of pictures",
            Format::Snapshot => "a snapshot",
        }
    }
}

/// Writes an episode, one frame per tick. Animations show the last moment for one second, so that the end is
/// seen before they repeat.
pub(super) fn write(
    to: &Target,
    scenario: &Scenario,
    options: Options,
    moments: &[Moment],
    fps: f64,
) -> CommandResult {
    let renderer = Renderer::new(scenario, options)?;
    let draw = |i: usize| renderer.render_recent(&moments[..=i.min(moments.len() - 1)]);
    let n_frames = moments.len() + fps.round() as usize;
    let path = &to.path;
    match to.format {
        Format::Gif => {
            // Drawn before the file is begun: a signal may end the program meanwhile.
            check_file_of("--to", path)?;
            let mut gif = Vec::new();
            write_gif(&mut gif, n_frames, &draw, fps)
                .map_err(|error| format!("{}: {error}", path.display()))?;
            write_file(path, |output| output.write_all(&gif))
        }
        Format::Mp4 => write_mp4(path, options, (0..n_frames).map(draw), fps),
        Format::Frames => write_folder(path, (0..moments.len()).map(draw)),
        Format::Page | Format::Snapshot => Err(format!("{} is not made of frames", to.format.name()).into()),
    }
}

fn write_folder(folder: &Path, frames: impl ExactSizeIterator<Item = Picture>) -> CommandResult {
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    check_folder_of("--to", folder)?;
    if folder.exists() {
        return Err(format!("{}: exists; --to must be a new folder", folder.display()).into());
    }
    // Whole or not at all: in another folder, which gets the name at the end.
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let interrupted = interruption()?;
    let partial = partial_folder().tempdir_in(parent).map_err(failed)?;
    let digits = frames.len().to_string().len();
    for (i, frame) in frames.enumerate() {
        if interrupted() {
            return Err(Interrupted.into());
        }
        let file = partial.path().join(format!("{i:0digits$}.png"));
        write_file(&file, |output| frame.write_png(output)).map_err(|error| {
            let named = |path: &Path| path.display().to_string();
            error.to_string().replace(&named(partial.path()), &named(folder))
        })?;
    }
    std::fs::rename(partial.path(), folder).map_err(failed)?;
    let _ = partial.keep(); // it has another name now
    Ok(())
}

/// Pipes frames to ffmpeg, which the user installs.
fn write_mp4(to: &Path, options: Options, frames: impl Iterator<Item = Picture>, fps: f64) -> CommandResult {
    let (size, rate) = (format!("{}x{}", options.width, options.height), fps.to_string());
    let mut command = Command::new("ffmpeg");
    command.args(["-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", &size, "-r", &rate]);
    // Players need yuv420p, and that needs even sides.
    command.args(["-i", "-", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-y"]);
    let interrupted = interruption()?;
    let partial = partial_file(to, ".mp4").map_err(|error| format!("{}: {error}", to.display()))?;
    let partial = partial.into_temp_path();
    let mut file = std::ffi::OsString::from("file:"); // a name with a colon or a dash is a name
    file.push(&partial);
    let child = command.arg(file).stdin(Stdio::piped()).stdout(Stdio::null()).spawn();
    let mut child = child.map_err(|error| match error.kind() {
        ErrorKind::NotFound => "an MP4 file needs the program ffmpeg, which is not installed; \
            install it, or choose .gif or .html"
            .to_owned(),
        _ => format!("ffmpeg: {error}"),
    })?;
    let mut written = Ok(());
    if let Some(mut input) = child.stdin.take() {
        let mut frames = frames.take_while(|_| !interrupted());
        written = frames.try_for_each(|frame| input.write_all(frame.rgb()));
    } // ffmpeg ends when its input is closed
    let status = child.wait()?;
    if interrupted() {
        return Err(Interrupted.into());
    }
    match (status.success(), written) {
        (true, Ok(())) => Ok(partial.persist(to).map_err(|error| format!("{}: {error}", to.display()))?),
        (true, Err(error)) => Err(format!("ffmpeg: {error}").into()),
        (false, _) => Err(format!("{}: ffmpeg failed ({status}); it says above why", to.display()).into()),
    }
}
