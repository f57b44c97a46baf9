//! Tuning plans: the configurations of each method as cells of a study in memory.

use std::collections::HashSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use xxhash_rust::xxh64::xxh64;

use super::file::{Method, Parameter, Tuning};
use super::schedule::{MIN_CONFIGURATIONS, Rule, Schedule};
use super::space::Value;
use crate::input_files;
use crate::study::design::CellDraft;
use crate::study::design::cell::Cell;
use crate::study::design::cell::PlannedRun;
use crate::study::design::cell::missing_measure;
use crate::study::design::located_text;
use crate::study::design::plan::StudyPlan;
use crate::study::evaluate::column;
use crate::study::external::Problem;
use crate::text::file_stem;
use seedbed_input::numbers::Positive;
use seedbed_input::{Document, InputError, Located, ValidationError};
use seedbed_random::{Purpose, stream};

/// A checked tuning file.
#[derive(Clone, Debug)]
pub struct TuningFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Contents of the file.
    pub document: Document<Tuning>,
    /// The default configuration of each method, in the order of the file.
    pub defaults: Vec<Cell>,
}

/// A search that can be run.
#[derive(Clone, Debug)]
pub struct TuningPlan {
    /// Contents of the file.
    pub document: Document<Tuning>,
    /// Number of runs of each method.
    pub budget: u64,
    /// Number from which configurations are drawn.
    pub search_seed: u64,
    /// Methods, in the order of the file.
    pub methods: Vec<TunedMethod>,
    /// A study whose cells are all configurations of all methods. Its runs are more than those of the
    /// search.
    pub study: StudyPlan,
}

/// A method with its configurations.
#[derive(Clone, Debug)]
pub struct TunedMethod {
    /// Name.
    pub name: String,
    /// Scenario, as in the tuning file.
    pub scenario: String,
    /// Names of its parameters.
    pub parameters: Vec<String>,
    /// Values of the parameters of each configuration. The first is the default configuration, whose
    /// values are those of the scenario: it has none.
    pub configurations: Vec<Vec<String>>,
    /// Indices of the cells of its configurations.
    pub cells: Range<usize>,
    /// How its budget is spent.
    pub schedule: Schedule,
}

/// Error: a search cannot be planned.
#[derive(Debug, thiserror::Error)]
pub enum TuningError {
    /// Something in the tuning file or a scenario is wrong.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The budget is too small.
    #[error(
        "--budget {budget}: a search needs at least {needed} runs: the default and another configuration, {runs} runs \
         each (`runs` in the file)"
    )]
    BudgetTooSmall {
        /// Number of runs of each method.
        budget: u64,
        /// Number of runs of the smallest search.
        needed: u64,
        /// Number of runs of each configuration in rung 0.
        runs: u64,
    },
    /// There are fewer run seeds than a configuration would need runs.
    #[error(
        "--budget {budget}: method `{method}` has {configurations} configurations, so that one of them would need \
         {needed} run seeds; there are {seeds} for tuning. Choose a smaller budget"
    )]
    TooFewSeeds {
        /// Number of runs of each method.
        budget: u64,
        /// Name of the method.
        method: String,
        /// Number of its configurations.
        configurations: usize,
        /// Number of run seeds that would be needed.
        needed: u64,
        /// Number of run seeds that there are.
        seeds: u64,
    },
}

impl TuningFile {
    /// Reads and checks a tuning file, the scenario of each method, and the first and last value of
    /// each parameter.
    ///
    /// # Errors
    /// The first error, located in the tuning file.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let document = Tuning::read(path)?;
        let located = |error: ValidationError| document.locate(error);
        let tuning = &document.value;
        tuning.check().map_err(located)?;
        let folder = input_files::folder_of(path);
        let mut defaults = Vec::new();
        for method in tuning.methods.iter() {
            let default = cell(&document, &folder, method, 0, &[])?;
            if let Some(message) = missing_measure([&default].into_iter(), *tuning.measure) {
                return Err(located(tuning.measure.error(message)));
            }
            check_extremes(&document, &folder, method)?;
            defaults.push(default);
        }
        Ok(Self {
            path: path.to_owned(),
            document,
            defaults,
        })
    }

    /// Plans the search that spends `budget` runs on each method.
    ///
    /// # Errors
    /// If a drawn configuration is invalid, or the budget is too small or cannot be spent.
    pub fn plan(self, budget: u64, search_seed: u64) -> Result<TuningPlan, TuningError> {
        let tuning = &self.document.value;
        let rule = tuning.rule();
        if budget < rule.min_budget() {
            return Err(TuningError::BudgetTooSmall {
                budget,
                needed: rule.min_budget(),
                runs: rule.runs,
            });
        }
        let count = rule.max_configurations(budget).max(MIN_CONFIGURATIONS);
        let (mut cells, mut methods) = (Vec::new(), Vec::new());
        for (method, default) in tuning.methods.iter().zip(&self.defaults) {
            let start = cells.len();
            cells.push(default.clone());
            let drawn = self.draw(method, count, search_seed, &mut cells)?;
            let configurations: Vec<Vec<String>> = [Vec::new()].into_iter().chain(drawn).collect();
            let schedule = rule.schedule(budget, configurations.len());
            methods.push(TunedMethod {
                name: method.name.value().clone(),
                scenario: tuning.scenario_of(method).value().clone(),
                parameters: tuning.parameters(method).map(Parameter::name).collect(),
                schedule: schedule.map_err(|error| TuningError::TooFewSeeds {
                    budget,
                    method: method.name.value().clone(),
                    configurations: configurations.len(),
                    needed: error.needed,
                    seeds: rule.max_runs,
                })?,
                cells: start..cells.len(),
                configurations,
            });
        }
        let study = self.study_of(cells, &methods)?;
        Ok(TuningPlan {
            document: self.document,
            budget,
            search_seed,
            methods,
            study,
        })
    }

    /// Draws configurations of a method until it has `count` with its default, all of them different,
    /// or until none is new for a long time. Adds their cells to `cells`, and returns their values.
    fn draw(
        &self,
        method: &Method,
        count: usize,
        search_seed: u64,
        cells: &mut Vec<Cell>,
    ) -> Result<Vec<Vec<String>>, InputError> {
        /// Number of known configurations in a row after which there are no new ones.
        const MAX_KNOWN_IN_A_ROW: usize = 1000;
        let folder = input_files::folder_of(&self.path);
        let name_hash = xxh64(method.name.as_bytes(), 0) as u32;
        let mut digests: HashSet<String> = cells
            .last()
            .map(|cell| cell.digest().to_owned())
            .into_iter()
            .collect();
        let (mut seen, mut drawn) = (HashSet::new(), Vec::new());
        let mut known_in_a_row = 0;
        for index in 1.. {
            if drawn.len() + 1 == count || known_in_a_row == MAX_KNOWN_IN_A_ROW {
                break;
            }
            known_in_a_row += 1;
            let mut stream = stream(search_seed, Purpose::TuningConfiguration, name_hash, index);
            let parameters = self.document.value.parameters(method);
            let values: Vec<Value<'_>> = parameters
                .map(|parameter| parameter.draw(&mut stream))
                .collect();
            let texts: Vec<String> = values.iter().map(|value| value.text.clone()).collect();
            if !seen.insert(texts.clone()) {
                continue;
            }
            let values: Vec<Option<&Value<'_>>> = values.iter().map(Some).collect();
            let cell = cell(&self.document, &folder, method, drawn.len() + 1, &values)?;
            if digests.insert(cell.digest().to_owned()) {
                cells.push(cell);
                drawn.push(texts);
                known_in_a_row = 0;
            }
        }
        Ok(drawn)
    }

    /// The study in memory whose cells are all configurations, with as many runs as a configuration
    /// has at most.
    fn study_of(&self, cells: Vec<Cell>, methods: &[TunedMethod]) -> Result<StudyPlan, InputError> {
        let tuning = &self.document.value;
        let scenario_of_cell = methods
            .iter()
            .flat_map(|method| method.cells.clone().map(|_| method.scenario.as_str()));
        let cell_texts = cells.iter().zip(scenario_of_cell).map(|(cell, scenario)| {
            let set = ron_list(&cell.overrides);
            let (name, scenario) = (ron_text(&cell.name), ron_text(scenario));
            format!("        (name: {name}, scenario: {scenario}, set: {set}),\n")
        });
        let max_runs = methods
            .iter()
            .map(|method| method.schedule.max_runs())
            .max();
        let text = format!(
            "Study(\n    title: {},\n    about: {},\n    cells: [\n{}    ],\n    repeats: {},\n    first_seed: {},\n    \
             measures: [{}],\n)\n",
            ron_text(&tuning.title),
            ron_text(&tuning.about),
            cell_texts.collect::<String>(),
            max_runs.unwrap_or(1),
            *tuning.first_seed,
            column(*tuning.measure)
        );
        Ok(StudyPlan {
            name: file_stem(&self.path, "tuning"),
            path: self.path.clone(),
            document: seedbed_input::parse(&self.path.display().to_string(), text)?,
            quick: false,
            cells,
            lock: None,
        })
    }
}

/// A text in RON.
pub(super) fn ron_text(text: &str) -> String {
    ron::to_string(text).expect("plain data always serializes")
}

/// A list of texts in RON.
pub(super) fn ron_list(texts: &[String]) -> String {
    let texts: Vec<String> = texts.iter().map(|text| ron_text(text)).collect();
    format!("[{}]", texts.join(", "))
}

impl Tuning {
    fn rule(&self) -> Rule {
        Rule {
            runs: self.runs.get().into(),
            eta: self.eta.get().into(),
            max_runs: self.max_runs(),
        }
    }

    fn scenario_of<'a>(&'a self, method: &'a Method) -> &'a Located<String> {
        method.scenario.as_ref().unwrap_or(&self.scenario)
    }
}

/// Checks the first and last number or all texts of each parameter, with the defaults of all others.
fn check_extremes(
    document: &Document<Tuning>,
    folder: &Path,
    method: &Method,
) -> Result<(), InputError> {
    let parameters = document.value.parameters(method);
    for (index, parameter) in parameters.enumerate() {
        for value in parameter.extremes() {
            let mut values = vec![None; index];
            values.push(Some(&value));
            cell(document, folder, method, 0, &values)?;
        }
    }
    Ok(())
}

/// The cell of a configuration of a method. Parameters without a value have that of the scenario.
fn cell(
    document: &Document<Tuning>,
    folder: &Path,
    method: &Method,
    number: usize,
    values: &[Option<&Value<'_>>],
) -> Result<Cell, InputError> {
    let tuning = &document.value;
    let draft = CellDraft::of_scenario(
        vec![method.name.value().clone(), configuration_name(number)],
        located_text(tuning.scenario_of(method)),
    );
    let mut draft = draft.with_overrides(tuning.set.iter().chain(&method.set).map(located_text));
    for (parameter, value) in tuning.parameters(method).zip(values) {
        let Some(value) = value else { continue };
        let overrides = parameter.set.iter();
        draft = draft.with_overrides(overrides.map(|template| {
            let text = template.replace("{}", &value.text);
            (value.place.unwrap_or(template), text)
        }));
    }
    let cell = draft.build(folder, &[], Some(&method.name));
    cell.map_err(|problem| match problem {
        Problem::Study(error) => document.locate(error),
        Problem::Data(error) => error,
    })
}

/// Name of a configuration: `default`, or `configuration N`.
#[must_use]
pub fn configuration_name(number: usize) -> String {
    if number == 0 {
        "default".to_owned()
    } else {
        format!("configuration {number}")
    }
}

impl TuningPlan {
    /// The tuning file.
    #[must_use]
    pub fn tuning(&self) -> &Tuning {
        &self.document.value
    }

    /// The run with this number, counted from 0, of a cell.
    #[must_use]
    pub fn run(&self, cell: usize, repeat: u64) -> PlannedRun<'_> {
        PlannedRun {
            index: cell * self.study.repeats() as usize + repeat as usize,
            cell: &self.study.cells[cell],
            repeat,
            run_seed: *self.tuning().first_seed + repeat,
            name: None,
        }
    }

    /// Number of rungs of the method that has most.
    #[must_use]
    pub fn rungs(&self) -> usize {
        let rungs = self
            .methods
            .iter()
            .map(|method| method.schedule.rungs.len());
        rungs.max().unwrap_or(0)
    }

    /// For times: number of episodes or steps as which a run counts that took longer.
    #[must_use]
    pub fn horizon(&self) -> f64 {
        let max_episodes = self
            .study
            .cells
            .iter()
            .map(|cell| cell.source.max_episodes());
        let default = max_episodes.max().map_or(f64::INFINITY, f64::from);
        self.tuning().horizon.map_or(default, Positive::get)
    }

    /// Default folder of the results.
    #[must_use]
    pub fn default_folder(&self) -> PathBuf {
        Path::new("recordings")
            .join("tuning")
            .join(&self.study.name)
    }
}
