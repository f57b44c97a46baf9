//! Results that others made: runs read from their files, in place of runs of a scenario.
//!
//! A cell of a study may name files instead of a scenario: run directories of seedbed,
//! Stable-Baselines3's monitor files, event files of TensorBoard, or any CSV files. Each run is
//! identified by a hash of its files, which takes the place of a run seed: if a file changes, it is
//! another run.

mod csv_file;
mod data_file;
mod event_files;
mod event_log;
mod monitor;
mod pattern;
mod read_run;
mod run_data;
mod run_folder;
pub mod source;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use self::data_file::FileHash;
pub(super) use self::data_file::SeenFiles;
use self::pattern::matching_paths;
pub use self::read_run::ExternalRun;
use self::read_run::{RETURNS_ONLY, ReadRun};
use self::run_data::Limits;
use self::source::{Columns, ResultsSource, SolvedAt, Values};
use crate::experiment::measure::{Curve, Measure, Needs};
use crate::experiment::run_result::RunResult;
use seedbed_env::Quantity;
use seedbed_input::{InputError, Located, ValidationError};

/// Number of digits of a hash that are shown in messages.
const SHOWN_DIGITS: usize = 12;

/// Why results of others cannot be used.
#[derive(Debug)]
pub enum Problem {
    /// Something in the study file is wrong.
    Study(ValidationError),
    /// Something in a file of results is wrong.
    Data(InputError),
}

impl From<ValidationError> for Problem {
    fn from(error: ValidationError) -> Self {
        Self::Study(error)
    }
}

impl From<InputError> for Problem {
    fn from(error: InputError) -> Self {
        Self::Data(error)
    }
}

/// How runs are read, besides their source.
#[derive(Clone, Copy, Debug, Default)]
struct Settings {
    solved: Option<SolvedAt>,
    /// Whether all files of a run are those of one learner.
    has_one_learner: bool,
    limits: Limits,
}

/// What a study says of a cell of results of others.
#[derive(Clone, Debug)]
pub struct ExternalSpec {
    /// Where the results are.
    pub source: ResultsSource,
    /// Place of the cell in the study file, for errors.
    pub place: Located<String>,
    /// When a run counts as solved.
    pub solved: Option<SolvedAt>,
    /// Number of agents that each run must have; `None` if it may be any.
    pub agents: Option<u32>,
    /// Maximum number of episodes per agent that are used.
    pub max_episodes: Option<u32>,
    /// Maximum number of environment steps of the team that are used.
    pub max_steps: Option<u64>,
    /// Number of runs that the study says.
    pub repeats: Option<u32>,
}

/// What is not known of runs that others made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unknown {
    /// Numbers of episodes: values are means over several episodes.
    pub episodes: bool,
    /// Numbers of environment steps.
    pub env_steps: bool,
    /// Numbers of gradient steps.
    pub gradient_steps: bool,
}

/// The runs of a cell that others made.
#[derive(Clone, Debug)]
pub struct ExternalRuns {
    spec: ExternalSpec,
    /// Folder of the study.
    folder: PathBuf,
    /// Name of the task.
    task: String,
    runs: Vec<ReadRun>,
    /// Names of runs that are not used, because their files existed at the registration.
    seen_before: Vec<String>,
}

/// Description of the results of others in the description of a study.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExternalCell {
    /// What is not known of its runs.
    pub unknown: Unknown,
    /// Runs that are used.
    pub runs: Vec<ExternalRun>,
    /// Names of runs that are not used, because their files existed at the registration.
    #[serde(default)]
    pub seen_before: Vec<String>,
    /// What a reader should know of the files.
    #[serde(default)]
    pub warnings: Vec<String>,
}

impl ExternalRuns {
    /// Reads all runs that the pattern of `spec` matches, of which there may be none. `folder` is the
    /// folder of the study.
    ///
    /// # Errors
    /// If the specification contradicts itself, if a file cannot be read, or if runs do not belong
    /// into one cell.
    pub fn load(folder: &Path, spec: ExternalSpec) -> Result<Self, Problem> {
        check_spec(&spec)?;
        let settings = Settings {
            solved: spec.solved,
            has_one_learner: spec.agents == Some(1),
            limits: Limits {
                max_episodes: spec.max_episodes,
                max_steps: spec.max_steps,
            },
        };
        let paths = matching_paths(folder, spec.source.pattern())?;
        let runs: Result<Vec<Vec<ReadRun>>, Problem> = paths
            .par_iter()
            .map(|path| read(folder, path, &spec.source, settings))
            .collect();
        let runs = Self {
            runs: runs?.into_iter().flatten().collect(),
            spec,
            folder: folder.to_owned(),
            task: String::new(),
            seen_before: Vec::new(),
        };
        runs.check_duplicates()?;
        runs.check_equal_teams()?;
        Ok(runs)
    }

    /// Two runs must not have the same file, unless it is one file with several runs.
    fn check_duplicates(&self) -> Result<(), ValidationError> {
        let mut paths: HashMap<&str, &str> = HashMap::new();
        for file in self
            .runs
            .iter()
            .flat_map(|run| self.identifying_files(&run.run))
        {
            let other = paths.entry(&file.sha256).or_insert(&file.path);
            if *other != file.path {
                return Err(self.spec.source.pattern().error(format!(
                    "`{other}` and `{}` are copies of one file (SHA-256 {}…); expected different runs",
                    file.path,
                    &file.sha256[..SHOWN_DIGITS]
                )));
            }
        }
        Ok(())
    }

    /// The files of a run that no other run has. Tables of rounds and summaries of different run
    /// directories may be equal.
    fn identifying_files<'a>(&self, run: &'a ExternalRun) -> &'a [FileHash] {
        match self.spec.source {
            ResultsSource::Runs(_) => &run.files[..1],
            _ => &run.files,
        }
    }

    /// The files that identify the runs.
    pub(super) fn files(&self) -> impl Iterator<Item = &FileHash> {
        self.runs
            .iter()
            .flat_map(|run| self.identifying_files(&run.run))
    }

    /// All runs must have the same number of agents and the same threshold, and an episode of each
    /// agent.
    fn check_equal_teams(&self) -> Result<(), ValidationError> {
        let Some(first) = self.runs.first() else {
            return Ok(());
        };
        let agents = self
            .spec
            .agents
            .unwrap_or(first.result.returns.len() as u32);
        for run in &self.runs {
            let found = run.result.returns.len();
            if found != agents as usize {
                return Err(self.spec.place.error(format!(
                    "the run `{}` has {}; expected {agents}, as {}",
                    run.run.name,
                    crate::text::pluralize(found, "agent"),
                    if self.spec.agents.is_some() {
                        "`agents` says".to_owned()
                    } else {
                        format!("in `{}`", first.run.name)
                    }
                )));
            }
            if run.result.threshold != first.result.threshold {
                return Err(self.spec.place.error(format!(
                    "the runs `{}` and `{}` count as solved at different returns; expected `solved: (return: …, \
                     window: …)` in the cell or the study",
                    first.run.name, run.run.name
                )));
            }
            if run.result.episodes_per_agent() == 0 {
                return Err(self.spec.place.error(format!(
                    "the run `{}` has an agent without an episode up to `max_episodes` and `max_steps`; expected at \
                     least one episode of each agent",
                    run.run.name
                )));
            }
        }
        Ok(())
    }

    /// Checks that there are runs, and not more than the study says.
    ///
    /// # Errors
    /// Otherwise.
    pub fn check_number(&self, expected: Option<u64>) -> Result<(), ValidationError> {
        let pattern = self.spec.source.pattern();
        if self.runs.is_empty() && self.seen_before.is_empty() {
            let folder = if self.folder.as_os_str().is_empty() {
                Path::new(".")
            } else {
                &self.folder
            };
            let error = pattern.error(format!(
                "nothing in {} matches `{}`; expected {}",
                folder.display(),
                pattern.value(),
                self.spec.source.noun()
            ));
            return Err(error.with_help(
                "patterns are relative to the study's directory; a study is registered before its results exist by \
                 `seedbed study register`",
            ));
        }
        match expected {
            Some(expected) if self.runs.len() as u64 > expected => Err(pattern.error(format!(
                "found {} runs, expected {expected}: which of them count must not depend on their results; expected a pattern that \
                 matches fewer, or another `repeats`",
                self.runs.len()
            ))),
            _ => Ok(()),
        }
    }

    /// Runs without those whose files existed at a registration, or continue such files.
    ///
    /// # Errors
    /// If a file cannot be read again.
    pub(super) fn without(&self, seen: &SeenFiles) -> Result<Self, InputError> {
        let mut remaining = self.clone();
        remaining.runs.clear();
        for run in &self.runs {
            if self.is_seen(&run.run, seen)? {
                remaining.seen_before.push(run.run.name.clone());
            } else {
                remaining.runs.push(run.clone());
            }
        }
        Ok(remaining)
    }

    fn is_seen(&self, run: &ExternalRun, seen: &SeenFiles) -> Result<bool, InputError> {
        for file in self.identifying_files(run) {
            let path = self.folder.join(&file.path);
            let bytes = data_file::DataFile::read(&self.folder, &path)?.bytes;
            if seen.include_beginning_of(&bytes) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The runs, in the order of their names.
    pub fn runs(&self) -> impl Iterator<Item = &ExternalRun> {
        self.runs.iter().map(|run| &run.run)
    }

    /// Number of runs that the study says.
    #[must_use]
    pub fn repeats(&self) -> Option<u64> {
        self.spec.repeats.map(u64::from)
    }

    /// Result of the run with this id.
    #[must_use]
    pub fn result(&self, id: u64) -> Option<&RunResult> {
        let mut runs = self.runs.iter();
        runs.find(|run| run.run.id == id).map(|run| &run.result)
    }

    /// The same runs, of a task with this name.
    #[must_use]
    pub fn with_task(self, task: String) -> Self {
        Self { task, ..self }
    }

    /// Name of the task.
    #[must_use]
    pub fn task(&self) -> &str {
        &self.task
    }

    /// The source, as in study files.
    #[must_use]
    pub fn source(&self) -> String {
        self.spec.source.text()
    }

    /// The pattern of their paths.
    #[must_use]
    pub fn pattern(&self) -> &str {
        self.spec.source.pattern()
    }

    /// Number of agents of each run; 1 without runs.
    #[must_use]
    pub fn agents(&self) -> u32 {
        let agents = self.runs.first().map(|run| run.result.returns.len() as u32);
        self.spec.agents.or(agents).unwrap_or(1)
    }

    /// Maximum number of episodes per agent: what the study says or, without that, the smallest number
    /// of episodes of a run that did not solve its task; if all did, the largest number of episodes.
    #[must_use]
    pub fn max_episodes(&self) -> u32 {
        let episodes = |run: &ReadRun| run.result.episodes_per_agent() as u32;
        let unsolved = self.runs.iter().filter(|run| run.result.solved.is_none());
        let observed = unsolved.map(episodes).min();
        let longest = || self.runs.iter().map(episodes).max().unwrap_or(0);
        self.spec
            .max_episodes
            .unwrap_or_else(|| observed.unwrap_or_else(longest))
    }

    /// What is not known of the runs.
    #[must_use]
    pub fn unknown(&self) -> Unknown {
        let source = &self.spec.source;
        Unknown {
            episodes: source.values() == Values::Means,
            env_steps: !has_env_steps(source),
            gradient_steps: !self
                .runs
                .iter()
                .all(|run| run.without_curve(Some(Curve::GradientSteps)).is_none()),
        }
    }

    /// Hash of everything but the files on which results depend.
    #[must_use]
    pub fn digest(&self) -> String {
        let ExternalSpec {
            source,
            solved,
            max_episodes,
            max_steps,
            ..
        } = &self.spec;
        let text = format!(
            "{}\0{solved:?}\0{max_episodes:?}\0{max_steps:?}",
            source.text()
        );
        format!("{:016x}", xxhash_rust::xxh64::xxh64(text.as_bytes(), 0))
    }

    /// What a reader should know of the files.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings: Vec<String> = self
            .runs
            .iter()
            .flat_map(|run| &run.warnings)
            .cloned()
            .collect();
        let equal = self.runs.iter().enumerate().filter_map(|(index, run)| {
            let mut earlier = self.runs[..index].iter();
            let same = earlier.find(|other| other.result.returns == run.result.returns)?;
            Some((same, run))
        });
        for (first, second) in equal {
            warnings.push(format!(
                "`{}` and `{}` have the same returns in all episodes: they may be one run",
                first.run.name, second.run.name
            ));
        }
        warnings
    }

    /// Description for the description of the study.
    #[must_use]
    pub fn description(&self) -> ExternalCell {
        ExternalCell {
            unknown: self.unknown(),
            runs: self.runs().cloned().collect(),
            seen_before: self.seen_before.clone(),
            warnings: self.warnings(),
        }
    }

    /// Why these runs do not have `measure`, and what to use instead; `None` if they have it.
    #[must_use]
    pub fn measure_obstacle(&self, measure: Measure) -> Option<(&'static str, &'static str)> {
        let unknown = self.unknown();
        let has_threshold = match self.runs.first() {
            Some(run) => run.result.threshold.is_some(),
            None => self.spec.solved.is_some(),
        };
        let curve = measure.curve();
        if measure.needs() == Needs::Tables {
            return Some((
                "regret is known only for tabular scenarios that are run here",
                "expected another measure",
            ));
        }
        if matches!(measure.needs(), Needs::Threshold | Needs::Goal) && !has_threshold {
            return Some((
                "the study does not say when its runs count as solved",
                "expected `solved: (return: …, window: …)` in the cell or the study",
            ));
        }
        if measure.counts_env_steps() && unknown.env_steps {
            return Some((
                "its files have no environment steps",
                "expected `env_steps` or `length` in `columns`, or a measure that counts episodes",
            ));
        }
        if unknown.episodes && measure.counts_episodes() {
            return Some((
                "its values are means over several episodes, so that episodes are not known",
                "expected `Solved`, `EnvStepsToSolve`, or a curve with one value per episode",
            ));
        }
        let is_of_rounds = curve.is_some_and(|curve| curve != Curve::Return);
        // Before the results exist, nothing is known of their curves.
        let missing = match self.spec.source {
            ResultsSource::Runs(_) => self.runs.iter().find_map(|run| run.without_curve(curve)),
            _ => Some(RETURNS_ONLY),
        };
        let unequal = self.axes_obstacle().filter(|_| measure.is_of_visits());
        let missing = missing.filter(|_| is_of_rounds);
        let missing = missing.map(|missing| (missing, EXPECTED_RETURNS));
        missing.or(unequal)
    }

    /// Why visits of the runs cannot be compared: they are counted on the axes of the observations.
    fn axes_obstacle(&self) -> Option<(&'static str, &'static str)> {
        let first = &self.runs.first()?.observations;
        if self.runs.iter().any(|run| run.observations.is_none()) {
            return Some((
                "visits of each of its runs are counted on axes that end at the extremes of this run",
                "expected recordings with `ranges` for all observations",
            ));
        }
        let differs = self.runs.iter().any(|run| run.observations != *first);
        differs.then_some((
            "visits of its runs are counted on different axes",
            "expected runs with equal ranges of all observations",
        ))
    }

    /// The observations that all runs have, with the ranges on which visits are counted; none if they are not known or
    /// differ.
    #[must_use]
    pub fn observations(&self) -> &[Quantity] {
        let first = self.runs.first().filter(|_| self.axes_obstacle().is_none());
        let observations = first.and_then(|run| run.observations.as_deref());
        observations.unwrap_or_default()
    }
}

const EXPECTED_RETURNS: &str = "expected a measure of returns, such as `FinalReturn()`";

fn has_env_steps(source: &ResultsSource) -> bool {
    match source {
        ResultsSource::Csv { columns, .. } => {
            columns.env_steps.is_some() || columns.length.is_some()
        }
        _ => true,
    }
}

fn check_columns(columns: &Columns, values: Values) -> Result<(), ValidationError> {
    if let (Some(_), Some(length)) = (&columns.env_steps, &columns.length) {
        return Err(
            length.error("steps are in two columns; expected `env_steps` or `length`, not both")
        );
    }
    if let (Some(length), Values::Means) = (&columns.length, values) {
        return Err(length.error(
            "means over several episodes have no lengths of episodes; expected `env_steps`",
        ));
    }
    match (columns.r#return.matches('*').count(), &columns.run) {
        (0, _) | (1, None) => Ok(()),
        (1, Some(run)) => Err(run.error(format!(
            "each column that `{}` matches is a run; expected no column with names of runs",
            columns.r#return.value()
        ))),
        _ => Err(columns
            .r#return
            .error("expected at most one `*`, for the part that differs between runs")),
    }
}

fn check_spec(spec: &ExternalSpec) -> Result<(), ValidationError> {
    if let ResultsSource::Csv {
        columns, values, ..
    } = &spec.source
    {
        check_columns(columns, *values)?;
    }
    if spec.max_steps.is_some() && !has_env_steps(&spec.source) {
        return Err(spec.source.pattern().error(
            "its files have no environment steps, which `max_steps` needs; expected `env_steps` or `length` in `columns`",
        ));
    }
    if spec.max_episodes.is_some() && spec.source.values() == Values::Means {
        return Err(spec.source.pattern().error(
            "its values are means over several episodes, so that `max_episodes` cannot be counted; expected `max_steps`",
        ));
    }
    Ok(())
}

fn read(
    folder: &Path,
    path: &Path,
    source: &ResultsSource,
    settings: Settings,
) -> Result<Vec<ReadRun>, Problem> {
    match source {
        ResultsSource::Runs(_) => run_folder::read(folder, path, settings).map(|run| vec![run]),
        ResultsSource::Monitor(_) => monitor::read(folder, path, settings).map(|run| vec![run]),
        ResultsSource::TensorBoard { tag, .. } => {
            event_files::read(folder, path, tag, settings).map(|run| vec![run])
        }
        ResultsSource::Csv {
            columns, values, ..
        } => csv_file::read(folder, path, columns, *values, settings),
    }
}
