//! `smaclite-pool replay`: verifies a replay, or converts it to a page, an animation or pictures.

mod export;

use super::CommandResult;
use super::files::write_file;
use super::picture::{Size, theme};
use crate::number::count;
use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args, ValueHint};
use export::{Format, Target};
use smaclite_view::{Episode, Options, Replay as ReplayFile, Theme, View};
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "\
Examples:
    smaclite-pool replay 2s3z.smreplay                  play every episode again and compare it
    smaclite-pool replay 2s3z.smreplay --to 2s3z.html   a page for any browser
    smaclite-pool replay 2s3z.smreplay --to 2s3z.gif --episode 1 --fps 8   half speed
    smaclite-pool replay 2s3z.smreplay --to 2s3z.snapshot --step 20   to branch from")]
pub(super) struct Replay {
    /// The replay file
    file: PathBuf,
    /// What to write: NAME.html (a page with all episodes), NAME.gif (an animation), NAME.mp4 (needs ffmpeg),
    /// a new folder for one PNG file per tick, or NAME.snapshot (the state before a step, from which battles
    /// branch); a file of that name is replaced
    #[arg(long, value_name = "OUT", value_hint = ValueHint::AnyPath,
        value_parser = PathBufValueParser::new().try_map(Target::new))]
    to: Option<Target>,
    /// The episode of an animation, folder or snapshot, counted from 0 [default: 0]
    #[arg(long, value_name = "N", requires = "to", value_parser = count(0..=usize::MAX))]
    episode: Option<usize>,
    /// How many steps of the episode are played in a snapshot [default: 0]
    #[arg(long, value_name = "N", requires = "to", value_parser = count(0..=usize::MAX))]
    step: Option<usize>,
    /// Width and height of pictures in pixels [default: 512x512]
    #[arg(long, value_name = "WxH", requires = "to")]
    size: Option<Size>,
    /// Frames per second of an animation, one frame per tick: 16 is the speed of the battle [default: 16]
    #[arg(long, value_name = "F", requires = "to")]
    fps: Option<f64>,
    /// Background of pictures [default: dark]
    #[arg(long, requires = "to", value_parser = theme())]
    theme: Option<Theme>,
}

/// Ticks per second of a battle.
const TICKS_PER_SECOND: f64 = 16.0;

/// Frame rates that every format can express.
const MAX_FPS: f64 = 1000.0;
/// A frame of a GIF lasts at most 655 seconds.
const MIN_FPS: f64 = 0.01;

/// Browsers show the frames of a GIF for at least two hundredths of a second.
const MAX_GIF_FPS: f64 = 50.0;

/// Squares around the units of an animation.
const MARGIN: f32 = 2.0;

impl Replay {
    pub(super) fn run(self) -> CommandResult {
        // Options are checked before the battles are played again.
        if let Some(to) = &self.to {
            self.check_options(to.format)?;
        }
        let replay = ReplayFile::read(&self.file)?;
        let file = self.file.display();
        match &self.to {
            Some(Target { path, format: Format::Page }) => {
                let page = smaclite_view::export_html(&replay).map_err(|error| format!("{file}: {error}"))?;
                write_file(path, |output| output.write_all(page.as_bytes()))?;
            }
            Some(Target { path, format: Format::Snapshot }) => self.save_snapshot(&replay, path)?,
            Some(to) => self.animate(&replay, to)?,
            None => self.print_summary(&replay)?,
        }
        Ok(())
    }

    /// Refuses options that would have no effect.
    fn check_options(&self, format: Format) -> CommandResult {
        let has_pictures = !matches!(format, Format::Page | Format::Snapshot);
        let has_rate = has_pictures && format != Format::Frames;
        let options = [
            ("--episode", self.episode.is_some(), format != Format::Page),
            ("--step", self.step.is_some(), format == Format::Snapshot),
            ("--size", self.size.is_some(), has_pictures),
            ("--theme", self.theme.is_some(), has_pictures),
            ("--fps", self.fps.is_some(), has_rate),
        ];
        let unused = options.into_iter().find(|(_, is_given, has_effect)| *is_given && !has_effect);
        if let Some((option, ..)) = unused {
            return Err(format!("{option} has no effect on {}; leave it out", format.name()).into());
        }
        // What a GIF cannot show faster would only end in a longer standstill.
        let most = if format == Format::Gif { MAX_GIF_FPS } else { MAX_FPS };
        match self.fps {
            Some(fps) if !(MIN_FPS..=most).contains(&fps) => {
                let what = format.name();
                Err(format!("--fps must be between {MIN_FPS} and {most} for {what}, got {fps}").into())
            }
            _ => Ok(()),
        }
    }

    fn animate(&self, replay: &ReplayFile, to: &Target) -> CommandResult {
        let failed = |error| format!("{}: {error}", self.file.display());
        let player = replay.play(self.episode.unwrap_or(0)).map_err(failed)?;
        let moments = player.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let scenario = replay.setup().rules.figures(replay.scenario());
        let mut options = Options { view: View::around(&scenario, &moments, MARGIN), ..Options::default() };
        if let Some(size) = self.size {
            (options.width, options.height) = (size.width, size.height);
        }
        options.theme = self.theme.unwrap_or_default();
        let fps = self.fps.unwrap_or(TICKS_PER_SECOND);
        export::write(to, &scenario, options, &moments, fps)
    }

    /// Writes the state before a step, as a record that pools of the same scenario restore.
    fn save_snapshot(&self, replay: &ReplayFile, to: &Path) -> CommandResult {
        let failed = |error| format!("{}: {error}", self.file.display());
        let mut player = replay.play(self.episode.unwrap_or(0)).map_err(failed)?;
        player.seek(self.step.unwrap_or(0)).map_err(failed)?;
        write_file(to, |output| output.write_all(&player.battle().record()))
    }

    /// Plays all episodes again, and prints what they are.
    fn print_summary(&self, replay: &ReplayFile) -> CommandResult {
        out!("scenario: {}", replay.scenario().name)?;
        out!("rules: {}", replay.setup().rules)?;
        out!("recorded by: {}", replay.program())?;
        out!("episodes: {}", replay.episodes().len())?;
        for (i, episode) in replay.episodes().iter().enumerate() {
            for moment in replay.play(i)? {
                moment.map_err(|error| format!("{}: {error}", self.file.display()))?;
            }
            out!("episode {i}: {}; reproduced", describe(replay, episode))?;
        }
        Ok(())
    }
}

/// Prints the episodes of a replay that was just written.
pub(crate) fn print_recorded(replay: &ReplayFile, file: &Path) -> CommandResult {
    for (i, episode) in replay.episodes().iter().enumerate() {
        out!("episode {i}: {}", describe(replay, episode))?;
    }
    let bytes = std::fs::metadata(file)?.len();
    out!("{}: {bytes} bytes", file.display())?;
    Ok(())
}

/// How an episode ended.
fn describe(replay: &ReplayFile, episode: &Episode) -> String {
    let outcome = &episode.outcome;
    let end = outcome.result().map_or("recorded for".to_owned(), |result| format!("{} after", result.name()));
    let sizes = replay.arena().sizes();
    format!(
        "{end} {} steps, return {:.2}, dead: {} of {} agents, {} of {} enemies",
        outcome.steps,
        outcome.episode_return,
        outcome.dead_allies,
        sizes.n_agents,
        outcome.dead_enemies,
        sizes.n_enemies
    )
}
