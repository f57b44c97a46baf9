//! Arranges the requested panels on a page.

use super::states::{self, PanelStates};
use super::{CliError, ColorBy, MAX_AGENTS, PlotArgs, PlottedRun, What, curves};
use crate::run::review::selection::SelectedStates;
use seedbed_figure::{Figure, Panel, Row};

/// Page width in CSS pixels: two columns of a paper.
const WIDTH: f64 = 760.0;

/// Minimum width of an axis with its name, in CSS pixels.
const MIN_AXIS_WIDTH: f64 = 62.0;

/// The page to draw.
pub(super) struct PlotPage<'a> {
    pub(super) args: &'a PlotArgs,
    pub(super) runs: &'a [PlottedRun],
}

impl PlotPage<'_> {
    pub(super) fn figure(&self) -> Result<Figure, CliError> {
        let args = self.args;
        self.check()?;
        let mut rows = Vec::new();
        if args.shows(What::Visitation) {
            rows.extend(self.visitation());
        }
        // By default, densities are omitted if they would repeat the panels of single agents or runs.
        let is_new = args.what.contains(&What::Density)
            || (self.runs.len() == 1 && self.runs[0].states.len() > 1);
        if args.shows(What::Density) && is_new {
            rows.extend(self.density());
        }
        if args.shows(What::Scatter) {
            rows.extend(self.scatter());
        }
        if args.shows(What::Returns) {
            rows.push(curves::returns(self.runs, &args.agents));
        }
        if args.shows(What::Curves) {
            rows.extend(curves::updates(self.runs, &args.agents));
        }
        Ok(Figure {
            title: self.title(),
            description: self.description(),
            width: WIDTH,
            rows,
        })
    }

    /// Checks that the runs have the data for the requested panels.
    fn check(&self) -> Result<(), CliError> {
        let named = |run: &PlottedRun| run.review.path.display().to_string();
        for run in self.runs {
            if self.args.shows_states() && run.review.recording.is_none() {
                let advice = "use --what returns,curves, which needs only the tables";
                return Err(CliError::Usage(format!(
                    "{} has no recording, which is needed to draw states; {advice}",
                    named(run)
                )));
            }
            if self.args.shows_states() && run.states.is_empty() {
                return Err(CliError::Usage(format!(
                    "{} has no episodes that match --agents and --episodes",
                    named(run)
                )));
            }
            if self.args.what.contains(&What::Curves) && run.review.rounds.is_empty() {
                return Err(CliError::Usage(format!(
                    "{} has no rounds.csv, which --what curves needs",
                    named(run)
                )));
            }
            let has_bonus = run
                .review
                .recording
                .as_ref()
                .is_some_and(|recording| recording.bonus().exists());
            if self.args.color_by == Some(ColorBy::IntrinsicReward) && !has_bonus {
                return Err(CliError::Usage(format!(
                    "--colour intrinsic-reward: {} has no intrinsic rewards (its scenario has no `bonus`)",
                    named(run)
                )));
            }
        }
        Ok(())
    }

    fn title(&self) -> String {
        let window = self.window();
        let window = if window.is_empty() || !self.args.shows_states() {
            String::new()
        } else {
            format!(": {window}")
        };
        match self.runs {
            [run] if self.omits_agents(run) => {
                format!(
                    "{}{window} (panels of agents 0 to {} of {})",
                    run.label,
                    MAX_AGENTS - 1,
                    run.review.agents()
                )
            }
            [run] => format!("{}{window}", run.label),
            runs => format!("{} runs side by side{window}", runs.len()),
        }
    }

    /// Whether `--agents` was not given and some agents have no panel, because there are too many.
    fn omits_agents(&self, run: &PlottedRun) -> bool {
        self.args.shows(What::Visitation)
            && self.args.agents.is_empty()
            && run.states.len() > MAX_AGENTS as usize
    }

    /// The range of drawn episodes as text; empty for all episodes.
    fn window(&self) -> String {
        match &self.args.episodes {
            None => String::new(),
            Some(range) if range.end == u32::MAX => format!("episodes from {} on", range.start),
            Some(range) => format!("episodes {} to {}", range.start, range.end - 1),
        }
    }

    fn description(&self) -> String {
        let runs: Vec<String> = self
            .runs
            .iter()
            .map(|run| format!("{} ({} agents)", run.label, run.review.agents()))
            .collect();
        let states: u64 = self
            .runs
            .iter()
            .flat_map(|run| &run.states)
            .map(|states| states.count)
            .sum();
        let states = if states > 0 {
            format!(
                " {states} visited states, each drawn as a line across one vertical axis per observation."
            )
        } else {
            String::new()
        };
        format!("Concurrent agents in {}.{states}", runs.join(", "))
    }

    /// One panel per agent; with several runs and without `--agents`, one panel per run.
    fn visitation(&self) -> Vec<Row> {
        let groups = self.groups();
        let axes = self
            .runs
            .iter()
            .filter_map(|run| run.states.first().map(|_| self.axes_of(run)))
            .max()
            .unwrap_or(2);
        let fitting = ((WIDTH - 90.0) / (MIN_AXIS_WIDTH * axes as f64)) as usize;
        let columns = if self.runs.len() > 1 && !self.args.agents.is_empty() {
            self.runs.len()
        } else {
            fitting.clamp(1, 4)
        };
        let columns = balanced_columns(groups.len(), columns);
        let (panels, key) = states::lines_or_density(self.args, &groups);
        layout_rows(panels, columns, 230.0, key.as_ref())
    }

    fn axes_of(&self, run: &PlottedRun) -> usize {
        if self.args.axes.is_empty() {
            run.axes.as_ref().map_or(2, |axes| axes.all().len())
        } else {
            self.args.axes.len()
        }
    }

    fn groups(&self) -> Vec<PanelStates<'_>> {
        let several = self.runs.len() > 1;
        if several && self.args.agents.is_empty() {
            return self
                .runs
                .iter()
                .map(|run| PanelStates::new(run, run.label.clone(), run.states.iter().collect()))
                .collect();
        }
        let shown =
            |states: &&SelectedStates| !self.args.agents.is_empty() || states.agent < MAX_AGENTS;
        let agents: Vec<u32> = self.runs[0]
            .states
            .iter()
            .filter(shown)
            .map(|states| states.agent)
            .collect();
        let group = |run: &'_ PlottedRun, agent: u32| {
            let title = if several {
                format!("{}, agent {agent}", run.label)
            } else {
                format!("agent {agent}")
            };
            (title, agent)
        };
        let each = agents
            .iter()
            .flat_map(|&agent| self.runs.iter().map(move |run| (run, group(run, agent))));
        each.map(|(run, (title, agent))| {
            PanelStates::new(
                run,
                title,
                run.states
                    .iter()
                    .filter(|states| states.agent == agent)
                    .collect(),
            )
        })
        .collect()
    }

    fn density(&self) -> Vec<Row> {
        let groups: Vec<PanelStates<'_>> = self.team_groups();
        let (panels, key) = states::density(self.args, &groups);
        layout_rows(panels, self.runs.len().min(3), 230.0, key.as_ref())
    }

    fn team_groups(&self) -> Vec<PanelStates<'_>> {
        let several = self.runs.len() > 1;
        let title = |run: &PlottedRun| match run.states.len() {
            _ if several => run.label.clone(),
            1 => format!("agent {}", run.states[0].agent),
            agents => format!("{agents} agents together"),
        };
        self.runs
            .iter()
            .map(|run| PanelStates::new(run, title(run), run.states.iter().collect()))
            .collect()
    }

    fn scatter(&self) -> Vec<Row> {
        let several = self.runs.len() > 1;
        let (panels, key) = states::scatter(self.args, &self.team_groups());
        let columns = if several {
            self.runs.len()
        } else {
            balanced_columns(panels.len(), 3)
        };
        layout_rows(panels, columns, 220.0, key.as_ref())
    }
}

/// Number of columns, at most `max`, that distributes panels evenly over the smallest possible number of rows.
fn balanced_columns(panels: usize, max: usize) -> usize {
    let rows = panels.div_ceil(max.max(1)).max(1);
    panels.div_ceil(rows).max(1)
}

/// Arranges panels in rows, with the color key beside each row.
fn layout_rows(
    panels: Vec<Panel>,
    columns: usize,
    height: f64,
    key: Option<&seedbed_figure::Key>,
) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut panels = panels.into_iter().peekable();
    while panels.peek().is_some() {
        let mut row: Vec<Panel> = panels.by_ref().take(columns).collect();
        row.resize(columns, Panel::Blank);
        rows.push(Row {
            height,
            panels: row,
            key: key.cloned(),
        });
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_even() {
        assert_eq!(
            [(4, 3), (6, 4), (5, 2), (1, 4), (7, 4)]
                .map(|(panels, max)| balanced_columns(panels, max)),
            [2, 3, 2, 1, 4]
        );
    }
}
