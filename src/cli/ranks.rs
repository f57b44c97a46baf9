//! Commands in the processes of an MPI job.

use super::CliError;
use seedbed::run::ranks::Ranks;

/// An error if this is one of several processes that `mpirun` has started, which would all do the same.
pub(super) fn check_is_single() -> Result<(), CliError> {
    let sizes = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"];
    let sizes = sizes
        .into_iter()
        .filter_map(|name| std::env::var(name).ok());
    let processes: Option<u32> = sizes.filter_map(|size| size.parse().ok()).max();
    let processes = processes.unwrap_or(1);
    if processes == 1 {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "{processes} processes of mpirun would all do this run; divide it over them with --mpi"
    )))
}

/// Executes `command` in all processes of an MPI job. An error of one ends all.
#[cfg(feature = "mpi")]
pub(super) fn with_ranks(
    command: impl FnOnce(Ranks) -> Result<(), CliError>,
) -> Result<(), CliError> {
    use seedbed::run::ranks::mpi_calls::{abort, enter};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    let Some(process) = enter() else {
        return Err(CliError::Runtime("MPI cannot be initialized".to_owned()));
    };
    let ranks = process.ranks;
    let Ok(result) = catch_unwind(AssertUnwindSafe(|| command(ranks))) else {
        note!("error: rank {} of {} panicked", ranks.rank(), ranks.count());
        abort(101);
    };
    match result {
        Ok(()) | Err(CliError::Interrupted(_)) => result,
        Err(error) => {
            note!("error: rank {} of {}: {error}", ranks.rank(), ranks.count());
            abort(error.exit_code().into());
        }
    }
}

/// An error: this build has no MPI.
#[cfg(not(feature = "mpi"))]
pub(super) fn with_ranks(
    _command: impl FnOnce(Ranks) -> Result<(), CliError>,
) -> Result<(), CliError> {
    Err(CliError::Usage(
        "this build has no MPI; install one that has, with `cargo install --features mpi` \
         (docs/mpi.md)"
            .to_owned(),
    ))
}
