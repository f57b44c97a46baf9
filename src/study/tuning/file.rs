//! Tuning files: the methods that are tuned with equal budgets, and the space of their parameters.

use std::path::Path;

use serde::Deserialize;

use crate::experiment::measure::{self, Measure};
use crate::input_files;
use crate::scenario::synonyms;
use crate::study::design::file::FIRST_REPORTING_SEED;
use seedbed_input::numbers::{Count, FiniteNumber, Positive, ranged_count};
use seedbed_input::{Document, InputError, Located, ValidationError};

/// A tuning file: `Tuning(…)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tuning {
    /// Subject of the search.
    pub title: String,
    /// Why these methods and this space.
    #[serde(default)]
    pub about: String,
    /// Scenario of all methods that do not give another one: a path relative to the folder of the
    /// tuning file, or the name of a scenario.
    pub scenario: Located<String>,
    /// Values to replace in the scenarios of all methods, each as `path=value`.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// Methods, which are tuned separately with the same budget.
    pub methods: Located<Vec<Method>>,
    /// Parameters of all methods.
    #[serde(default)]
    pub space: Vec<Parameter>,
    /// Measure of every run.
    pub measure: Located<Measure>,
    /// Whether large or small values of the measure are better.
    pub goal: Goal,
    /// For times: number of episodes or steps as which a run counts that took longer or did not
    /// reach the time. [default: the largest maximum number of episodes of all configurations]
    #[serde(default)]
    pub horizon: Option<Positive>,
    /// First of the run seeds, which are all below 1000.
    #[serde(default)]
    pub first_seed: Located<u64>,
    /// Number of runs of each configuration in rung 0.
    #[serde(default = "default_runs")]
    pub runs: Located<Count<1000>>,
    /// One of this many configurations is kept after each rung, with this many times as many runs.
    #[serde(default = "default_eta")]
    pub eta: Located<Count<100, 2>>,
}

/// A method that is tuned.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Method {
    /// Name of the method in tables and files.
    pub name: Located<String>,
    /// Scenario [default: scenario of the tuning file].
    #[serde(default)]
    pub scenario: Option<Located<String>>,
    /// Values to replace in the scenario, after the replacements of the tuning file.
    #[serde(default)]
    pub set: Vec<Located<String>>,
    /// Parameters of this method, in addition to those of all methods.
    #[serde(default)]
    pub space: Vec<Parameter>,
}

/// A parameter that is searched.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Name in tables [default: the path in the first entry of `set`].
    #[serde(default)]
    pub name: Option<Located<String>>,
    /// Values to replace in the scenario, such as `["algorithm.discount={}"]`. An entry that is empty
    /// after substitution is ignored.
    pub set: Located<Vec<Located<String>>>,
    /// Distribution of the value that replaces `{}`.
    pub draw: Located<Distribution>,
}

/// Distribution of the values of a parameter.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Distribution {
    /// A number between two numbers, with equal density.
    Uniform(FiniteNumber, FiniteNumber),
    /// A number between two numbers above 0, whose logarithm has equal density.
    LogUniform(Positive, Positive),
    /// A whole number from the first to the second, each with equal probability.
    Integer(u32, u32),
    /// One of these texts, each with equal probability.
    Choice(Vec<Located<String>>),
}

/// Which values of the measure are better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Goal {
    /// Large values are better.
    Maximize,
    /// Small values are better.
    Minimize,
}

/// Columns that every table of runs has; no parameter may have their names.
pub(super) const COLUMNS: [&str; 7] = [
    "method",
    "configuration",
    "rung",
    "run_seed",
    "state",
    "value",
    "reason",
];

impl Tuning {
    /// Reads a tuning file.
    ///
    /// # Errors
    /// The file is no tuning file.
    pub fn read(path: &Path) -> Result<Document<Self>, InputError> {
        input_files::read(path)
            .map_err(synonyms::explain_in_study)
            .map_err(measure::explain_curve)
    }

    /// Number of run seeds from the first one to the end of those for tuning.
    #[must_use]
    pub fn max_runs(&self) -> u64 {
        FIRST_REPORTING_SEED.saturating_sub(*self.first_seed)
    }

    /// The parameters of a method: those of all methods, then its own.
    pub fn parameters<'a>(&'a self, method: &'a Method) -> impl Iterator<Item = &'a Parameter> {
        self.space.iter().chain(&method.space)
    }

    /// Checks what can be checked without scenarios.
    ///
    /// # Errors
    /// The invalid field, and the reason.
    pub fn check(&self) -> Result<(), ValidationError> {
        if *self.first_seed >= FIRST_REPORTING_SEED {
            return Err(self.first_seed.error(format!(
                "run seeds for tuning are 0 to {}; expected one of these, found {}",
                FIRST_REPORTING_SEED - 1,
                *self.first_seed
            )));
        }
        if u64::from(self.runs.get()) > self.max_runs() {
            return Err(self.runs.error(format!(
                "expected at most {}, the number of run seeds for tuning from {} on, found {}",
                self.max_runs(),
                *self.first_seed,
                self.runs.get()
            )));
        }
        if self.methods.is_empty() {
            return Err(self.methods.error("expected at least one method"));
        }
        if self.measure.is_time_in_env_steps() && self.horizon.is_none() {
            return Err(self.measure.error(format!(
                "`{}` needs `horizon`, the number of environment steps as which runs \
                 count that take longer",
                self.measure.canonical_text()
            )));
        }
        if !self.measure.is_time() && self.horizon.is_some() {
            return Err(self
                .measure
                .error("`horizon` is for times only; expected no `horizon`"));
        }
        self.check_seed_is_not_set()?;
        let methods = self.methods.iter().enumerate();
        methods
            .into_iter()
            .try_for_each(|(index, method)| self.check_method(index, method))
    }

    fn check_method(&self, index: usize, method: &Method) -> Result<(), ValidationError> {
        if method.name.trim().is_empty() {
            return Err(method.name.error("expected a name"));
        }
        let earlier = &self.methods[..index];
        if earlier.iter().any(|other| other.name == method.name) {
            return Err(method
                .name
                .error(format!("there are two methods named `{}`", *method.name)));
        }
        let mut names: Vec<String> = Vec::new();
        for parameter in self.parameters(method) {
            parameter.check()?;
            let name = parameter.name();
            if names.contains(&name) {
                return Err(parameter.place().error(format!(
                    "there are two parameters named `{name}`; expected `name` with another one"
                )));
            }
            names.push(name);
        }
        if names.is_empty() {
            return Err(method.name.error(
                "this method has no parameters; expected `space` in it or in the whole file",
            ));
        }
        Ok(())
    }

    fn check_seed_is_not_set(&self) -> Result<(), ValidationError> {
        let of_methods = self.methods.iter().flat_map(|method| &method.set);
        let of_spaces = self.methods.iter().flat_map(|method| &method.space);
        let templates = self
            .space
            .iter()
            .chain(of_spaces)
            .flat_map(|parameter| parameter.set.iter());
        let mut assignments = self.set.iter().chain(of_methods).chain(templates);
        match assignments.find(|assignment| path_of(assignment) == "seed") {
            Some(assignment) => Err(assignment.error(
                "the run seed cannot be set here; expected `first_seed`, the first run seed",
            )),
            None => Ok(()),
        }
    }
}

/// The path in an assignment `path=value`.
fn path_of(assignment: &str) -> &str {
    assignment
        .split_once('=')
        .map_or(assignment, |(path, _)| path)
        .trim()
}

impl Parameter {
    /// Name in tables.
    #[must_use]
    pub fn name(&self) -> String {
        let path = || {
            self.set
                .first()
                .map(|template| path_of(template).to_owned())
        };
        let name = self.name.as_ref().map(|name| name.value().clone());
        name.or_else(path).unwrap_or_default()
    }

    /// Place for errors about its name.
    fn place(&self) -> &Located<String> {
        self.name
            .as_ref()
            .or_else(|| self.set.first())
            .expect("a checked parameter has entries")
    }

    fn check(&self) -> Result<(), ValidationError> {
        if self.set.is_empty() {
            return Err(self
                .set
                .error("expected at least one entry, such as `\"algorithm.discount={}\"`"));
        }
        if !self.set.iter().any(|template| template.contains("{}")) {
            return Err(self
                .set
                .error("no entry contains `{}`; expected `{}` where the drawn value goes"));
        }
        let name = self.name();
        if name.trim().is_empty() || COLUMNS.contains(&name.as_str()) {
            return Err(self.place().error(format!(
                "`{name}` cannot be the name of a parameter; expected `name` with another one"
            )));
        }
        match &*self.draw {
            Distribution::Uniform(low, high) if low.get() >= high.get() => {
                Err(self.draw.error(expected_range(low.get(), high.get())))
            }
            Distribution::LogUniform(low, high) if low.get() >= high.get() => {
                Err(self.draw.error(expected_range(low.get(), high.get())))
            }
            Distribution::Integer(low, high) if low >= high => {
                Err(self.draw.error(expected_range(low, high)))
            }
            Distribution::Choice(values) if values.len() < 2 => Err(self.draw.error(format!(
                "expected at least 2 values, found {}",
                values.len()
            ))),
            _ => Ok(()),
        }
    }
}

fn expected_range(low: impl std::fmt::Debug, high: impl std::fmt::Debug) -> String {
    format!("expected a smaller number first, found {low:?} and {high:?}")
}

fn default_runs() -> Located<Count<1000>> {
    ranged_count(2).into()
}

fn default_eta() -> Located<Count<100, 2>> {
    ranged_count(3).into()
}
