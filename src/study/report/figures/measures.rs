//! Figures of one number a run: medians with their intervals, times not reached yet, performance profiles.

use rayon::prelude::*;

use super::{Made, capital, color, in_one_panel};
use crate::figure::{Curves, Figure as Picture, IntervalRow, Intervals, Panel, Row, Series};
use crate::study::comparison::{aggregate, lifetimes};
use crate::study::measure::Measure;
use crate::study::results::CellResults;
use crate::study::statistics::aggregate::interquartile_mean;
use crate::study::statistics::profile::performance_profile;
use crate::study::statistics::survival::kaplan_meier;
use crate::study::statistics::{Estimate, Interval, estimate};

/// Cells that are shown as one.
pub(super) struct Group<'a> {
    name: String,
    /// One for each task over which runs are pooled.
    cells: Vec<&'a CellResults>,
}

/// Cells whose names differ only in words of `over`, in the order of the first of each; every cell by itself if that is empty.
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
    /// `[task][run]`, without tasks that no run can tell.
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

    /// A median; where tasks are pooled the mean of the middle half of all runs, drawn again task by task.
    fn middle(&self, measure: Measure, pooled: bool) -> Option<(Estimate, usize)> {
        if let ([cell], false) = (&self.cells[..], pooled) {
            let aggregate = aggregate(&cell.scores(measure), measure.is_time())?;
            return Some((aggregate.median, aggregate.n));
        }
        let tasks = self.scores(measure);
        let n = tasks.iter().map(Vec::len).sum();
        (n > 0).then(|| {
            (
                estimate(&tasks, |tasks| interquartile_mean(&tasks.concat())),
                n,
            )
        })
    }
}

pub(super) fn intervals(groups: &[Group<'_>], measure: Measure) -> Made {
    let pooled = groups.iter().any(|group| group.cells.len() > 1);
    let row = |(number, group): (usize, &Group<'_>)| {
        let (middle, n) = group.middle(measure, pooled)?;
        let interval = match middle.interval {
            Interval::Known { low, high } if low.is_finite() => Some([low, high]),
            _ => None,
        };
        let estimate = middle.value.is_finite().then_some(middle.value);
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
        "interquartile mean of the"
    } else {
        "median"
    };
    let panel = Intervals {
        x_label: format!("{statistic} {}", measure.title()),
        rows,
        ..Intervals::default()
    };
    let how = match (pooled, measure.is_time()) {
        (true, _) => " (bootstrap of the runs of all tasks, stratified by task)",
        (_, true) => " (Kaplan and Meier; runs that did not get there are censored)",
        _ => " (bootstrap)",
    };
    let caption = format!(
        "{} {} with its interval of 95 %{how}.",
        capital(statistic),
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
    ("intervals", capital(&measure.title()), caption, picture)
}

pub(super) fn unsolved(cells: &[&CellResults]) -> Made {
    let series = cells.iter().enumerate().map(|(number, cell)| {
        let times = lifetimes(&cell.scores(Measure::EpisodesToSolve));
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
        "The share of runs that have not solved their task yet (Kaplan and Meier).".to_owned();
    (
        "unsolved",
        "Runs not solved yet".to_owned(),
        caption,
        in_one_panel(curves),
    )
}

pub(super) fn profiles(groups: &[Group<'_>], measure: Measure) -> Made {
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
        "The share of runs {better} each value, with pointwise bootstrap bands of 95 % (performance profiles)."
    );
    (
        "profiles",
        format!("Performance profiles: {}", measure.title()),
        caption,
        in_one_panel(curves),
    )
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

/// The shares of runs above, or `below`, from each value of a run on until the next, from end to end of the figure.   `scores: [task][run]`
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
    // Just before the first value it is the share of all or of none. What is better below is turned round.
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

/// Finite values, each once, from small to large.
fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 1, 2, 2, 4 and a time not reached: above 1 are four of five, above 2 two, above 4 one; below or at them 1, 3 and 4.
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
