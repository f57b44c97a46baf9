//! `seedbed preview`.

use std::path::{Path, PathBuf};

use super::new::{GYMNASIUM, read_gymnasium};
use super::replay::check_suffix;
use super::run::recorder_factory_at;
use super::{CliError, PreviewArgs, film, former_names, pluralize};
use seedbed::film::{Film, FilmSettings, Filmed, FilmedTask, SeedsOfEpisodes};
use seedbed::input_files::{self, Directory};
use seedbed::record::RecordedStates;
use seedbed::review::LoadRunError;
use seedbed::run::facts::EpisodeRow;
use seedbed::run::{Plan, preview};
use seedbed::storage::incomplete::Incomplete;
use seedbed_env::{Physics, TaskDescription, physics_warnings};
use seedbed_input::numbers::Count;
use seedbed_input::{FileKind, file_kind, former_names_in};

pub(super) fn preview(args: &PreviewArgs) -> Result<(), CliError> {
    let description = task(&args.environment)?;
    let episodes = Count::try_from(args.episodes)
        .map_err(|message| CliError::Usage(format!("--episodes: {message}")))?;
    let physics = if args.analytic {
        Physics::Analytic
    } else {
        Physics::Rapier
    };
    for warning in physics_warnings(&description, physics) {
        note!("warning: {warning}");
    }
    let path = args
        .out
        .clone()
        .unwrap_or_else(|| default_path(&description.spec().name));
    check_suffix(&path)?;
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|error| {
            CliError::Runtime(format!("cannot create {}: {error}", folder.display()))
        })?;
    }
    let _incomplete = Incomplete::recording(&path);
    let (rows, warning) = preview::record(
        &description,
        physics,
        episodes,
        args.seed,
        recorder_factory_at(&path),
    )?;
    for row in &rows {
        say!(
            "episode {}: {}, return {:.3}, {}",
            row.episode,
            pluralize(row.length as usize, "step"),
            row.r#return,
            row.outcome.name()
        );
    }
    if let Some(warning) = warning {
        note!("warning: {warning}");
    }
    say!(
        "\nrecording  {0}; open it with\n             rerun {0}",
        path.display()
    );
    let film = path.with_extension("gif");
    if args.film {
        let task = FilmedTask {
            description: &description,
            physics,
            seeds: SeedsOfEpisodes {
                run_seed: args.seed,
                episodes_per_round: 1,
            },
        };
        write_film(task, &rows, &path, &film)?;
        say!("film       {}", film.display());
    } else if film.exists() {
        note!(
            "note: {} is of an earlier preview; add --film to film this one",
            film.display()
        );
    }
    Ok(())
}

/// The task with this name or path, that of a scenario, or `gymnasium:ID`.
pub(super) fn task(argument: &Path) -> Result<TaskDescription, CliError> {
    if let Some(id) = argument
        .to_str()
        .and_then(|text| text.strip_prefix(GYMNASIUM))
    {
        let (_, task) = read_gymnasium("preview", Path::new(""), id)?;
        return Ok(task?.into());
    }
    let path =
        input_files::find_argument(argument, &[Directory::Environments, Directory::Scenarios])?;
    let text = input_files::read_text(&path)?;
    former_names::warn(&path, &former_names_in(&text), &[]);
    match file_kind(&path.display().to_string(), &text)? {
        FileKind::Scenario => Ok(Plan::load(&path, &[])?.description),
        _ => Ok(input_files::read_task(&path)?.0),
    }
}

/// Maximum duration of a film, s.
const MAX_SECONDS: f64 = 24.0;

/// Films all episodes in real time, or the ends of long ones.
fn write_film(
    task: FilmedTask<'_>,
    rows: &[EpisodeRow],
    recording: &Path,
    out: &Path,
) -> Result<(), CliError> {
    let spec = task.description.spec();
    let max_length = rows.iter().map(|row| row.length).max().unwrap_or(0);
    let settings = FilmSettings {
        agent: 0,
        seconds: None,
        frames_per_second: 12,
        width: 760,
        scenes: rows.len(),
    };
    let longest = settings.seconds_of_episode(f64::from(max_length) * spec.control_step);
    let duration = longest * rows.len() as f64;
    let settings = FilmSettings {
        seconds: Some(duration.clamp(1.0, MAX_SECONDS)),
        ..settings
    };
    let recording = RecordedStates::open(recording).map_err(LoadRunError::from)?;
    let filmed = Filmed {
        title: format!("{}, random actions", spec.name),
        recording: &recording,
        task: Some(task),
        agent_count: 1,
        episodes: rows,
    };
    let film = Film::new(filmed, settings, &mut || ())?;
    film::warn(&film);
    film::write(&film, settings.frames_per_second, out)
}

fn default_path(name: &str) -> PathBuf {
    Path::new("recordings")
        .join("preview")
        .join(format!("{name}.rrd"))
}
