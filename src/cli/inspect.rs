//! `seedbed inspect`: summary of a run on the terminal.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use console::{Style, Term};
use indicatif::HumanBytes;

use super::progress::ReadCounter;
use super::sparkline::sparkline;
use super::{CliError, pluralize};
use crate::record::RoundRow;
use crate::run::review::recording_stats::{RecordingStats, ValueDistribution};
use crate::run::review::{LoadRunError, LoadedRun, final_mean};
use crate::run::summary::FINAL_WINDOW;
use crate::study::experiment::NO_THRESHOLD;
use crate::text::without_trailing_zeros;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed inspect recordings/cartpole/seed-0    a run, finished or not
  seedbed inspect recordings/sample/run.rrd     a recording without its run directory")]
pub(super) struct InspectArgs {
    /// Run directory, or a recording
    run: PathBuf,
}

/// Maximum team size for which the overlap of each pair is printed.
const MAX_PAIRED: usize = 16;

/// Maximum number of agents with a row in the table of agents.
const MAX_ROWS: usize = 64;

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
    let page = Page {
        run: &run,
        stats: stats.as_ref(),
        width,
    };
    let sections = [
        page.heading(),
        page.returns(),
        page.agents(),
        page.overlaps(),
        page.axes(),
        page.files(),
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

struct Page<'a> {
    run: &'a LoadedRun,
    stats: Option<&'a RecordingStats>,
    width: usize,
}

impl Page<'_> {
    fn heading(&self) -> String {
        let run = self.run;
        let per_agent = run.team_returns().len();
        let env_steps = run.episodes.last().map_or(0, |row| row.env_steps);
        let task = run
            .recording
            .as_ref()
            .and_then(|recording| recording.properties().get("environment"));
        let task = task.map_or(String::new(), |task| format!(" in {task}"));
        let mut text = format!(
            "{}: {}{task}, {}{}, {} env steps\n",
            bold(&run.name()),
            pluralize(run.agents(), "agent"),
            pluralize(per_agent, "episode"),
            if run.agents() == 1 { "" } else { " each" },
            grouped(env_steps)
        );
        text += &self.outcome();
        text
    }

    fn outcome(&self) -> String {
        let Some(summary) = &self.run.summary else {
            let state = if self.run.folder.is_some() {
                "not finished: in progress or interrupted"
            } else {
                "recording only, without tables"
            };
            return format!("{state}\n");
        };
        // Thresholds are stored in single precision; printed as f64 they would have spurious digits.
        match (summary.solved_at, summary.episodes_until_solved) {
            (None, _) => format!("finished; solved: {NO_THRESHOLD}\n"),
            (Some(at), Some(episodes)) => {
                let solved = Style::new().green().apply_to("solved");
                format!(
                    "{solved} after {} per agent: the team's mean return over {} reached {}\n",
                    pluralize(episodes, "episode"),
                    pluralize(at.window, "episode"),
                    at.r#return as f32
                )
            }
            (Some(at), None) => format!(
                "not solved: the team's mean return over {} did not reach {}\n",
                pluralize(at.window, "episode"),
                at.r#return as f32
            ),
        }
    }

    fn returns(&self) -> String {
        let returns = self.run.team_returns();
        let Some(last) = final_mean(&returns) else {
            return "no episode finished by all agents\n".to_owned();
        };
        let (min, max) = min_max(&returns);
        let line = sparkline(
            &returns,
            self.width.saturating_sub(30).min(returns.len()),
            [min, max],
        );
        format!(
            "{}\n  {:>9} {line} {:<9}\n  min {}, max {}, mean of the last {} episodes: {}\n",
            bold("mean return of the team per episode, from the first to the last"),
            number(returns[0]),
            number(returns[returns.len() - 1]),
            number(min),
            number(max),
            FINAL_WINDOW.min(returns.len()),
            number(last)
        )
    }

    fn agents(&self) -> String {
        let agents = self.run.agents();
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
        for agent in 0..agents.min(MAX_ROWS) as u32 {
            text += &self.agent(agent, has_bonus);
        }
        if agents > MAX_ROWS {
            let _ = writeln!(text, "  and {} more", agents - MAX_ROWS);
        }
        text + &self.team()
    }

    fn agent(&self, agent: u32, has_bonus: bool) -> String {
        let returns: Vec<f64> = self.run.returns(agent).collect();
        let (min, max) = min_max(&returns);
        let columns = self
            .width
            .saturating_sub(if has_bonus { 70 } else { 60 })
            .clamp(8, 50);
        let update = self.run.rounds.iter().rev().find(|row| row.agent == agent);
        let bonus = update
            .and_then(|row| row.intrinsic_reward)
            .map_or(f64::NAN, f64::from);
        format!(
            "  {agent:>5} {:>8} {:>9} {:>9} {:>9} {:>8}{}  {}\n",
            returns.len(),
            number(final_mean(&returns).unwrap_or(f64::NAN)),
            number(max),
            percent(self.coverage(agent, update)),
            percent(self.evenness(agent, update)),
            if has_bonus {
                format!(" {:>9}", number(bonus))
            } else {
                String::new()
            },
            sparkline(&returns, columns.min(returns.len()), [min, max])
        )
    }

    fn coverage(&self, agent: u32, update: Option<&RoundRow>) -> Option<f64> {
        let counted = self
            .stats
            .and_then(|stats| stats.visitation.get(agent as usize));
        counted
            .map(crate::run::measures::visitation::Visitation::coverage)
            .or(update.map(|row| row.coverage))
    }

    fn evenness(&self, agent: u32, update: Option<&RoundRow>) -> Option<f64> {
        let counted = self
            .stats
            .and_then(|stats| stats.visitation.get(agent as usize));
        let counted = counted.map(|visitation| visitation.entropy() / visitation.max_entropy());
        counted.or(update.map(|row| row.visitation_evenness))
    }

    /// Line with the diversity of the agents' visited states; empty for a single agent.
    fn team(&self) -> String {
        let agents = self.run.agents();
        let counted = self
            .stats
            .map(RecordingStats::diversity)
            .map(|team| (team.overlap, team.effective_agents));
        let from_rounds = self
            .run
            .rounds
            .last()
            .map(|row| (row.team_overlap, row.effective_agents));
        match counted.or(from_rounds) {
            Some((overlap, effective)) if agents > 1 => format!(
                "  effective agents: {} of {agents} (overlap {})\n",
                number(effective),
                percent(Some(overlap))
            ),
            _ => String::new(),
        }
    }

    fn overlaps(&self) -> String {
        let Some(stats) = self
            .stats
            .filter(|stats| (2..=MAX_PAIRED).contains(&stats.visitation.len()))
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

    fn axes(&self) -> String {
        let Some(stats) = self.stats.filter(|stats| {
            stats
                .distributions
                .iter()
                .any(|distribution| distribution.count > 0)
        }) else {
            return String::new();
        };
        let distributions: Vec<&ValueDistribution> =
            stats.distributions.iter().chain(&stats.bonus).collect();
        let widest = distributions
            .iter()
            .map(|distribution| label(distribution).chars().count())
            .max()
            .unwrap_or(0);
        let states = grouped(stats.distributions[0].count);
        let mut text = format!(
            "{}\n  {:widest$} {:>10} {:>10} {:>10} {:>22} {:>8}\n",
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
            let [low, high] = distribution
                .quantity
                .range
                .map(|end| number(f64::from(end)));
            let _ = writeln!(
                text,
                "  {:widest$} {:>10} {:>10} {:>10} {:>22} {:>8}",
                label(distribution),
                number(f64::from(distribution.min)),
                number(distribution.median().map_or(f64::NAN, f64::from)),
                number(f64::from(distribution.max)),
                format!("{low} to {high}"),
                percent(Some(
                    distribution.outside as f64 / distribution.count as f64
                ))
            );
        }
        text
    }

    fn files(&self) -> String {
        let run = self.run;
        let of_folder = run.folder.iter().flat_map(|folder| {
            let [episodes, rounds] = folder.tables();
            let named = folder.summary();
            let recording = folder.recording();
            let part = recording.with_added_extension("part");
            [
                recording,
                part,
                episodes,
                rounds,
                folder.scenario(),
                named,
                folder.policies(),
            ]
        });
        let alone = run.folder.is_none().then(|| run.path.clone());
        let mut text = bold("files") + "\n";
        for path in of_folder.chain(alone).filter(|path| path.is_file()) {
            let _ = writeln!(text, "  {} ({})", path.display(), size(&path));
        }
        text + &format!(
            "  to draw visited states: seedbed plot {}\n",
            run.path.display()
        )
    }
}

fn size(path: &Path) -> String {
    path.metadata().map_or("?".to_owned(), |metadata| {
        HumanBytes(metadata.len()).to_string()
    })
}

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

fn percent(share: Option<f64>) -> String {
    share
        .filter(|share| share.is_finite())
        .map_or("–".to_owned(), |share| format!("{:.1} %", 100.0 * share))
}

/// Formats a number with at most four significant digits.
fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let digits = if value == 0.0 {
        0
    } else {
        value.abs().log10().floor() as i32 + 1
    };
    let text = format!("{value:.*}", (4 - digits).clamp(0, 6) as usize);
    without_trailing_zeros(&text).to_owned()
}

fn grouped(number: u64) -> String {
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
    fn numbers_are_short() {
        let numbers = [
            0.0,
            195.0,
            -1_234.56,
            0.012_342,
            1e6,
            f64::NAN,
            -0.000_000_1,
        ]
        .map(number);
        assert_eq!(
            numbers,
            ["0", "195", "-1235", "0.01234", "1000000", "–", "0"]
        );
    }
}
