//! Study files: which settings are compared, how often each is run, and what is claimed of them before anything ran.

use serde::{Deserialize, Serialize};

use super::figure::Figure;
use super::measure::Measure;
use crate::input::numbers::{Count, Positive, known_count};
use crate::input::{Complaint, Located};

/// Seeds below this are for tuning; published results take seeds from here on.
pub const FIRST_REPORTING_SEED: u64 = 1000;

/// A study file: `Study(…)` in `scenarios/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Heads the report.
    pub title: String,
    /// What it is about, and where the claims come from.
    #[serde(default)]
    pub about: String,
    /// The scenario of all cells that name no other, as a path from the study's folder.
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// What all cells replace in their scenario, each as `path=value`.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// Axes of which every combination of values is a cell.
    #[serde(default)]
    pub grid: Vec<Axis>,
    /// Cells beside the grid's.
    #[serde(default)]
    pub cells: Vec<NamedCell>,
    /// Runs of each cell, with seeds that all cells have in common.
    #[serde(default = "default_repeats")]
    pub repeats: Located<Count<100_000>>,
    /// The first of these seeds: 0 to 999 while tuning, from 1000 on for what is reported.
    #[serde(default = "default_first_seed")]
    pub first_seed: Located<u64>,
    /// What `--quick` does instead.
    #[serde(default)]
    pub quick: Quick,
    /// What is measured of every run; the first one counts.
    #[serde(default = "default_measures")]
    pub measures: Located<Vec<Located<Measure>>>,
    /// What is claimed.
    #[serde(default)]
    pub claims: Vec<Claim>,
    /// What is drawn.
    #[serde(default)]
    pub figures: Vec<Figure>,
}

/// One axis of a grid: what stands for `{}` in `scenario` and `set`, value by value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Stands before the value in the names of cells, such as `σ`; may be empty.
    #[serde(default)]
    pub name: String,
    /// The scenario, such as `"../{}.ron"`.
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// What is replaced in the scenario, such as `["agents.count={}"]`. What is empty after replacing `{}` counts for nothing.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// What stands for `{}`.
    pub values: Located<Vec<Located<String>>>,
    /// How values are called in the names of cells, where not by themselves.
    #[serde(default)]
    pub labels: Option<Located<Vec<String>>>,
    /// What else each value replaces, such as how long its task takes; nothing, or one list for each value.
    #[serde(default)]
    pub with: Located<Vec<Vec<Located<String>>>>,
}

/// One setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedCell {
    /// What claims and figures call it.
    pub name: Located<String>,
    /// Its scenario, where not the study's.
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// What it replaces there, after what the study does.
    #[serde(default)]
    pub set: Vec<Located<String>>,
}

/// A smaller study of the same shape, to see whether everything is as meant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Quick {
    /// Runs of each cell.
    pub repeats: Count<100_000>,
    /// What all cells replace last, such as a shorter `stop`.
    pub set: Vec<Located<String>>,
}

/// Something that the data may bear out, with the test that decides, fixed before the runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// In words.
    pub text: String,
    /// Who claims it, and where.
    #[serde(default)]
    pub source: String,
    /// Two cells; the effect is the first's measure less the second's.
    pub compare: (Located<String>, Located<String>),
    /// What is compared; the study's first measure if nothing is said.
    #[serde(default)]
    pub measure: Option<Located<Measure>>,
    /// Which way the effect is said to go.
    pub direction: Claimed,
    /// How large it is said to be or, where none is claimed, the least that would matter; in units of the measure.
    pub size: Positive,
    /// How runs are set against each other.
    #[serde(default)]
    pub test: Test,
}

impl Claim {
    /// What decides it, without the words: cells, measure, direction, size and test.
    #[must_use]
    pub fn spelled_out(&self, study: &Study) -> String {
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

/// What is claimed of an effect: the first cell's measure less the second's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Claimed {
    /// It is above 0.
    More,
    /// It is below 0.
    Less,
    /// It is smaller than `size` in both directions.
    Same,
    /// It is below `size`: no gain worth the name.
    NotMore,
    /// It is above −`size`: no loss worth the name.
    NotLess,
}

impl Claimed {
    /// Whether it is that the first is above the second, or at least not below.
    #[must_use]
    pub fn is_upwards(self) -> bool {
        matches!(self, Self::More | Self::NotLess)
    }

    /// Whether it is that there is no effect worth the name, in both directions or in one.
    #[must_use]
    pub fn is_null(self) -> bool {
        matches!(self, Self::Same | Self::NotMore | Self::NotLess)
    }
}

/// How runs of two cells are set against each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Test {
    /// Seed by seed, with Wilcoxon's signed-rank test.
    #[default]
    Paired,
    /// As two samples, with the log-rank test for times and Welch's test for all else.
    Independent,
}

impl Study {
    /// The measure that counts.
    ///
    /// # Panics
    /// If the study was not checked and measures nothing.
    #[must_use]
    pub fn main_measure(&self) -> Measure {
        **self
            .measures
            .first()
            .expect("a checked study measures something")
    }

    /// What a claim compares.
    #[must_use]
    pub fn measure_of(&self, claim: &Claim) -> Measure {
        claim
            .measure
            .as_ref()
            .map_or_else(|| self.main_measure(), |measure| **measure)
    }

    /// Says what is wrong with a study whose cells have these names.
    ///
    /// # Errors
    /// The field to blame, and why.
    pub fn check(&self, cells: &[&str]) -> Result<(), Complaint> {
        self.check_seeds()?;
        if self.measures.is_empty() {
            return Err(self
                .measures
                .complain("expected at least one measure, such as `EpisodesToSolve`"));
        }
        let compared = self
            .claims
            .iter()
            .flat_map(|claim| [&claim.compare.0, &claim.compare.1]);
        let drawn = self.figures.iter().flat_map(Figure::cells);
        let unknown = |name: &&Located<String>| !cells.contains(&name.as_str());
        if let Some(name) = compared.chain(drawn).find(unknown) {
            return Err(name.complain_unknown("cell", cells.iter().copied()));
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
                .complain("expected another cell than the first"))
        })
    }

    /// Only shares mean the same in all tasks.
    fn check_pools(&self, cells: &[&str]) -> Result<(), Complaint> {
        for (figure, over) in self
            .figures
            .iter()
            .filter_map(|figure| Some((figure, figure.over()?)))
        {
            if !figure
                .shown(self.main_measure())
                .is_some_and(Measure::is_share)
            {
                return Err(
                    over.complain("only shares can be pooled over tasks; expected a `measure` from 0 to 1, such as `Reach`")
                );
            }
            let is_known = |word: &&String| {
                cells
                    .iter()
                    .any(|cell| cell.split(", ").any(|part| part == word.as_str()))
            };
            if let Some(word) = over.iter().find(|word| !is_known(word)) {
                return Err(
                    over.complain(format!("no cell has `{word}` in its name; expected words between commas of cells' names"))
                );
            }
        }
        Ok(())
    }

    /// Tuning and reporting seeds do not mix.
    fn check_seeds(&self) -> Result<(), Complaint> {
        let (first, count) = (
            *self.first_seed,
            u64::from(self.repeats.get().max(self.quick.repeats.get())),
        );
        let Some(end) = first.checked_add(count) else {
            return Err(self.first_seed.complain("this whole number is too large"));
        };
        let last = end - 1;
        let seeded = self.assignments().find(|set| {
            set.split('=')
                .next()
                .is_some_and(|path| path.trim() == "seed")
        });
        if let Some(set) = seeded {
            return Err(set.complain("runs take their seeds from `first_seed` on"));
        }
        if first < FIRST_REPORTING_SEED && last >= FIRST_REPORTING_SEED {
            return Err(self.first_seed.complain(format!(
                "seeds {first} to {last} mix those for tuning, 0 to {}, with those that may be reported; expected fewer `repeats`, or \
                 `first_seed: {FIRST_REPORTING_SEED}`",
                FIRST_REPORTING_SEED - 1
            )));
        }
        Ok(())
    }

    /// All that replaces values of scenarios, each as `path=value`.
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
