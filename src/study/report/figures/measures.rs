//! Figures of measures: intervals, survival curves, performance profiles.

use rayon::prelude::*;

use super::{UnnumberedFigure, capitalized, picture_of_curves, picture_of_one_panel};
use crate::experiment::measure::Measure;
use crate::study::evaluate::comparison::summarize_scores;
use crate::study::evaluate::results::CellResults;
use crate::study::evaluate::rules::Quantity;
use crate::study::evaluate::score::times_to_event;
use seedbed_figure::color::series_color;
use seedbed_figure::{Curves, IntervalRow, Intervals, Panel, Series};
use seedbed_stats::aggregate::interquartile_mean_of_sorted;
use seedbed_stats::bootstrap::bootstrap_sorted_statistics;
use seedbed_stats::profile::performance_profile;
use seedbed_stats::survival::kaplan_meier;
use seedbed_stats::{Estimate, Interval};

/// Cells whose runs are pooled and shown as one row or curve.
pub(super) struct Group<'a> {
    name: String,
    /// One cell per pooled task.
    cells: Vec<&'a CellResults>,
}

/// Groups cells whose names differ only in parts that `over` contains. Groups are in the order of
/// their first cells. If `over` is empty, every cell is a group.
pub(super) fn groups<'a>(cells: &[&'a CellResults], over: &[String]) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for cell in cells {
        let unpooled_parts = cell
            .description
            .name
            .split(", ")
            .filter(|part| !over.iter().any(|pooled| pooled == part));
        let name = unpooled_parts.collect::<Vec<_>>().join(", ");
        match groups
            .iter_mut()
            .find(|group| group.name == name && !over.is_empty())
        {
            Some(group) => group.cells.push(cell),
            None => groups.push(Group {
                name,
                cells: vec![cell],
            }),
        }
    }
    groups
}

impl Group<'_> {
    /// Scores `[task][run]`, without tasks in which no run has a score.
    fn scores(&self, measure: Measure) -> Vec<Vec<f64>> {
        let scores = |cell: &&CellResults| {
            cell.scores(measure)
                .iter()
                .map(|score| score.value)
                .collect()
        };
        self.cells
            .iter()
            .map(scores)
            .filter(|scores: &Vec<f64>| !scores.is_empty())
            .collect()
    }

    /// Estimate with its interval, and number of runs; `None` without runs. The estimate is that of
    /// [`summarize_scores`] or, if tasks are pooled, the interquartile mean of all runs with a
    /// bootstrap interval stratified by task.
    fn estimate_with_count(&self, measure: Measure, is_pooled: bool) -> Option<(Estimate, usize)> {
        if let ([cell], false) = (&self.cells[..], is_pooled) {
            let aggregate = summarize_scores(cell.scores(measure), measure)?;
            return Some((aggregate.center, aggregate.n));
        }
        let tasks = self.scores(measure);
        let n = tasks.iter().map(Vec::len).sum();
        (n > 0).then(|| {
            let estimates = bootstrap_sorted_statistics(&[tasks], 1, |groups, statistics| {
                statistics[0] = interquartile_mean_of_sorted(&groups[0]);
            });
            (estimates[0], n)
        })
    }
}

/// A row for each group, and a dashed line at the value of the cell `line`.
pub(super) fn intervals(
    groups: &[Group<'_>],
    measure: Measure,
    line: Option<&CellResults>,
) -> UnnumberedFigure {
    let is_pooled = groups.iter().any(|group| group.cells.len() > 1);
    let row = |(number, group): (usize, &Group<'_>)| {
        let (center, n) = group.estimate_with_count(measure, is_pooled)?;
        let interval = match center.interval {
            Interval::Known { low, high } if low.is_finite() => Some([low, high]),
            _ => None,
        };
        let estimate = center.value.is_finite().then_some(center.value);
        Some(IntervalRow {
            name: group.name.clone(),
            estimate,
            interval,
            margin: None,
            n,
            color: series_color(number),
        })
    };
    let rows: Vec<IntervalRow> = groups.par_iter().enumerate().filter_map(row).collect();
    let quantity = Quantity::of(measure, f64::INFINITY);
    let statistic = match quantity {
        _ if is_pooled => "interquartile mean of ",
        Quantity::Share => "",
        Quantity::Mean => "mean of ",
        Quantity::RestrictedMeanTime { .. } => "median of ",
    };
    let quantity_title = format!("{statistic}{}", measure.title());
    let line = line.and_then(|cell| {
        let summary = summarize_scores(cell.scores(measure), measure)?;
        let value = Some(summary.center.value).filter(|value| value.is_finite())?;
        Some((&cell.description.name, value))
    });
    let panel = Intervals {
        x_label: quantity_title.clone(),
        rows,
        reference: line.map(|(_, value)| value),
        ..Intervals::default()
    };
    let line = line.map_or(String::new(), |(name, _)| format!(" Dashed: {name}."));
    let caption = format!(
        "{} with its 95 % interval ({}).{line}",
        capitalized(&quantity_title),
        interval_method(quantity, is_pooled)
    );
    UnnumberedFigure {
        kind: "intervals",
        title: capitalized(&measure.title()),
        caption,
        picture: picture_of_one_panel(panel.height(), Panel::Intervals(panel)),
    }
}

/// How the intervals of a measure are computed.
fn interval_method(quantity: Quantity, is_pooled: bool) -> &'static str {
    match quantity {
        _ if is_pooled => "bootstrap over the runs of all tasks, stratified by task",
        Quantity::Share => "Wilson",
        Quantity::Mean => "bootstrap",
        Quantity::RestrictedMeanTime { .. } => {
            "Kaplan–Meier; runs that ended without reaching it are censored"
        }
    }
}

pub(super) fn unsolved(cells: &[&CellResults]) -> UnnumberedFigure {
    let series = cells.iter().enumerate().map(|(number, cell)| {
        let times = times_to_event(cell.scores(Measure::EpisodesToSolve));
        let end_of_last_run = times.iter().map(|time| time.time).fold(0.0, f64::max);
        let steps = kaplan_meier(&times).steps;
        let last_survival = steps.last().map_or(1.0, |step| step.survival);
        let points = steps.iter().map(|step| [step.time, step.survival]);
        let points = [[0.0, 1.0]]
            .into_iter()
            .chain(points)
            .chain([[end_of_last_run, last_survival]])
            .collect();
        Series {
            name: cell.description.name.clone(),
            color: series_color(number),
            points,
            has_steps: true,
            ..Series::default()
        }
    });
    let curves = Curves {
        x_label: "episodes of each agent".to_owned(),
        y_label: "share of runs not solved yet".to_owned(),
        series: series.collect(),
        y_range: Some([0.0, 1.0]),
        has_legend: true,
        ..Curves::default()
    };
    let caption =
        "Share of runs that have not solved their task yet (Kaplan–Meier estimate).".to_owned();
    UnnumberedFigure {
        kind: "unsolved",
        title: "Runs not solved yet".to_owned(),
        caption,
        picture: picture_of_curves(curves),
    }
}

pub(super) fn profiles(groups: &[Group<'_>], measure: Measure) -> UnnumberedFigure {
    let groups: Vec<&Group<'_>> = groups
        .iter()
        .filter(|group| !group.scores(measure).is_empty())
        .collect();
    let finite_scores = groups
        .iter()
        .flat_map(|group| group.scores(measure))
        .flatten()
        .filter(|value| value.is_finite());
    let ends = finite_scores.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    let profile = |(number, group): (usize, &&Group<'_>)| profile(group, measure, ends, number);
    let side = if measure.is_smaller_better() {
        "below"
    } else {
        "above"
    };
    let curves = Curves {
        x_label: measure.title(),
        y_label: format!("share of runs {side}"),
        series: groups.par_iter().enumerate().map(profile).collect(),
        y_range: Some([0.0, 1.0]),
        has_legend: true,
        ..Curves::default()
    };
    let caption = format!(
        "Share of runs {side} each value, with pointwise 95 % bootstrap bands (performance profiles)."
    );
    UnnumberedFigure {
        kind: "profiles",
        title: format!("Performance profiles: {}", measure.title()),
        caption,
        picture: picture_of_curves(curves),
    }
}

fn profile(group: &Group<'_>, measure: Measure, ends: [f64; 2], number: usize) -> Series {
    let shares = profile_steps(group.scores(measure), measure.is_smaller_better(), ends);
    let band = shares
        .iter()
        .filter_map(|(position, share)| match share.interval {
            Interval::Known { low, high } => Some([*position, low, high]),
            Interval::TooFewRuns { .. } => None,
        });
    let band: Vec<[f64; 3]> = band.collect();
    let points = shares
        .iter()
        .map(|(position, share)| [*position, share.value])
        .collect();
    let band = (!band.is_empty()).then_some(band);
    Series {
        name: group.name.clone(),
        color: series_color(number),
        points,
        band,
        has_steps: true,
        ..Series::default()
    }
}

/// Steps of a profile: positions on the axis, each with the share of runs above it or, if
/// `is_below` is set, below it, which is the share up to the next position. Positions are the
/// scores of runs and both ends of the figure.   `scores: [task][run]`
fn profile_steps(
    mut scores: Vec<Vec<f64>>,
    is_below: bool,
    [low, high]: [f64; 2],
) -> Vec<(f64, Estimate)> {
    let positions: Vec<f64> = [low]
        .into_iter()
        .chain(sorted_distinct(scores.iter().flatten().copied()))
        .chain([high])
        .collect();
    // A performance profile is the share of runs above a threshold. For shares below, scores and
    // thresholds are negated. The share at the first position is the share just before it: all runs
    // or, for shares below, none. `next_up` and `next_down` determine whether runs count whose
    // score equals the threshold.
    let first_threshold = if is_below { -low } else { low.next_down() };
    let threshold_after = |position: &f64| {
        if is_below {
            -position.next_up()
        } else {
            *position
        }
    };
    let thresholds: Vec<f64> = [first_threshold]
        .into_iter()
        .chain(positions[1..].iter().map(threshold_after))
        .collect();
    if is_below {
        scores
            .iter_mut()
            .flatten()
            .for_each(|score| *score = -*score);
    }
    positions
        .into_iter()
        .zip(performance_profile(&scores, &thresholds))
        .collect()
}

/// Finite values in ascending order, without duplicates.
fn sorted_distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the scores 1, 2, 2, 4 and ∞, four are above 1, two are above 2, and one is above 4. One
    /// score is at most 1, three are at most 2, and four are at most 4.
    #[test]
    fn profiles_have_steps_at_the_values_of_runs() {
        let steps = |is_below: bool| {
            let steps = profile_steps(
                vec![vec![4.0, 2.0, f64::INFINITY], vec![1.0, 2.0]],
                is_below,
                [0.5, 5.0],
            );
            steps
                .into_iter()
                .map(|(position, share)| [position, share.value])
                .collect::<Vec<_>>()
        };
        assert_eq!(
            steps(false),
            [[0.5, 1.0], [1.0, 0.8], [2.0, 0.4], [4.0, 0.2], [5.0, 0.2]]
        );
        assert_eq!(
            steps(true),
            [[0.5, 0.0], [1.0, 0.2], [2.0, 0.6], [4.0, 0.8], [5.0, 0.8]]
        );
        // A run whose value is the end of the figure has a step there.
        assert_eq!(
            profile_steps(vec![vec![1.0]], false, [1.0, 1.0])[..2]
                .iter()
                .map(|(_, share)| share.value)
                .collect::<Vec<_>>(),
            [1.0, 0.0]
        );
    }
}
