//! `seedbed preview`.

use std::path::{Path, PathBuf};

use super::{Failure, PreviewArgs, counted};
use crate::env::{self, Physics};
use crate::input::InputError;
use crate::input::numbers::Count;
use crate::run::preview;
use crate::scenario;

pub(super) fn preview(args: &PreviewArgs) -> Result<(), Failure> {
    let description = env::load(&task_file(&args.environment)?)?;
    let episodes = Count::try_from(args.episodes)
        .map_err(|message| Failure::Input(format!("--episodes: {message}")))?;
    let physics = if args.analytic {
        Physics::Analytic
    } else {
        Physics::Rapier
    };
    let path = args
        .out
        .clone()
        .unwrap_or_else(|| default_path(&description.spec.name));
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::Work(format!("cannot create {}: {error}", folder.display()))
        })?;
    }
    let rows = preview::record(&description, physics, episodes, args.seed, &path)?;
    for row in rows {
        let outcome = format!("{:?}", row.outcome).to_lowercase();
        say!(
            "episode {}: {}, return {:.3}, {outcome}",
            row.episode,
            counted(row.length as usize, "step"),
            row.r#return
        );
    }
    say!("look at it with\n  rerun {}", path.display());
    Ok(())
}

fn default_path(name: &str) -> PathBuf {
    Path::new("recordings")
        .join("preview")
        .join(format!("{name}.rrd"))
}

/// A path as it is; a name as a file of the nearest folder `envs`.
fn task_file(environment: &str) -> Result<PathBuf, InputError> {
    let path = PathBuf::from(environment);
    if path.is_file() {
        return Ok(path);
    }
    scenario::task_file(environment, &[std::env::current_dir().unwrap_or_default()]).map_err(
        |known| InputError {
            origin: environment.to_owned(),
            position: None,
            field: String::new(),
            message: neither(&known),
            help: crate::input::nearest(environment, known.iter().map(String::as_str))
                .map(|name| format!("did you mean `{name}`?")),
        },
    )
}

fn neither(known: &[String]) -> String {
    if known.is_empty() {
        return "is no file, and there is no folder `envs` with tasks here or further up"
            .to_owned();
    }
    let known = crate::input::listed(known.iter().map(String::as_str));
    format!("is neither a file nor a task in `envs/`, where there are {known}")
}
