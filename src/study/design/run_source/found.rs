//! Runs that others made, whose files are read.

use super::RunSource;
use crate::experiment::RunControl;
use crate::experiment::measure::Measure;
use crate::experiment::run_result::RunResult;
use crate::study::external::ExternalRuns;
use seedbed_env::Quantity;

/// Estimated cost of reading a run: hardly any, compared with that of making one.
const COST_OF_READING: f64 = 1.0;

impl RunSource for ExternalRuns {
    fn agents(&self) -> u32 {
        self.agents()
    }

    fn max_episodes(&self) -> u32 {
        self.max_episodes()
    }

    fn task(&self) -> &str {
        self.task()
    }

    fn observations(&self) -> &[Quantity] {
        &[]
    }

    fn digest(&self) -> String {
        self.digest()
    }

    fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)> {
        self.measure_obstacle(measure)
    }

    fn warnings(&self) -> Vec<String> {
        self.warnings()
    }

    fn cost(&self) -> f64 {
        COST_OF_READING
    }

    fn result(
        &self,
        run_seed: u64,
        _windows: &[u32],
        _control: RunControl<'_>,
    ) -> Result<Option<RunResult>, String> {
        let result = self.result(run_seed).cloned();
        result
            .map(Some)
            .ok_or_else(|| "its files are gone".to_owned())
    }

    fn found(&self) -> Option<&ExternalRuns> {
        Some(self)
    }
}
