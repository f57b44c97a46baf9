//! Study files: the cells that are compared, the number of runs per cell, and claims that are
//! registered before the runs.

use std::path::Path;

use serde::Deserialize;

use super::direction::ClaimDirection;
use super::figure::Figure;
use crate::experiment::measure::{self, Measure};
use crate::input_files;
use crate::scenario::synonyms;
use crate::study::external::source::{ResultsSource, SolvedAt};
use seedbed_input::numbers::{Count, Fraction, Positive, ranged_count};
use seedbed_input::{Document, InputError, Located, ValidationError};

/// First run seed for reported results. Smaller run seeds are for tuning.
pub const FIRST_REPORTING_SEED: u64 = 1000;

/// A study file: `Study(…)` in `scenarios/`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Title of the report.
    pub title: String,
    /// Introduction of the report: subject of the study, and source of its claims.
    #[serde(default)]
    pub about: String,
    /// Scenario of all cells that do not give another one. The path is relative to the folder of
    /// the study file.
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// Values to replace in the scenarios of all cells, each as `path=value`.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// Axes of the grid. Every combination of their values is a cell.
    #[serde(default)]
    pub grid: Vec<Axis>,
    /// Cells in addition to the cells of the grid.
    #[serde(default)]
    pub cells: Vec<NamedCell>,
    /// Number of runs per cell. All cells have the same run seeds.
    #[serde(default = "default_repeats")]
    pub repeats: Located<Count<100_000>>,
    /// Numbers of runs per cell at which confirmatory claims are evaluated, in ascending order; the
    /// last is `repeats`. [default: `repeats` only]
    #[serde(default)]
    pub looks: Located<Vec<Count<100_000>>>,
    /// Run seed of the first run of each cell: 0 to 999 for tuning, at least 1000 for reported
    /// results.
    #[serde(default = "default_first_seed")]
    pub first_seed: Located<u64>,
    /// Settings of the option `--quick`.
    #[serde(default)]
    pub quick: Quick,
    /// Measures of every run. The first one is the main measure.
    #[serde(default = "default_measures")]
    pub measures: Located<Vec<Located<Measure>>>,
    /// Claims.
    #[serde(default)]
    pub claims: Vec<Claim>,
    /// What runs of different cells share if their run seeds are equal, such as `the drawn task`.
    /// Without it, claims cannot be `paired`.
    #[serde(default)]
    pub pairs_share: String,
    /// When results of others count as solved, in all cells that do not say it.
    #[serde(default)]
    pub solved: Option<Located<SolvedAt>>,
    /// Maximum number of episodes per agent of results of others, in all cells that do not give
    /// another one.
    #[serde(default)]
    pub max_episodes: Option<Located<Count>>,
    /// Maximum number of environment steps of the team of results of others, in all cells that do not
    /// give another one.
    #[serde(default)]
    pub max_steps: Option<Located<Count<4_000_000_000>>>,
    /// Which cells explore without direction, for a study that compares exploration.
    #[serde(default)]
    pub exploration: Option<Exploration>,
    /// What the report says of the size of teams.
    #[serde(default)]
    pub scaling: Option<Scaling>,
    /// Which measures the report compares as predictors of an outcome.
    #[serde(default)]
    pub predictors: Option<Predictors>,
    /// Figures of the report.
    #[serde(default)]
    pub figures: Vec<Figure>,
}

/// The gate for tasks of exploration: a task counts only if the best undirected baseline of a team
/// is below 0.2 in a measure with its whole interval, and some method of an equal team above 0.8, with its interval above 0.5.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exploration {
    /// Cells that explore by random actions only.
    pub undirected: Vec<Located<String>>,
    /// An undirected cell, and the cell that shows that it learns an easy variant of the task, in which it must be above 0.8.
    #[serde(default)]
    pub easy: Vec<(Located<String>, Located<String>)>,
    /// A share, such as `Solved` or `Reach`.
    pub measure: Located<Measure>,
}

/// Tables of speed-up, efficiency and diversity for cells whose names differ in a part `K n`, the number
/// of agents.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scaling {
    /// `Regret`, or a time in episodes.
    pub measure: Located<Measure>,
    /// Parts of the names of cells that differ in diversity only: with it, and without.
    #[serde(default)]
    pub diversity: Vec<(Located<String>, Located<String>)>,
}

/// A table of the rank correlations of measures with an outcome, over the runs within cells and over cells.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Predictors {
    /// The outcome, such as `EpisodesToFind`.
    pub of: Located<Measure>,
    /// Measures that may predict it, such as `At(of: TeamCoverage, episode: 25)`.
    pub measures: Located<Vec<Located<Measure>>>,
}

impl Predictors {
    /// The outcome and the measures.
    pub fn all(&self) -> impl Iterator<Item = Measure> {
        let measures = self.measures.iter();
        std::iter::once(&self.of)
            .chain(measures)
            .map(|measure| **measure)
    }

    /// Checks that there are measures, and that none is the outcome.
    fn check(&self) -> Result<(), ValidationError> {
        if self.measures.is_empty() {
            return Err(self.measures.error(
                "expected at least one measure, such as `At(of: TeamCoverage, episode: 25)`",
            ));
        }
        let mut measures = self.measures.iter();
        match measures.find(|measure| ***measure == *self.of) {
            Some(same) => {
                Err(same.error("is the outcome itself; expected another measure than that of `of`"))
            }
            None => Ok(()),
        }
    }
}

impl Scaling {
    /// Checks the measure, and that pairs are parts of the names of cells.
    ///
    /// # Errors
    /// The invalid field, and the reason.
    fn check(&self, cells: &[&str]) -> Result<(), ValidationError> {
        let measure = *self.measure;
        if !matches!(
            measure,
            Measure::Regret
                | Measure::EpisodesToSolve
                | Measure::FirstGoal
                | Measure::EpisodesToFind
        ) {
            return Err(self
                .measure
                .error("expected `Regret`, `EpisodesToSolve`, `FirstGoal` or `EpisodesToFind`"));
        }
        let parts = self
            .diversity
            .iter()
            .flat_map(|(with, without)| [with, without]);
        let is_unknown = |part: &&Located<String>| !cells.iter().any(|cell| has_part(cell, part));
        match parts.into_iter().find(is_unknown) {
            None => Ok(()),
            Some(part) => Err(unknown_part(part)),
        }
    }
}

/// One axis of a grid: values that replace `{}` in `scenario` and `set`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Text before the value in the names of cells, such as `σ`; may be empty.
    #[serde(default)]
    pub name: String,
    /// Path of the scenario, such as `"../{}.ron"`.
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// Values to replace in the scenario, such as `["agents.count={}"]`. An entry that is empty
    /// after substitution is ignored.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// Values that replace `{}`.
    pub values: Located<Vec<Located<String>>>,
    /// Names of the values in the names of cells [default: the values].
    #[serde(default)]
    pub labels: Option<Located<Vec<String>>>,
    /// Additional values to replace for each value of the axis, such as a longer `stop`: empty, or
    /// one list per value.
    #[serde(default)]
    pub with: Located<Vec<Vec<Located<String>>>>,
}

/// A cell that is not part of the grid.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedCell {
    /// Name of the cell in claims, figures and the report.
    pub name: Located<String>,
    /// Scenario [default: scenario of the study].
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// Values to replace in the scenario, after the replacements of the study.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// Results that others made, in place of runs of a scenario.
    #[serde(default)]
    pub results: Option<ResultsSource>,
    /// Name of the task of these results [default: the task of the other cells].
    #[serde(default)]
    pub task: Option<Located<String>>,
    /// Number of these runs [default: as many as there are, and in a registered study its `repeats`].
    #[serde(default)]
    pub repeats: Option<Located<Count<100_000>>>,
    /// Number of agents of each of these runs [default: as the files say].
    #[serde(default)]
    pub agents: Option<Located<Count>>,
    /// When these runs count as solved [default: as the study says].
    #[serde(default)]
    pub solved: Option<Located<SolvedAt>>,
    /// Maximum number of episodes per agent [default: as the study says]. Later episodes are not used.
    #[serde(default)]
    pub max_episodes: Option<Located<Count>>,
    /// Maximum number of environment steps of the team [default: as the study says]. Episodes that
    /// ended later are not used.
    #[serde(default)]
    pub max_steps: Option<Located<Count<4_000_000_000>>>,
}

/// Settings of a shorter version of the study, to check it before the long runs.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Quick {
    /// Number of runs per cell.
    pub repeats: Count<100_000>,
    /// Values to replace in the scenarios of all cells after all other replacements, such as a
    /// shorter `stop`.
    pub set: Vec<Located<String>>,
}

/// A claim about two cells, registered before the runs.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The claim as text.
    pub text: String,
    /// Source of the claim.
    #[serde(default)]
    pub source: String,
    /// The two compared cells, or a cell and a number, such as `("ε 0.2", "0.1")`. The effect is the
    /// measure of the first minus the measure of the second, or minus the number.
    pub compare: (Located<String>, Located<String>),
    /// Measure that is compared [default: the first of the study].
    #[serde(default)]
    pub measure: Option<Located<Measure>>,
    /// Claimed direction of the effect.
    pub direction: ClaimDirection,
    /// Smallest effect of interest or, for claims of no effect, the margin within which an effect
    /// is of no interest; in the unit of the measure.
    pub smallest: Positive,
    /// Why effects smaller than `smallest` are of no interest. Needed for confirmatory claims of no
    /// effect.
    #[serde(default)]
    pub because: String,
    /// Size of the effect according to the source, in the unit of the measure.
    #[serde(default)]
    pub claimed: Option<Positive>,
    /// Whether the claim gets a verdict. All confirmatory claims of a study share its error
    /// probability, so they should be few. Other claims are exploratory: they get an interval and
    /// no verdict.
    #[serde(default)]
    pub confirmatory: bool,
    /// Whether runs with equal run seeds are compared with each other. Only for cells whose runs
    /// share what `Study::pairs_share` says.
    #[serde(default)]
    pub paired: Located<bool>,
    /// For times: number of episodes or steps up to which times are compared. Longer times count as
    /// this number. [default: the smaller maximum number of episodes of the two cells]
    #[serde(default)]
    pub horizon: Option<Positive>,
    /// What is expected of the two cells, for the computation of power.
    #[serde(default)]
    pub expected: Option<Located<Expected>>,
}

/// What is expected of the runs of two cells, for the computation of power.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Expected {
    /// Shares of successful runs of the first and of the second cell.
    Shares(Fraction, Fraction),
    /// Standard deviation of the measure over runs or, if runs are paired, of the differences.
    Deviation(Positive),
}

impl Claim {
    /// The number with which the first cell is compared, if the second is no name but a number.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        let number: f64 = self.compare.1.parse().ok()?;
        number.is_finite().then_some(number)
    }

    /// Whether the claim is about one score per run seed: the difference of a pair, or of a run from a number.
    #[must_use]
    pub fn has_one_score_per_pair(&self) -> bool {
        *self.paired || self.number().is_some()
    }

    /// Whether the claim compares the cell with this name.
    #[must_use]
    pub fn is_about(&self, cell: &str) -> bool {
        self.cells().any(|name| name.as_str() == cell)
    }

    /// Names of the compared cells.
    pub(in crate::study) fn cells(&self) -> impl Iterator<Item = &Located<String>> {
        let second = self.number().is_none().then_some(&self.compare.1);
        [&self.compare.0].into_iter().chain(second)
    }

    /// The parts of the claim on which its verdict depends, as one line: cells, measure, direction,
    /// smallest effect of interest, role and comparison.
    #[must_use]
    pub fn canonical_text(&self, study: &Study) -> String {
        let (first_cell, second_cell) = (self.compare.0.as_str(), self.compare.1.as_str());
        let role = if self.confirmatory {
            "confirmatory"
        } else {
            "exploratory"
        };
        let pairing = if *self.paired {
            "paired"
        } else {
            "independent"
        };
        let horizon = self
            .horizon
            .map_or("default".to_owned(), |horizon| horizon.get().to_string());
        format!(
            "{first_cell} | {second_cell} | {} | {} | {} | {role} | {pairing} | horizon {horizon}",
            study.measure_of(self).canonical_text(),
            self.direction.name(),
            self.smallest.get(),
        )
    }
}

/// Whether the name of a cell has this part, as separated by commas.
pub(in crate::study) fn has_part(cell: &str, part: &str) -> bool {
    cell.split(", ").any(|each| each == part)
}

/// The error that no cell has this part in its name.
fn unknown_part(part: &Located<String>) -> ValidationError {
    part.error(format!(
        "no cell has `{}` in its name; expected a part of a cell's name, as separated by commas",
        part.as_str()
    ))
}

impl Study {
    /// Reads a study.
    ///
    /// # Errors
    /// The file is no study.
    pub fn read(path: &Path) -> Result<Document<Self>, InputError> {
        input_files::read(path)
            .map_err(synonyms::explain_in_study)
            .map_err(measure::explain_curve)
    }

    /// Number of cells of the grid.
    pub(super) fn grid_cell_count(&self) -> usize {
        if self.grid.is_empty() {
            return 0;
        }
        self.grid.iter().map(|axis| axis.values.len()).product()
    }

    /// Number of cells.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        (self.grid_cell_count() + self.cells.len()).max(1)
    }

    /// Main measure of the study: the first one.
    ///
    /// # Panics
    /// If the study has no measures, which [`check`](Self::check) excludes.
    #[must_use]
    pub fn main_measure(&self) -> Measure {
        **self
            .measures
            .first()
            .expect("a checked study has a measure")
    }

    /// Whether the study compares a first with a second cell in the opposite direction: the first of
    /// its claims about both cells and this measure names them so. A report has one comparison of
    /// two cells in a measure, whichever is named first.
    #[must_use]
    pub fn compares_in_reverse(&self, measure: Measure, first: &str, second: &str) -> bool {
        let compared = self
            .claims
            .iter()
            .filter(|claim| self.measure_of(claim) == measure)
            .map(|claim| [claim.compare.0.as_str(), claim.compare.1.as_str()]);
        let mut about_both =
            compared.filter(|names| [[first, second], [second, first]].contains(names));
        about_both.next() == Some([second, first])
    }

    /// Measure that a claim compares.
    #[must_use]
    pub fn measure_of(&self, claim: &Claim) -> Measure {
        claim
            .measure
            .as_ref()
            .map_or_else(|| self.main_measure(), |measure| **measure)
    }

    /// Numbers of runs per cell at which confirmatory claims are evaluated.
    #[must_use]
    pub fn looks(&self) -> Vec<u64> {
        if self.looks.is_empty() {
            return vec![self.repeats.get().into()];
        }
        self.looks.iter().map(|look| look.get().into()).collect()
    }

    /// Indices of the confirmatory claims of an effect or, if `is_null`, of no effect.
    #[must_use]
    pub fn family(&self, is_null: bool) -> Vec<usize> {
        let claims = self.claims.iter().enumerate();
        let members = claims
            .filter(|(_, claim)| claim.confirmatory && claim.direction.rule().is_null == is_null);
        members.map(|(index, _)| index).collect()
    }

    /// Checks the study. `cells` are the names of all its cells.
    ///
    /// # Errors
    /// The invalid field, and the reason.
    pub fn check(&self, cells: &[&str]) -> Result<(), ValidationError> {
        self.check_seeds()?;
        let looks = self.looks();
        let ends_with_all = looks.last() == Some(&self.repeats.get().into());
        if !ends_with_all || !looks.is_sorted_by(|earlier, later| earlier < later) {
            return Err(self.looks.error(format!(
                "expected ascending numbers of runs per cell, the last of which is `repeats` ({})",
                self.repeats.get()
            )));
        }
        if self.measures.is_empty() {
            return Err(self
                .measures
                .error("expected at least one measure, such as `EpisodesToSolve`"));
        }
        let compared = self.claims.iter().flat_map(Claim::cells);
        let figures = self.figures.iter();
        let drawn = figures.flat_map(|figure| figure.cells().iter().chain(figure.line()));
        let exploration = self.exploration.iter();
        let undirected = exploration
            .clone()
            .flat_map(|exploration| &exploration.undirected);
        let easy = exploration.flat_map(|exploration| &exploration.easy);
        let easy = easy.flat_map(|(baseline, easy)| [baseline, easy]);
        let is_unknown = |name: &&Located<String>| !cells.contains(&name.as_str());
        let named = compared.chain(drawn).chain(undirected).chain(easy);
        if let Some(name) = named.into_iter().find(is_unknown) {
            return Err(name.unknown_name("cell", cells.iter().copied()));
        }
        if let Some(Exploration { measure, .. }) = &self.exploration
            && !measure.is_share()
        {
            return Err(measure.error("expected a share, such as `Solved`, `Reach` or `Found`"));
        }
        self.check_pools(cells)?;
        self.check_differences(cells)?;
        if let Some(scaling) = &self.scaling {
            scaling.check(cells)?;
        }
        if let Some(predictors) = &self.predictors {
            predictors.check()?;
        }
        self.claims
            .iter()
            .try_for_each(|claim| self.check_claim(claim))
    }

    /// Checks the fields of cells that have results of others, before these are read.
    ///
    /// # Errors
    /// The invalid field, and the reason.
    pub(in crate::study) fn check_results(&self) -> Result<(), ValidationError> {
        for cell in &self.cells {
            let has_scenario = cell.scenario.is_some() || !cell.set.is_empty();
            let has_fields_of_results = cell.task.is_some()
                || cell.repeats.is_some()
                || cell.agents.is_some()
                || cell.solved.is_some()
                || cell.max_episodes.is_some()
                || cell.max_steps.is_some();
            if cell.results.is_some() && has_scenario {
                return Err(cell.name.error(
                    "a cell with `results` is not run; expected no `scenario` and no `set`",
                ));
            }
            if cell.results.is_none() && has_fields_of_results {
                return Err(cell.name.error(
                    "`task`, `repeats`, `agents`, `solved`, `max_episodes` and `max_steps` are for cells with `results`; \
                     expected them in the scenario, or `results`",
                ));
            }
        }
        let has_results = self.cells.iter().any(|cell| cell.results.is_some());
        let message = "`solved`, `max_episodes` and `max_steps` are for cells with `results`, and the study has none; \
                       expected them in the scenario";
        let solved = self.solved.as_ref().map(|solved| solved.error(message));
        let max_episodes = || Some(self.max_episodes.as_ref()?.error(message));
        let max_steps = || Some(self.max_steps.as_ref()?.error(message));
        if let Some(error) = solved.or_else(max_episodes).or_else(max_steps)
            && !has_results
        {
            return Err(error);
        }
        if has_results && self.looks().len() > 1 {
            return Err(self.looks.error(
                "results of others have no order, so that no lock could say which are the first; expected one look",
            ));
        }
        let claims = self.claims.iter();
        claims
            .into_iter()
            .try_for_each(|claim| self.check_claim_about_results(claim))
    }

    /// Checks a claim that may compare results of others.
    fn check_claim_about_results(&self, claim: &Claim) -> Result<(), ValidationError> {
        let compared: Vec<&NamedCell> = claim
            .cells()
            .filter_map(|name| self.cells.iter().find(|cell| cell.name == *name))
            .filter(|cell| cell.results.is_some())
            .collect();
        if !compared.is_empty() && *claim.paired {
            return Err(claim.paired.error(
                "run seeds of others are not known, so that their runs cannot be paired; expected `paired: false`",
            ));
        }
        let measure = self.measure_of(claim);
        let counts_episodes = measure.is_time() && !measure.is_time_in_env_steps();
        let needs_horizon = claim.confirmatory && counts_episodes && claim.horizon.is_none();
        let has_no_maximum =
            |cell: &&NamedCell| cell.max_episodes.is_none() && self.max_episodes.is_none();
        if needs_horizon && compared.iter().any(has_no_maximum) {
            return Err(claim.compare.0.error(
                "a confirmatory claim on a time of results of others needs a number of episodes up to which times are \
                 compared; expected `horizon` in the claim, or `max_episodes` in the cell or the study",
            ));
        }
        Ok(())
    }

    /// The cell with this name, if it has results of others.
    #[must_use]
    pub fn external_cell(&self, name: &str) -> Option<&NamedCell> {
        let cell = self.cells.iter().find(|cell| *cell.name == name)?;
        cell.results.is_some().then_some(cell)
    }

    /// Number of runs that others should have made of the cell with this name; `None` if any number is
    /// right.
    #[must_use]
    pub fn expected_runs_of_others(&self, cell: &str, is_registered: bool) -> Option<u64> {
        let repeats = self.external_cell(cell)?.repeats.as_ref();
        let of_study = is_registered.then_some(self.repeats.get());
        let expected = repeats.map(|repeats| repeats.get()).or(of_study);
        expected.map(u64::from)
    }

    fn check_claim(&self, claim: &Claim) -> Result<(), ValidationError> {
        let measure = self.measure_of(claim);
        if claim.compare.0 == claim.compare.1 {
            return Err(claim
                .compare
                .1
                .error("expected a cell other than the first"));
        }
        if claim.confirmatory && claim.direction.rule().is_null && claim.because.trim().is_empty() {
            return Err(claim.compare.0.error(
                "a confirmatory claim of no effect needs a reason for its margin; expected \
                 `because: \"…\"`, why effects below `smallest` are of no interest",
            ));
        }
        if claim.number().is_some() && measure.is_yes_or_no() {
            return Err(claim.compare.1.error(
                "shares of runs cannot be compared with a number; expected the name of a cell",
            ));
        }
        if *claim.paired && self.pairs_share.trim().is_empty() {
            return Err(claim.paired.error(
                "equal run seeds do not make runs of different cells alike; expected \
                 `pairs_share: \"…\"` in the study, what such runs share, or no `paired`",
            ));
        }
        if *claim.paired && measure.is_yes_or_no() {
            return Err(claim
                .paired
                .error("shares of runs cannot be paired; expected `paired: false`"));
        }
        if measure.is_time_in_env_steps() && claim.horizon.is_none() {
            return Err(claim.compare.0.error(format!(
                "a claim on `{}` needs `horizon`, the number of environment steps up \
                 to which times are compared",
                measure.canonical_text()
            )));
        }
        let is_of_shares = matches!(claim.expected.as_deref(), Some(Expected::Shares(..)));
        match &claim.expected {
            Some(expected) if is_of_shares != measure.is_yes_or_no() => Err(expected.error(
                "expected `Shares(first, second)` for `Solved` and `RegretAbove`, and `Deviation(…)` for \
                 all others",
            )),
            _ => Ok(()),
        }
    }

    /// Checks that figures pool runs of several tasks only in shares, which can be compared between
    /// tasks.
    fn check_pools(&self, cells: &[&str]) -> Result<(), ValidationError> {
        for (figure, over) in self
            .figures
            .iter()
            .filter_map(|figure| Some((figure, figure.over()?)))
        {
            if !figure
                .required_measure(self.main_measure())
                .is_some_and(Measure::is_share)
            {
                return Err(over.error(
                    "only shares can be pooled over tasks; expected a `measure` from 0 to 1, such \
                         as `Reach`",
                ));
            }
            let is_known = |name_part: &&String| cells.iter().any(|cell| has_part(cell, name_part));
            if let Some(name_part) = over.iter().find(|name_part| !is_known(name_part)) {
                return Err(over.error(format!(
                    "no cell has `{name_part}` in its name; expected a part of a cell's name, as \
                         separated by commas"
                )));
            }
        }
        Ok(())
    }

    /// Checks that every figure of differences has cells to compare.
    fn check_differences(&self, cells: &[&str]) -> Result<(), ValidationError> {
        let differences = self.figures.iter().filter_map(Figure::compared_parts);
        let mut parts = differences.flat_map(|(first, second)| [first, second]);
        let is_unknown =
            |part: &&Located<String>| !cells.iter().any(|cell| has_part(cell, part.as_str()));
        parts
            .find(is_unknown)
            .map_or(Ok(()), |part| Err(unknown_part(part)))
    }

    /// Checks that run seeds are either all for tuning or all for reported results.
    fn check_seeds(&self) -> Result<(), ValidationError> {
        let (first_seed, count) = (
            *self.first_seed,
            u64::from(self.repeats.get().max(self.quick.repeats.get())),
        );
        let Some(end) = first_seed.checked_add(count) else {
            return Err(self.first_seed.error("this whole number is too large"));
        };
        let last_seed = end - 1;
        let seed_assignment = self.assignments().find(|assignment| {
            assignment
                .split('=')
                .next()
                .is_some_and(|path| path.trim() == "seed")
        });
        if let Some(assignment) = seed_assignment {
            return Err(assignment.error(
                "the seed cannot be set here; expected `first_seed`, the seed of the first run",
            ));
        }
        if first_seed < FIRST_REPORTING_SEED && last_seed >= FIRST_REPORTING_SEED {
            return Err(self.first_seed.error(format!(
                "seeds {first_seed} to {last_seed} include both seeds for tuning (0 to {}) and seeds for reported \
                 results; expected fewer `repeats`, or `first_seed: {FIRST_REPORTING_SEED}`",
                FIRST_REPORTING_SEED - 1
            )));
        }
        Ok(())
    }

    /// All replacements of values in scenarios, each as `path=value`.
    fn assignments(&self) -> impl Iterator<Item = &Located<String>> {
        let of_grid = self
            .grid
            .iter()
            .flat_map(|axis| axis.set.iter().chain(axis.with.iter().flatten()));
        let of_cells = self.cells.iter().flat_map(|cell| &cell.set);
        self.set
            .iter()
            .chain(&self.quick.set)
            .chain(of_grid)
            .chain(of_cells)
    }
}

impl Default for Quick {
    fn default() -> Self {
        Self {
            repeats: ranged_count(5),
            set: Vec::new(),
        }
    }
}

fn default_repeats() -> Located<Count<100_000>> {
    ranged_count(20).into()
}

fn default_first_seed() -> Located<u64> {
    FIRST_REPORTING_SEED.into()
}

fn default_measures() -> Located<Vec<Located<Measure>>> {
    vec![Measure::EpisodesToSolve.into()].into()
}
