//! `seedbed film`.

use std::io;
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use super::evaluate::evaluation_settings;
use super::progress::{ReadCounter, episode_bar};
use super::{CliError, PlayArgs, open_run, pluralize, warn_if_unverified};
use seedbed::film::encoder::{FilmEncoder, FilmFormat, FilmLayout};
use seedbed::film::{Film, FilmError, FilmSettings};
use seedbed::run::folder::{RunFolder, run_folder};
use seedbed::storage::files::{self, Replacement};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed film recordings/cartpole/seed-0                  write recordings/cartpole/seed-0/film.gif
  seedbed film recordings/cartpole/seed-0 --agent 2 --seconds 20 --out agent2.gif
  seedbed film recordings/cartpole/seed-0 --policy 2 --actions greedy --out policy2.mp4
                                                           the trained policy of agent 2 in three new episodes
  seedbed film recordings/cartpole/seed-0 --policy 2 --environment my_pole.ron
                                                           the same in another task

On the left, the bodies of one agent: the last seconds of some episodes, in real time. If the motion of the agent was not \
recorded (`recording: (scene: …)` in the scenario; by default every tenth episode of agent 0), and in environments of \
Gymnasium, recorded episodes are played again. On the right, the states that all agents have visited up to the episode that is shown, as a map if there are two observations; below, their \
returns. With --policy, the film shows only the motion.")]
pub(super) struct FilmArgs {
    /// Run directory
    run: PathBuf,
    /// Write the film to FILE.gif, FILE.png (animated, exact colors) or FILE.mp4 (needs ffmpeg) [default: film.gif, or
    /// policy.gif with --policy, in the run directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Agent whose bodies are shown
    #[arg(long, value_name = "K", default_value_t = 0)]
    agent: u32,
    /// Instead of the training, film new episodes of the trained policy of this agent
    #[arg(long, value_name = "K", conflicts_with = "agent")]
    policy: Option<u32>,
    #[command(flatten)]
    play: PlayArgs,
    /// Duration of the film in seconds; long episodes are shown at their end [default: 12; with --policy whole episodes]
    #[arg(long, value_name = "S", value_parser = parse_seconds)]
    seconds: Option<f64>,
    /// Frames per second
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=50))]
    fps: u32,
    /// Width of the film in pixels
    #[arg(long, value_name = "N", default_value_t = 760, value_parser = clap::value_parser!(u32).range(300..=4000))]
    width: u32,
    /// Number of episodes whose bodies are shown, one after the other [default: 6, or 3 with --policy]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    scenes: Option<u16>,
}

pub(super) fn film(args: &FilmArgs) -> Result<(), CliError> {
    let (film, default_out) = match args.policy {
        Some(_) => film_of_policy(args)?,
        None => film_of_run(args)?,
    };
    let out = args.out.clone().unwrap_or(default_out);
    warn(&film);
    write(&film, args.fps, &out)?;
    say!(
        "wrote {}: {}",
        out.display(),
        pluralize(film.frame_count(), "frame")
    );
    Ok(())
}

/// The film of a run, and where it is written by default.
fn film_of_run(args: &FilmArgs) -> Result<(Film, PathBuf), CliError> {
    refuse_play_options(&args.play)?;
    check_format(args)?;
    let run = open_run(&args.run)?;
    let out = run.folder.as_ref().map(RunFolder::film_file);
    let counter = ReadCounter::new("episodes read");
    let film = Film::of_run(&run, args.settings(), &mut || counter.count())?;
    Ok((film, out.unwrap_or_else(|| PathBuf::from("film.gif"))))
}

fn film_of_policy(args: &FilmArgs) -> Result<(Film, PathBuf), CliError> {
    check_format(args)?;
    let folder = run_folder(&args.run);
    warn_if_unverified(&folder)?;
    let evaluation = evaluation_settings(args.scenes.unwrap_or(3).into(), &args.play)?;
    let film = Film::of_policy(&folder, args.settings(), &evaluation)?;
    Ok((film, folder.path().join("policy.gif")))
}

/// Recorded actions are played, so that none is chosen.
fn refuse_play_options(play: &PlayArgs) -> Result<(), CliError> {
    let is_usual =
        play.actions.is_none() && play.temperature.is_none() && play.environment.is_none();
    if !is_usual || play.seed != 0 {
        let message = "--actions, --temperature, --environment and --seed need --policy: recorded episodes have their task and actions";
        return Err(CliError::Usage(message.to_owned()));
    }
    Ok(())
}

/// Checks the output file before anything is read.
fn check_format(args: &FilmArgs) -> Result<(), CliError> {
    args.out
        .as_deref()
        .map_or(Ok(()), |out| format_of(out).map(|_| ()))
}

fn format_of(out: &Path) -> Result<FilmFormat, CliError> {
    FilmFormat::of(out).ok_or_else(|| {
        let out = out.display();
        CliError::Usage(format!(
            "--out {out}: expected a file that ends in .gif, .png or .mp4"
        ))
    })
}

impl FilmArgs {
    fn settings(&self) -> FilmSettings {
        FilmSettings {
            agent: self.policy.unwrap_or(self.agent),
            seconds: self.seconds,
            frames_per_second: self.fps,
            width: self.width,
            scenes: usize::from(self.scenes.unwrap_or(6)),
        }
    }
}

/// Says why a film shows no motion.
pub(super) fn warn(film: &Film) {
    if let Some(warning) = film.warning() {
        note!("warning: {warning}");
    }
}

/// Draws frames on all cores, and writes them in their order.
pub(super) fn write(film: &Film, frames_per_second: u32, out: &Path) -> Result<(), CliError> {
    let layout = FilmLayout {
        size: film.size(),
        frames: film.frame_count() as u32,
        frames_per_second,
    };
    write_frames(film, layout, out, format_of(out)?)
        .map_err(|error| CliError::Runtime(format!("cannot write {}: {error}", out.display())))
}

fn write_frames(film: &Film, layout: FilmLayout, out: &Path, format: FilmFormat) -> io::Result<()> {
    files::remove_abandoned_of(out);
    let replacement = Replacement::begin_any(out)?;
    let mut encoder = FilmEncoder::begin(format, replacement.file()?, layout)?;
    let bar = episode_bar(layout.frames, "frames");
    let numbers: Vec<usize> = (0..film.frame_count()).collect();
    for batch in numbers.chunks(4 * rayon::current_num_threads()) {
        let pictures: Vec<_> = batch
            .par_iter()
            .map(|&number| film.pixels(number))
            .collect();
        for picture in pictures {
            encoder.add(picture.map_err(io::Error::other)?)?;
            bar.inc(1);
        }
    }
    encoder.finish()?;
    replacement.commit()
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number".to_owned())?;
    if (0.1..=600.0).contains(&seconds) {
        Ok(seconds)
    } else {
        Err("expected 0.1 to 600 seconds".to_owned())
    }
}

impl From<FilmError> for CliError {
    fn from(error: FilmError) -> Self {
        match error {
            FilmError::Policy(error) => error.into(),
            other => Self::Usage(other.to_string()),
        }
    }
}
