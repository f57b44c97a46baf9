//! `seedbed preview`.

use std::path::{Path, PathBuf};

use super::run::recorder_factory_at;
use super::{CliError, PreviewArgs, pluralize};
use seedbed::input_files::{self, Directory};
use seedbed::run::preview;
use seedbed_env::Physics;
use seedbed_env::input::numbers::Count;

pub(super) fn preview(args: &PreviewArgs) -> Result<(), CliError> {
    let path = input_files::find_argument(&args.environment, &[Directory::Environments])?;
    let description = input_files::read_task(&path)?.0;
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
