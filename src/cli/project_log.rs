//! What commands add to the log of the project, in which registrations see what was tried before.

use std::path::Path;

use seedbed::experiment::Experiment;
use seedbed::run_log::{LoggedRun, RunLog};
use seedbed::study::design::cell::PlannedRun;

/// Adds runs of a scenario when they begin, since their rounds can be looked at before they end.
pub(super) fn add_runs(
    file: &Path,
    experiment: &dyn Experiment,
    run_seeds: impl Iterator<Item = u64>,
) {
    let log = RunLog::of_file(file);
    let digest = experiment.digest();
    let mut runs = run_seeds.map(|run_seed| LoggedRun {
        digest: digest.clone(),
        run_seed,
        task: experiment.spec().name.clone(),
    });
    warn_if_failed(runs.try_for_each(|run| log.add_run(&run)));
}

/// A finished run of a study.
pub(super) fn run_of_study(run: &PlannedRun<'_>) -> LoggedRun {
    LoggedRun {
        digest: run.cell.digest().to_owned(),
        run_seed: run.run_seed,
        task: run.cell.source.task().to_owned(),
    }
}

/// Warns if something could not be added: runs and studies do without the log.
pub(super) fn warn_if_failed(added: Result<(), String>) {
    if let Err(reason) = added {
        note!("warning: registrations in this project will not know of this: {reason}");
    }
}
