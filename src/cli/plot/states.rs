//! Panels of visited states: parallel coordinates and pairs of axes.

use super::{ColorBy, PlotArgs, PlottedRun};
use crate::plotting::axis;
use crate::run::review::selection::{GRID_CELLS, SelectedState, SelectedStates, is_sampled};
use seedbed_env::{Quantity, Status};
use seedbed_figure::color::{categorical_color, sequential_color};
use seedbed_figure::{
    Color, DensityImage, HeatMap, Key, Panel, ParallelCoordinates, Scatter, ScatterPoint,
    StateLine, States,
};

/// The states of one panel.
pub(super) struct PanelStates<'a> {
    run: &'a PlottedRun,
    title: String,
    agents: Vec<&'a SelectedStates>,
}

/// The color of an outcome on a white page.
fn outcome_color(outcome: Status) -> Color {
    categorical_color(if outcome == Status::Terminated { 5 } else { 4 })
}

/// Maximum number of axes for which all pairs are drawn. With more axes, only pairs of neighboring axes are drawn.
const MAX_PAIRED_AXES: usize = 5;

/// The pairs of axes that are drawn, as indices of axes.
pub(super) fn pairs(axes: &[usize]) -> Vec<[usize; 2]> {
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

/// Panels of lines, if no panel has more than `--lines` states or if `--colour` is given; otherwise panels of
/// densities on a common scale.
///
/// More than about 1,000 lines make a panel a solid block, even if they are transparent. A density also shows all
/// states instead of a sample. All panels of a figure are of the same kind, because lines cannot be compared
/// with densities.
pub(super) fn lines_or_density(
    args: &PlotArgs,
    groups: &[PanelStates<'_>],
) -> (Vec<Panel>, Option<Key>) {
    if draws_density(args, groups) {
        return density(args, groups);
    }
    let colors = StateColors::of(args, groups);
    let panel = |group: &PanelStates<'_>| {
        let lines = group
            .sample(args)
            .into_iter()
            .map(|(agent, state)| StateLine {
                fractions: state.crossed.clone(),
                color: colors.color(agent, state),
            });
        group.parallel(args, States::Lines(lines.collect()), &group.sampled(args))
    };
    (groups.iter().map(panel).collect(), colors.key)
}

/// Panels of densities on a common scale: the number of states per pixel or, with several panels, the share of the
/// states of the panel.
pub(super) fn density(args: &PlotArgs, groups: &[PanelStates<'_>]) -> (Vec<Panel>, Option<Key>) {
    let pixels_of_groups =
        scale_to_largest(groups, groups.iter().map(PanelStates::pixels).collect());
    let max_count = pixels_of_groups
        .iter()
        .flatten()
        .copied()
        .max()
        .unwrap_or(0);
    let panel = |(group, pixels): (&PanelStates<'_>, Vec<u32>)| {
        let width = group
            .run
            .axes
            .as_ref()
            .map_or(1, |axes| axes.subset(&group.axis_indices(args)).width());
        group.parallel(
            args,
            States::Density(DensityImage {
                pixels,
                width,
                max_count,
            }),
            &group.pluralize(),
        )
    };
    let panels = groups.iter().zip(pixels_of_groups).map(panel).collect();
    (panels, Some(key(groups, "states per pixel", max_count)))
}

/// Panels of pairs of axes: for each pair, one panel per group.
pub(super) fn scatter(args: &PlotArgs, groups: &[PanelStates<'_>]) -> (Vec<Panel>, Option<Key>) {
    let pairs = groups
        .first()
        .map_or(Vec::new(), |group| pairs(&group.axis_indices(args)));
    if draws_density(args, groups) {
        let grids = scale_to_largest(
            groups,
            groups
                .iter()
                .map(|group| group.grids(pairs.len()))
                .collect(),
        );
        let max_count = grids.iter().flatten().copied().max().unwrap_or(0);
        let panel = |pair: usize, (group, grids): (&PanelStates<'_>, &Vec<u32>)| {
            let counts = grids
                [pair * GRID_CELLS * GRID_CELLS..(pair + 1) * GRID_CELLS * GRID_CELLS]
                .to_vec();
            group.heat_map(pairs[pair], counts, max_count)
        };
        let panels = (0..pairs.len())
            .flat_map(|pair| groups.iter().zip(&grids).map(move |drawn| (pair, drawn)));
        let panels = panels.map(|(pair, drawn)| panel(pair, drawn)).collect();
        return (panels, Some(key(groups, "states per cell", max_count)));
    }
    let colors = StateColors::of(args, groups);
    let panels = pairs
        .iter()
        .flat_map(|pair| groups.iter().map(move |group| (pair, group)));
    let panels = panels
        .map(|(pair, group)| group.points(args, *pair, &colors))
        .collect();
    (panels, colors.key)
}

/// Scales the counts of each group as if it had as many states as the largest group. So panels show shares, which
/// do not depend on the lengths of runs.
fn scale_to_largest(groups: &[PanelStates<'_>], counts: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
    let largest = max_states(groups);
    let scaled = |count: u32, of: u64| {
        if count == 0 {
            0
        } else {
            (u64::from(count) * largest / of)
                .max(1)
                .try_into()
                .unwrap_or(u32::MAX)
        }
    };
    let each = groups.iter().map(PanelStates::count).zip(counts);
    each.map(|(of, counts)| {
        counts
            .into_iter()
            .map(|count| scaled(count, of.max(1)))
            .collect()
    })
    .collect()
}

fn max_states(groups: &[PanelStates<'_>]) -> u64 {
    groups.iter().map(PanelStates::count).max().unwrap_or(0)
}

fn key(groups: &[PanelStates<'_>], label: &str, max_count: u32) -> Key {
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

fn draws_density(args: &PlotArgs, groups: &[PanelStates<'_>]) -> bool {
    args.color_by.is_none()
        && groups
            .iter()
            .any(|group| group.count() > u64::from(args.lines))
}

impl<'a> PanelStates<'a> {
    pub(super) fn new(run: &'a PlottedRun, title: String, agents: Vec<&'a SelectedStates>) -> Self {
        Self { run, title, agents }
    }

    fn count(&self) -> u64 {
        self.agents.iter().map(|states| states.count).sum()
    }

    /// A sample of at most `--lines` states, in the order of episodes, so that the states of one agent do not cover
    /// the states of all others.
    fn sample(&self, args: &PlotArgs) -> Vec<(u32, &'a SelectedState)> {
        let of_agent = |states: &&'a SelectedStates| {
            let agent = states.agent;
            states.sample.iter().map(move |state| (agent, state))
        };
        let all: Vec<(u32, &SelectedState)> = self.agents.iter().flat_map(of_agent).collect();
        let (count, max_drawn) = (all.len() as u64, u64::from(args.lines));
        let mut sampled_states: Vec<_> = (0..)
            .zip(all)
            .filter(|(index, _)| is_sampled(*index, count, max_drawn))
            .map(|(_, state)| state)
            .collect();
        sampled_states.sort_by_key(|(_, state)| state.episode);
        sampled_states
    }

    fn pluralize(&self) -> String {
        format!("{} states", indicatif::HumanCount(self.count()))
    }

    fn sampled(&self, args: &PlotArgs) -> String {
        let (count, max_drawn) = (self.count(), u64::from(args.lines));
        if count <= max_drawn {
            self.pluralize()
        } else {
            format!(
                "{} of {}",
                indicatif::HumanCount(max_drawn),
                self.pluralize()
            )
        }
    }

    /// Indices of the selected axes.
    fn axis_indices(&self, args: &PlotArgs) -> Vec<usize> {
        self.run
            .axes
            .as_ref()
            .and_then(|axes| args.chosen_axes(axes).ok())
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

    fn parallel(&self, args: &PlotArgs, states: States, count_text: &str) -> Panel {
        let axes = self
            .axis_indices(args)
            .into_iter()
            .map(|axis_index| axis(&self.quantity(axis_index)))
            .collect();
        let title = format!("{}: {count_text}", self.title);
        Panel::ParallelCoordinates(ParallelCoordinates {
            title,
            axes,
            states,
        })
    }

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

    /// Number of states per cell of all pairs of axes.
    fn grids(&self, pairs: usize) -> Vec<u32> {
        let mut sum = vec![0_u32; pairs * GRID_CELLS * GRID_CELLS];
        for states in &self.agents {
            sum.iter_mut()
                .zip(&states.grids)
                .for_each(|(sum, count)| *sum = sum.saturating_add(*count));
        }
        sum
    }

    fn heat_map(&self, [x, y]: [usize; 2], counts: Vec<u32>, max_count: u32) -> Panel {
        let (title, x, y) = (
            format!("{}: {}", self.title, self.pluralize()),
            self.quantity(x),
            self.quantity(y),
        );
        Panel::HeatMap(HeatMap {
            title,
            x: axis(&x),
            y: axis(&y),
            counts,
            columns: GRID_CELLS,
            max_count,
        })
    }

    fn points(&self, args: &PlotArgs, [x, y]: [usize; 2], colors: &StateColors) -> Panel {
        let (x_axis, y_axis) = (self.quantity(x), self.quantity(y));
        let value = |axis: &Quantity, fraction: f32| {
            axis.range[0] + fraction * (axis.range[1] - axis.range[0])
        };
        let point = |(agent, state): (u32, &SelectedState)| ScatterPoint {
            position: [
                value(&x_axis, state.fractions[x]),
                value(&y_axis, state.fractions[y]),
            ],
            color: colors.color(agent, state),
        };
        let points = self.sample(args).into_iter().map(point).collect();
        Panel::Scatter(Scatter {
            title: format!("{}: {}", self.title, self.sampled(args)),
            x: axis(&x_axis),
            y: axis(&y_axis),
            points,
        })
    }
}

/// Colors of states, with their color key.
struct StateColors {
    color_by: ColorBy,
    range: [f64; 2],
    key: Option<Key>,
}

impl StateColors {
    fn of(args: &PlotArgs, groups: &[PanelStates<'_>]) -> Self {
        let color_by = args.color_by.unwrap_or(ColorBy::Agent);
        let states = || {
            groups
                .iter()
                .flat_map(|group| &group.agents)
                .flat_map(|states| &states.sample)
        };
        let [low, high] = states()
            .filter_map(|state| value(color_by, state))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |ends, value| {
                [ends[0].min(value), ends[1].max(value)]
            });
        let range = if high > low {
            [low, high]
        } else {
            [low.min(0.0), low.max(0.0) + 1.0]
        };
        let continuous_key = |label: &str| {
            Some(Key::Continuous {
                label: label.to_owned(),
                range,
            })
        };
        let key = match color_by {
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
        };
        Self {
            color_by,
            range,
            key,
        }
    }

    fn color(&self, agent: u32, state: &SelectedState) -> Color {
        let [low, high] = self.range;
        match value(self.color_by, state) {
            Some(value) => sequential_color((value - low) / (high - low)),
            None if self.color_by == ColorBy::Agent => categorical_color(agent),
            None => outcome_color(state.outcome),
        }
    }
}

/// The value that determines the color on a continuous scale; `None` for categorical colors.
fn value(color_by: ColorBy, state: &SelectedState) -> Option<f64> {
    match color_by {
        ColorBy::Agent | ColorBy::Outcome => None,
        ColorBy::Episode => Some(f64::from(state.episode)),
        ColorBy::Return => Some(state.r#return),
        ColorBy::IntrinsicReward => Some(f64::from(state.bonus)),
    }
}

/// Key of the colors of agents; `None` unless a panel shows several agents.
fn agent_key(groups: &[PanelStates<'_>]) -> Option<Key> {
    let has_several_agents = groups.iter().any(|group| group.agents.len() > 1);
    let mut agents: Vec<u32> = groups
        .iter()
        .flat_map(|group| &group.agents)
        .map(|states| states.agent)
        .collect();
    agents.sort_unstable();
    agents.dedup();
    has_several_agents.then(|| {
        Key::Categories(
            agents
                .into_iter()
                .map(|agent| (format!("agent {agent}"), categorical_color(agent)))
                .collect(),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_pairs_of_few_axes_are_drawn() {
        assert_eq!(pairs(&[0, 2, 3]), [[0, 2], [0, 3], [2, 3]]);
        assert_eq!(pairs(&[0, 1, 2, 3, 4, 5]).len(), 5);
    }
}
