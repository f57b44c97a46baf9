//! Panels of visited states: parallel coordinates and pairs of axes.

use super::{ColorBy, PlotArgs, PlottedRun};
use seedbed::plotting::axis_with_shares;
use seedbed::record::visitation::{Unplaced, share_difference};
use seedbed::review::selection::{GRID_CELLS, SelectedState, SelectedStates, is_sampled};
use seedbed_env::{Quantity, Status};
use seedbed_figure::color::{
    AGENT_COLORS, OTHERS_COLOR, agent_color, categorical_color, sequential_color,
};
use seedbed_figure::{
    Axis, Color, DensityImage, DifferenceImage, HeatMap, Key, Panel, ParallelCoordinates, Scatter,
    ScatterPoint, StateLine, States,
};

/// States of a run that are drawn together: those of one agent or of several agents.
#[derive(Clone)]
pub(super) struct StateGroup<'a> {
    run: &'a PlottedRun,
    title: String,
    /// Selected states of each agent of the group.
    agents: Vec<&'a SelectedStates>,
}

/// The color of an outcome on a white page.
fn outcome_color(outcome: Status) -> Color {
    categorical_color(if outcome == Status::Terminated { 0 } else { 3 })
}

/// Maximum number of axes for which all pairs are drawn. With more axes, only pairs of neighboring
/// axes are drawn.
const MAX_PAIRED_AXES: usize = 5;

/// The pairs of axes that are drawn, as indices of axes.
pub(super) fn axis_pairs(axes: &[usize]) -> Vec<[usize; 2]> {
    if axes.len() > MAX_PAIRED_AXES {
        return axes.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    }
    let pairs_with_later_axes =
        |index: usize| axes[index + 1..].iter().map(move |&second| (index, second));
    (0..axes.len())
        .flat_map(pairs_with_later_axes)
        .map(|(first, second)| [axes[first], second])
        .collect()
}

/// One panel per group: panels of lines, if no group has more than `--lines` states or if
/// `--colour` is given; otherwise panels of densities on a common scale.
///
/// More than about 1,000 lines make a panel a solid block, even if they are transparent. A density
/// also shows all states instead of a sample. All panels of a figure are of the same kind, because
/// lines cannot be compared with densities.
pub(super) fn lines_or_density(
    args: &PlotArgs,
    groups: &[StateGroup<'_>],
) -> (Vec<Panel>, Option<Key>) {
    if draws_density(args, groups) {
        return density(args, groups);
    }
    let colors = StateColors::new(args, groups);
    let panel = |group: &StateGroup<'_>| {
        let lines = group
            .sample(args)
            .into_iter()
            .map(|(agent, state)| StateLine {
                axis_positions: state.selected_axis_positions.clone(),
                color: colors.color(agent, state),
            });
        group.parallel_coordinates(
            args,
            States::Lines(lines.collect()),
            group.title_with(&group.sample_size_text(args)),
        )
    };
    (groups.iter().map(panel).collect(), colors.key)
}

/// Panels of densities on a common scale: the number of states per pixel or, with several panels,
/// the share of the panel's states per pixel.
pub(super) fn density(args: &PlotArgs, groups: &[StateGroup<'_>]) -> (Vec<Panel>, Option<Key>) {
    let pixels_of_groups =
        scale_to_largest(groups, groups.iter().map(StateGroup::pixels).collect());
    let max_count = pixels_of_groups
        .iter()
        .flatten()
        .copied()
        .max()
        .unwrap_or(0);
    let panel = |(group, pixels): (&StateGroup<'_>, Vec<u32>)| {
        let width = group.width(args);
        group.parallel_coordinates(
            args,
            States::Density(DensityImage {
                pixels,
                width,
                max_count,
            }),
            group.title_with(&group.state_count_text()),
        )
    };
    let panels = groups.iter().zip(pixels_of_groups).map(panel).collect();
    (
        panels,
        Some(density_key(groups, "states per pixel", max_count)),
    )
}

/// Panels of differences of groups from a reference, on a common scale: for each pixel the share of
/// the group's lines minus the share of the reference's lines.
pub(super) fn differences(
    args: &PlotArgs,
    groups: &[StateGroup<'_>],
    reference: &StateGroup<'_>,
) -> (Vec<Panel>, Key) {
    let width = reference.width(args);
    let of_reference = reference.pixels();
    let difference = |group: &StateGroup<'_>| {
        share_difference(
            (&group.pixels(), group.state_count()),
            (&of_reference, reference.state_count()),
        )
    };
    let images: Vec<(Vec<f32>, f32)> = groups.iter().map(difference).collect();
    let max = images.iter().map(|(_, max)| *max).fold(0.0, f32::max);
    let panel = |(group, (mut pixels, own_max)): (&StateGroup<'_>, (Vec<f32>, f32))| {
        // From the scale of this image to the common one.
        let factor = if max > 0.0 {
            (own_max / max).sqrt()
        } else {
            0.0
        };
        for pixel in &mut *pixels {
            *pixel *= factor;
        }
        let title = format!("{} − {}", group.title, reference.title);
        group.parallel_coordinates(
            args,
            States::Difference(DifferenceImage { pixels, width }),
            title,
        )
    };
    let key = Key::Differences {
        label: "difference of shares, √ scale".to_owned(),
        max: f64::from(max),
    };
    (groups.iter().zip(images).map(panel).collect(), key)
}

/// Panels of pairs of axes: for each pair, one panel per group.
pub(super) fn scatter(args: &PlotArgs, groups: &[StateGroup<'_>]) -> (Vec<Panel>, Option<Key>) {
    let pairs = groups
        .first()
        .map_or(Vec::new(), |group| axis_pairs(&group.axis_indices(args)));
    if draws_density(args, groups) {
        let grids = scale_to_largest(
            groups,
            groups
                .iter()
                .map(|group| group.grids(pairs.len()))
                .collect(),
        );
        let max_count = grids.iter().flatten().copied().max().unwrap_or(0);
        let panel = |pair: usize, (group, grids): (&StateGroup<'_>, &Vec<u32>)| {
            let counts = grids
                [pair * GRID_CELLS * GRID_CELLS..(pair + 1) * GRID_CELLS * GRID_CELLS]
                .to_vec();
            group.heat_map_panel(args, pairs[pair], counts, max_count)
        };
        let panels = (0..pairs.len())
            .flat_map(|pair| groups.iter().zip(&grids).map(move |drawn| (pair, drawn)));
        let panels = panels.map(|(pair, drawn)| panel(pair, drawn)).collect();
        return (
            without_repeated_titles(panels, groups.len()),
            Some(density_key(groups, "states per cell", max_count)),
        );
    }
    let colors = StateColors::new(args, groups);
    let panels = pairs
        .iter()
        .flat_map(|pair| groups.iter().map(move |group| (pair, group)));
    let panels = panels.map(|(pair, group)| group.scatter_panel(args, *pair, &colors));
    (
        without_repeated_titles(panels.collect(), groups.len()),
        colors.key,
    )
}

/// Panels of pairs of axes, of which only the first of each group has a title.
fn without_repeated_titles(mut panels: Vec<Panel>, groups: usize) -> Vec<Panel> {
    for panel in panels.iter_mut().skip(groups) {
        match panel {
            Panel::Scatter(scatter) => scatter.title.clear(),
            Panel::HeatMap(heat_map) => heat_map.title.clear(),
            _ => {}
        }
    }
    panels
}

/// Scales the counts of each group as if it had as many states as the largest group. So panels show
/// shares, which do not depend on the lengths of runs.
fn scale_to_largest(groups: &[StateGroup<'_>], counts: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
    let max_states = max_states(groups);
    let scale = |count: u32, group_states: u64| {
        if count == 0 {
            0
        } else {
            ((u64::from(count) * max_states + group_states / 2) / group_states)
                .max(1)
                .try_into()
                .unwrap_or(u32::MAX)
        }
    };
    groups
        .iter()
        .map(StateGroup::state_count)
        .zip(counts)
        .map(|(group_states, counts)| {
            counts
                .into_iter()
                .map(|count| scale(count, group_states.max(1)))
                .collect()
        })
        .collect()
}

/// Number of states of the largest group.
fn max_states(groups: &[StateGroup<'_>]) -> u64 {
    groups
        .iter()
        .map(StateGroup::state_count)
        .max()
        .unwrap_or(0)
}

/// Key of the densities; with several groups, a key of shares.
fn density_key(groups: &[StateGroup<'_>], label: &str, max_count: u32) -> Key {
    if groups.len() > 1 {
        return Key::Shares {
            label: format!("share of {label}"),
            max_count,
            total: max_states(groups),
        };
    }
    Key::Counts {
        label: label.to_owned(),
        max_count,
    }
}

fn draws_density(args: &PlotArgs, groups: &[StateGroup<'_>]) -> bool {
    args.color_by.is_none()
        && groups
            .iter()
            .any(|group| group.state_count() > u64::from(args.lines))
}

impl<'a> StateGroup<'a> {
    pub(super) fn new(run: &'a PlottedRun, title: String, agents: Vec<&'a SelectedStates>) -> Self {
        Self { run, title, agents }
    }

    fn state_count(&self) -> u64 {
        self.agents.iter().map(|states| states.count).sum()
    }

    /// A sample of at most `--lines` states with their agents, in a mixed order, so that neither the
    /// states of one agent nor late ones cover all others.
    fn sample(&self, args: &PlotArgs) -> Vec<(u32, &'a SelectedState)> {
        let with_agent = |states: &&'a SelectedStates| {
            let agent = states.agent;
            states.sample.iter().map(move |state| (agent, state))
        };
        let all: Vec<(u32, &SelectedState)> = self.agents.iter().flat_map(with_agent).collect();
        let (count, max_drawn) = (all.len() as u64, u64::from(args.lines));
        let mut sampled_states: Vec<_> = (0..)
            .zip(all)
            .filter(|(index, _)| is_sampled(*index, count, max_drawn))
            .map(|(_, state)| state)
            .collect();
        sampled_states.sort_by_key(|(_, state)| state.episode);
        mixed(sampled_states)
    }

    /// Number of states, e.g. `1,234 states`.
    fn state_count_text(&self) -> String {
        format!("{} states", indicatif::HumanCount(self.state_count()))
    }

    /// Number of states in the sample, e.g. `1,000 of 1,234 states`.
    fn sample_size_text(&self, args: &PlotArgs) -> String {
        let (count, max_drawn) = (self.state_count(), u64::from(args.lines));
        if count <= max_drawn {
            self.state_count_text()
        } else {
            format!(
                "{} of {}",
                indicatif::HumanCount(max_drawn),
                self.state_count_text()
            )
        }
    }

    /// Indices of the selected axes among all axes of the recording.
    fn axis_indices(&self, args: &PlotArgs) -> Vec<usize> {
        self.run
            .axes
            .as_ref()
            .and_then(|axes| args.axis_indices(axes).ok())
            .unwrap_or_default()
    }

    fn quantity(&self, axis_index: usize) -> Quantity {
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

    pub(super) fn agent_count(&self) -> usize {
        self.agents.len()
    }

    fn title_with(&self, count_text: &str) -> String {
        format!("{}: {count_text}", self.title)
    }

    /// Width of the image of all axes, in pixels.
    fn width(&self, args: &PlotArgs) -> usize {
        let axes = self.run.axes.as_ref();
        axes.map_or(1, |axes| axes.subset(&self.axis_indices(args)).width())
    }

    fn parallel_coordinates(&self, args: &PlotArgs, states: States, title: String) -> Panel {
        let axes = self.axis_indices(args).into_iter().enumerate();
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
    fn axis(&self, position: usize, index: usize) -> Axis {
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
    fn axes_of_pair(&self, args: &PlotArgs, pair: [usize; 2]) -> [Axis; 2] {
        let selected = self.axis_indices(args);
        let position = |index: usize| selected.iter().position(|other| *other == index);
        pair.map(|index| self.axis(position(index).unwrap_or_default(), index))
    }

    /// Number of lines per pixel, over all agents of the group.
    fn pixels(&self) -> Vec<u32> {
        let mut sum: Vec<u32> = Vec::new();
        for states in &self.agents {
            let mut density = states.density.clone();
            let pixels = density.draw_all();
            sum.resize(pixels.len(), 0);
            sum.iter_mut()
                .zip(pixels)
                .for_each(|(sum, lines)| *sum = sum.saturating_add(*lines));
        }
        sum
    }

    /// Number of states per cell of the grids of all pairs of axes, over all agents of the group.
    fn grids(&self, pair_count: usize) -> Vec<u32> {
        let mut sum = vec![0_u32; pair_count * GRID_CELLS * GRID_CELLS];
        for states in &self.agents {
            sum.iter_mut()
                .zip(&states.grids)
                .for_each(|(sum, count)| *sum = sum.saturating_add(*count));
        }
        sum
    }

    fn heat_map_panel(
        &self,
        args: &PlotArgs,
        pair: [usize; 2],
        counts: Vec<u32>,
        max_count: u32,
    ) -> Panel {
        let [x, y] = self.axes_of_pair(args, pair);
        Panel::HeatMap(HeatMap {
            title: format!("{}: {}", self.title, self.state_count_text()),
            x,
            y,
            counts,
            columns: GRID_CELLS,
            max_count,
        })
    }

    fn scatter_panel(&self, args: &PlotArgs, [x, y]: [usize; 2], colors: &StateColors) -> Panel {
        let [x_axis, y_axis] = self.axes_of_pair(args, [x, y]);
        let axis_value =
            |axis: &Axis, fraction: f32| axis.range[0] + fraction * (axis.range[1] - axis.range[0]);
        let point = |(agent, state): (u32, &SelectedState)| ScatterPoint {
            position: [
                axis_value(&x_axis, state.axis_positions[x]),
                axis_value(&y_axis, state.axis_positions[y]),
            ],
            color: colors.color(agent, state),
        };
        let points = self.sample(args).into_iter().map(point).collect();
        Panel::Scatter(Scatter {
            title: format!("{}: {}", self.title, self.sample_size_text(args)),
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

/// Colors of states, with their color key.
struct StateColors {
    color_by: ColorBy,
    /// Values at the ends of a continuous color scale.
    range: [f64; 2],
    key: Option<Key>,
}

impl StateColors {
    fn new(args: &PlotArgs, groups: &[StateGroup<'_>]) -> Self {
        let color_by = args.color_by.unwrap_or(ColorBy::Agent);
        let range = color_range(color_by, groups);
        let key = color_key(color_by, range, groups);
        Self {
            color_by,
            range,
            key,
        }
    }

    fn color(&self, agent: u32, state: &SelectedState) -> Color {
        let [low, high] = self.range;
        match color_value(self.color_by, state) {
            Some(value) if value.is_nan() => OTHERS_COLOR,
            Some(value) => sequential_color((value - low) / (high - low)),
            None if self.color_by == ColorBy::Agent => agent_color(agent),
            None => outcome_color(state.outcome),
        }
    }
}

/// The value that determines the color on a continuous scale; `None` for categorical colors.
fn color_value(color_by: ColorBy, state: &SelectedState) -> Option<f64> {
    match color_by {
        ColorBy::Agent | ColorBy::Outcome => None,
        ColorBy::Episode => Some(f64::from(state.episode)),
        ColorBy::Return => Some(state.r#return),
        ColorBy::IntrinsicReward => Some(f64::from(state.intrinsic_reward)),
    }
}

/// Smallest and largest value on the continuous color scale. If all values are equal, the range
/// also includes 0 and is never empty; without values it is 0 to 1.
fn color_range(color_by: ColorBy, groups: &[StateGroup<'_>]) -> [f64; 2] {
    let [low, high] = groups
        .iter()
        .flat_map(|group| &group.agents)
        .flat_map(|states| &states.sample)
        .filter_map(|state| color_value(color_by, state))
        .filter(|value| value.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |ends, value| {
            [ends[0].min(value), ends[1].max(value)]
        });
    if high > low {
        [low, high]
    } else if low > high {
        [0.0, 1.0]
    } else {
        [low.min(0.0), low.max(0.0) + 1.0]
    }
}

fn color_key(color_by: ColorBy, range: [f64; 2], groups: &[StateGroup<'_>]) -> Option<Key> {
    let mut states = groups
        .iter()
        .flat_map(|group| &group.agents)
        .flat_map(|states| &states.sample);
    let has_nan = states.any(|state| color_value(color_by, state).is_some_and(f64::is_nan));
    let continuous_key = |label: &str| {
        Some(Key::Continuous {
            label: format!("{label}{}", if has_nan { ", gray: NaN" } else { "" }),
            range,
        })
    };
    match color_by {
        ColorBy::Agent => agent_key(groups),
        ColorBy::Episode => continuous_key("episode"),
        ColorBy::Return => continuous_key("return of the episode"),
        ColorBy::IntrinsicReward => continuous_key("intrinsic reward"),
        ColorBy::Outcome => {
            let outcomes = [
                ("terminated", Status::Terminated),
                ("truncated", Status::Truncated),
            ];
            Some(Key::Categories(
                outcomes
                    .map(|(name, outcome)| (name.to_owned(), outcome_color(outcome)))
                    .to_vec(),
            ))
        }
    }
}

/// Key of the colors of agents; `None` unless a panel shows several agents.
fn agent_key(groups: &[StateGroup<'_>]) -> Option<Key> {
    let has_several_agents = groups.iter().any(|group| group.agents.len() > 1);
    let mut agents: Vec<u32> = groups
        .iter()
        .flat_map(|group| &group.agents)
        .map(|states| states.agent)
        .collect();
    agents.sort_unstable();
    agents.dedup();
    let (colored, others): (Vec<u32>, Vec<u32>) =
        agents.into_iter().partition(|&agent| agent < AGENT_COLORS);
    let mut names: Vec<(String, Color)> = colored
        .into_iter()
        .map(|agent| (format!("agent {agent}"), agent_color(agent)))
        .collect();
    if !others.is_empty() {
        names.push(("other agents".to_owned(), OTHERS_COLOR));
    }
    has_several_agents.then_some(Key::Categories(names))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_axes_are_paired_with_all_and_many_only_with_neighbors() {
        assert_eq!(axis_pairs(&[0, 2, 3]), [[0, 2], [0, 3], [2, 3]]);
        assert_eq!(axis_pairs(&[0, 1, 2, 3, 4, 5]).len(), 5);
    }
}
