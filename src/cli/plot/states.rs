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

/// Maximum number of axes for which all pairs are drawn; otherwise only neighboring axes are paired.
const MAX_PAIRED_AXES: usize = 5;

/// The pairs of these axes that are drawn.
pub(super) fn pairs(axes: &[usize]) -> Vec<[usize; 2]> {
    if axes.len() > MAX_PAIRED_AXES {
        return axes.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    }
    let rest = |index: usize| axes[index + 1..].iter().map(move |&second| (index, second));
    (0..axes.len())
        .flat_map(rest)
        .map(|(first, second)| [axes[first], second])
        .collect()
}

/// Lines if no panel has more states than wanted or if colors were chosen; otherwise densities on one
/// scale.
///
/// Beyond about a thousand lines a panel is a solid block, however transparent they are; a density
/// also shows all states instead of a sample. All panels of a figure are drawn the same way, because
/// lines and densities cannot be compared with each other.
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

/// Draws the number of states per pixel or, with several panels, the share of each panel's states;
/// on one scale for all panels.
pub(super) fn density(args: &PlotArgs, groups: &[PanelStates<'_>]) -> (Vec<Panel>, Option<Key>) {
    let pictures = scale_to_largest(groups, groups.iter().map(PanelStates::pixels).collect());
    let most = pictures.iter().flatten().copied().max().unwrap_or(0);
    let panel = |(group, pixels): (&PanelStates<'_>, Vec<u32>)| {
        let width = group
            .run
            .axes
            .as_ref()
            .map_or(1, |axes| axes.subset(&group.places(args)).width());
        group.parallel(
            args,
            States::Density(DensityImage {
                pixels,
                width,
                max_count: most,
            }),
            &group.pluralize(),
        )
    };
    let panels = groups.iter().zip(pictures).map(panel).collect();
    (panels, Some(key(groups, "states per pixel", most)))
}

/// Draws pairs of axes: for each pair, one panel per group.
pub(super) fn scatter(args: &PlotArgs, groups: &[PanelStates<'_>]) -> (Vec<Panel>, Option<Key>) {
    let pairs = groups
        .first()
        .map_or(Vec::new(), |group| pairs(&group.places(args)));
    if draws_density(args, groups) {
        let grids = scale_to_largest(
            groups,
            groups
                .iter()
                .map(|group| group.grids(pairs.len()))
                .collect(),
        );
        let most = grids.iter().flatten().copied().max().unwrap_or(0);
        let panel = |pair: usize, (group, grids): (&PanelStates<'_>, &Vec<u32>)| {
            let counts = grids
                [pair * GRID_CELLS * GRID_CELLS..(pair + 1) * GRID_CELLS * GRID_CELLS]
                .to_vec();
            group.heat_map(pairs[pair], counts, most)
        };
        let panels = (0..pairs.len())
            .flat_map(|pair| groups.iter().zip(&grids).map(move |drawn| (pair, drawn)));
        let panels = panels.map(|(pair, drawn)| panel(pair, drawn)).collect();
        return (panels, Some(key(groups, "states per cell", most)));
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

/// Scales the counts of each group to the largest group's number of states, so that panels show
/// shares and do not depend on the lengths of runs.
fn scale_to_largest(groups: &[PanelStates<'_>], counts: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
    let most = max_states(groups);
    let scaled = |count: u32, of: u64| {
        if count == 0 {
            0
        } else {
            (u64::from(count) * most / of)
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

fn key(groups: &[PanelStates<'_>], label: &str, most: u32) -> Key {
    if groups.len() > 1 {
        return Key::Shares {
            label: format!("share of {label}"),
            max_count: most,
            total: max_states(groups),
        };
    }
    Key::Counts {
        label: label.to_owned(),
        max_count: most,
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

    /// At most `--lines` states, in the order of episodes, so that no agent's states cover those of all
    /// others.
    fn sample(&self, args: &PlotArgs) -> Vec<(u32, &'a SelectedState)> {
        let of_agent = |states: &&'a SelectedStates| {
            let agent = states.agent;
            states.sample.iter().map(move |state| (agent, state))
        };
        let all: Vec<(u32, &SelectedState)> = self.agents.iter().flat_map(of_agent).collect();
        let (count, wanted) = (all.len() as u64, u64::from(args.lines));
        let mut kept: Vec<_> = (0..)
            .zip(all)
            .filter(|(index, _)| is_sampled(*index, count, wanted))
            .map(|(_, state)| state)
            .collect();
        kept.sort_by_key(|(_, state)| state.episode);
        kept
    }

    fn pluralize(&self) -> String {
        format!("{} states", indicatif::HumanCount(self.count()))
    }

    fn sampled(&self, args: &PlotArgs) -> String {
        let (count, wanted) = (self.count(), u64::from(args.lines));
        if count <= wanted {
            self.pluralize()
        } else {
            format!("{} of {}", indicatif::HumanCount(wanted), self.pluralize())
        }
    }

    /// Indices of the selected axes.
    fn places(&self, args: &PlotArgs) -> Vec<usize> {
        self.run
            .axes
            .as_ref()
            .and_then(|axes| args.chosen_axes(axes).ok())
            .unwrap_or_default()
    }

    fn quantity(&self, place: usize) -> Quantity {
        let axes = self
            .run
            .axes
            .as_ref()
            .and_then(|axes| axes.all().get(place));
        axes.map_or(
            Quantity {
                name: String::new(),
                unit: String::new(),
                range: [0.0, 1.0],
            },
            |axis| axis.quantity.clone(),
        )
    }

    fn parallel(&self, args: &PlotArgs, states: States, how_many: &str) -> Panel {
        let axes = self
            .places(args)
            .into_iter()
            .map(|place| axis(&self.quantity(place)))
            .collect();
        let title = format!("{}: {how_many}", self.title);
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

    /// Counts per cell of all pairs.
    fn grids(&self, pairs: usize) -> Vec<u32> {
        let mut sum = vec![0_u32; pairs * GRID_CELLS * GRID_CELLS];
        for states in &self.agents {
            sum.iter_mut()
                .zip(&states.grids)
                .for_each(|(sum, count)| *sum = sum.saturating_add(*count));
        }
        sum
    }

    fn heat_map(&self, [x, y]: [usize; 2], counts: Vec<u32>, most: u32) -> Panel {
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
            max_count: most,
        })
    }

    fn points(&self, args: &PlotArgs, [x, y]: [usize; 2], colors: &StateColors) -> Panel {
        let (x_axis, y_axis) = (self.quantity(x), self.quantity(y));
        let value = |axis: &Quantity, fraction: f32| {
            axis.range[0] + fraction * (axis.range[1] - axis.range[0])
        };
        let point = |(agent, state): (u32, &SelectedState)| ScatterPoint {
            at: [
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

/// Assigns colors to states, with the key to them.
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
        let gradual = |label: &str| {
            Some(Key::Continuous {
                label: label.to_owned(),
                range,
            })
        };
        let key = match color_by {
            ColorBy::Agent => agent_key(groups),
            ColorBy::Episode => gradual("episode"),
            ColorBy::Return => gradual("return of the episode"),
            ColorBy::IntrinsicReward => gradual("intrinsic reward"),
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

/// The value that determines the color, for gradual colors.
fn value(color_by: ColorBy, state: &SelectedState) -> Option<f64> {
    match color_by {
        ColorBy::Agent | ColorBy::Outcome => None,
        ColorBy::Episode => Some(f64::from(state.episode)),
        ColorBy::Return => Some(state.r#return),
        ColorBy::IntrinsicReward => Some(f64::from(state.bonus)),
    }
}

/// Key of agents' colors, if a panel shows several agents.
fn agent_key(groups: &[PanelStates<'_>]) -> Option<Key> {
    let several = groups.iter().any(|group| group.agents.len() > 1);
    let mut agents: Vec<u32> = groups
        .iter()
        .flat_map(|group| &group.agents)
        .map(|states| states.agent)
        .collect();
    agents.sort_unstable();
    agents.dedup();
    several.then(|| {
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
    fn few_axes_are_all_paired() {
        assert_eq!(pairs(&[0, 2, 3]), [[0, 2], [0, 3], [2, 3]]);
        assert_eq!(pairs(&[0, 1, 2, 3, 4, 5]).len(), 5);
    }
}
