//! Summary of a run on the terminal.

use std::fmt::Write;
use std::path::Path;

use console::Term;
use indicatif::HumanBytes;

use super::super::sparkline::sparkline;
use super::super::{bold, green, pluralize};
use super::Inspected;
use super::numbers::{
    format_number, format_or_dash, format_percent, min_max, with_thousands_separators,
};
use seedbed::experiment::NO_THRESHOLD;
use seedbed::review::distribution::ValueDistribution;
use seedbed::run::facts::FINAL_WINDOW;
use seedbed::run::facts::returns::final_mean;
use seedbed::run::measures::recent::RECENT_ROUNDS;
use seedbed::text::terminal_line;

/// Maximum number of agents for which the overlap of each pair of agents is printed.
const MAX_AGENTS_IN_OVERLAP_TABLE: usize = 16;

/// Maximum number of agents with a row in the table of agents.
const MAX_AGENT_ROWS: usize = 64;

/// The summary as text for a terminal.
pub(super) fn text(inspected: &Inspected) -> String {
    let width = Term::stdout()
        .size_checked()
        .map_or(110, |(_, columns)| usize::from(columns))
        .clamp(60, 160);
    let summary = TerminalSummary { inspected, width };
    let sections = [
        summary.heading(),
        summary.returns(),
        summary.agent_table(),
        summary.overlap_table(),
        summary.observation_table(),
        summary.files(),
    ];
    let sections = sections.into_iter().filter(|section| !section.is_empty());
    sections.collect::<Vec<_>>().join("\n")
}

/// Summary of a run. Each section is a text; a section without data is empty.
struct TerminalSummary<'a> {
    inspected: &'a Inspected,
    /// Width of the terminal, in characters.
    width: usize,
}

impl TerminalSummary<'_> {
    fn heading(&self) -> String {
        let run = &self.inspected.run;
        let env_steps = self.inspected.env_steps();
        let agent_count = self.inspected.agents.len();
        let task = run
            .recording
            .as_ref()
            .and_then(|recording| recording.properties().get("environment"));
        let learners = self.inspected.returns_of_learners();
        let learner_count = learners.as_ref().map_or(agent_count, Vec::len);
        let who = if learner_count < agent_count {
            let task = task.map_or("the environment", String::as_str);
            let learners = pluralize(learner_count, "learner");
            format!("{learners} in {agent_count} copies of {task}")
        } else {
            let task = task.map_or(String::new(), |task| format!(" in {task}"));
            format!("{}{task}", pluralize(agent_count, "agent"))
        };
        let mut text = format!(
            "{}: {who}, {}{}, {} env steps\n",
            bold(&terminal_line(&run.name())),
            self.episode_count(),
            if learner_count == 1 { "" } else { " each" },
            with_thousands_separators(env_steps)
        );
        if !self.inspected.selection.is_all() {
            text += &self.selection_line();
        }
        if !self.inspected.selection.is_all() {
            text += "whole run: ";
        }
        text += &self.outcome_line();
        text
    }

    /// Number of episodes per agent, or from the smallest to the largest number.
    fn episode_count(&self) -> String {
        let returns = self.inspected.returns();
        let counts = || returns.iter().map(Vec::len);
        match (counts().min(), counts().max()) {
            (Some(min), Some(max)) if min < max => format!("{min} to {max} episodes"),
            _ => pluralize(self.inspected.team_returns().len(), "episode"),
        }
    }

    /// The selected agents and episodes.
    fn selection_line(&self) -> String {
        let episodes = || self.inspected.run.episodes.iter().map(|row| row.episode);
        let (first, last) = (episodes().min().unwrap_or(0), episodes().max().unwrap_or(0));
        let agents = if self.inspected.selection.agents.is_empty() {
            "each agent".to_owned()
        } else {
            let numbers = self.inspected.agents.iter().map(ToString::to_string);
            format!("agents {}", numbers.collect::<Vec<_>>().join(", "))
        };
        format!("only episodes {first} to {last} of {agents}\n")
    }

    fn outcome_line(&self) -> String {
        let Some(summary) = &self.inspected.run.summary else {
            let run = &self.inspected.run;
            let state = match (run.is_finished, &run.folder) {
                (true, _) => "finished",
                (false, Some(_)) => "not finished: in progress or interrupted",
                (false, None) => "recording only, without tables",
            };
            return format!("{state}\n");
        };
        // Tasks store thresholds in single precision; as f64 they would have spurious digits.
        match (summary.solved_at, summary.episodes_until_solved) {
            (None, _) => format!("finished; solved: {NO_THRESHOLD}\n"),
            (Some(threshold), Some(episodes)) => {
                let solved = green("solved");
                format!(
                    "{solved} after {} per agent: the team's mean return over {} reached {}\n",
                    pluralize(episodes, "episode"),
                    pluralize(threshold.window, "episode"),
                    threshold.r#return as f32
                )
            }
            (Some(threshold), None) => format!(
                "not solved: the team's mean return over {} did not reach {}\n",
                pluralize(threshold.window, "episode"),
                threshold.r#return as f32
            ),
        }
    }

    fn returns(&self) -> String {
        let returns = self.inspected.team_returns();
        let Some(final_return) = self
            .inspected
            .final_return()
            .filter(|_| !returns.is_empty())
        else {
            return "no episode finished by all agents\n".to_owned();
        };
        let range = min_max(&returns);
        let curve = sparkline(
            &returns,
            self.width.saturating_sub(30).min(returns.len()),
            range.unwrap_or_default(),
        );
        format!(
            "{}\n  {:>9} {curve} {:<9}\n  min {}, max {}, mean of {} last {} episodes: {}\n",
            bold(self.title_of_returns()),
            format_number(returns[0]),
            format_number(returns[returns.len() - 1]),
            format_or_dash(range.map(|[min, _]| min)),
            format_or_dash(range.map(|[_, max]| max)),
            if self.has_different_lengths() {
                "each agent's"
            } else {
                "the"
            },
            FINAL_WINDOW.min(returns.len()),
            format_number(final_return)
        ) + &self.endings()
    }

    fn has_different_lengths(&self) -> bool {
        let returns = self.inspected.returns();
        let mut lengths = returns.iter().map(Vec::len);
        lengths.any(|length| length != returns[0].len())
    }

    fn title_of_returns(&self) -> &'static str {
        if self.has_different_lengths() {
            "mean return of the team per episode, up to the last that every agent has finished"
        } else {
            "mean return of the team per episode, from the first to the last"
        }
    }

    /// Lengths of episodes, and how many ended before the time limit. If they become shorter while the
    /// return improves, agents are rewarded for failing early.
    fn endings(&self) -> String {
        let endings = self.inspected.endings();
        let mut text = format!(
            "  mean length of episodes: {} at first, {} at last; terminated before the time limit: {}\n",
            format_number(endings.first_length),
            format_number(endings.last_length),
            format_percent(Some(endings.terminated)),
        );
        let nan = self.inspected.nan_returns();
        if nan > 0 {
            text += &format!(
                "  return NaN {}: in {} of {}, left out of min, max and best\n",
                format_percent(Some(nan as f64 / self.inspected.run.episodes.len() as f64)),
                with_thousands_separators(nan as u64),
                pluralize(self.inspected.run.episodes.len(), "episode")
            );
        }
        if endings.all_returns_equal {
            text += "  all episodes have the same return: agents may never have been rewarded\n";
        }
        text
    }

    fn agent_table(&self) -> String {
        let agents = &self.inspected.agents;
        let has_bonus = self.inspected.has_bonus();
        let mut text = format!(
            "{}\n  {:>5} {:>8} {:>9} {:>9} {:>9} {:>7} {:>8}{}  returns\n",
            bold(&format!(
                "agents (mean return of the last {FINAL_WINDOW} episodes, best return, share of states visited, and visited before \
                 the others)"
            )),
            "agent",
            "episodes",
            format!("last {FINAL_WINDOW}"),
            "best",
            "coverage",
            "first",
            "evenness",
            if has_bonus {
                format!(" {:>9}", "bonus")
            } else {
                String::new()
            }
        );
        for &agent in agents.iter().take(MAX_AGENT_ROWS) {
            text += &self.agent_row(agent, has_bonus);
        }
        if agents.len() > MAX_AGENT_ROWS {
            let _ = writeln!(text, "  and {} more", agents.len() - MAX_AGENT_ROWS);
        }
        text + &self.diversity_line()
    }

    fn agent_row(&self, agent: u32, has_bonus: bool) -> String {
        let returns: Vec<f64> = self.inspected.run.returns(agent).collect();
        let range = min_max(&returns);
        let curve_width = self
            .width
            .saturating_sub(if has_bonus { 78 } else { 68 })
            .clamp(8, 50);
        let intrinsic_reward = self.inspected.intrinsic_reward(agent);
        format!(
            "  {agent:>5} {:>8} {:>9} {:>9} {:>9} {:>7} {:>8}{}  {}\n",
            returns.len(),
            format_or_dash(final_mean(&returns)),
            format_or_dash(range.map(|[_, max]| max)),
            format_percent(self.inspected.coverage(agent)),
            format_percent(self.inspected.first_coverage(agent)),
            format_percent(self.inspected.evenness(agent)),
            if has_bonus {
                format!(" {:>9}", format_or_dash(intrinsic_reward))
            } else {
                String::new()
            },
            sparkline(
                &returns,
                curve_width.min(returns.len()),
                range.unwrap_or_default()
            )
        )
    }

    /// Line with the diversity of the team's visited states; empty for a single agent.
    fn diversity_line(&self) -> String {
        let agents = self.inspected.agents.len();
        match self.inspected.diversity() {
            Some((overlap, effective_agents)) if agents > 1 => {
                let visiting = match self.inspected.visiting_agents() {
                    visiting if visiting < agents => format!(", {visiting} with visits"),
                    _ => String::new(),
                };
                let recent = self.inspected.recent_effective_agents();
                let recent = recent.map_or(String::new(), |recent| {
                    let recent = format_number(recent);
                    format!("; by visits of the latest {RECENT_ROUNDS} rounds: {recent}")
                });
                format!(
                    "  effective agents: {} of {agents}{visiting} (overlap {}){recent}\n",
                    format_number(effective_agents),
                    format_percent(Some(overlap))
                )
            }
            _ => String::new(),
        }
    }

    fn overlap_table(&self) -> String {
        let agents = &self.inspected.agents;
        if !(2..=MAX_AGENTS_IN_OVERLAP_TABLE).contains(&agents.len()) {
            return String::new();
        }
        let Some(overlaps) = self.inspected.overlaps() else {
            return String::new();
        };
        let mut text = bold(
            "overlap of visited states per pair of agents, in % (100: identical, 0: disjoint)",
        ) + "\n        ";
        text.extend(agents.iter().map(|agent| format!("{agent:>4}")));
        for (one, row) in agents.iter().zip(overlaps) {
            let _ = write!(text, "\n  {one:>5} ");
            let cell = |(other, overlap): (&u32, Option<f64>)| match overlap {
                _ if one == other => "   ·".to_owned(),
                Some(overlap) => format!("{:>4.0}", 100.0 * overlap),
                None => "   –".to_owned(),
            };
            text.extend(agents.iter().zip(row).map(cell));
        }
        text + "\n"
    }

    /// Smallest, median and largest value of each observation, of each entry of `info` and of the intrinsic reward,
    /// and of actions and rewards of which some are no finite numbers.
    fn observation_table(&self) -> String {
        let Some(stats) = self.inspected.stats.as_ref().filter(|stats| {
            stats
                .distributions
                .iter()
                .any(|distribution| distribution.count > 0)
        }) else {
            return String::new();
        };
        let distributions: Vec<&ValueDistribution> = stats
            .distributions
            .iter()
            .chain(&stats.info)
            .chain(&stats.intrinsic_rewards)
            .chain(not_finite(&stats.actions))
            .chain(not_finite(std::slice::from_ref(&stats.rewards)))
            .collect();
        let has_nan = distributions
            .iter()
            .any(|distribution| distribution.nan > 0);
        let name_width = distributions
            .iter()
            .map(|distribution| label(distribution).chars().count())
            .max()
            .unwrap_or(0)
            .min(MAX_NAME_WIDTH);
        let states = with_thousands_separators(stats.distributions[0].count);
        let mut text = format!(
            "{}\n  {:name_width$} {:>10} {:>10} {:>10} {:>22} {:>8}{}\n",
            bold(&format!("observations in {states} states")),
            "",
            "min",
            "median",
            "max",
            "axis range",
            "outside",
            if has_nan {
                "       NaN (left out of min, median and max)"
            } else {
                ""
            }
        );
        for distribution in distributions
            .into_iter()
            .filter(|distribution| distribution.count > 0)
        {
            text += &distribution_row(distribution, name_width, has_nan);
        }
        text
    }

    fn files(&self) -> String {
        let run = &self.inspected.run;
        let run_files = run.folder.iter().flat_map(|folder| {
            let [episodes, rounds] = folder.table_files();
            let recording = folder.recording_file();
            let part = recording.with_added_extension("part");
            let state_files = folder.state_files();
            let others = [
                recording,
                part,
                episodes,
                rounds,
                folder.scenario_file(),
                folder.summary_file(),
                folder.policies_file(),
            ];
            state_files.into_iter().take(MAX_AGENT_ROWS).chain(others)
        });
        let single_recording = run.folder.is_none().then(|| run.path.clone());
        let mut text = bold("files") + "\n";
        for path in run_files
            .chain(single_recording)
            .filter(|path| path.is_file())
        {
            let name = terminal_line(&path.to_string_lossy());
            let _ = writeln!(text, "  {name} ({})", file_size(&path));
        }
        text + &format!(
            "  to draw visited states: seedbed plot {}\n",
            terminal_line(&run.path.to_string_lossy())
        )
    }
}

/// The distributions of which some values are NaN or infinite.
fn not_finite(distributions: &[ValueDistribution]) -> impl Iterator<Item = &ValueDistribution> {
    let is_not_finite =
        |distribution: &&ValueDistribution| distribution.nan + distribution.infinite > 0;
    distributions.iter().filter(is_not_finite)
}

/// Maximum width of the column of names; longer names shift the rest of their row.
const MAX_NAME_WIDTH: usize = 200;

/// Row of the table of observations, with a name column of `name_width` characters.
fn distribution_row(distribution: &ValueDistribution, name_width: usize, has_nan: bool) -> String {
    let has_numbers = distribution.number_count() > 0;
    let end = |value: f32| has_numbers.then(|| f64::from(value));
    let share = |count: u64| format_percent(Some(count as f64 / distribution.count as f64));
    let range = range_of_axis(distribution);
    let outside = range.as_ref().map(|_| share(distribution.outside));
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    format!(
        "  {:name_width$} {:>10} {:>10} {:>10} {:>22} {:>8}{}\n",
        label(distribution),
        format_or_dash(end(distribution.min)),
        format_or_dash(distribution.median()),
        format_or_dash(end(distribution.max)),
        or_dash(range),
        or_dash(outside),
        if has_nan {
            format!(" {:>9}", share(distribution.nan))
        } else {
            String::new()
        }
    )
}

/// The range of the quantity's axis; entries of `info` have none.
fn range_of_axis(distribution: &ValueDistribution) -> Option<String> {
    let range = distribution.quantity.range;
    let [low, high] = range.map(|end| format_number(f64::from(end)));
    let is_known = range.iter().any(|end| end.is_finite());
    is_known.then(|| format!("{low} to {high}"))
}

fn file_size(path: &Path) -> String {
    path.metadata().map_or("?".to_owned(), |metadata| {
        HumanBytes(metadata.len()).to_string()
    })
}

/// Name and unit of the quantity, e.g. `x [m]`.
fn label(distribution: &ValueDistribution) -> String {
    let quantity = &distribution.quantity;
    if quantity.unit.is_empty() {
        quantity.name.clone()
    } else {
        format!("{} [{}]", quantity.name, quantity.unit)
    }
}
