//! `seedbed replay`.

use std::path::PathBuf;

use super::evaluate::{describe_actions, evaluation, print_table};
use super::progress::episode_bar;
use super::run::recording_at;
use super::{CliError, ReplayArgs, pluralize};
use crate::run::evaluate;
use crate::run::folder::RunFolder;
use crate::run::replay::{self, Replay};

pub(super) fn replay(args: &ReplayArgs) -> Result<(), CliError> {
    let folder = evaluate::run_folder(&args.run);
    let path = output(args, &folder)?;
    let evaluation = evaluation(args.episodes, &args.play)?;
    let agents = (!args.agents.is_empty()).then_some(args.agents.as_slice());
    let bar = episode_bar(args.episodes, "episodes");
    let played = replay::replay(
        &folder,
        &Replay { evaluation, agents },
        recording_at(&path),
        &mut |episodes| {
            bar.set_position(episodes.into());
        },
    );
    bar.finish_and_clear();
    let (plan, rows) = played?;
    let (task, count) = (
        &plan.description.spec().name,
        pluralize(args.episodes as usize, "episode"),
    );
    say!(
        "{task}: {count} per agent, {}\n",
        describe_actions(evaluation.actions)
    );
    let rows: Vec<_> = rows
        .iter()
        .map(|row| (row.agent, row.r#return, row.length as usize))
        .collect();
    print_table(&rows);
    say!("\nopen it with\n  rerun {}", path.display());
    Ok(())
}

/// Path of the replay; must not be the recording of the training itself.
fn output(args: &ReplayArgs, folder: &RunFolder) -> Result<PathBuf, CliError> {
    let path = args.out.clone().unwrap_or_else(|| folder.replay());
    let same = |path: PathBuf| path.canonicalize().ok();
    if same(path.clone()).is_some_and(|path| Some(path) == same(folder.recording())) {
        return Err(CliError::Usage(format!(
            "--out {} would overwrite the recording of the run; choose another file",
            path.display()
        )));
    }
    Ok(path)
}
