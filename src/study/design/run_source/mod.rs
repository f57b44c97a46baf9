//! Where the runs of a cell come from. Each kind of cell is one file, with an implementation of [`RunSource`], and one
//! line in the list below.

mod found;
mod scenario;

pub use scenario::ScenarioRuns;

use std::fmt::Debug;
use std::path::Path;
use std::sync::Arc;

use super::file::{NamedCell, Study};
use crate::experiment::measure::Measure;
use crate::experiment::run_result::RunResult;
use crate::experiment::{RunControl, RunQueue};
use crate::study::external::{ExternalRuns, Problem};
use seedbed_env::Quantity;
use seedbed_learn::agent::bonus::PaidFor;
use seedbed_learn::algorithms::RandomActions;

/// The source of runs in a study file, as results call it, and the runs.
type NamedSource = (String, Arc<dyn RunSource>);

/// Reads a named cell of one kind. It gets the folder of the study file, and returns `None` if the cell is of another kind.
type ReadKind = fn(&Path, &Study, &NamedCell) -> Result<Option<NamedSource>, Problem>;

/// Kinds of named cells that have no scenario.
const KINDS: [ReadKind; 1] = [found::of_named_cell];

/// The runs of a named cell; `None` if they are those of a scenario.
pub(super) fn of_named_cell(
    folder: &Path,
    study: &Study,
    cell: &NamedCell,
) -> Result<Option<NamedSource>, Problem> {
    for kind in KINDS {
        if let Some(source) = kind(folder, study, cell)? {
            return Ok(Some(source));
        }
    }
    Ok(None)
}

/// Where the runs of a cell come from.
pub trait RunSource: Debug + Send + Sync {
    /// Number of agents K.
    fn agents(&self) -> u32;

    /// Maximum number of episodes per agent.
    fn max_episodes(&self) -> u32;

    /// Name of the task.
    fn task(&self) -> &str;

    /// Observations of the task, as far as they are known.
    fn observations(&self) -> &[Quantity];

    /// Which random actions the agents take; `None` if it is not known.
    fn random_actions(&self) -> Option<RandomActions> {
        None
    }

    /// What the agents are paid for beside the rewards of the task; `None` if it is not known.
    fn paid_for(&self) -> Option<PaidFor> {
        None
    }

    /// The outlines of bodies of the task that never move, m: `[lines]` of `[points]`, as far as they are known.
    fn walls(&self) -> Vec<Vec<[f32; 2]>> {
        Vec::new()
    }

    /// Hash of everything on which runs depend, except their run seeds or files.
    fn digest(&self) -> String;

    /// Why runs do not have `measure`, and what to use instead; `None` if they have it.
    fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)>;

    /// Why the runs may not be what they seem to be.
    fn warnings(&self) -> Vec<String>;

    /// Why a run cannot be repeated bit for bit; `None` if it can.
    fn repeatability_warning(&self) -> Option<String> {
        None
    }

    /// Rough estimate of the work of a run, in environment steps of a random agent.
    fn cost(&self) -> f64;

    /// The result of the run with this run seed or, of runs that were found, with this id. For each number n in
    /// `windows`, it has a sample of the states visited in the first n episodes of each agent. `None` if interrupted.
    ///
    /// # Errors
    /// Why the run failed.
    fn result(
        &self,
        run_seed: u64,
        windows: &[u32],
        control: RunControl<'_>,
    ) -> Result<Option<RunResult>, String>;

    /// Approximate number of bytes of memory that a run needs; 0 for results that are read.
    fn memory(&self) -> u64 {
        0
    }

    /// Number of runs that take the least time if they are measured together.
    fn runs_together(&self) -> usize {
        1
    }

    /// Measures the runs of `queue`, at most `places` at once, until it is empty or they are interrupted.
    fn measure_together(&self, _places: usize, queue: &mut dyn RunQueue, control: RunControl<'_>) {
        while !control.is_interrupted()
            && let Some(request) = queue.next()
        {
            let result = self.result(request.run_seed, &request.windows, control);
            if let Some(outcome) = result.transpose() {
                queue.finish(&request, outcome);
            }
        }
    }

    /// Runs that were found, because others made them. `None` if runs are made when they are needed, with the run seeds
    /// of the study.
    fn found(&self) -> Option<&ExternalRuns> {
        None
    }
}
