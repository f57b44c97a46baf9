//! `seedbed replay`.

use std::path::{Path, PathBuf};

use super::evaluate::{EpisodeResult, describe_actions, evaluation_settings, print_table};
use super::plot::agents_in;
use super::progress::episode_bar;
use super::run::recorder_factory_at;
use super::{CliError, ReplayArgs, pluralize, warn_if_unverified};
use seedbed::run::folder::{RunFolder, run_folder};
use seedbed::run::replay::{self, ReplaySettings};
use seedbed::storage::incomplete::Incomplete;

pub(super) fn replay(args: &ReplayArgs) -> Result<(), CliError> {
    let folder = run_folder(&args.run);
    let path = output_path(args, &folder)?;
    warn_if_unverified(&folder)?;
    let evaluation = evaluation_settings(args.episodes, &args.play)?;
    let agents = agents_in(&args.agents);
    let settings = ReplaySettings {
        evaluation,
        drawn_agents: (!agents.is_empty()).then_some(agents.as_slice()),
    };
    let bar = episode_bar(args.episodes, "episodes");
    let incomplete = Incomplete::recording(&path);
    let result = replay::replay(
        &folder,
        &settings,
        recorder_factory_at(&path),
        &mut |episodes| {
            bar.set_position(episodes.into());
        },
    );
    bar.finish_and_clear();
    drop(incomplete);
    let (plan, episode_rows) = result?;
    let (task, count) = (
        &plan.description.spec().name,
        pluralize(args.episodes as usize, "episode"),
    );
    say!(
        "{task}: {count} per agent, {}\n",
        describe_actions(evaluation.action_selection)
    );
    let episode_results: Vec<EpisodeResult> = episode_rows
        .iter()
        .map(|row| EpisodeResult {
            agent: row.agent,
            r#return: row.r#return,
            length: row.length as usize,
        })
        .collect();
    print_table(&episode_results);
    say!("\nopen the recording with\n  rerun {}", path.display());
    Ok(())
}

/// Refuses a recording under the name of another kind of file, such as a film.
pub(super) fn check_suffix(path: &Path) -> Result<(), CliError> {
    if path.extension().is_some_and(|extension| extension == "rrd") {
        return Ok(());
    }
    let path = path.display();
    let message =
        format!("--out {path}: expected a file that ends in .rrd; `seedbed film` writes films");
    Err(CliError::Usage(message))
}

/// Path of the replay; an error if it is the recording of the training.
fn output_path(args: &ReplayArgs, folder: &RunFolder) -> Result<PathBuf, CliError> {
    let path = args.out.clone().unwrap_or_else(|| folder.replay_file());
    check_suffix(&path)?;
    let canonical = |path: PathBuf| path.canonicalize().ok();
    if canonical(path.clone()).is_some_and(|path| Some(path) == canonical(folder.recording_file()))
    {
        return Err(CliError::Usage(format!(
            "--out {} would overwrite the recording of the run; choose another file",
            path.display()
        )));
    }
    Ok(path)
}
