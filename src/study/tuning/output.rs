//! What a search writes and prints: `tuning.csv`, `best.ron`, and a table per method.

use std::io;
use std::path::{Path, PathBuf};

use super::plan::{TunedMethod, TuningPlan, configuration_name, ron_list, ron_text};
use super::search::{Score, Search, Tried};
use crate::experiment::measure::Measure;
use crate::storage::files;
use crate::study::evaluate::column;
use crate::text::short_number as number;
use crate::text::{align_columns, pluralize, spreadsheet_cell};
use seedbed_stats::aggregate::mean;
use seedbed_stats::bootstrap::bootstrap_estimate;
use seedbed_stats::shares::{Share, wilson_interval};
use seedbed_stats::{Estimate, Interval};

/// Maximum number of configurations in a table, apart from the default.
const MAX_ROWS: usize = 10;

impl Search<'_> {
    /// Writes `tuning.csv` and `best.ron` to a folder. Returns their paths.
    ///
    /// # Errors
    /// If a file cannot be written, with its path.
    pub fn write(&self, folder: &Path) -> Result<[PathBuf; 2], (PathBuf, io::Error)> {
        let (table, best) = (folder.join("tuning.csv"), folder.join("best.ron"));
        let written = self.csv().and_then(|bytes| files::replace(&table, &bytes));
        written.map_err(|error| (table.clone(), error))?;
        let text = self.best_text();
        files::replace(&best, text.as_bytes()).map_err(|error| (best.clone(), error))?;
        Ok([table, best])
    }

    /// The best configuration of a method: the index of its cell.
    ///
    /// # Panics
    /// Never: each method has its default configuration.
    #[must_use]
    pub fn best(&self, method: usize) -> usize {
        let ranked = self.ranked_cells(method);
        *ranked.first().expect("each method has a configuration")
    }

    /// The bytes of `tuning.csv`: one row per run. A value of a parameter is empty in the default
    /// configuration, which has the values of the scenario, and for methods without the parameter.
    fn csv(&self) -> io::Result<Vec<u8>> {
        let parameters = self.plan.all_parameters();
        let mut writer = csv::Writer::from_writer(Vec::new());
        let names = parameters
            .iter()
            .map(|name| spreadsheet_cell(name).into_owned());
        writer.write_record(
            super::file::COLUMNS
                .map(str::to_owned)
                .into_iter()
                .chain(names),
        )?;
        for method in &self.plan.methods {
            for (configuration, values) in method.configurations.iter().enumerate() {
                let values = values_by_name(method, values, &parameters);
                let tried = &self.configurations[method.cells.start + configuration];
                for run in &tried.runs {
                    let (state, value, reason) = state_of(&run.score);
                    let fixed = [
                        spreadsheet_cell(&method.name).into_owned(),
                        configuration.to_string(),
                        run.rung.to_string(),
                        run.run_seed.to_string(),
                        state.to_owned(),
                        value,
                        reason,
                    ];
                    writer.write_record(fixed.iter().chain(&values))?;
                }
            }
        }
        let bytes = writer.into_inner();
        bytes.map_err(|error| io::Error::other(error.to_string()))
    }

    /// The text of `best.ron`: one cell of a study per method.
    fn best_text(&self) -> String {
        let plan = self.plan;
        let mut text = format!(
            "// The best configuration of each method in {}: budget {} runs per method, search seed {}.\n\
             // {}, {}. Put these into `cells` of a study in the directory of that file; a study takes other run seeds.\n[\n",
            one_line(&plan.study.path.display().to_string()),
            plan.budget,
            plan.search_seed,
            column(*plan.tuning().measure),
            format!("{:?}d", plan.tuning().goal).to_lowercase(),
        );
        for (index, method) in plan.methods.iter().enumerate() {
            let best = self.best(index);
            let cell = &plan.study.cells[best];
            text += &format!(
                "    // {}: {}\n    (name: {}, scenario: {}, set: {}),\n",
                configuration_name(best - method.cells.start),
                self.summary(best),
                ron_text(&method.name),
                ron_text(&method.scenario),
                ron_list(&cell.overrides),
            );
        }
        text + "]\n"
    }

    /// Runs, mean and failures of a configuration, such as `18 runs, mean 120 (95 % interval 110 to
    /// 131)`.
    fn summary(&self, cell: usize) -> String {
        let tried = &self.configurations[cell];
        let mean = match self.estimate(tried) {
            Some(Estimate { value, interval }) if interval.ends().is_some() => {
                let interval = interval_text(interval);
                format!(", mean {} (95 % interval {interval})", number(value))
            }
            Some(Estimate { value, .. }) => format!(", mean {}", number(value)),
            None => String::new(),
        };
        let failures = match tried.failures() {
            0 => String::new(),
            failures => format!(", {failures} failed"),
        };
        format!("{}{mean}{failures}", pluralize(tried.runs.len(), "run"))
    }

    /// Mean over the runs that did not fail; `None` if there are none.
    fn estimate(&self, tried: &Tried) -> Option<Estimate> {
        let values = tried.values();
        (!values.is_empty()).then(|| estimate(*self.plan.tuning().measure, &values))
    }

    /// The lines of the table of a method: its configurations from the best on, and the default.
    #[must_use]
    pub fn table(&self, method: usize) -> Vec<String> {
        let tuned = &self.plan.methods[method];
        let ranked = self.ranked_cells(method);
        let default = tuned.cells.start;
        let mut shown: Vec<usize> = ranked.iter().copied().take(MAX_ROWS).collect();
        if !shown.contains(&default) {
            shown.push(default);
        }
        let header = [
            "configuration",
            "rung",
            "runs",
            "failed",
            "mean",
            "95 % interval",
        ];
        let mut rows = vec![header.map(str::to_owned).to_vec()];
        rows.extend(shown.iter().map(|&cell| self.row(tuned, cell)));
        let mut lines = align_columns(&rows);
        for (line, cell) in lines.iter_mut().skip(1).zip(&shown) {
            let values = described_values(tuned, cell - default);
            if !values.is_empty() {
                *line += &format!("  {values}");
            }
        }
        if let Some(more) = ranked
            .len()
            .checked_sub(shown.len())
            .filter(|more| *more > 0)
        {
            lines.push(format!("and {more} more"));
        }
        lines
    }

    /// What the best configuration of a method has from the edge of a range, such as `step size 0.00012`. The method may be better
    /// beyond.
    #[must_use]
    pub fn values_at_edges(&self, method: usize) -> Vec<String> {
        let tuned = &self.plan.methods[method];
        let values = &tuned.configurations[self.best(method) - tuned.cells.start];
        let tuning = self.plan.tuning();
        let parameters = tuning.parameters(&tuning.methods[method]);
        let at_edges = parameters
            .zip(values)
            .filter(|(parameter, value)| parameter.draw.is_at_an_edge(value));
        at_edges
            .map(|(parameter, value)| format!("{} {value}", parameter.name()))
            .collect()
    }

    fn row(&self, method: &TunedMethod, cell: usize) -> Vec<String> {
        let tried = &self.configurations[cell];
        let estimate = self.estimate(tried);
        vec![
            configuration_name(cell - method.cells.start),
            tried.rung().map_or(String::new(), |rung| rung.to_string()),
            tried.runs.len().to_string(),
            tried.failures().to_string(),
            estimate.map_or("–".to_owned(), |estimate| number(estimate.value)),
            estimate.map_or("–".to_owned(), |estimate| {
                interval_text(estimate.interval)
            }),
        ]
    }
}

impl TuningPlan {
    /// Names of the parameters of all methods, without duplicates.
    fn all_parameters(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for name in self.methods.iter().flat_map(|method| &method.parameters) {
            if !names.contains(name) {
                names.push(name.clone());
            }
        }
        names
    }
}

/// Values of a configuration in the order of `names`, as cells of a table.
fn values_by_name(method: &TunedMethod, values: &[String], names: &[String]) -> Vec<String> {
    let value = |name: &String| {
        let index = method.parameters.iter().position(|other| other == name)?;
        values.get(index)
    };
    let cells = names
        .iter()
        .map(|name| value(name).map_or("", String::as_str));
    cells
        .map(|cell| spreadsheet_cell(cell).into_owned())
        .collect()
}

/// The values of a configuration, such as `step size 0.001, epochs 8`; empty for the default.
#[must_use]
pub fn described_values(method: &TunedMethod, configuration: usize) -> String {
    let values = method
        .parameters
        .iter()
        .zip(&method.configurations[configuration]);
    let parts: Vec<String> = values
        .map(|(name, value)| format!("{name} {value}"))
        .collect();
    parts.join(", ")
}

/// State, value and reason of a run, as cells of a table.
fn state_of(score: &Score) -> (&'static str, String, String) {
    match score {
        Score::Value(value) => ("finished", value.to_string(), String::new()),
        Score::NotReached(horizon) => ("not reached", horizon.to_string(), String::new()),
        Score::Failed(reason) => (
            "failed",
            String::new(),
            spreadsheet_cell(reason).into_owned(),
        ),
    }
}

/// Mean with its 95 % interval: Wilson's for shares, otherwise a bootstrap interval.
fn estimate(measure: Measure, values: &[f64]) -> Estimate {
    if !measure.is_yes_or_no() {
        return bootstrap_estimate(values, mean);
    }
    let share = Share {
        successes: values.iter().filter(|&&value| value > 0.5).count(),
        runs: values.len(),
    };
    Estimate {
        value: share.value(),
        interval: wilson_interval(share),
    }
}

fn interval_text(interval: Interval) -> String {
    match interval.ends() {
        Some([low, high]) => format!("{} to {}", number(low), number(high)),
        None => "too few runs".to_owned(),
    }
}

/// The text on one line, for a comment.
fn one_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}
