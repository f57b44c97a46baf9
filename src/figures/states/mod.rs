//! Panels of visited states: parallel coordinates and pairs of axes.

mod colors;
mod group;
mod shares;

use self::colors::StateColors;
pub(super) use self::group::StateGroup;
use self::shares::{density_key, scale_to_largest};
use super::settings::FigureSettings;
use crate::record::visitation::share_difference;
use crate::review::selection::{GRID_CELLS, SelectedStates};
use seedbed_figure::{Cells, DensityImage, DifferenceImage, Key, Panel, StateLine, States};

/// One panel per group: panels of lines, if no group has more than `max_lines` states or if
/// a color is chosen; otherwise panels of densities on a common scale.
///
/// More than about 1,000 lines make a panel a solid block, even if they are transparent. A density
/// also shows all states instead of a sample. All panels of a figure are of the same kind, because
/// lines cannot be compared with densities.
pub(super) fn lines_or_density(
    settings: &FigureSettings,
    groups: &[StateGroup<'_>],
) -> (Vec<Panel>, Option<Key>) {
    if draws_density(settings, groups) {
        return density(settings, groups);
    }
    let colors = StateColors::new(settings, &agents_of(groups));
    let panel = |group: &StateGroup<'_>| {
        let lines = group
            .sample(settings)
            .into_iter()
            .map(|(agent, state)| StateLine {
                axis_positions: state.selected_axis_positions.clone(),
                color: colors.color(agent, state),
            });
        group.parallel_coordinates(
            settings,
            States::Lines(lines.collect()),
            group.title_with(&group.sample_size_text(settings)),
        )
    };
    (groups.iter().map(panel).collect(), colors.key)
}

/// The selected states of each agent, group by group.
fn agents_of<'a>(groups: &'a [StateGroup<'a>]) -> Vec<&'a [&'a SelectedStates]> {
    groups.iter().map(|group| &group.agents[..]).collect()
}

/// Panels of densities on a common scale: the number of states per pixel or, with several panels,
/// the share of the panel's states per pixel. Of a single pair of axes they are maps.
pub(super) fn density(
    settings: &FigureSettings,
    groups: &[StateGroup<'_>],
) -> (Vec<Panel>, Option<Key>) {
    let pair = groups.first().and_then(|group| group.chosen_pair(settings));
    if let Some(pair) = pair {
        return density_maps(settings, groups, &[pair]);
    }
    let pixels_of_groups =
        scale_to_largest(groups, groups.iter().map(StateGroup::pixels).collect());
    let max_count = pixels_of_groups
        .iter()
        .flatten()
        .copied()
        .max()
        .unwrap_or(0);
    let panel = |(group, pixels): (&StateGroup<'_>, Vec<u32>)| {
        let width = group.width(settings);
        group.parallel_coordinates(
            settings,
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
        Some(density_key(groups, "states per bin", max_count)),
    )
}

/// Panels of differences of groups from a reference, on a common scale: for each pixel the share of
/// the group's lines minus the share of the reference's lines or, of a single pair of axes, the same of states in
/// each cell of the plane.
pub(super) fn differences(
    settings: &FigureSettings,
    groups: &[StateGroup<'_>],
    reference: &StateGroup<'_>,
) -> (Vec<Panel>, Key) {
    let width = reference.width(settings);
    let pair = reference.chosen_pair(settings);
    let counts = |group: &StateGroup<'_>| match pair {
        Some(_) => group.grids(1),
        None => group.pixels(),
    };
    let of_reference = counts(reference);
    let difference = |group: &StateGroup<'_>| {
        share_difference(
            (&counts(group), group.state_count()),
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
        if let Some(pair) = pair {
            return group.heat_map_panel(settings, title, pair, Cells::Differences(pixels));
        }
        group.parallel_coordinates(
            settings,
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

/// Maps of the density of states on pairs of axes: for each pair, one panel per group, on a common scale.
fn density_maps(
    settings: &FigureSettings,
    groups: &[StateGroup<'_>],
    pairs: &[[usize; 2]],
) -> (Vec<Panel>, Option<Key>) {
    let grids = groups.iter().map(|group| group.grids(pairs.len()));
    let grids = scale_to_largest(groups, grids.collect());
    let max_count = grids.iter().flatten().copied().max().unwrap_or(0);
    let panel = |pair: usize, (group, grids): (&StateGroup<'_>, &Vec<u32>)| {
        let counts =
            grids[pair * GRID_CELLS * GRID_CELLS..(pair + 1) * GRID_CELLS * GRID_CELLS].to_vec();
        let title = group.title_with(&group.state_count_text());
        let cells = Cells::Counts { counts, max_count };
        group.heat_map_panel(settings, title, pairs[pair], cells)
    };
    let panels =
        (0..pairs.len()).flat_map(|pair| groups.iter().zip(&grids).map(move |drawn| (pair, drawn)));
    let panels = panels.map(|(pair, drawn)| panel(pair, drawn)).collect();
    (
        without_repeated_titles(panels, groups.len()),
        Some(density_key(groups, "states per cell", max_count)),
    )
}

/// Panels of pairs of axes: for each pair, one panel per group.
pub(super) fn scatter(
    settings: &FigureSettings,
    groups: &[StateGroup<'_>],
) -> (Vec<Panel>, Option<Key>) {
    let pairs = groups
        .first()
        .map_or(Vec::new(), |group| group.scatter_pairs(settings));
    if draws_density(settings, groups) {
        return density_maps(settings, groups, &pairs);
    }
    let colors = StateColors::new(settings, &agents_of(groups));
    let panels = pairs
        .iter()
        .flat_map(|pair| groups.iter().map(move |group| (pair, group)));
    let panels = panels.map(|(pair, group)| group.scatter_panel(settings, *pair, &colors));
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

fn draws_density(settings: &FigureSettings, groups: &[StateGroup<'_>]) -> bool {
    settings.color_by.is_none()
        && groups
            .iter()
            .any(|group| group.state_count() > u64::from(settings.max_lines))
}
