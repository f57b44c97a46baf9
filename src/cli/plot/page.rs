//! Puts the panels of what was asked for on a page.

use super::states::{self, Group};
use super::{Colour, Drawn, Failure, MOST_AGENTS, PlotArgs, What, curves};
use crate::figure::{Figure, Panel, Row};
use crate::run::review::selection::PickedStates;

/// The page's width, CSS pixels: two columns of a paper.
const WIDTH: f64 = 760.0;

/// An axis needs this much room to be named.
const AXIS_ROOM: f64 = 62.0;

/// What is to be drawn.
pub(super) struct Picture<'a> {
    pub(super) args: &'a PlotArgs,
    pub(super) runs: &'a [Drawn],
}

impl Picture<'_> {
    pub(super) fn figure(&self) -> Result<Figure, Failure> {
        let args = self.args;
        self.check()?;
        let mut rows = Vec::new();
        if args.shows(What::Visitation) {
            rows.extend(self.visitation());
        }
        // A team of one, and runs that are drawn one a panel, would be drawn twice.
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

    /// What was asked for has to be there.
    fn check(&self) -> Result<(), Failure> {
        let named = |run: &Drawn| run.review.path.display().to_string();
        for run in self.runs {
            if self.args.shows_states() && run.review.recording.is_none() {
                let advice = "draw --what returns,curves, which takes the tables alone";
                return Err(Failure::Input(format!(
                    "{} has no recording, so that its states are not known; {advice}",
                    named(run)
                )));
            }
            if self.args.shows_states() && run.states.is_empty() {
                return Err(Failure::Input(format!(
                    "{} has no episode among those that were asked for",
                    named(run)
                )));
            }
            if self.args.what.contains(&What::Curves) && run.review.rounds.is_empty() {
                return Err(Failure::Input(format!(
                    "{} has no rounds.csv, which --what curves draws",
                    named(run)
                )));
            }
            let curious = run
                .review
                .recording
                .as_ref()
                .is_some_and(|recording| recording.largest_bonus().is_some());
            if self.args.colour == Some(Colour::IntrinsicReward) && !curious {
                return Err(Failure::Input(format!(
                    "--colour intrinsic-reward: the agents of {} earn none",
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
            [run] if self.leaves_out(run) => {
                format!(
                    "{}{window} (agents 0 to {} of {} one by one)",
                    run.label,
                    MOST_AGENTS - 1,
                    run.review.agents()
                )
            }
            [run] => format!("{}{window}", run.label),
            runs => format!("{} runs side by side{window}", runs.len()),
        }
    }

    /// Whether some agents have no panel of their own, although nobody chose among them.
    fn leaves_out(&self, run: &Drawn) -> bool {
        self.args.shows(What::Visitation)
            && self.args.agents.is_empty()
            && run.states.len() > MOST_AGENTS as usize
    }

    /// Which episodes are drawn.
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
                " {states} visited states, each a line across one upright axis for each observed quantity."
            )
        } else {
            String::new()
        };
        format!("Concurrent agents in {}.{states}", runs.join(", "))
    }

    /// One panel an agent, or one a run where there are several and nobody chose agents.
    fn visitation(&self) -> Vec<Row> {
        let groups = self.groups();
        let axes = self
            .runs
            .iter()
            .filter_map(|run| run.states.first().map(|_| self.axes_of(run)))
            .max()
            .unwrap_or(2);
        let fitting = ((WIDTH - 90.0) / (AXIS_ROOM * axes as f64)) as usize;
        let columns = if self.runs.len() > 1 && !self.args.agents.is_empty() {
            self.runs.len()
        } else {
            fitting.clamp(1, 4)
        };
        let columns = balanced(groups.len(), columns);
        let (panels, key) = states::lines_or_density(self.args, &groups);
        in_rows(panels, columns, 230.0, key.as_ref())
    }

    fn axes_of(&self, run: &Drawn) -> usize {
        if self.args.axes.is_empty() {
            run.axes.as_ref().map_or(2, |axes| axes.all().len())
        } else {
            self.args.axes.len()
        }
    }

    fn groups(&self) -> Vec<Group<'_>> {
        let several = self.runs.len() > 1;
        if several && self.args.agents.is_empty() {
            return self
                .runs
                .iter()
                .map(|run| Group::new(run, run.label.clone(), run.states.iter().collect()))
                .collect();
        }
        let shown =
            |states: &&PickedStates| !self.args.agents.is_empty() || states.agent < MOST_AGENTS;
        let agents: Vec<u32> = self.runs[0]
            .states
            .iter()
            .filter(shown)
            .map(|states| states.agent)
            .collect();
        let group = |run: &'_ Drawn, agent: u32| {
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
            Group::new(
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
        let groups: Vec<Group<'_>> = self.whole_teams();
        let (panels, key) = states::density(self.args, &groups);
        in_rows(panels, self.runs.len().min(3), 230.0, key.as_ref())
    }

    fn whole_teams(&self) -> Vec<Group<'_>> {
        let several = self.runs.len() > 1;
        let title = |run: &Drawn| match run.states.len() {
            _ if several => run.label.clone(),
            1 => format!("agent {}", run.states[0].agent),
            agents => format!("{agents} agents together"),
        };
        self.runs
            .iter()
            .map(|run| Group::new(run, title(run), run.states.iter().collect()))
            .collect()
    }

    fn scatter(&self) -> Vec<Row> {
        let several = self.runs.len() > 1;
        let (panels, key) = states::scatter(self.args, &self.whole_teams());
        let columns = if several {
            self.runs.len()
        } else {
            balanced(panels.len(), 3)
        };
        in_rows(panels, columns, 220.0, key.as_ref())
    }
}

/// As few rows as `most` columns allow, with as few columns as those rows need.
fn balanced(panels: usize, most: usize) -> usize {
    let rows = panels.div_ceil(most.max(1)).max(1);
    panels.div_ceil(rows).max(1)
}

/// Row by row; the colours' key stands beside each row.
fn in_rows(
    panels: Vec<Panel>,
    columns: usize,
    height: f64,
    key: Option<&crate::figure::Key>,
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
            [(4, 3), (6, 4), (5, 2), (1, 4), (7, 4)].map(|(panels, most)| balanced(panels, most)),
            [2, 3, 2, 1, 4]
        );
    }
}
