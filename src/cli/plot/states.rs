//! Panels of visited states: parallel coordinates and pairs of axes.

use super::{Colour, Drawn, PlotArgs};
use crate::env::{Quantity, Status};
use crate::figure::color::{agent_color, gradual};
use crate::figure::{
    Color, DensityPicture, HeatMap, Key, Panel, ParallelCoordinates, Scatter, ScatterPoint,
    StateLine, States,
};
use crate::run::review::selection::{CELLS, PickedState, PickedStates, is_picked};

/// States of one panel.
pub(super) struct Group<'a> {
    run: &'a Drawn,
    title: String,
    agents: Vec<&'a PickedStates>,
}

/// Colours of outcomes.
const TERMINATED: Color = [213, 94, 0];
const TRUNCATED: Color = [0, 98, 178];

/// Pairs of axes are all drawn as long as there are so many axes; beyond, only neighbours.
const MOST_PAIRED_AXES: usize = 5;

/// The pairs that are drawn of these axes.
pub(super) fn pairs(axes: &[usize]) -> Vec<[usize; 2]> {
    if axes.len() > MOST_PAIRED_AXES {
        return axes.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    }
    let rest = |index: usize| axes[index + 1..].iter().map(move |&second| (index, second));
    (0..axes.len())
        .flat_map(rest)
        .map(|(first, second)| [axes[first], second])
        .collect()
}

/// Lines, where no panel has more states than wanted or colours were chosen; else densities on one scale.
pub(super) fn lines_or_density(args: &PlotArgs, groups: &[Group<'_>]) -> (Vec<Panel>, Option<Key>) {
    if drawn_as_counts(args, groups) {
        return density(args, groups);
    }
    let paint = Paint::of(args, groups);
    let panel = |group: &Group<'_>| {
        let lines = group
            .sample(args)
            .into_iter()
            .map(|(agent, state)| StateLine {
                fractions: state.crossed.clone(),
                color: paint.color(agent, state),
            });
        group.parallel(args, States::Lines(lines.collect()), &group.sampled(args))
    };
    (groups.iter().map(panel).collect(), paint.key)
}

/// How many lines pass each point, or which share of its lines where there are several panels; on one scale for all.
pub(super) fn density(args: &PlotArgs, groups: &[Group<'_>]) -> (Vec<Panel>, Option<Key>) {
    let pictures = of_one_total(groups, groups.iter().map(Group::pixels).collect());
    let most = pictures.iter().flatten().copied().max().unwrap_or(0);
    let panel = |(group, pixels): (&Group<'_>, Vec<u32>)| {
        let width = group
            .run
            .axes
            .as_ref()
            .map_or(1, |axes| axes.chosen(&group.places(args)).width());
        group.parallel(
            args,
            States::Density(DensityPicture {
                pixels,
                width,
                most,
            }),
            &group.counted(),
        )
    };
    let panels = groups.iter().zip(pictures).map(panel).collect();
    (panels, Some(key(groups, "states through a point", most)))
}

/// Pairs of axes, pair by pair for all groups.
pub(super) fn scatter(args: &PlotArgs, groups: &[Group<'_>]) -> (Vec<Panel>, Option<Key>) {
    let pairs = groups
        .first()
        .map_or(Vec::new(), |group| pairs(&group.places(args)));
    if drawn_as_counts(args, groups) {
        let grids = of_one_total(
            groups,
            groups
                .iter()
                .map(|group| group.grids(pairs.len()))
                .collect(),
        );
        let most = grids.iter().flatten().copied().max().unwrap_or(0);
        let panel = |pair: usize, (group, grids): (&Group<'_>, &Vec<u32>)| {
            let counts = grids[pair * CELLS * CELLS..(pair + 1) * CELLS * CELLS].to_vec();
            group.heat_map(pairs[pair], counts, most)
        };
        let panels = (0..pairs.len())
            .flat_map(|pair| groups.iter().zip(&grids).map(move |drawn| (pair, drawn)));
        let panels = panels.map(|(pair, drawn)| panel(pair, drawn)).collect();
        return (panels, Some(key(groups, "states in a cell", most)));
    }
    let paint = Paint::of(args, groups);
    let panels = pairs
        .iter()
        .flat_map(|pair| groups.iter().map(move |group| (pair, group)));
    let panels = panels
        .map(|(pair, group)| group.points(args, *pair, &paint))
        .collect();
    (panels, paint.key)
}

/// Counts of each group as if all had as many states as the one that has most: panels show shares, not how long a run was.
fn of_one_total(groups: &[Group<'_>], counts: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
    let most = most_states(groups);
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
    let each = groups.iter().map(Group::count).zip(counts);
    each.map(|(of, counts)| {
        counts
            .into_iter()
            .map(|count| scaled(count, of.max(1)))
            .collect()
    })
    .collect()
}

fn most_states(groups: &[Group<'_>]) -> u64 {
    groups.iter().map(Group::count).max().unwrap_or(0)
}

fn key(groups: &[Group<'_>], label: &str, most: u32) -> Key {
    if groups.len() > 1 {
        return Key::Shares {
            label: format!("share of {label}"),
            most,
            of: most_states(groups),
        };
    }
    Key::Counts {
        label: label.to_owned(),
        most,
    }
}

fn drawn_as_counts(args: &PlotArgs, groups: &[Group<'_>]) -> bool {
    args.colour.is_none()
        && groups
            .iter()
            .any(|group| group.count() > u64::from(args.lines))
}

impl<'a> Group<'a> {
    pub(super) fn new(run: &'a Drawn, title: String, agents: Vec<&'a PickedStates>) -> Self {
        Self { run, title, agents }
    }

    fn count(&self) -> u64 {
        self.agents.iter().map(|states| states.count).sum()
    }

    /// At most as many states as wanted, in the order of episodes, so that no agent covers all others.
    fn sample(&self, args: &PlotArgs) -> Vec<(u32, &'a PickedState)> {
        let of_agent = |states: &&'a PickedStates| {
            let agent = states.agent;
            states.sample.iter().map(move |state| (agent, state))
        };
        let all: Vec<(u32, &PickedState)> = self.agents.iter().flat_map(of_agent).collect();
        let (count, wanted) = (all.len() as u64, u64::from(args.lines));
        let mut kept: Vec<_> = (0..)
            .zip(all)
            .filter(|(index, _)| is_picked(*index, count, wanted))
            .map(|(_, state)| state)
            .collect();
        kept.sort_by_key(|(_, state)| state.episode);
        kept
    }

    fn counted(&self) -> String {
        format!("{} states", indicatif::HumanCount(self.count()))
    }

    fn sampled(&self, args: &PlotArgs) -> String {
        let (count, wanted) = (self.count(), u64::from(args.lines));
        if count <= wanted {
            self.counted()
        } else {
            format!("{} of {}", indicatif::HumanCount(wanted), self.counted())
        }
    }

    /// The places of the wanted axes among all.
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
            .map(|place| self.quantity(place))
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

    /// Counts of all cells of all pairs.
    fn grids(&self, pairs: usize) -> Vec<u32> {
        let mut sum = vec![0_u32; pairs * CELLS * CELLS];
        for states in &self.agents {
            sum.iter_mut()
                .zip(&states.grids)
                .for_each(|(sum, count)| *sum = sum.saturating_add(*count));
        }
        sum
    }

    fn heat_map(&self, [x, y]: [usize; 2], counts: Vec<u32>, most: u32) -> Panel {
        let (title, x, y) = (
            format!("{}: {}", self.title, self.counted()),
            self.quantity(x),
            self.quantity(y),
        );
        Panel::HeatMap(HeatMap {
            title,
            x,
            y,
            counts,
            columns: CELLS,
            most,
        })
    }

    fn points(&self, args: &PlotArgs, [x, y]: [usize; 2], paint: &Paint) -> Panel {
        let (x_axis, y_axis) = (self.quantity(x), self.quantity(y));
        let value = |axis: &Quantity, fraction: f32| {
            axis.range[0] + fraction * (axis.range[1] - axis.range[0])
        };
        let point = |(agent, state): (u32, &PickedState)| ScatterPoint {
            at: [
                value(&x_axis, state.fractions[x]),
                value(&y_axis, state.fractions[y]),
            ],
            color: paint.color(agent, state),
        };
        let points = self.sample(args).into_iter().map(point).collect();
        Panel::Scatter(Scatter {
            title: format!("{}: {}", self.title, self.sampled(args)),
            x: x_axis.clone(),
            y: y_axis.clone(),
            points,
        })
    }
}

/// What the colour of a state means, and the key to it.
struct Paint {
    colour: Colour,
    range: [f64; 2],
    key: Option<Key>,
}

impl Paint {
    fn of(args: &PlotArgs, groups: &[Group<'_>]) -> Self {
        let colour = args.colour.unwrap_or(Colour::Agent);
        let states = || {
            groups
                .iter()
                .flat_map(|group| &group.agents)
                .flat_map(|states| &states.sample)
        };
        let [low, high] = states()
            .filter_map(|state| value(colour, state))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |ends, value| {
                [ends[0].min(value), ends[1].max(value)]
            });
        let range = if high > low {
            [low, high]
        } else {
            [low.min(0.0), low.max(0.0) + 1.0]
        };
        let gradual = |label: &str| {
            Some(Key::Gradual {
                label: label.to_owned(),
                range,
            })
        };
        let key = match colour {
            Colour::Agent => names(groups),
            Colour::Episode => gradual("episode"),
            Colour::Return => gradual("return of the episode"),
            Colour::IntrinsicReward => gradual("intrinsic reward"),
            Colour::Outcome => {
                let outcomes = [("terminated", TERMINATED), ("truncated", TRUNCATED)];
                Some(Key::Names(
                    outcomes
                        .map(|(name, color)| (name.to_owned(), color))
                        .to_vec(),
                ))
            }
        };
        Self { colour, range, key }
    }

    fn color(&self, agent: u32, state: &PickedState) -> Color {
        let [low, high] = self.range;
        match value(self.colour, state) {
            Some(value) => gradual((value - low) / (high - low)),
            None if self.colour == Colour::Agent => agent_color(agent),
            None if state.outcome == Status::Terminated => TERMINATED,
            None => TRUNCATED,
        }
    }
}

/// What runs from low to high.
fn value(colour: Colour, state: &PickedState) -> Option<f64> {
    match colour {
        Colour::Agent | Colour::Outcome => None,
        Colour::Episode => Some(f64::from(state.episode)),
        Colour::Return => Some(state.r#return),
        Colour::IntrinsicReward => Some(f64::from(state.bonus)),
    }
}

/// Agents' colours, where a panel shows several.
fn names(groups: &[Group<'_>]) -> Option<Key> {
    let several = groups.iter().any(|group| group.agents.len() > 1);
    let mut agents: Vec<u32> = groups
        .iter()
        .flat_map(|group| &group.agents)
        .map(|states| states.agent)
        .collect();
    agents.sort_unstable();
    agents.dedup();
    several.then(|| {
        Key::Names(
            agents
                .into_iter()
                .map(|agent| (format!("agent {agent}"), agent_color(agent)))
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
