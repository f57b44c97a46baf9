//! `seedbed inspect`: summary of a run on the terminal.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use console::{Style, Term};
use indicatif::HumanBytes;

use super::progress::ReadCounter;
use super::sparkline::sparkline;
use super::{CliError, pluralize};
use seedbed::record::RoundRow;
use seedbed::run::measures::visitation::Visitation;
use seedbed::run::review::recording_stats::{RecordingStats, ValueDistribution};
use seedbed::run::review::{LoadRunError, LoadedRun, final_mean};
use seedbed::run::summary::FINAL_WINDOW;
use seedbed::study::experiment::NO_THRESHOLD;
use seedbed::text::without_trailing_zeros;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed inspect recordings/cartpole/seed-0    a run, finished or not
  seedbed inspect recordings/sample/run.rrd     a recording without its run directory")]
pub(super) struct InspectArgs {
    /// Run directory, or a recording
    run: PathBuf,
}

/// Maximum number of agents for which the overlap of each pair of agents is printed.
const MAX_AGENTS_IN_OVERLAP_TABLE: usize = 16;

/// Maximum number of agents with a row in the table of agents.
const MAX_AGENT_ROWS: usize = 64;

pub(super) fn inspect(args: &InspectArgs) -> Result<(), CliError> {
    let mut run = LoadedRun::open(&args.run)?;
    let counter = ReadCounter::new("episodes read");
    let stats = run
        .compute_stats(|_| counter.count())
        .map_err(LoadRunError::from)?;
    drop(counter);
    let width = Term::stdout()
        .size_checked()
        .map_or(110, |(_, columns)| usize::from(columns))
        .clamp(60, 160);
    let summary = TerminalSummary {
        run: &run,
        stats: stats.as_ref(),
        width,
    };
    let sections = [
        summary.heading(),
        summary.returns(),
        summary.agent_table(),
        summary.overlap_table(),
        summary.observation_table(),
        summary.files(),
    ];
    say!(
        "{}",
        sections
            .into_iter()
            .filter(|section| !section.is_empty())
            .collect::<Vec<_>>()
            .join("\n")
    );
    Ok(())
}

/// Summary of a run. Each section is a text; a section without data is empty.
struct TerminalSummary<'a> {
    run: &'a LoadedRun,
    /// Statistics of the recording, if there is one.
    stats: Option<&'a RecordingStats>,
    /// Width of the terminal, in characters.
    width: usize,
}

impl TerminalSummary<'_> {
    fn heading(&self) -> String {
        let run = self.run;
        let episodes_per_agent = run.team_returns().len();
        let env_steps = run.episodes.last().map_or(0, |row| row.env_steps);
        let task = run
            .recording
            .as_ref()
            .and_then(|recording| recording.properties().get("environment"));
        let task = task.map_or(String::new(), |task| format!(" in {task}"));
        let mut text = format!(
            "{}: {}{task}, {}{}, {} env steps\n",
            bold(&run.name()),
            pluralize(run.agent_count(), "agent"),
            pluralize(episodes_per_agent, "episode"),
            if run.agent_count() == 1 { "" } else { " each" },
            with_thousands_separators(env_steps)
        );
        text += &self.outcome_line();
        text
    }

    fn outcome_line(&self) -> String {
        let Some(summary) = &self.run.summary else {
            let state = if self.run.folder.is_some() {
                "not finished: in progress or interrupted"
            } else {
                "recording only, without tables"
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
        let returns = self.run.team_returns();
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
        )
    }

    fn agent_table(&self) -> String {
        let agents = self.run.agent_count();
        let has_bonus = self
            .run
            .rounds
            .iter()
            .any(|row| row.intrinsic_reward.is_some_and(|bonus| bonus != 0.0));
        let mut text = format!(
            "{}\n  {:>5} {:>8} {:>9} {:>9} {:>9} {:>8}{}  returns\n",
            bold(&format!(
                "agents (mean return of the last {FINAL_WINDOW} episodes, best return)"
            )),
            "agent",
            "episodes",
            format!("last {FINAL_WINDOW}"),
            "best",
            "coverage",
            "evenness",
            if has_bonus {
                format!(" {:>9}", "bonus")
            } else {
                String::new()
            }
        );
        for agent in 0..agents.min(MAX_AGENT_ROWS) as u32 {
            text += &self.agent_row(agent, has_bonus);
        }
        if agents > MAX_AGENT_ROWS {
            let _ = writeln!(text, "  and {} more", agents - MAX_AGENT_ROWS);
        }
        text + &self.diversity_line()
    }

    fn agent_row(&self, agent: u32, has_bonus: bool) -> String {
        let returns: Vec<f64> = self.run.returns(agent).collect();
        let (min, max) = min_max(&returns);
        let curve_width = self
            .width
            .saturating_sub(if has_bonus { 70 } else { 60 })
            .clamp(8, 50);
        let last_update = self.run.rounds.iter().rev().find(|row| row.agent == agent);
        let intrinsic_reward = last_update
            .and_then(|row| row.intrinsic_reward)
            .map_or(f64::NAN, f64::from);
        format!(
            "  {agent:>5} {:>8} {:>9} {:>9} {:>9} {:>8}{}  {}\n",
            returns.len(),
            format_number(final_mean(&returns).unwrap_or(f64::NAN)),
            format_number(max),
            format_percent(self.coverage(agent, last_update)),
            format_percent(self.evenness(agent, last_update)),
            if has_bonus {
                format!(" {:>9}", format_number(intrinsic_reward))
            } else {
                String::new()
            },
            sparkline(&returns, curve_width.min(returns.len()), [min, max])
        )
    }

    /// Coverage of an agent, from the recording or else from the row of the agent's last update.
    fn coverage(&self, agent: u32, last_update: Option<&RoundRow>) -> Option<f64> {
        self.visitation(agent)
            .map(Visitation::coverage)
            .or(last_update.map(|row| row.coverage))
    }

    /// Visitation evenness of an agent, from the recording or else from the row of the agent's last
    /// update.
    fn evenness(&self, agent: u32, last_update: Option<&RoundRow>) -> Option<f64> {
        self.visitation(agent)
            .map(|visitation| visitation.entropy() / visitation.max_entropy())
            .or(last_update.map(|row| row.visitation_evenness))
    }

    /// Visit counts of an agent, from the recording.
    fn visitation(&self, agent: u32) -> Option<&Visitation> {
        self.stats?.visitation.get(agent as usize)
    }

    /// Line with the diversity of the team's visited states; empty for a single agent.
    fn diversity_line(&self) -> String {
        let agents = self.run.agent_count();
        let from_recording = self
            .stats
            .map(RecordingStats::diversity)
            .map(|diversity| (diversity.overlap, diversity.effective_agents));
        let from_rounds = self
            .run
            .rounds
            .last()
            .map(|row| (row.team_overlap, row.effective_agents));
        match from_recording.or(from_rounds) {
            Some((overlap, effective_agents)) if agents > 1 => format!(
                "  effective agents: {} of {agents} (overlap {})\n",
                format_number(effective_agents),
                format_percent(Some(overlap))
            ),
            _ => String::new(),
        }
    }

    fn overlap_table(&self) -> String {
        let Some(stats) = self
            .stats
            .filter(|stats| (2..=MAX_AGENTS_IN_OVERLAP_TABLE).contains(&stats.visitation.len()))
        else {
            return String::new();
        };
        let (agents, overlaps) = (stats.visitation.len(), stats.overlaps());
        let mut text = bold(
            "overlap of visited states per pair of agents, in % (100: identical, 0: disjoint)",
        ) + "\n        ";
        text.extend((0..agents).map(|agent| format!("{agent:>4}")));
        for (one, row) in overlaps.chunks(agents).enumerate() {
            let _ = write!(text, "\n  {one:>5} ");
            let cell = |(other, overlap): (usize, &f64)| {
                if one == other {
                    "   ·".to_owned()
                } else {
                    format!("{:>4.0}", 100.0 * overlap)
                }
            };
            text.extend(row.iter().enumerate().map(cell));
        }
        text + "\n"
    }

    /// Smallest, median and largest value of each observation and of the intrinsic reward.
    fn observation_table(&self) -> String {
        let Some(stats) = self.stats.filter(|stats| {
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
            .unwrap_or(0);
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
        let run = self.run;
        let run_files = run.folder.iter().flat_map(|folder| {
            let [episodes, rounds] = folder.table_files();
            let recording = folder.recording_file();
            let part = recording.with_added_extension("part");
            [
                recording,
                part,
                episodes,
                rounds,
                folder.scenario_file(),
                folder.summary_file(),
                folder.policies_file(),
            ]
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
