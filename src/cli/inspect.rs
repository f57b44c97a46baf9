//! `seedbed inspect`: what came of a run, in words and small pictures, on the terminal.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use console::{Style, Term};
use indicatif::HumanBytes;

use super::progress::Counter;
use super::spark::spark;
use super::{Failure, counted};
use crate::record::RoundRow;
use crate::run::review::survey::{Spread, Survey};
use crate::run::review::{Review, ReviewError, final_mean};
use crate::run::summary::FINAL_WINDOW;

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  seedbed inspect recordings/cartpole/seed-0              a run, finished or not
  seedbed inspect recordings/sample/run.rrd               a recording alone
  seedbed inspect recordings/cartpole/seed-0 | less")]
pub(super) struct InspectArgs {
    /// A run's folder, or a recording
    run: PathBuf,
}

/// Agents of a team whose pairs are compared one by one.
const MOST_PAIRED: usize = 16;

/// Agents that have a row of their own.
const MOST_ROWS: usize = 64;

pub(super) fn inspect(args: &InspectArgs) -> Result<(), Failure> {
    let mut review = Review::open(&args.run)?;
    let counter = Counter::new("episodes read");
    let survey = review
        .survey(|_| counter.count())
        .map_err(ReviewError::from)?;
    drop(counter);
    let width = Term::stdout()
        .size_checked()
        .map_or(110, |(_, columns)| usize::from(columns))
        .clamp(60, 160);
    let page = Page {
        review: &review,
        survey: survey.as_ref(),
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
    review: &'a Review,
    survey: Option<&'a Survey>,
    width: usize,
}

impl Page<'_> {
    fn heading(&self) -> String {
        let review = self.review;
        let per_agent = review.team_returns().len();
        let env_steps = review.episodes.last().map_or(0, |row| row.env_steps);
        let task = review
            .recording
            .as_ref()
            .and_then(|recording| recording.properties().get("environment"));
        let task = task.map_or(String::new(), |task| format!(" in {task}"));
        let mut text = format!(
            "{}: {}{task}, {}{}, {} env steps\n",
            bold(&review.name()),
            counted(review.agents(), "agent"),
            counted(per_agent, "episode"),
            if review.agents() == 1 { "" } else { " each" },
            grouped(env_steps)
        );
        text += &self.outcome();
        text
    }

    fn outcome(&self) -> String {
        let Some(summary) = &self.review.summary else {
            let state = if self.review.folder.is_some() {
                "not finished, or interrupted"
            } else {
                "a recording alone, without tables"
            };
            return format!("{state}\n");
        };
        match (summary.solved_at, summary.episodes_until_solved) {
            (None, _) => "finished; nothing says when the task counts as solved\n".to_owned(),
            (Some(at), Some(episodes)) => {
                let solved = Style::new().green().apply_to("solved");
                format!(
                    "{solved} after {episodes} episodes: the team's mean return over {} reached {}\n",
                    at.window, at.r#return
                )
            }
            (Some(at), None) => {
                format!(
                    "not solved: the team's mean return over {} episodes never reached {}\n",
                    at.window, at.r#return
                )
            }
        }
    }

    fn returns(&self) -> String {
        let returns = self.review.team_returns();
        let Some(last) = final_mean(&returns) else {
            return "no episode that all agents have finished\n".to_owned();
        };
        let (least, most) = ends(&returns);
        let line = spark(
            &returns,
            self.width.saturating_sub(30).min(returns.len()),
            [least, most],
        );
        format!(
            "{}\n  {:>9} {line} {:<9}\n  least {}, most {}, mean of the last {}: {}\n",
            bold("mean return of the team, from the first episode to the last"),
            number(returns[0]),
            number(returns[returns.len() - 1]),
            number(least),
            number(most),
            FINAL_WINDOW.min(returns.len()),
            number(last)
        )
    }

    fn agents(&self) -> String {
        let agents = self.review.agents();
        let curious = self
            .review
            .rounds
            .iter()
            .any(|row| row.intrinsic_reward != 0.0);
        let mut text = format!(
            "{}\n  {:>5} {:>8} {:>9} {:>9} {:>9} {:>8}{}  returns\n",
            bold("agents"),
            "agent",
            "episodes",
            format!("last {FINAL_WINDOW}"),
            "best",
            "coverage",
            "evenness",
            if curious {
                format!(" {:>9}", "bonus")
            } else {
                String::new()
            }
        );
        for agent in 0..agents.min(MOST_ROWS) as u32 {
            text += &self.agent(agent, curious);
        }
        if agents > MOST_ROWS {
            let _ = writeln!(text, "  and {} more", agents - MOST_ROWS);
        }
        text + &self.team()
    }

    fn agent(&self, agent: u32, curious: bool) -> String {
        let returns: Vec<f64> = self.review.returns(agent).collect();
        let (least, best) = ends(&returns);
        let room = self
            .width
            .saturating_sub(if curious { 70 } else { 60 })
            .clamp(8, 50);
        let update = self
            .review
            .rounds
            .iter()
            .rev()
            .find(|row| row.agent == agent);
        let bonus = update.map_or(f64::NAN, |row| f64::from(row.intrinsic_reward));
        format!(
            "  {agent:>5} {:>8} {:>9} {:>9} {:>9} {:>8}{}  {}\n",
            returns.len(),
            number(final_mean(&returns).unwrap_or(f64::NAN)),
            number(best),
            percent(self.coverage(agent, update)),
            percent(self.evenness(agent, update)),
            if curious {
                format!(" {:>9}", number(bonus))
            } else {
                String::new()
            },
            spark(&returns, room.min(returns.len()), [least, best])
        )
    }

    fn coverage(&self, agent: u32, update: Option<&RoundRow>) -> Option<f64> {
        let counted = self
            .survey
            .and_then(|survey| survey.visitation.get(agent as usize));
        counted
            .map(crate::run::measures::visitation::Visitation::coverage)
            .or(update.map(|row| row.coverage))
    }

    fn evenness(&self, agent: u32, update: Option<&RoundRow>) -> Option<f64> {
        let counted = self
            .survey
            .and_then(|survey| survey.visitation.get(agent as usize));
        let counted = counted.map(|visitation| visitation.entropy() / visitation.largest_entropy());
        counted.or(update.map(|row| row.visitation_evenness))
    }

    /// How far the agents differ, if there are several.
    fn team(&self) -> String {
        let agents = self.review.agents();
        let counted = self
            .survey
            .map(Survey::diversity)
            .map(|team| (team.overlap, team.effective_agents));
        let told = self
            .review
            .rounds
            .last()
            .map(|row| (row.team_overlap, row.effective_agents));
        match counted.or(told) {
            Some((overlap, effective)) if agents > 1 => format!(
                "  the team visits as many different places as {} agents that share none; overlap {}\n",
                number(effective),
                percent(Some(overlap))
            ),
            _ => String::new(),
        }
    }

    fn overlaps(&self) -> String {
        let Some(survey) = self
            .survey
            .filter(|survey| (2..=MOST_PAIRED).contains(&survey.visitation.len()))
        else {
            return String::new();
        };
        let (agents, overlaps) = (survey.visitation.len(), survey.overlaps());
        let mut text =
            bold("overlap of where two agents were, in % (100: alike, 0: no place in common)")
                + "\n        ";
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
        let Some(survey) = self
            .survey
            .filter(|survey| survey.spreads.iter().any(|spread| spread.count > 0))
        else {
            return String::new();
        };
        let spreads: Vec<&Spread> = survey.spreads.iter().chain(&survey.bonus).collect();
        let widest = spreads
            .iter()
            .map(|spread| label(spread).chars().count())
            .max()
            .unwrap_or(0);
        let states = grouped(survey.spreads[0].count);
        let mut text = format!(
            "{}\n  {:widest$} {:>10} {:>10} {:>10} {:>22} {:>8}\n",
            bold(&format!("what agents saw, in {states} states")),
            "",
            "min",
            "median",
            "max",
            "axis",
            "outside"
        );
        for spread in spreads.into_iter().filter(|spread| spread.count > 0) {
            let [low, high] = spread.quantity.range.map(|end| number(f64::from(end)));
            let _ = writeln!(
                text,
                "  {:widest$} {:>10} {:>10} {:>10} {:>22} {:>8}",
                label(spread),
                number(f64::from(spread.least)),
                number(spread.median().map_or(f64::NAN, f64::from)),
                number(f64::from(spread.most)),
                format!("{low} to {high}"),
                percent(Some(spread.outside as f64 / spread.count as f64))
            );
        }
        text
    }

    fn files(&self) -> String {
        let review = self.review;
        let of_folder = review.folder.iter().flat_map(|folder| {
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
        let alone = review.folder.is_none().then(|| review.path.clone());
        let mut text = bold("files") + "\n";
        for path in of_folder.chain(alone).filter(|path| path.is_file()) {
            let _ = writeln!(text, "  {} ({})", path.display(), size(&path));
        }
        text + &format!(
            "  seedbed plot {} draws where agents went\n",
            review.path.display()
        )
    }
}

fn size(path: &Path) -> String {
    path.metadata().map_or("?".to_owned(), |metadata| {
        HumanBytes(metadata.len()).to_string()
    })
}

fn label(spread: &Spread) -> String {
    let quantity = &spread.quantity;
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

/// At most four significant digits.
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
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

fn grouped(number: u64) -> String {
    indicatif::HumanCount(number).to_string()
}

fn ends(values: &[f64]) -> (f64, f64) {
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
