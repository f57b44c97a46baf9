//! Visited states of one agent or of several agents, and their panels.

use super::colors::StateColors;
use crate::figures::runs::PlottedRun;
use crate::figures::settings::FigureSettings;
use crate::plotting::{are_coordinates, axis_with_shares, number_of_states};
use crate::record::visitation::Unplaced;
use crate::review::selection::{GRID_CELLS, SelectedState, SelectedStates, is_sampled};
use seedbed_env::Quantity;
use seedbed_figure::{
    Axis, Cells, HeatMap, Panel, ParallelCoordinates, Scatter, ScatterPoint, States,
};

/// States of a run that are drawn together: those of one agent or of several agents.
#[derive(Clone)]
pub(in crate::figures) struct StateGroup<'a> {
    run: &'a PlottedRun,
    pub(super) title: String,
    /// Selected states of each agent of the group.
    pub(super) agents: Vec<&'a SelectedStates>,
}

impl<'a> StateGroup<'a> {
    pub(in crate::figures) fn new(
        run: &'a PlottedRun,
        title: String,
        agents: Vec<&'a SelectedStates>,
    ) -> Self {
        Self { run, title, agents }
    }

    pub(super) fn state_count(&self) -> u64 {
        self.agents.iter().map(|states| states.count).sum()
    }

    /// A sample of at most `max_lines` states with their agents, in a mixed order, so that neither the
    /// states of one agent nor late ones cover all others.
    pub(super) fn sample(&self, settings: &FigureSettings) -> Vec<(u32, &'a SelectedState)> {
        let with_agent = |states: &&'a SelectedStates| {
            let agent = states.agent;
            states.sample.iter().map(move |state| (agent, state))
        };
        let all: Vec<(u32, &SelectedState)> = self.agents.iter().flat_map(with_agent).collect();
        let (count, max_drawn) = (all.len() as u64, u64::from(settings.max_lines));
        let mut sampled_states: Vec<_> = (0..)
            .zip(all)
            .filter(|(index, _)| is_sampled(*index, count, max_drawn))
            .map(|(_, state)| state)
            .collect();
        sampled_states.sort_by_key(|(_, state)| state.episode);
        mixed(sampled_states)
    }

    /// Number of states, e.g. `1,234 states`.
    pub(super) fn state_count_text(&self) -> String {
        number_of_states(self.state_count(), self.state_count())
    }

    /// Number of states in the sample, e.g. `1,000 of 1,234 states`.
    pub(super) fn sample_size_text(&self, settings: &FigureSettings) -> String {
        number_of_states(u64::from(settings.max_lines), self.state_count())
    }

    /// The pair of axes, as indices among all axes, if two were chosen.
    pub(super) fn chosen_pair(&self, settings: &FigureSettings) -> Option<[usize; 2]> {
        match self.scatter_pairs(settings)[..] {
            [pair] if settings.axes.len() == 2 => Some(pair),
            _ => None,
        }
    }

    /// The pairs of axes of scatter plots, as indices among all axes.
    pub(super) fn scatter_pairs(&self, settings: &FigureSettings) -> Vec<[usize; 2]> {
        let axes = self.run.axes.as_ref();
        axes.and_then(|axes| settings.scatter_pairs(axes).ok())
            .unwrap_or_default()
    }

    /// Indices of the selected axes among all axes of the recording.
    pub(super) fn axis_indices(&self, settings: &FigureSettings) -> Vec<usize> {
        self.run
            .axes
            .as_ref()
            .and_then(|axes| settings.axis_indices(axes).ok())
            .unwrap_or_default()
    }

    pub(super) fn quantity(&self, axis_index: usize) -> Quantity {
        let axes = self
            .run
            .axes
            .as_ref()
            .and_then(|axes| axes.all().get(axis_index));
        axes.map_or(
            Quantity {
                name: String::new(),
                unit: String::new(),
                range: [0.0, 1.0],
            },
            |axis| axis.quantity.clone(),
        )
    }

    pub(in crate::figures) fn agent_count(&self) -> usize {
        self.agents.len()
    }

    pub(super) fn title_with(&self, count_text: &str) -> String {
        format!("{}: {count_text}", self.title)
    }

    /// Width of the image of all axes, in pixels.
    pub(super) fn width(&self, settings: &FigureSettings) -> usize {
        let axes = self.run.axes.as_ref();
        axes.map_or(1, |axes| axes.subset(&self.axis_indices(settings)).width())
    }

    pub(super) fn parallel_coordinates(
        &self,
        settings: &FigureSettings,
        states: States,
        title: String,
    ) -> Panel {
        let axes = self.axis_indices(settings).into_iter().enumerate();
        let axes = axes
            .map(|(position, index)| self.axis(position, index))
            .collect();
        Panel::ParallelCoordinates(ParallelCoordinates {
            title,
            axes,
            states,
        })
    }

    /// The axis at `position` among the selected axes, which is `index` among all axes, with the shares of
    /// states of all agents of the group that have no place on it.
    pub(super) fn axis(&self, position: usize, index: usize) -> Axis {
        let mut unplaced = Unplaced::default();
        for agent in &self.agents {
            unplaced += agent.unplaced[position];
        }
        axis_with_shares(
            &self.quantity(index),
            unplaced.shares(self.state_count()).to_array(),
        )
    }

    /// The axes of a pair of indices among all axes.
    pub(super) fn axes_of_pair(&self, settings: &FigureSettings, pair: [usize; 2]) -> [Axis; 2] {
        let selected = self.axis_indices(settings);
        let position = |index: usize| selected.iter().position(|other| *other == index);
        pair.map(|index| self.axis(position(index).unwrap_or_default(), index))
    }

    /// Number of lines per pixel, over all agents of the group.
    pub(super) fn pixels(&self) -> Vec<u32> {
        let mut sum: Vec<u32> = Vec::new();
        for states in &self.agents {
            let pixels = states.density.pixels();
            sum.resize(pixels.len(), 0);
            sum.iter_mut()
                .zip(pixels)
                .for_each(|(sum, lines)| *sum = sum.saturating_add(lines));
        }
        sum
    }

    /// Number of states per cell of the grids of all pairs of axes, over all agents of the group.
    pub(super) fn grids(&self, pair_count: usize) -> Vec<u32> {
        let mut sum = vec![0_u32; pair_count * GRID_CELLS * GRID_CELLS];
        for states in &self.agents {
            sum.iter_mut()
                .zip(&states.grids)
                .for_each(|(sum, count)| *sum = sum.saturating_add(*count));
        }
        sum
    }

    /// The walls of the task, if the axes are its coordinates.
    fn scenery(&self, axes: [&Axis; 2]) -> Vec<Vec<[f32; 2]>> {
        if are_coordinates(axes) {
            self.run.walls.clone()
        } else {
            Vec::new()
        }
    }

    pub(super) fn heat_map_panel(
        &self,
        settings: &FigureSettings,
        title: String,
        pair: [usize; 2],
        cells: Cells,
    ) -> Panel {
        let [x, y] = self.axes_of_pair(settings, pair);
        let lines = self.scenery([&x, &y]);
        Panel::HeatMap(HeatMap {
            title,
            x,
            y,
            cells,
            columns: GRID_CELLS,
            lines,
        })
    }

    pub(super) fn scatter_panel(
        &self,
        settings: &FigureSettings,
        [x, y]: [usize; 2],
        colors: &StateColors,
    ) -> Panel {
        let [x_axis, y_axis] = self.axes_of_pair(settings, [x, y]);
        let point = |(agent, state): (u32, &SelectedState)| ScatterPoint {
            position: [
                x_axis.value_at(state.axis_positions[x]),
                y_axis.value_at(state.axis_positions[y]),
            ],
            color: colors.color(agent, state),
        };
        let points = self.sample(settings).into_iter().map(point).collect();
        let lines = self.scenery([&x_axis, &y_axis]);
        Panel::Scatter(Scatter {
            title: format!("{}: {}", self.title, self.sample_size_text(settings)),
            lines,
            x: x_axis,
            y: y_axis,
            points,
        })
    }
}

/// The items in an order in which neighbors are far apart: that of the multiples of the golden ratio,
/// without their whole parts.
fn mixed<T>(items: Vec<T>) -> Vec<T> {
    const GOLDEN_RATIO_BITS: u64 = 0x9E37_79B9_7F4A_7C15;
    let position = |index: u64| index.wrapping_mul(GOLDEN_RATIO_BITS);
    let mut numbered: Vec<(u64, T)> = (0..).map(position).zip(items).collect();
    numbered.sort_by_key(|(position, _)| *position);
    numbered.into_iter().map(|(_, item)| item).collect()
}
