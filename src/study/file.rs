//! Study files: which settings are compared, how many runs each has, and what is claimed before any
//! of them is run.

use serde::{Deserialize, Serialize};

use super::figure::Figure;
use super::measure::Measure;
use seedbed_env::input::numbers::{Count, Positive, known_count};
use seedbed_env::input::{Located, ValidationError};

/// First seed for reported results. Smaller seeds are for tuning.
pub const FIRST_REPORTING_SEED: u64 = 1000;

/// A study file: `Study(…)` in `scenarios/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Title of the report.
    pub title: String,
    /// Subject of the study, and source of its claims.
    #[serde(default)]
    pub about: String,
    /// Scenario of all cells without one of their own, as a path from the study's folder.
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// Values that all cells replace in their scenario, each as `path=value`.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// Axes; every combination of their values is a cell.
    #[serde(default)]
    pub grid: Vec<Axis>,
    /// Cells in addition to those of the grid.
    #[serde(default)]
    pub cells: Vec<NamedCell>,
    /// Number of runs per cell. All cells have the same seeds.
    #[serde(default = "default_repeats")]
    pub repeats: Located<Count<100_000>>,
    /// First seed: 0 to 999 for tuning, at least 1000 for reported results.
    #[serde(default = "default_first_seed")]
    pub first_seed: Located<u64>,
    /// What `--quick` changes.
    #[serde(default)]
    pub quick: Quick,
    /// Measures of every run. The first is the main one.
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
    /// Name before the value in the names of cells, such as `σ`; may be empty.
    #[serde(default)]
    pub name: String,
    /// Path of the scenario, such as `"../{}.ron"`.
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// Values to replace in the scenario, such as `["agents.count={}"]`. An entry that is empty
    /// after substitution is ignored.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// Values for `{}`.
    pub values: Located<Vec<Located<String>>>,
    /// Names of the values in the names of cells, if not the values themselves.
    #[serde(default)]
    pub labels: Option<Located<Vec<String>>>,
    /// Further replacements for each value, such as a longer `stop`: empty, or one list per value.
    #[serde(default)]
    pub with: Located<Vec<Vec<Located<String>>>>,
}

/// One setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedCell {
    /// Name by which claims and figures refer to it.
    pub name: Located<String>,
    /// Scenario, if not that of the study.
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// Values to replace in the scenario, after those of the study.
    #[serde(default)]
    pub set: Vec<Located<String>>,
}

/// A smaller version of the study, to check it before the long runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Quick {
    /// Number of runs per cell.
    pub repeats: Count<100_000>,
    /// Values that all cells replace last, such as a shorter `stop`.
    pub set: Vec<Located<String>>,
}

/// A claim about two cells, with the test that decides it, registered before the runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// The claim in words.
    pub text: String,
    /// Source of the claim.
    #[serde(default)]
    pub source: String,
    /// Two cells. The effect is the measure of the first less that of the second.
    pub compare: (Located<String>, Located<String>),
    /// Measure that is compared [default: the first of the study].
    #[serde(default)]
    pub measure: Option<Located<Measure>>,
    /// ClaimDirection direction of the effect.
    pub direction: ClaimDirection,
    /// ClaimDirection size of the effect or, for claims of no effect, the smallest size that would matter;
    /// in units of the measure.
    pub size: Positive,
    /// How runs are compared.
    #[serde(default)]
    pub test: Test,
}

impl Claim {
    /// What decides the claim, as one line: cells, measure, direction, size and test.
    #[must_use]
    pub fn canonical_text(&self, study: &Study) -> String {
        let (first, second) = (self.compare.0.as_str(), self.compare.1.as_str());
        format!(
            "{first} | {second} | {:?} | {:?} | {} | {:?}",
            study.measure_of(self),
            self.direction,
            self.size.get(),
            self.test
        )
    }
}

/// ClaimDirection direction of an effect: the measure of the first cell less that of the second.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClaimDirection {
    /// Above 0.
    More,
    /// Below 0.
    Less,
    /// Smaller than `size` in both directions.
    Same,
    /// Below `size`: no gain that matters.
    NotMore,
    /// Above −`size`: no loss that matters.
    NotLess,
}

impl ClaimDirection {
    /// Whether the first cell is claimed to be above the second, or at least not below it.
    #[must_use]
    pub fn is_upwards(self) -> bool {
        matches!(self, Self::More | Self::NotLess)
    }

    /// Whether no effect that matters is claimed, in both directions or in one.
    #[must_use]
    pub fn is_null(self) -> bool {
        matches!(self, Self::Same | Self::NotMore | Self::NotLess)
    }
}

/// How the runs of two cells are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Test {
    /// Seed by seed, with Wilcoxon's signed-rank test.
    #[default]
    Paired,
    /// As two samples, with the log-rank test for times and Welch's test for other measures.
    Independent,
}

impl Study {
    /// Main measure.
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

    /// Checks a study whose cells have these names.
    ///
    /// # Errors
    /// The field that is wrong, and why.
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
        let unknown = |name: &&Located<String>| !cells.contains(&name.as_str());
        if let Some(name) = compared.chain(drawn).find(unknown) {
            return Err(name.unknown_name("cell", cells.iter().copied()));
        }
        self.check_pools(cells)?;
        let itself = self
            .claims
            .iter()
            .find(|claim| claim.compare.0 == claim.compare.1);
        itself.map_or(Ok(()), |claim| {
            Err(claim
                .compare
                .1
                .error("expected a cell other than the first"))
        })
    }

    /// Runs of several tasks are pooled only in shares, which mean the same in all tasks.
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
            let is_known = |word: &&String| {
                cells
                    .iter()
                    .any(|cell| cell.split(", ").any(|part| part == word.as_str()))
            };
            if let Some(word) = over.iter().find(|word| !is_known(word)) {
                return Err(over.error(format!(
                    "no cell has `{word}` in its name; expected a part of a cell's name, as \
                         separated by commas"
                )));
            }
        }
        Ok(())
    }

    /// Seeds for tuning and for reported results must not be mixed.
    fn check_seeds(&self) -> Result<(), ValidationError> {
        let (first, count) = (
            *self.first_seed,
            u64::from(self.repeats.get().max(self.quick.repeats.get())),
        );
        let Some(end) = first.checked_add(count) else {
            return Err(self.first_seed.error("this whole number is too large"));
        };
        let last = end - 1;
        let seeded = self.assignments().find(|set| {
            set.split('=')
                .next()
                .is_some_and(|path| path.trim() == "seed")
        });
        if let Some(set) = seeded {
            return Err(set.error(
                "the seed cannot be set here; expected `first_seed`, the seed of the first run",
            ));
        }
        if first < FIRST_REPORTING_SEED && last >= FIRST_REPORTING_SEED {
            return Err(self.first_seed.error(format!(
                "seeds {first} to {last} include both seeds for tuning (0 to {}) and seeds for reported \
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
            repeats: known_count(5),
            set: Vec::new(),
        }
    }
}

fn default_repeats() -> Located<Count<100_000>> {
    known_count(20).into()
}

fn default_first_seed() -> Located<u64> {
    FIRST_REPORTING_SEED.into()
}

fn default_measures() -> Located<Vec<Located<Measure>>> {
    vec![Measure::EpisodesToSolve.into()].into()
}
