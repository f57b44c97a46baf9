//! `seedbed replay`.

use std::path::PathBuf;

use super::evaluate::{evaluation, print_table, words};
use super::progress::counter;
use super::{Failure, ReplayArgs, counted};
use crate::run::evaluate;
use crate::run::folder::RunFolder;
use crate::run::replay::{self, Replay};

pub(super) fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    let folder = evaluate::run_folder(&args.run);
    let path = output(args, &folder)?;
    let evaluation = evaluation(args.episodes, &args.play)?;
    let agents = (!args.agents.is_empty()).then_some(args.agents.as_slice());
    let bar = counter(args.episodes, "episodes");
    let played = replay::replay(
        &folder,
        &Replay {
            evaluation,
            agents,
            path: &path,
        },
        &mut |episodes| {
            bar.set_position(episodes.into());
        },
    );
    bar.finish_and_clear();
    let (plan, rows) = played?;
    let (task, count) = (
        &plan.description.spec.name,
        counted(args.episodes as usize, "episode"),
    );
    say!(
        "{task}, {count} of each agent, {}:\n",
        words(evaluation.actions)
    );
    let rows: Vec<_> = rows
        .iter()
        .map(|row| (row.agent, row.r#return, row.length as usize))
        .collect();
    print_table(&rows);
    say!("\nlook at it with\n  rerun {}", path.display());
    Ok(())
}

/// Never the recording of the training itself.
fn output(args: &ReplayArgs, folder: &RunFolder) -> Result<PathBuf, Failure> {
    let path = args.out.clone().unwrap_or_else(|| folder.replay());
    let same = |path: PathBuf| path.canonicalize().ok();
    if same(path.clone()).is_some_and(|path| Some(path) == same(folder.recording())) {
        return Err(Failure::Input(format!(
            "{} is the recording of the run itself; choose another --out",
            path.display()
        )));
    }
    Ok(path)
}
