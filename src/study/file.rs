//! Study files: the cells that are compared, the number of runs per cell, and claims that are
//! registered before the runs.

use serde::{Deserialize, Serialize};

use super::figure::Figure;
use super::measure::Measure;
use seedbed_env::input::numbers::{Count, Positive, ranged_count};
use seedbed_env::input::{Located, ValidationError};

/// First run seed for reported results. Smaller run seeds are for tuning.
pub const FIRST_REPORTING_SEED: u64 = 1000;

/// A study file: `Study(…)` in `scenarios/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Figures of the report.
    #[serde(default)]
    pub figures: Vec<Figure>,
}

/// One axis of a grid: values that replace `{}` in `scenario` and `set`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
}

/// Settings of a shorter version of the study, to check it before the long runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Quick {
    /// Number of runs per cell.
    pub repeats: Count<100_000>,
    /// Values to replace in the scenarios of all cells after all other replacements, such as a
    /// shorter `stop`.
    pub set: Vec<Located<String>>,
}

/// A claim about two cells, registered before the runs, with the test that evaluates it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The claim as text.
    pub text: String,
    /// Source of the claim.
    #[serde(default)]
    pub source: String,
    /// The two compared cells. The effect is the measure of the first minus the measure of the
    /// second.
    pub compare: (Located<String>, Located<String>),
    /// Measure that is compared [default: the first of the study].
    #[serde(default)]
    pub measure: Option<Located<Measure>>,
    /// Claimed direction of the effect.
    pub direction: ClaimDirection,
    /// Claimed size of the effect or, for claims of no effect, the smallest relevant size; in the
    /// unit of the measure.
    pub size: Positive,
    /// Test that compares the runs.
    #[serde(default)]
    pub test: Test,
}

impl Claim {
    /// The parts of the claim on which its verdict depends, as one line: cells, measure, direction,
    /// size and test.
    #[must_use]
    pub fn canonical_text(&self, study: &Study) -> String {
        let (first_cell, second_cell) = (self.compare.0.as_str(), self.compare.1.as_str());
        format!(
            "{first_cell} | {second_cell} | {:?} | {:?} | {} | {:?}",
            study.measure_of(self),
            self.direction,
            self.size.get(),
            self.test
        )
    }
}

/// Claimed direction of an effect, which is the measure of the first cell minus the measure of the
/// second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClaimDirection {
    /// Above 0.
    More,
    /// Below 0.
    Less,
    /// Smaller than `size` in both directions.
    Same,
    /// Below `size`: the first cell is not relevantly larger.
    NotMore,
    /// Above −`size`: the first cell is not relevantly smaller.
    NotLess,
}

impl ClaimDirection {
    /// Whether the claim is that the first cell is above the second, or not below it.
    #[must_use]
    pub fn is_upwards(self) -> bool {
        matches!(self, Self::More | Self::NotLess)
    }

    /// Whether the claim is that there is no relevant effect, in both directions or in one.
    #[must_use]
    pub fn is_null(self) -> bool {
        matches!(self, Self::Same | Self::NotMore | Self::NotLess)
    }
}

/// How the runs of two cells are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Test {
    /// Paired by run seed, with Wilcoxon's signed-rank test.
    #[default]
    Paired,
    /// As two samples, with the log-rank test for times and Welch's test for other measures.
    Independent,
}

impl Study {
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

    /// Measure that a claim compares.
    #[must_use]
    pub fn measure_of(&self, claim: &Claim) -> Measure {
        claim
            .measure
            .as_ref()
            .map_or_else(|| self.main_measure(), |measure| **measure)
    }

    /// Checks the study. `cells` are the names of all its cells.
    ///
    /// # Errors
    /// The invalid field, and the reason.
    pub fn check(&self, cells: &[&str]) -> Result<(), ValidationError> {
        self.check_seeds()?;
        if self.measures.is_empty() {
            return Err(self
                .measures
                .error("expected at least one measure, such as `EpisodesToSolve`"));
        }
        let compared = self
            .claims
            .iter()
            .flat_map(|claim| [&claim.compare.0, &claim.compare.1]);
        let drawn = self.figures.iter().flat_map(Figure::cells);
        let is_unknown = |name: &&Located<String>| !cells.contains(&name.as_str());
        if let Some(name) = compared.chain(drawn).find(is_unknown) {
            return Err(name.unknown_name("cell", cells.iter().copied()));
        }
        self.check_pools(cells)?;
        let claim_about_one_cell = self
            .claims
            .iter()
            .find(|claim| claim.compare.0 == claim.compare.1);
        claim_about_one_cell.map_or(Ok(()), |claim| {
            Err(claim
                .compare
                .1
                .error("expected a cell other than the first"))
        })
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
            let is_known = |name_part: &&String| {
                cells
                    .iter()
                    .any(|cell| cell.split(", ").any(|part| part == name_part.as_str()))
            };
            if let Some(name_part) = over.iter().find(|name_part| !is_known(name_part)) {
                return Err(over.error(format!(
                    "no cell has `{name_part}` in its name; expected a part of a cell's name, as \
                         separated by commas"
                )));
            }
        }
        Ok(())
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
