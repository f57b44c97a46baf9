//! Results of a finished or unfinished study, read from its folder.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::score::RunCost;
use super::score::RunScore;
use crate::experiment::measure::Measure;
use crate::experiment::run_result::{RunResult, VisitedStates};
use crate::provenance::BuildId;
use crate::study::FileError;
use crate::study::design::cell::CellDescription;
use crate::study::design::figure::{EpisodeWindow, Figure};
use crate::study::design::file::{FIRST_REPORTING_SEED, Predictors, Study};
use crate::study::external::Unknown;
use crate::study::store::Manifest;
use seedbed_env::Quantity;
use seedbed_input::InputError;
use seedbed_stats::family::{FAMILY_LEVEL, levels_of_looks};

/// A study with all its finished runs.
#[derive(Clone, Debug)]
pub struct Results {
    /// Manifest of the folder.
    pub manifest: Manifest,
    /// The study file that was run.
    pub study: Study,
    /// Results of each cell, in the order of the study.
    pub cells: Vec<CellResults>,
    /// Versions of seedbed that made the runs.
    pub versions: BTreeSet<String>,
    /// Commits of seedbed that made the runs, as far as they are known.
    pub commits: BTreeSet<String>,
    /// Builds of seedbed that made the runs; `None` is an unknown build.
    pub builds: BTreeSet<Option<BuildId>>,
    /// What is wrong with the registration of these results, and what a reader should know of it;
    /// `None` for results that are not registered.
    pub audit: Option<Audit>,
}

/// Results of the runs of a cell.
#[derive(Clone, Debug)]
pub struct CellResults {
    /// Description of the cell.
    pub description: CellDescription,
    /// Run seeds and results of finished runs; empty in published results.
    pub runs: Vec<(u64, RunResult)>,
    /// Run seeds and costs of finished runs.
    pub costs: Vec<(u64, RunCost)>,
    /// Scores of finished runs in the [measures](Results::measures).
    scores: Vec<(Measure, Vec<RunScore>)>,
    /// Run seeds of failed runs, and the reasons why they failed.
    pub failures: Vec<(u64, String)>,
    /// Number of runs that are missing, up to the look at which the study could end.
    pub missing: usize,
}

/// What a check of registered results found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Audit {
    /// Why these results do not confirm what was registered, as sentences; empty if they do. With
    /// any of these, claims get no verdict.
    pub broken: Vec<String>,
    /// What a reader should know, as sentences.
    pub notes: Vec<String>,
}

/// Error: results cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// The folder has no readable manifest of a study.
    #[error("not the results of a study: {0}")]
    Folder(FileError),
    /// This version of seedbed cannot read the study file that was run.
    #[error(transparent)]
    Study(#[from] InputError),
    /// The result file of a run is damaged, was edited, or has another layout.
    #[error(
        "{path} is damaged, was changed, or is of another version of seedbed; to repeat its run: seedbed study {study}"
    )]
    Run {
        /// The file.
        path: PathBuf,
        /// Path of the study.
        study: String,
    },
    /// The table of published results is damaged, or does not belong to the study.
    #[error("{}{}: {message}", path.display(), line.map_or(String::new(), |line| format!(":{line}")))]
    Table {
        /// Path of the table.
        path: PathBuf,
        /// Line of the uncompressed table, from 1.
        line: Option<u64>,
        /// What is wrong.
        message: String,
    },
}

impl Results {
    /// Computes scores and costs of all runs.
    pub(in crate::study) fn score_runs(&mut self) {
        let measures = self.measures();
        for cell in &mut self.cells {
            cell.score_runs(&measures);
        }
    }

    /// The measures of all claims, each once.
    #[must_use]
    pub fn measures_of_claims(&self) -> Vec<Measure> {
        let mut measures: Vec<Measure> = Vec::new();
        for claim in &self.study.claims {
            let measure = self.study.measure_of(claim);
            if !measures.contains(&measure) {
                measures.push(measure);
            }
        }
        measures
    }

    /// Measures of the study, its claims and figures, and of costs, without duplicates.
    #[must_use]
    pub fn measures(&self) -> Vec<Measure> {
        let of_claims = self.measures_of_claims();
        let of_study = self.study.measures.iter().map(|measure| **measure);
        let main_measure = self.study.main_measure();
        let exploration = self.study.exploration.iter();
        let of_gate = exploration.map(|exploration| *exploration.measure);
        let scaling = self.study.scaling.iter();
        let of_scaling = scaling.map(|scaling| *scaling.measure);
        let predictors = self.study.predictors.iter();
        let of_predictors = predictors.flat_map(Predictors::all);
        let figures = self.study.figures.iter();
        let of_figures = figures.filter_map(|figure| figure.required_measure(main_measure));
        let mut measures: Vec<Measure> = Vec::new();
        for measure in of_study
            .chain(of_claims)
            .chain(of_figures)
            .chain(of_gate)
            .chain(of_scaling)
            .chain(of_predictors)
            .chain([Measure::EpisodesToSolve])
        {
            if !measures.contains(&measure) {
                measures.push(measure);
            }
        }
        measures
    }

    /// Number of runs that others should have made of a cell, and that were not found: those that the
    /// study says, or in a registered study its `repeats`.
    pub(super) fn missing_runs_of_others(&self, cell: &CellDescription) -> usize {
        let Some(external) = &cell.external else {
            return 0;
        };
        let expected = self.expected_runs_of_others(&cell.name).unwrap_or(0);
        (expected as usize).saturating_sub(external.runs.len())
    }

    /// Number of runs that others should have made of a cell; `None` if any number is right.
    pub(super) fn expected_runs_of_others(&self, cell: &str) -> Option<u64> {
        let lock = self.manifest.lock.as_ref();
        self.study.expected_runs_of_others(cell, lock.is_some())
    }

    /// Run seeds of each cell with a scenario, up to the first look of which no later look has a run: a registered
    /// study ends as soon as all its claims are decided.
    /// `has_run`: whether the cell with this index has a run with this run seed
    pub(super) fn begun_run_seeds(&self, has_run: impl Fn(usize, u64) -> bool) -> Vec<u64> {
        let mut run_seeds = self.manifest.run_seeds();
        if self.manifest.lock.is_none() {
            return run_seeds;
        }
        let any_cell_has_run = |run_seed: &u64| {
            let cells = self.manifest.cells.iter().enumerate();
            let mut cells = cells.filter(|(_, cell)| cell.external.is_none());
            cells.any(|(cell, _)| has_run(cell, *run_seed))
        };
        let begun = run_seeds
            .iter()
            .rposition(any_cell_has_run)
            .map_or(0, |last| last as u64 + 1);
        let look = self.study.looks().into_iter().find(|&runs| runs >= begun);
        run_seeds.truncate(look.unwrap_or(u64::MAX) as usize);
        run_seeds
    }

    /// Results of the cell with this name.
    #[must_use]
    pub fn cell(&self, name: &str) -> Option<&CellResults> {
        self.cells.iter().find(|cell| cell.description.name == name)
    }

    /// Cells that a figure shows: its list of cells, in its order, or all cells if the list is
    /// empty.
    #[must_use]
    pub fn cells_of_figure(&self, figure: &Figure) -> Vec<&CellResults> {
        if figure.cells().is_empty() {
            return self.cells.iter().collect();
        }
        figure
            .cells()
            .iter()
            .filter_map(|name| self.cell(name))
            .collect()
    }

    /// Whether the run seeds are for tuning. Such results must not be published.
    #[must_use]
    pub fn is_tuning(&self) -> bool {
        self.manifest.lock.is_none() && self.manifest.first_seed < FIRST_REPORTING_SEED
    }

    /// Looks at which confirmatory claims are evaluated: the number of first runs of each cell
    /// (`None` for all that are finished), and the error probability of each family on each side.
    /// Looks of registered results that are not complete in every cell, and all looks of a broken
    /// registration, are left out.
    #[must_use]
    pub fn looks(&self) -> Vec<(Option<u64>, f64)> {
        let Some(audit) = &self.audit else {
            return vec![(None, FAMILY_LEVEL)];
        };
        let looks = self.study.looks();
        let levels = levels_of_looks(&looks, FAMILY_LEVEL);
        let is_usable = |runs: u64| audit.broken.is_empty() && self.is_complete(runs);
        let looks = looks
            .into_iter()
            .zip(levels)
            .filter(|(runs, _)| is_usable(*runs));
        looks.map(|(runs, level)| (Some(runs), level)).collect()
    }

    /// Whether the first `count` runs of every cell are finished.
    fn is_complete(&self, count: u64) -> bool {
        let run_seeds = self.manifest.run_seeds();
        let first_seeds = &run_seeds[..run_seeds.len().min(count as usize)];
        self.cells.iter().all(|cell| {
            if cell.description.external.is_some() {
                return cell.missing == 0 && cell.failures.is_empty();
            }
            let finished: BTreeSet<u64> =
                cell.costs.iter().map(|(run_seed, _)| *run_seed).collect();
            first_seeds
                .iter()
                .all(|run_seed| finished.contains(run_seed))
        })
    }

    /// Numbers of finished, failed and missing runs.
    #[must_use]
    pub fn run_counts(&self) -> [usize; 3] {
        let total = |count: fn(&CellResults) -> usize| self.cells.iter().map(count).sum();
        [
            total(|cell| cell.costs.len()),
            total(|cell| cell.failures.len()),
            total(|cell| cell.missing),
        ]
    }
}

/// Number of episodes up to which times of cells are compared unless a claim says another: their
/// smallest maximum number of episodes. Number of environment steps: the [`earliest_end`].
#[must_use]
pub fn default_horizon(cells: &[&CellResults], measure: Measure) -> f64 {
    if measure.is_time_in_env_steps() {
        return earliest_end(cells, measure);
    }
    let max_episodes = cells.iter().map(|cell| cell.description.max_episodes);
    max_episodes.min().map_or(f64::INFINITY, f64::from)
}

/// Earliest end of a run that did not reach its time: nothing is known of it afterwards. Infinite if all
/// runs of the cells reached their times.
#[must_use]
pub fn earliest_end(cells: &[&CellResults], measure: Measure) -> f64 {
    let scores = cells.iter().flat_map(|cell| cell.scores(measure));
    let ends = scores.map(|score| score.observed_until);
    ends.fold(f64::INFINITY, f64::min)
}

/// The largest time up to [`default_horizon`] up to which all runs are known: means of cells on their
/// own are of times up to this one.
#[must_use]
pub fn known_horizon(cells: &[&CellResults], measure: Measure) -> f64 {
    default_horizon(cells, measure).min(earliest_end(cells, measure))
}

impl CellResults {
    /// A cell without runs.
    pub(in crate::study) fn without_runs(description: CellDescription) -> Self {
        Self {
            description,
            runs: Vec::new(),
            costs: Vec::new(),
            scores: Vec::new(),
            failures: Vec::new(),
            missing: 0,
        }
    }

    /// Scores of all runs that have the measure, which is one of [`Results::measures`].
    #[must_use]
    pub fn scores(&self, measure: Measure) -> &[RunScore] {
        let scores = self.scores.iter().find(|(scored, _)| *scored == measure);
        scores.map_or(&[], |(_, scores)| scores)
    }

    fn score_runs(&mut self, measures: &[Measure]) {
        for (run_seed, run) in std::mem::take(&mut self.runs) {
            let scores: Vec<Option<RunScore>> = measures
                .iter()
                .map(|&measure| {
                    RunScore::of(measure, run_seed, &run).filter(|_| self.has_measure(measure))
                })
                .collect();
            let cost = RunCost::of(&run, self.unknown());
            self.add_scored_run(run_seed, cost, measures, scores);
            self.runs.push((run_seed, run));
        }
    }

    /// What is not known of the runs of this cell.
    #[must_use]
    pub fn unknown(&self) -> Unknown {
        let external = self.description.external.as_ref();
        external.map_or(Unknown::default(), |external| external.unknown)
    }

    /// Whether everything that a measure needs is known of the runs of this cell.
    #[must_use]
    pub fn has_measure(&self, measure: Measure) -> bool {
        let Unknown {
            episodes,
            env_steps,
            ..
        } = self.unknown();
        !(episodes && measure.counts_episodes() || env_steps && measure.is_time_in_env_steps())
    }

    /// Name of a run that others made.
    #[must_use]
    pub fn run_name(&self, run_seed: u64) -> Option<&str> {
        let external = self.description.external.as_ref()?;
        let run = external.runs.iter().find(|run| run.id == run_seed)?;
        Some(&run.name)
    }

    /// Adds the cost of a finished run, and its score in each of `measures`.
    pub(super) fn add_scored_run(
        &mut self,
        run_seed: u64,
        cost: RunCost,
        measures: &[Measure],
        scores: impl IntoIterator<Item = Option<RunScore>>,
    ) {
        self.costs.push((run_seed, cost));
        self.scores
            .resize_with(measures.len(), || (Measure::Solved, Vec::new()));
        let end_of = |measure| self.early_end(measure, cost);
        let ends: Vec<Option<f64>> = measures.iter().map(|&measure| end_of(measure)).collect();
        let entries = self.scores.iter_mut().zip(measures);
        for (((entries, &measure), score), end) in entries.zip(scores).zip(ends) {
            entries.0 = measure;
            entries.1.extend(score.map(|score| RunScore {
                observed_until: end.unwrap_or(score.observed_until),
                ..score
            }));
        }
    }

    /// The number of episodes after which a run of others ended without solving its task, if it has fewer than
    /// the cell: then it is not known whether it would have solved it.
    fn early_end(&self, measure: Measure, cost: RunCost) -> Option<f64> {
        let is_unsolved = measure == Measure::Solved && cost.solved == Some(false);
        let is_of_others = self.description.external.is_some();
        let max_episodes = f64::from(self.description.max_episodes);
        let episodes = cost.episodes.filter(|_| is_unsolved && is_of_others);
        episodes.filter(|episodes| *episodes < max_episodes)
    }

    /// Run seeds of all runs that have finished or failed.
    pub(super) fn run_seeds(&self) -> impl Iterator<Item = u64> {
        let finished = self.costs.iter().map(|(run_seed, _)| *run_seed);
        finished.chain(self.failures.iter().map(|(run_seed, _)| *run_seed))
    }

    /// Whether a run has finished or failed.
    pub(super) fn has_run(&self, run_seed: u64) -> bool {
        self.run_seeds().any(|present| present == run_seed)
    }

    /// The observations of the cell's task.
    #[must_use]
    pub fn observations(&self) -> Vec<Quantity> {
        let quantity = |(name, unit, range): &(String, String, [f32; 2])| Quantity {
            name: name.clone(),
            unit: unit.clone(),
            range: *range,
        };
        self.description.observations.iter().map(quantity).collect()
    }

    /// Runs with the states that they visited in the given episodes; empty if states were not
    /// stored.
    #[must_use]
    pub fn states(&self, window: EpisodeWindow) -> Vec<(&RunResult, &VisitedStates)> {
        let mut found = Vec::new();
        for (_, run) in &self.runs {
            let mut states = run.states.iter();
            let of_window = states.find(|states| states.episodes == window.episodes());
            found.extend(of_window.map(|states| (run, states)));
        }
        found
    }
}
