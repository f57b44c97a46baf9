//! Figures of one number per run: intervals, survival curves, performance profiles.

use rayon::prelude::*;

use super::{Drawing, capitalized, color, in_one_panel};
use crate::study::comparison::{aggregate, times_to_event};
use crate::study::measure::Measure;
use crate::study::results::CellResults;
use seedbed_figure::{Curves, Figure as Picture, IntervalRow, Intervals, Panel, Row, Series};
use seedbed_stats::aggregate::interquartile_mean;
use seedbed_stats::profile::performance_profile;
use seedbed_stats::survival::kaplan_meier;
use seedbed_stats::{Estimate, Interval, bootstrap_strata};

/// Cells that are shown as one, because their runs are pooled.
pub(super) struct Group<'a> {
    name: String,
    /// One cell per task over which runs are pooled.
    cells: Vec<&'a CellResults>,
}

/// Groups cells whose names differ only in parts that are listed in `over`, in the order of the first
/// cell of each group. Without `over`, every cell is a group.
pub(super) fn groups<'a>(cells: &[&'a CellResults], over: &[String]) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for cell in cells {
        let words = cell
            .about
            .name
            .split(", ")
            .filter(|word| !over.iter().any(|pooled| pooled == word));
        let name = words.collect::<Vec<_>>().join(", ");
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
    /// Scores `[task][run]`, without tasks in which no run has the measure.
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

    /// Median with its interval; if tasks are pooled, the interquartile mean of all runs, with a
    /// bootstrap interval stratified by task. And the number of runs.
    fn center(&self, measure: Measure, pooled: bool) -> Option<(Estimate, usize)> {
        if let ([cell], false) = (&self.cells[..], pooled) {
            let aggregate = aggregate(&cell.scores(measure), measure.is_time())?;
            return Some((aggregate.median, aggregate.n));
        }
        let tasks = self.scores(measure);
        let n = tasks.iter().map(Vec::len).sum();
        (n > 0).then(|| {
            (
                bootstrap_strata(&tasks, |tasks| interquartile_mean(&tasks.concat())),
                n,
            )
        })
    }
}

pub(super) fn intervals(groups: &[Group<'_>], measure: Measure) -> Drawing {
    let pooled = groups.iter().any(|group| group.cells.len() > 1);
    let row = |(number, group): (usize, &Group<'_>)| {
        let (center, n) = group.center(measure, pooled)?;
        let interval = match center.interval {
            Interval::Known { low, high } if low.is_finite() => Some([low, high]),
            _ => None,
        };
        let estimate = center.value.is_finite().then_some(center.value);
        Some(IntervalRow {
            name: group.name.clone(),
            estimate,
            interval,
            n,
            color: color(number),
        })
    };
    let rows: Vec<IntervalRow> = groups.par_iter().enumerate().filter_map(row).collect();
    let statistic = if pooled {
        "interquartile mean of"
    } else {
        "median of"
    };
    let panel = Intervals {
        x_label: format!("{statistic} {}", measure.title()),
        rows,
        ..Intervals::default()
    };
    let how = match (pooled, measure.is_time()) {
        (true, _) => "bootstrap over the runs of all tasks, stratified by task",
        (_, true) => "Kaplan–Meier; runs that ended without reaching it are censored",
        _ => "bootstrap",
    };
    let caption = format!(
        "{} {} with its 95 % interval ({how}).",
        capitalized(statistic),
        measure.title()
    );
    let row = Row {
        height: panel.height(),
        panels: vec![Panel::Intervals(panel)],
        key: None,
    };
    let picture = Picture {
        title: String::new(),
        description: String::new(),
        width: 760.0,
        rows: vec![row],
    };
    Drawing {
        kind: "intervals",
        title: capitalized(&measure.title()),
        caption,
        picture,
    }
}

pub(super) fn unsolved(cells: &[&CellResults]) -> Drawing {
    let series = cells.iter().enumerate().map(|(number, cell)| {
        let times = times_to_event(&cell.scores(Measure::EpisodesToSolve));
        let end = times.iter().map(|time| time.time).fold(0.0, f64::max);
        let steps = kaplan_meier(&times).steps;
        let last = steps.last().map_or(1.0, |step| step.survival);
        let points = steps.iter().map(|step| [step.time, step.survival]);
        let points = [[0.0, 1.0]]
            .into_iter()
            .chain(points)
            .chain([[end, last]])
            .collect();
        Series {
            name: cell.about.name.clone(),
            color: color(number),
            points,
            steps: true,
            ..Series::default()
        }
    });
    let curves = Curves {
        x_label: "episodes of each agent".to_owned(),
        y_label: "share of runs not solved yet".to_owned(),
        series: series.collect(),
        y_range: Some([0.0, 1.0]),
        legend: true,
        ..Curves::default()
    };
    let caption =
        "Share of runs that have not solved their task yet (Kaplan–Meier estimate).".to_owned();
    Drawing {
        kind: "unsolved",
        title: "Runs not solved yet".to_owned(),
        caption,
        picture: in_one_panel(curves),
    }
}

pub(super) fn profiles(groups: &[Group<'_>], measure: Measure) -> Drawing {
    let groups: Vec<&Group<'_>> = groups
        .iter()
        .filter(|group| !group.scores(measure).is_empty())
        .collect();
    let all = groups
        .iter()
        .flat_map(|group| group.scores(measure))
        .flatten()
        .filter(|value| value.is_finite());
    let ends = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    let profile = |(number, group): (usize, &&Group<'_>)| profile(group, measure, ends, number);
    let better = if measure.is_better_below() {
        "below"
    } else {
        "above"
    };
    let curves = Curves {
        x_label: measure.title(),
        y_label: format!("share of runs {better}"),
        series: groups.par_iter().enumerate().map(profile).collect(),
        y_range: Some([0.0, 1.0]),
        legend: true,
        ..Curves::default()
    };
    let caption = format!(
        "Share of runs {better} each value, with pointwise 95 % bootstrap bands (performance profiles)."
    );
    Drawing {
        kind: "profiles",
        title: format!("Performance profiles: {}", measure.title()),
        caption,
        picture: in_one_panel(curves),
    }
}

fn profile(group: &Group<'_>, measure: Measure, ends: [f64; 2], number: usize) -> Series {
    let shares = steps_of_profile(group.scores(measure), measure.is_better_below(), ends);
    let band = shares
        .iter()
        .filter_map(|(place, share)| match share.interval {
            Interval::Known { low, high } => Some([*place, low, high]),
            Interval::TooFewRuns { .. } => None,
        });
    let band: Vec<[f64; 3]> = band.collect();
    let points = shares
        .iter()
        .map(|(place, share)| [*place, share.value])
        .collect();
    let band = (!band.is_empty()).then_some(band);
    Series {
        name: group.name.clone(),
        color: color(number),
        points,
        band,
        steps: true,
        ..Series::default()
    }
}

/// Steps of a profile: places on the axis, and the share of runs above, or `below`, from there to the
/// next place. Places are the values of runs and both ends of the figure.   `scores: [task][run]`
fn steps_of_profile(
    mut scores: Vec<Vec<f64>>,
    below: bool,
    [low, high]: [f64; 2],
) -> Vec<(f64, Estimate)> {
    let places: Vec<f64> = [low]
        .into_iter()
        .chain(distinct(scores.iter().flatten().copied()))
        .chain([high])
        .collect();
    // Shares count runs above a threshold. For shares below, scores and thresholds are negated. The
    // first place shows the share just before its value: all runs, or none. `next_up` and `next_down`
    // include or exclude runs at a threshold itself.
    let before = if below { -low } else { low.next_down() };
    let after = |place: &f64| if below { -place.next_up() } else { *place };
    let thresholds: Vec<f64> = [before]
        .into_iter()
        .chain(places[1..].iter().map(after))
        .collect();
    if below {
        scores
            .iter_mut()
            .flatten()
            .for_each(|score| *score = -*score);
    }
    places
        .into_iter()
        .zip(performance_profile(&scores, &thresholds))
        .collect()
}

/// Finite values in ascending order, each once.
fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 1, 2, 2, 4 and a time not reached: above 1 are four of five, above 2 two, above 4 one;
    /// below or at them 1, 3 and 4.
    #[test]
    fn profiles_step_at_the_values_of_runs() {
        let steps = |below: bool| {
            let steps = steps_of_profile(
                vec![vec![4.0, 2.0, f64::INFINITY], vec![1.0, 2.0]],
                below,
                [0.5, 5.0],
            );
            steps
                .into_iter()
                .map(|(place, share)| [place, share.value])
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
        // A run at the very end of the figure is a step there.
        assert_eq!(
            steps_of_profile(vec![vec![1.0]], false, [1.0, 1.0])[..2]
                .iter()
                .map(|(_, share)| share.value)
                .collect::<Vec<_>>(),
            [1.0, 0.0]
        );
    }
}
