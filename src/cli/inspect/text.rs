//! Summary of a run on the terminal.

use std::fmt::Write;
use std::path::Path;

use console::{Style, Term};
use indicatif::HumanBytes;

use super::super::pluralize;
use super::super::sparkline::sparkline;
use super::Inspected;
use seedbed::record::state_files::StateFiles;
use seedbed::run::measures::recent::RECENT_ROUNDS;
use seedbed::run::review::final_mean;
use seedbed::run::review::recording_stats::ValueDistribution;
use seedbed::run::summary::FINAL_WINDOW;
use seedbed::study::experiment::NO_THRESHOLD;
use seedbed::text::without_trailing_zeros;

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
        let episodes_per_agent = self.inspected.team_returns().len();
        let env_steps = self.inspected.env_steps();
        let agent_count = self.inspected.agents.len();
        let task = run
            .recording
            .as_ref()
            .and_then(|recording| recording.properties().get("environment"));
        let task = task.map_or(String::new(), |task| format!(" in {task}"));
        let mut text = format!(
            "{}: {}{task}, {}{}, {} env steps\n",
            bold(&run.name()),
            pluralize(agent_count, "agent"),
            pluralize(episodes_per_agent, "episode"),
            if agent_count == 1 { "" } else { " each" },
            with_thousands_separators(env_steps)
        );
        if !self.inspected.selection.is_all() {
            text += &self.selection_line();
        }
        text += &self.outcome_line();
        text
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
                let solved = Style::new().green().apply_to("solved");
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
        let Some(final_return) = final_mean(&returns) else {
            return "no episode finished by all agents\n".to_owned();
        };
        let (min, max) = min_max(&returns);
        let curve = sparkline(
            &returns,
            self.width.saturating_sub(30).min(returns.len()),
            [min, max],
        );
        format!(
            "{}\n  {:>9} {curve} {:<9}\n  min {}, max {}, mean of the last {} episodes: {}\n",
            bold("mean return of the team per episode, from the first to the last"),
            format_number(returns[0]),
            format_number(returns[returns.len() - 1]),
            format_number(min),
            format_number(max),
            FINAL_WINDOW.min(returns.len()),
            format_number(final_return)
        ) + &self.endings()
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
        let (min, max) = min_max(&returns);
        let curve_width = self
            .width
            .saturating_sub(if has_bonus { 78 } else { 68 })
            .clamp(8, 50);
        let intrinsic_reward = self.inspected.intrinsic_reward(agent);
        format!(
            "  {agent:>5} {:>8} {:>9} {:>9} {:>9} {:>7} {:>8}{}  {}\n",
            returns.len(),
            format_number(final_mean(&returns).unwrap_or(f64::NAN)),
            format_number(max),
            format_percent(self.inspected.coverage(agent)),
            format_percent(self.inspected.first_coverage(agent)),
            format_percent(self.inspected.evenness(agent)),
            if has_bonus {
                format!(
                    " {:>9}",
                    format_number(intrinsic_reward.unwrap_or(f64::NAN))
                )
            } else {
                String::new()
            },
            sparkline(&returns, curve_width.min(returns.len()), [min, max])
        )
    }

    /// Line with the diversity of the team's visited states; empty for a single agent.
    fn diversity_line(&self) -> String {
        let agents = self.inspected.agents.len();
        match self.inspected.diversity() {
            Some((overlap, effective_agents)) if agents > 1 => {
                let recent = self.inspected.recent_effective_agents();
                let recent = recent.map_or(String::new(), |recent| {
                    let recent = format_number(recent);
                    format!("; by visits of the latest {RECENT_ROUNDS} rounds: {recent}")
                });
                format!(
                    "  effective agents: {} of {agents} (overlap {}){recent}\n",
                    format_number(effective_agents),
                    format_percent(Some(overlap))
                )
            }
            _ => String::new(),
        }
    }

    fn overlap_table(&self) -> String {
        let agents = &self.inspected.agents;
        let Some(overlaps) = self
            .inspected
            .overlaps()
            .filter(|overlaps| (2..=MAX_AGENTS_IN_OVERLAP_TABLE).contains(&overlaps.len()))
        else {
            return String::new();
        };
        let mut text = bold(
            "overlap of visited states per pair of agents, in % (100: identical, 0: disjoint)",
        ) + "\n        ";
        text.extend(agents.iter().map(|agent| format!("{agent:>4}")));
        for (one, row) in agents.iter().zip(overlaps) {
            let _ = write!(text, "\n  {one:>5} ");
            let cell = |(other, overlap): (&u32, f64)| {
                if one == other {
                    "   ·".to_owned()
                } else {
                    format!("{:>4.0}", 100.0 * overlap)
                }
            };
            text.extend(agents.iter().zip(row).map(cell));
        }
        text + "\n"
    }

    /// Smallest, median and largest value of each observation and of the intrinsic reward.
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
            .chain(&stats.intrinsic_rewards)
            .collect();
        let name_width = distributions
            .iter()
            .map(|distribution| label(distribution).chars().count())
            .max()
            .unwrap_or(0)
            .min(MAX_NAME_WIDTH);
        let states = with_thousands_separators(stats.distributions[0].count);
        let mut text = format!(
            "{}\n  {:name_width$} {:>10} {:>10} {:>10} {:>22} {:>8}\n",
            bold(&format!("observations in {states} states")),
            "",
            "min",
            "median",
            "max",
            "axis range",
            "outside"
        );
        for distribution in distributions
            .into_iter()
            .filter(|distribution| distribution.count > 0)
        {
            text += &distribution_row(distribution, name_width);
        }
        text
    }

    fn files(&self) -> String {
        let run = &self.inspected.run;
        let run_files = run.folder.iter().flat_map(|folder| {
            let [episodes, rounds] = folder.table_files();
            let recording = folder.recording_file();
            let part = recording.with_added_extension("part");
            let state_files = StateFiles::paths_in(folder.path());
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
            let _ = writeln!(text, "  {} ({})", path.display(), file_size(&path));
        }
        text + &format!(
            "  to draw visited states: seedbed plot {}\n",
            run.path.display()
        )
    }
}

/// Maximum width of the column of names; longer names shift the rest of their row.
const MAX_NAME_WIDTH: usize = 200;

/// Row of the table of observations, with a name column of `name_width` characters.
fn distribution_row(distribution: &ValueDistribution, name_width: usize) -> String {
    let [low, high] = distribution
        .quantity
        .range
        .map(|end| format_number(f64::from(end)));
    format!(
        "  {:name_width$} {:>10} {:>10} {:>10} {:>22} {:>8}\n",
        label(distribution),
        format_number(f64::from(distribution.min)),
        format_number(distribution.median().map_or(f64::NAN, f64::from)),
        format_number(f64::from(distribution.max)),
        format!("{low} to {high}"),
        format_percent(Some(
            distribution.outside as f64 / distribution.count as f64
        ))
    )
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

fn bold(text: &str) -> String {
    Style::new().bold().apply_to(text).to_string()
}

fn format_percent(share: Option<f64>) -> String {
    share
        .filter(|share| share.is_finite())
        .map_or("–".to_owned(), |share| format!("{:.1} %", 100.0 * share))
}

/// Formats a number with four significant digits, but at most six decimals, without trailing zeros.
/// Digits before the decimal point are never rounded.
fn format_number(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let integer_digits = if value == 0.0 {
        0
    } else {
        value.abs().log10().floor() as i32 + 1
    };
    let text = format!("{value:.*}", (4 - integer_digits).clamp(0, 6) as usize);
    without_trailing_zeros(&text).to_owned()
}

fn with_thousands_separators(number: u64) -> String {
    indicatif::HumanCount(number).to_string()
}

fn min_max(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| {
            (low.min(value), high.max(value))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_significant_digits() {
        let numbers = [
            0.0,
            195.0,
            -1_234.56,
            0.012_342,
            1e6,
            f64::NAN,
            -0.000_000_1,
        ]
        .map(format_number);
        assert_eq!(
            numbers,
            ["0", "195", "-1235", "0.01234", "1000000", "–", "0"]
        );
    }
}
