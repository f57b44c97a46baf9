//! Runs that others made, whose files are read.

use std::path::Path;
use std::sync::Arc;

use super::{NamedSource, RunSource};
use crate::experiment::RunControl;
use crate::experiment::measure::Measure;
use crate::experiment::run_result::RunResult;
use crate::study::design::file::{NamedCell, Study};
use crate::study::external::{ExternalRuns, ExternalSpec, Problem};
use seedbed_env::Quantity;

/// Estimated cost of reading a run: hardly any, compared with that of making one.
const COST_OF_READING: f64 = 1.0;

/// The runs that the `results` of a cell name.
pub(super) fn of_named_cell(
    folder: &Path,
    study: &Study,
    cell: &NamedCell,
) -> Result<Option<NamedSource>, Problem> {
    let Some(source) = &cell.results else {
        return Ok(None);
    };
    let solved = cell.solved.as_deref().or(study.solved.as_deref());
    let max_episodes = cell.max_episodes.as_deref();
    let max_episodes = max_episodes.or(study.max_episodes.as_deref());
    let max_steps = cell.max_steps.as_deref().or(study.max_steps.as_deref());
    let spec = ExternalSpec {
        source: source.clone(),
        place: cell.name.clone(),
        solved: solved.copied(),
        agents: cell.agents.as_ref().map(|agents| agents.get()),
        max_episodes: max_episodes.map(|max| max.get()),
        max_steps: max_steps.map(|max| max.get().into()),
        repeats: cell.repeats.as_ref().map(|repeats| repeats.get()),
    };
    let runs = ExternalRuns::load(folder, spec)?;
    Ok(Some((runs.source(), Arc::new(runs))))
}

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
        self.observations()
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
