//! Arranges the requested panels on a page.

use super::FigureError;
use super::curves;
use super::runs::PlottedRun;
use super::settings::{FigureSettings, Part};
use super::states::{self, StateGroup};
use crate::review::selection::SelectedStates;
use crate::scenario::recording::ColorBy;
use seedbed_figure::{Figure, Key, MAX_SHARE_OF_KEY, Panel, Row};

/// Minimum width of an axis with its name, in CSS pixels.
const MIN_AXIS_WIDTH: f64 = 62.0;

/// Maximum number of agents that have a panel each, unless agents are chosen.
const MAX_AGENT_PANELS: u32 = 8;

/// What surrounds a map, in CSS pixels: the color key beside a row, labels on the left, title and labels below.
const WIDTH_OF_KEY: f64 = 100.0;
const WIDTH_OF_LABELS: f64 = 70.0;
const HEIGHT_OF_LABELS: f64 = 68.0;
const HEIGHT_OF_TITLE: f64 = 44.0;

/// Height below which maps to scale have fewer columns.
const MIN_MAP_HEIGHT: f64 = 75.0;

/// The page to draw.
pub(super) struct PlotPage<'a> {
    pub(super) settings: &'a FigureSettings,
    pub(super) runs: &'a [PlottedRun],
}

impl PlotPage<'_> {
    pub(super) fn figure(&self) -> Result<(Figure, Vec<String>), FigureError> {
        let settings = self.settings;
        self.check_data()?;
        let (mut rows, mut notes) = (Vec::new(), Vec::new());
        for part in settings.parts_in_order() {
            rows.extend(self.rows_of(part, &mut notes));
        }
        let figure = Figure {
            title: self.title(),
            description: self.description(),
            width: settings.width,
            rows,
        };
        Ok((figure, notes))
    }

    fn rows_of(&self, part: Part, notes: &mut Vec<String>) -> Vec<Row> {
        let settings = self.settings;
        match part {
            Part::Scatter => self.scatter(),
            Part::Visitation => self.visitation(),
            Part::Difference => self.difference(),
            // By default, the density is omitted if it would show the same states as another panel: the
            // states of a single agent, or those of each of several runs.
            Part::Density => {
                let shows_others = self.runs.len() == 1 && self.runs[0].states.len() > 1;
                if shows_others || settings.parts.contains(&Part::Density) {
                    self.density()
                } else {
                    Vec::new()
                }
            }
            Part::Returns => vec![curves::returns_row(
                self.runs,
                &settings.agents,
                settings.over,
            )],
            Part::Curves => self.curves(notes),
            Part::All => Vec::new(),
        }
    }

    /// Curves over rounds; a note says which are not drawn.
    fn curves(&self, notes: &mut Vec<String>) -> Vec<Row> {
        let other_ranges = curves::other_ranges(self.runs);
        let are_comparable = other_ranges.is_none();
        notes.extend(other_ranges.map(|difference| {
            format!(
                "coverage, evenness and effective agents are not drawn, because they are measured on other axes: {difference}"
            )
        }));
        let columns = self.columns_of_width(240.0);
        curves::metric_rows(self.runs, self.settings, are_comparable, columns)
    }

    /// Checks that the runs have the data for the requested panels.
    fn check_data(&self) -> Result<(), FigureError> {
        let settings = self.settings;
        for PlottedRun {
            loaded_run, states, ..
        } in self.runs
        {
            let path = || loaded_run.path.clone();
            if settings.shows_states() && states.is_empty() {
                return Err(FigureError::NoEpisodes(path()));
            }
            if settings.parts.contains(&Part::Curves) && loaded_run.rounds.is_empty() {
                return Err(FigureError::NoRounds(path()));
            }
            let count: u64 = states.iter().map(|states| states.count).sum();
            if settings.shows_states() && count == 0 {
                return Err(FigureError::NoStates(path()));
            }
            let compares_with_team =
                settings.parts.contains(&Part::Difference) && self.runs.len() == 1;
            if compares_with_team && loaded_run.agent_count() < 2 {
                return Err(FigureError::NoTeam(path()));
            }
            let recording = loaded_run.recording.as_ref();
            let has_bonus = recording.is_some_and(|recording| recording.bonus().exists());
            if settings.color_by == Some(ColorBy::IntrinsicReward) && !has_bonus {
                return Err(FigureError::NoBonus(path()));
            }
        }
        Ok(())
    }

    fn title(&self) -> String {
        let selection: Vec<String> = [self.episode_range()]
            .into_iter()
            .chain(self.settings.conditions.iter().cloned())
            .filter(|part| !part.is_empty())
            .collect();
        let episodes = if selection.is_empty() || !self.settings.shows_states() {
            String::new()
        } else {
            format!(": {}", selection.join(", "))
        };
        match self.runs {
            [run] if self.omits_agents(run) => {
                format!(
                    "{}{episodes} (panels of agents 0 to {} of {})",
                    run.label,
                    MAX_AGENT_PANELS - 1,
                    run.loaded_run.agent_count()
                )
            }
            [run] => format!("{}{episodes}", run.label),
            runs => format!("{} runs side by side{episodes}", runs.len()),
        }
    }

    /// Whether no agents are chosen and some agents have no panel, because there are too many.
    fn omits_agents(&self, run: &PlottedRun) -> bool {
        self.settings.shows(Part::Visitation)
            && self.settings.agents.is_empty()
            && run.states.len() > MAX_AGENT_PANELS as usize
    }

    /// The range of drawn episodes as text; empty for all episodes.
    fn episode_range(&self) -> String {
        match &self.settings.episodes {
            None => String::new(),
            Some(range) if range.end == u32::MAX => format!("episodes from {} on", range.start),
            Some(range) => format!("episodes {} to {}", range.start, range.end - 1),
        }
    }

    fn description(&self) -> String {
        let runs: Vec<String> = self
            .runs
            .iter()
            .map(|run| format!("{} ({} agents)", run.label, run.loaded_run.agent_count()))
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

    /// One panel per agent; with several runs and without chosen agents, one panel per run.
    fn visitation(&self) -> Vec<Row> {
        let groups = self.visitation_groups();
        let columns = self.columns(groups.len());
        let (panels, key) = states::lines_or_density(self.settings, &groups);
        layout_rows(panels, columns, 230.0, key.as_ref())
    }

    /// One panel per agent, compared with its team; with several runs, one per run, compared with the
    /// first.
    fn difference(&self) -> Vec<Row> {
        let team_groups = self.team_groups();
        let groups = match self.runs {
            [_] => self.visitation_groups(),
            _ => team_groups[1..].to_vec(),
        };
        let reference = self.reference(&team_groups);
        if self.runs.len() == 1 && reference.agent_count() < 2 {
            return Vec::new();
        }
        let (panels, key) = states::differences(self.settings, &groups, &reference);
        self.rows_of_states(panels, self.columns(groups.len()), Some(&key))
    }

    /// What is subtracted: all agents of the run, also of those that have no panel, or the first run.
    fn reference<'a>(&'a self, team_groups: &[StateGroup<'a>]) -> StateGroup<'a> {
        let run = &self.runs[0];
        if run.team.is_empty() {
            return team_groups[0].clone();
        }
        let title = format!("{} agents together", run.team.len());
        StateGroup::new(run, title, run.team.iter().collect())
    }

    /// Number of panels of visited states per row.
    fn columns(&self, panels: usize) -> usize {
        let axes = self
            .runs
            .iter()
            .filter_map(|run| run.states.first().map(|_| self.axis_count(run)))
            .max()
            .unwrap_or(2);
        let fitting_columns =
            ((self.settings.width - 90.0) / (MIN_AXIS_WIDTH * axes as f64)) as usize;
        let max_columns = if self.runs.len() > 1 && !self.settings.agents.is_empty() {
            self.runs.len()
        } else {
            fitting_columns.clamp(1, 3)
        };
        balanced_columns(panels, max_columns)
    }

    /// Number of panels of at least this width that fit side by side, at most four.
    fn columns_of_width(&self, width: f64) -> usize {
        ((self.settings.width / width) as usize).clamp(1, 4)
    }

    /// Number of axes that a panel of the run draws.
    fn axis_count(&self, run: &PlottedRun) -> usize {
        if self.settings.axes.is_empty() {
            run.axes.as_ref().map_or(2, |axes| axes.all().len())
        } else {
            self.settings.axes.len()
        }
    }

    /// One group per agent; with several runs and without chosen agents, one group per run.
    fn visitation_groups(&self) -> Vec<StateGroup<'_>> {
        let has_several_runs = self.runs.len() > 1;
        if has_several_runs && self.settings.agents.is_empty() {
            return self.team_groups();
        }
        let is_shown = |states: &&SelectedStates| {
            !self.settings.agents.is_empty() || states.agent < MAX_AGENT_PANELS
        };
        let agents: Vec<u32> = self.runs[0]
            .states
            .iter()
            .filter(is_shown)
            .map(|states| states.agent)
            .collect();
        let title = |run: &PlottedRun, agent: u32| {
            if has_several_runs {
                format!("{}, agent {agent}", run.label)
            } else {
                format!("agent {agent}")
            }
        };
        let mut groups = Vec::new();
        for agent in agents {
            for run in self.runs {
                let states_of_agent = run.states.iter().filter(|states| states.agent == agent);
                groups.push(StateGroup::new(
                    run,
                    title(run, agent),
                    states_of_agent.collect(),
                ));
            }
        }
        groups
    }

    fn density(&self) -> Vec<Row> {
        let groups: Vec<StateGroup<'_>> = self.team_groups();
        let (panels, key) = states::density(self.settings, &groups);
        let columns = self.runs.len().min(self.columns_of_width(240.0));
        self.rows_of_states(panels, columns, key.as_ref())
    }

    /// One group per run, with the states of all its agents.
    fn team_groups(&self) -> Vec<StateGroup<'_>> {
        let has_several_runs = self.runs.len() > 1;
        let title = |run: &PlottedRun| match run.states.len() {
            _ if has_several_runs => run.label.clone(),
            1 => format!("agent {}", run.states[0].agent),
            agents => format!("{agents} agents together"),
        };
        self.runs
            .iter()
            .map(|run| StateGroup::new(run, title(run), run.states.iter().collect()))
            .collect()
    }

    fn scatter(&self) -> Vec<Row> {
        let groups = if self.settings.shows_one_pair() {
            self.visitation_groups()
        } else {
            self.team_groups()
        };
        let (panels, key) = states::scatter(self.settings, &groups);
        self.rows_of_maps(panels, key.as_ref())
    }

    /// Panels of states in rows: maps as large as they fit, others in so many columns.
    fn rows_of_states(&self, panels: Vec<Panel>, columns: usize, key: Option<&Key>) -> Vec<Row> {
        if matches!(panels[..], [Panel::HeatMap(_), ..]) {
            return self.rows_of_maps(panels, key);
        }
        layout_rows(panels, columns, 230.0, key)
    }

    /// Maps of two axes in rows, to scale if both are lengths.
    fn rows_of_maps(&self, panels: Vec<Panel>, key: Option<&Key>) -> Vec<Row> {
        let aspect = panels.first().and_then(Panel::aspect_of_map);
        let columns = if self.runs.len() > 1 {
            self.runs.len().min(panels.len())
        } else {
            let most = self.columns_of_width(if aspect.is_none() { 115.0 } else { 170.0 });
            let fitting = (1..=most).rev().find(|columns| {
                aspect.is_none_or(|aspect| self.size_of_map(*columns, aspect) >= MIN_MAP_HEIGHT)
            });
            let largest = aspect.and_then(|aspect| self.columns_of_largest(aspect, panels.len()));
            largest.unwrap_or(balanced_columns(panels.len(), fitting.unwrap_or(1)))
        };
        let height = aspect.map_or(220.0, |aspect| {
            self.size_of_map(columns, aspect).clamp(60.0, 500.0) + HEIGHT_OF_LABELS
        });
        layout_rows(panels, columns, height, key)
    }

    /// On a page of given height with nothing but maps: the number of columns with which they are largest.
    fn columns_of_largest(&self, aspect: f64, maps: usize) -> Option<usize> {
        let height = self.settings.height?;
        if self.settings.parts != [Part::Scatter] {
            return None;
        }
        let size = |columns: &usize| {
            let rows = maps.div_ceil(*columns) as f64;
            let in_height = (height - HEIGHT_OF_TITLE) / rows - HEIGHT_OF_LABELS;
            in_height.min(self.size_of_map(*columns, aspect))
        };
        (1..=maps).max_by(|one, other| size(one).total_cmp(&size(other)))
    }

    /// Height of the plots of maps to scale with so many columns. Rows of this height have no empty space.
    fn size_of_map(&self, columns: usize, aspect: f64) -> f64 {
        let is_below = WIDTH_OF_KEY > MAX_SHARE_OF_KEY * self.settings.width;
        let key = if is_below { 0.0 } else { WIDTH_OF_KEY };
        let width = (self.settings.width - key) / columns as f64 - WIDTH_OF_LABELS;
        width * aspect
    }
}

/// Number of columns, at most `max_columns`, that distributes panels evenly over the smallest
/// possible number of rows.
fn balanced_columns(panels: usize, max_columns: usize) -> usize {
    let rows = panels.div_ceil(max_columns.max(1)).max(1);
    panels.div_ceil(rows).max(1)
}

/// Arranges panels in rows, with the color key beside each row.
fn layout_rows(panels: Vec<Panel>, columns: usize, height: f64, key: Option<&Key>) -> Vec<Row> {
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
    fn panels_are_spread_evenly_over_rows() {
        assert_eq!(
            [(4, 3), (6, 4), (5, 2), (1, 4), (7, 4)]
                .map(|(panels, max_columns)| balanced_columns(panels, max_columns)),
            [2, 3, 2, 1, 4]
        );
    }
}
