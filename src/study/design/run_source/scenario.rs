//! Runs of a scenario, which are made here.

use std::sync::Arc;

use super::RunSource;
use crate::experiment::measure::Measure;
use crate::experiment::run_result::RunResult;
use crate::experiment::{Experiment, RunControl, RunQueue, StopRule};
use seedbed_env::Quantity;
use seedbed_learn::agent::bonus::PaidFor;
use seedbed_learn::algorithms::RandomActions;

/// Runs of a scenario.
#[derive(Clone, Debug)]
pub struct ScenarioRuns {
    experiment: Arc<dyn Experiment>,
}

impl ScenarioRuns {
    /// Runs of this experiment.
    #[must_use]
    pub fn new(experiment: Arc<dyn Experiment>) -> Self {
        Self { experiment }
    }
}

impl RunSource for ScenarioRuns {
    fn agents(&self) -> u32 {
        self.experiment.agents()
    }

    fn max_episodes(&self) -> u32 {
        self.experiment.max_episodes()
    }

    fn task(&self) -> &str {
        &self.experiment.spec().name
    }

    fn observations(&self) -> &[Quantity] {
        &self.experiment.spec().observations
    }

    fn random_actions(&self) -> Option<RandomActions> {
        Some(self.experiment.random_actions())
    }

    fn paid_for(&self) -> Option<PaidFor> {
        Some(self.experiment.paid_for())
    }

    fn walls(&self) -> Vec<Vec<[f32; 2]>> {
        self.experiment.walls()
    }

    fn digest(&self) -> String {
        self.experiment.digest()
    }

    fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)> {
        self.experiment.measure_obstacle(measure)
    }

    fn warnings(&self) -> Vec<String> {
        self.experiment.warnings()
    }

    fn repeatability_warning(&self) -> Option<String> {
        self.experiment.repeatability_warning()
    }

    fn cost(&self) -> f64 {
        self.experiment.cost()
    }

    fn result(
        &self,
        run_seed: u64,
        windows: &[u32],
        control: RunControl<'_>,
    ) -> Result<Option<RunResult>, String> {
        let result = self
            .experiment
            .measure_once(run_seed, StopRule::Scenario, windows, control);
        result.map_err(|error| error.to_string())
    }

    fn memory(&self) -> u64 {
        self.experiment.memory()
    }

    fn runs_together(&self) -> usize {
        self.experiment.runs_together()
    }

    fn measure_together(&self, places: usize, queue: &mut dyn RunQueue, control: RunControl<'_>) {
        self.experiment
            .measure_together(places, StopRule::Scenario, queue, control);
    }
}
