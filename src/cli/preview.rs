//! `seedbed preview`.

use std::path::{Path, PathBuf};

use super::run::recorder_factory_at;
use super::{CliError, PreviewArgs, pluralize};
use seedbed::run::preview;
use seedbed::scenario;
use seedbed_env::input::InputError;
use seedbed_env::input::numbers::Count;
use seedbed_env::{self, Physics};

pub(super) fn preview(args: &PreviewArgs) -> Result<(), CliError> {
    let description = seedbed_env::load(&environment_file(&args.environment)?)?;
    let episodes = Count::try_from(args.episodes)
        .map_err(|message| CliError::Usage(format!("--episodes: {message}")))?;
    let physics = if args.analytic {
        Physics::Analytic
    } else {
        Physics::Rapier
    };
    let path = args
        .out
        .clone()
        .unwrap_or_else(|| default_path(&description.spec().name));
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|error| {
            CliError::Runtime(format!("cannot create {}: {error}", folder.display()))
        })?;
    }
    let rows = preview::record(
        &description,
        physics,
        episodes,
        args.seed,
        recorder_factory_at(&path),
    )?;
    for row in rows {
        let outcome = format!("{:?}", row.outcome).to_lowercase();
        say!(
            "episode {}: {}, return {:.3}, {outcome}",
            row.episode,
            pluralize(row.length as usize, "step"),
            row.r#return
        );
    }
    say!("\nopen the recording with\n  rerun {}", path.display());
    Ok(())
}

fn default_path(name: &str) -> PathBuf {
    Path::new("recordings")
        .join("preview")
        .join(format!("{name}.rrd"))
}

/// Path of the environment file. `environment` is this path, or a name that is looked up in the
/// nearest directory `envs`.
fn environment_file(environment: &str) -> Result<PathBuf, InputError> {
    let path = PathBuf::from(environment);
    if path.is_file() {
        return Ok(path);
    }
    scenario::find_task_file(environment, &[std::env::current_dir().unwrap_or_default()]).map_err(
        |known| InputError {
            origin: environment.to_owned(),
            position: None,
            field: String::new(),
            message: not_found_message(&known),
            help: seedbed_env::input::nearest_name(environment, known.iter().map(String::as_str))
                .map(|name| format!("did you mean `{name}`?")),
        },
    )
}

/// Error message, with the names of all environments that were found.
fn not_found_message(known: &[String]) -> String {
    if known.is_empty() {
        return "no such file, and no directory `envs` with environments here or in a parent directory"
            .to_owned();
    }
    let known = seedbed_env::input::quoted_list(known.iter().map(String::as_str));
    format!("no such file or environment in `envs/`; expected one of {known}")
}
