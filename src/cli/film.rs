//! `seedbed film`.

use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use super::progress::{ReadCounter, episode_bar};
use super::{CliError, open_run, pluralize};
use seedbed::film::gif::GifWriter;
use seedbed::film::{Film, FilmError, FilmSettings};
use seedbed::storage::files::{self, Replacement};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed film recordings/cartpole/seed-0                  write recordings/cartpole/seed-0/film.gif
  seedbed film recordings/cartpole/seed-0 --agent 2 --seconds 20 --out agent2.gif

On the left, the bodies of one agent in episodes whose motion was recorded (`recording: (scene: …)` in the scenario; every \
tenth by default): the last seconds of each, in real time. In an environment of Gymnasium, recorded episodes are played again \
with its own pictures. On the right, the states that all agents have visited so far; below, their returns. To film the \
trained policies only, use `seedbed replay` and Rerun's viewer.")]
pub(super) struct FilmArgs {
    /// Run directory
    run: PathBuf,
    /// Write the film to FILE.gif [default: film.gif in the run directory]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Agent whose bodies are shown
    #[arg(long, value_name = "K", default_value_t = 0)]
    agent: u32,
    /// Duration of the film
    #[arg(long, value_name = "S", default_value_t = 12.0, value_parser = parse_seconds)]
    seconds: f64,
    /// Frames per second
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=50))]
    fps: u32,
    /// Width of the film in pixels
    #[arg(long, value_name = "N", default_value_t = 760, value_parser = clap::value_parser!(u32).range(300..=4000))]
    width: u32,
    /// Number of episodes whose bodies are shown, one after the other
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=1000))]
    scenes: u16,
}

pub(super) fn film(args: &FilmArgs) -> Result<(), CliError> {
    let run = open_run(&args.run)?;
    let out = args.out.clone().unwrap_or_else(|| match &run.folder {
        Some(folder) => folder.film_file(),
        None => PathBuf::from("film.gif"),
    });
    if out.extension().is_none_or(|extension| extension != "gif") {
        return Err(CliError::Usage(format!(
            "--out {}: expected a file that ends in .gif",
            out.display()
        )));
    }
    let settings = FilmSettings {
        agent: args.agent,
        seconds: args.seconds,
        frames_per_second: args.fps,
        width: args.width,
        scenes: usize::from(args.scenes),
    };
    let counter = ReadCounter::new("episodes read");
    let film = Film::of_run(&run, settings, &mut || counter.count())?;
    drop(counter);
    warn(&film);
    write(&film, settings, &out)?;
    say!(
        "wrote {}: {}",
        out.display(),
        pluralize(film.frame_count(), "frame")
    );
    Ok(())
}

/// Says why a film shows no motion.
pub(super) fn warn(film: &Film) {
    if let Some(warning) = film.warning() {
        note!("warning: {warning}");
    }
}

/// Draws frames on all cores, and writes them in their order.
pub(super) fn write(film: &Film, settings: FilmSettings, out: &Path) -> Result<(), CliError> {
    write_frames(film, settings, out)
        .map_err(|error| CliError::Runtime(format!("cannot write {}: {error}", out.display())))
}

fn write_frames(film: &Film, settings: FilmSettings, out: &Path) -> io::Result<()> {
    files::remove_abandoned_of(out);
    let replacement = Replacement::begin_any(out)?;
    let size = |side: f64| side.round() as u16;
    let height = film.frame(0).height();
    let file = BufWriter::new(replacement.file()?);
    let width = size(f64::from(settings.width));
    let mut writer = GifWriter::new(file, width, size(height), settings.frames_per_second)?;
    let bar = episode_bar(film.frame_count() as u32, "frames");
    let numbers: Vec<usize> = (0..film.frame_count()).collect();
    for batch in numbers.chunks(4 * rayon::current_num_threads()) {
        let pictures: Vec<_> = batch
            .par_iter()
            .map(|&number| film.frame(number).pixels(1.0))
            .collect();
        for picture in pictures {
            writer.add(picture.map_err(io::Error::other)?)?;
            bar.inc(1);
        }
    }
    writer.finish()?;
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
        Self::Usage(error.to_string())
    }
}
