//! A row of the table of published results, and whether its values are possible.

use std::collections::HashMap;
use std::str::FromStr;

use crate::experiment::measure::{Curve, Measure, Moment};
use crate::study::evaluate::results::CellResults;
use crate::study::evaluate::rows::column;
use crate::study::evaluate::score::RunCost;
use crate::study::evaluate::score::RunScore;
use crate::text::from_spreadsheet_cell;
use seedbed_input::numbers::ranged_count;

/// A row of the table.
pub(super) struct Row<'a> {
    pub(super) record: csv::StringRecord,
    pub(super) columns: &'a HashMap<String, usize>,
}

impl Row<'_> {
    /// The text in a column.
    pub(super) fn text(&self, name: &str) -> Result<&str, String> {
        let column = self.columns.get(name);
        let column = column.ok_or_else(|| format!("expected a column `{name}`"))?;
        Ok(&self.record[*column])
    }

    /// The value in a column; `None` if it is empty.
    pub(super) fn value<T: FromStr>(&self, name: &str) -> Result<Option<T>, String> {
        let text = self.text(name)?;
        if text.is_empty() {
            return Ok(None);
        }
        let value = text.parse();
        value
            .map(Some)
            .map_err(|_| format!("`{text}` in the column `{name}`"))
    }

    /// The value in a column that must not be empty.
    pub(super) fn required<T: FromStr>(&self, name: &str) -> Result<T, String> {
        let value = self.value(name)?;
        value.ok_or_else(|| format!("expected a value in the column `{name}`"))
    }

    /// Name of the cell and run seed.
    pub(super) fn key(&self) -> Result<(String, u64), String> {
        let name = from_spreadsheet_cell(self.text("cell")?);
        Ok((name.into_owned(), self.required("seed")?))
    }

    pub(super) fn cost(&self) -> Result<RunCost, String> {
        let (episodes, env_steps) = (self.value("episodes")?, self.value("env_steps")?);
        Ok(RunCost {
            solved: self.value("solved")?,
            episodes: self.value("episodes_to_solve")?.or(episodes),
            env_steps: self.value("env_steps_to_solve")?.or(env_steps),
            gradient_steps: self.value("gradient_steps")?,
            had_policy_gradient: self.value("had_policy_gradient")?,
        })
    }

    pub(super) fn score(
        &self,
        measure: Measure,
        name: &str,
        run_seed: u64,
    ) -> Result<Option<RunScore>, String> {
        let Some(value) = self.value::<f64>(name)? else {
            return Ok(None);
        };
        // Earlier versions wrote the last value before the end of the run.
        if self.ended_before(measure)? == Some(true) {
            return Ok(None);
        }
        let is_censored = measure.is_time() && !value.is_finite();
        let observed_until = if is_censored {
            self.observed_until(measure)?
        } else {
            f64::INFINITY
        };
        Ok(Some(RunScore {
            run_seed,
            value,
            observed_until,
            magnitude: value.abs(),
        }))
    }

    /// Until when a time that was not reached was observed.
    fn observed_until(&self, measure: Measure) -> Result<f64, String> {
        if measure.is_time_in_env_steps() {
            return self.required("env_steps");
        }
        let episodes: f64 = self.required("episodes")?;
        if !measure.is_since_first_find() {
            return Ok(episodes);
        }
        // It is counted from the first find. Without a column of finds, nothing is known but that it is no shorter than 1.
        let column = column(Measure::EpisodesToFind);
        let found = if self.columns.contains_key(column.as_str()) {
            self.value(&column)?
        } else {
            None
        };
        Ok(1.0 + episodes - found.unwrap_or(episodes))
    }

    /// Checks that the row says of its cell what the study says, and that a run of it can have these
    /// values.
    pub(super) fn check(
        &self,
        cell: &CellResults,
        measures: &[(Measure, String)],
    ) -> Result<(), String> {
        self.check_description(cell)?;
        if self.text("state")? != "finished" {
            return Ok(());
        }
        self.check_costs(cell)?;
        for (name, measure) in same_in_all_studies() {
            self.check_value(cell, measure, name)?;
        }
        for (measure, name) in measures {
            self.check_value(cell, *measure, name)?;
            self.check_same_value(*measure, name)?;
        }
        Ok(())
    }

    fn check_description(&self, cell: &CellResults) -> Result<(), String> {
        let description = &cell.description;
        let run_seed = self.required("seed")?;
        let agents = description.agents.to_string();
        let run_name = cell.run_name(run_seed).unwrap_or_default();
        for (name, expected) in [
            ("task", description.task.as_str()),
            ("agents", &agents),
            ("run", run_name),
        ] {
            // Earlier versions had no names of runs.
            let is_older = name == "run" && !self.columns.contains_key(name);
            let found = if is_older { expected } else { self.text(name)? };
            if from_spreadsheet_cell(found) != expected {
                return Err(format!(
                    "`{found}` in the column `{name}`; the study says `{expected}`"
                ));
            }
        }
        Ok(())
    }

    /// Checks the numbers of episodes and steps, and whether the task was solved within them.
    fn check_costs(&self, cell: &CellResults) -> Result<(), String> {
        let unknown = cell.unknown();
        for (name, is_unknown) in [
            ("episodes", unknown.episodes),
            ("env_steps", unknown.env_steps),
            ("gradient_steps", unknown.gradient_steps),
        ] {
            if self.text(name)?.is_empty() != is_unknown {
                let state = if is_unknown { "unknown" } else { "known" };
                return Err(format!(
                    "`{}` in the column `{name}`, which is {state} of this cell",
                    self.text(name)?
                ));
            }
        }
        let episodes: Option<u64> = self.value("episodes")?;
        let _: Option<u64> = self.value("env_steps")?;
        let max_episodes = u64::from(cell.description.max_episodes);
        // Runs of others may have more: they are compared up to the end of the shortest.
        let is_own = cell.description.external.is_none();
        if let Some(episodes) = episodes.filter(|episodes| is_own && *episodes > max_episodes) {
            return Err(format!(
                "{episodes} in the column `episodes`; the study has at most {max_episodes} per agent"
            ));
        }
        let gradient_steps: Option<f64> = self.value("gradient_steps")?;
        if gradient_steps.is_some_and(|steps| !(steps >= 0.0 && steps.is_finite())) {
            return Err(self.impossible("gradient_steps", "a number from 0"));
        }
        let solved: Option<bool> = self.value("solved")?;
        for name in ["episodes_to_solve", "env_steps_to_solve"] {
            if solved != Some(true) && !self.text(name)?.is_empty() {
                return Err(self.impossible(name, "nothing, because the run is not solved"));
            }
        }
        Ok(())
    }

    /// Checks that a run of the cell can have this value of a measure.
    fn check_value(&self, cell: &CellResults, measure: Measure, name: &str) -> Result<(), String> {
        let Some(value) = self.value::<f64>(name)? else {
            return Ok(());
        };
        if !cell.has_measure(measure) {
            return Err(self.impossible(name, "nothing, because it is unknown of this cell"));
        }
        let is_unreached_time = measure.is_time() && value == f64::INFINITY;
        let end = |name: &str| self.value(name).ok().flatten().unwrap_or(f64::INFINITY);
        let end = if measure.is_time_in_env_steps() {
            end("env_steps")
        } else {
            end("episodes")
        };
        let [low, high] = measure.possible_values(cell.description.agents, end);
        // Values that were measured in single precision can be a little beyond.
        let tolerance = |end: f64| 1e-6 * (1.0 + end.abs());
        let is_within = low - tolerance(low) <= value && value <= high + tolerance(high);
        let is_yes_or_no = !measure.is_yes_or_no() || value == 0.0 || value == 1.0;
        if is_unreached_time || value.is_finite() && is_within && is_yes_or_no {
            return Ok(());
        }
        let expected = match (low.is_finite(), high.is_finite()) {
            _ if measure.is_yes_or_no() => "0 or 1".to_owned(),
            (true, true) => format!("a number from {low} to {high}"),
            (true, false) => format!("a number from {low}"),
            _ => "a number".to_owned(),
        };
        Err(self.impossible(name, &expected))
    }

    /// Checks that the column of a measure has the value of the column that every study has.
    fn check_same_value(&self, measure: Measure, name: &str) -> Result<(), String> {
        let value: Option<f64> = self.value(name)?;
        let expected: Option<f64> = match measure {
            Measure::Solved => self
                .value::<bool>("solved")?
                .map(|solved| f64::from(u8::from(solved))),
            Measure::RegretAbove { regret } => {
                let found: Option<f64> = self.value("regret")?;
                found.map(|found| f64::from(u8::from(found > f64::from(regret.get()))))
            }
            _ => {
                let mut same = same_in_all_studies().into_iter();
                let Some((other, _)) = same.find(|(_, other)| *other == measure) else {
                    return Ok(());
                };
                let finite = value.is_none_or(f64::is_finite);
                if !finite && self.text(other)?.is_empty() {
                    return Ok(());
                }
                self.value(other)?
            }
        };
        if value == expected {
            return Ok(());
        }
        let expected = expected.map_or(String::new(), |value| value.to_string());
        Err(self.impossible(
            name,
            &format!("`{expected}`, as other columns of the row say"),
        ))
    }

    fn impossible(&self, name: &str, expected: &str) -> String {
        let found = self.text(name).unwrap_or_default();
        format!("`{found}` in the column `{name}`; expected {expected}")
    }

    /// Whether the run may lack a measure that other runs of its cell have: it ended before the episode
    /// at which it is measured, or no agent found what would have spread.
    pub(super) fn may_lack(&self, measure: Measure) -> Result<bool, String> {
        if measure.is_since_first_find() {
            let reach: Option<f64> = self.value("reach")?;
            return Ok(reach.is_none_or(|reach| reach == 0.0));
        }
        Ok(self.ended_before(measure)?.unwrap_or(true))
    }

    /// Whether the run ended before the episode of a measure; `None` if its episodes are unknown.
    fn ended_before(&self, measure: Measure) -> Result<Option<bool>, String> {
        match measure.needed_moment() {
            None => Ok(Some(false)),
            Some(Moment::Episode(needed)) => {
                let episodes: Option<u64> = self.value("episodes")?;
                Ok(episodes.map(|episodes| episodes < u64::from(needed)))
            }
            // The last episodes may have been begun before the step and not finished: see `RunResult::reaches_step`.
            Some(Moment::EnvSteps(needed)) => {
                let env_steps: Option<u64> = self.value("env_steps")?;
                Ok(env_steps
                    .filter(|env_steps| *env_steps >= u64::from(needed))
                    .map(|_| false))
            }
        }
    }
}

/// The columns of all studies that are measures.
fn same_in_all_studies() -> [(&'static str, Measure); 9] {
    let effective_agents = Measure::Last {
        of: Curve::EffectiveAgents,
    };
    [
        ("episodes_to_solve", Measure::EpisodesToSolve),
        ("env_steps_to_solve", Measure::EnvStepsToSolve),
        ("final_return", Measure::final_return(ranged_count(25))),
        ("mean_return", Measure::Mean { of: Curve::Return }),
        ("reach", Measure::Reach),
        ("first_goal", Measure::FirstGoal),
        ("regret", Measure::Regret),
        ("team_coverage", Measure::Coverage),
        ("effective_agents", effective_agents),
    ]
}
