//! Where the runs of a cell come from: from a scenario that is run here, or from files of others. No
//! other module distinguishes the two.

use std::sync::Arc;

use super::experiment::{Experiment, RunControl, RunQueue, StopRule};
use super::external::ExternalRuns;
use super::measure::Measure;
use super::run_result::RunResult;
use seedbed_env::Quantity;

/// Where the runs of a cell come from.
#[derive(Clone, Debug)]
pub enum RunSource {
    /// A scenario that is run here.
    Experiment(Arc<dyn Experiment>),
    /// Files of runs that others made.
    External(Arc<ExternalRuns>),
}

/// Estimated cost of reading a run of others: hardly any, compared with that of a run.
const COST_OF_READING: f64 = 1.0;

impl RunSource {
    /// The results of others; `None` for a scenario.
    #[must_use]
    pub fn external(&self) -> Option<&ExternalRuns> {
        match self {
            Self::Experiment(_) => None,
            Self::External(runs) => Some(runs),
        }
    }

    /// Number of agents K.
    #[must_use]
    pub fn agents(&self) -> u32 {
        match self {
            Self::Experiment(experiment) => experiment.agents(),
            Self::External(runs) => runs.agents(),
        }
    }

    /// Maximum number of episodes per agent.
    #[must_use]
    pub fn max_episodes(&self) -> u32 {
        match self {
            Self::Experiment(experiment) => experiment.max_episodes(),
            Self::External(runs) => runs.max_episodes(),
        }
    }

    /// Name of the task.
    #[must_use]
    pub fn task(&self) -> &str {
        match self {
            Self::Experiment(experiment) => &experiment.spec().name,
            Self::External(runs) => runs.task(),
        }
    }

    /// Observations of the task, as far as they are known.
    #[must_use]
    pub fn observations(&self) -> &[Quantity] {
        match self {
            Self::Experiment(experiment) => &experiment.spec().observations,
            Self::External(_) => &[],
        }
    }

    /// Hash of everything on which runs depend, except their run seeds or files.
    #[must_use]
    pub fn digest(&self) -> String {
        match self {
            Self::Experiment(experiment) => experiment.digest(),
            Self::External(runs) => runs.digest(),
        }
    }

    /// Approximate number of bytes of memory that a run needs; 0 for results that are read.
    #[must_use]
    pub fn memory(&self) -> u64 {
        match self {
            Self::Experiment(experiment) => experiment.memory(),
            Self::External(_) => 0,
        }
    }

    /// Rough estimate of the work of a run, see [`Experiment::cost`].
    #[must_use]
    pub fn cost(&self) -> f64 {
        match self {
            Self::Experiment(experiment) => experiment.cost(),
            Self::External(_) => COST_OF_READING,
        }
    }

    /// Why runs do not have `measure`, and what to use instead; `None` if they have it.
    #[must_use]
    pub fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Experiment(experiment) => experiment.measure_obstacle(measure),
            Self::External(runs) => runs.measure_obstacle(measure),
        }
    }

    /// Why the runs may not be what they seem to be.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        match self {
            Self::Experiment(experiment) => experiment.warnings(),
            Self::External(runs) => runs.warnings(),
        }
    }

    /// The result of the run with this run seed or, of results of others, with this id. `windows`: see
    /// [`Experiment::measure_once`]. `None` if interrupted.
    ///
    /// # Errors
    /// Why the run failed.
    pub fn result(
        &self,
        run_seed: u64,
        windows: &[u32],
        control: RunControl<'_>,
    ) -> Result<Option<RunResult>, String> {
        match self {
            Self::Experiment(experiment) => experiment
                .measure_once(run_seed, StopRule::Scenario, windows, control)
                .map_err(|error| error.to_string()),
            Self::External(runs) => {
                let result = runs.result(run_seed).cloned();
                result
                    .map(Some)
                    .ok_or_else(|| "its files are gone".to_owned())
            }
        }
    }

    /// Number of runs that take the least time if they are measured together.
    #[must_use]
    pub fn runs_together(&self) -> usize {
        match self {
            Self::Experiment(experiment) => experiment.runs_together(),
            Self::External(_) => 1,
        }
    }

    /// Measures the runs of `queue`, see [`Experiment::measure_together`].
    pub fn measure_together(
        &self,
        places: usize,
        queue: &mut dyn RunQueue,
        control: RunControl<'_>,
    ) {
        if let Self::Experiment(experiment) = self {
            return experiment.measure_together(places, StopRule::Scenario, queue, control);
        }
        while !control.is_interrupted()
            && let Some(request) = queue.next()
        {
            let result = self.result(request.run_seed, &request.windows, control);
            if let Some(outcome) = result.transpose() {
                queue.finish(&request, outcome);
            }
        }
    }
}
