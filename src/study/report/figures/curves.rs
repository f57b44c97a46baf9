//! Curves of cells over episodes or steps.

use rayon::prelude::*;

use super::{UnnumberedFigure, capitalized, picture_of_curves};
use crate::experiment::measure::{Curve, trailing_means};
use crate::experiment::run_result::RunResult;
use crate::study::design::figure::CurveAxis;
use crate::study::evaluate::results::CellResults;
use seedbed_figure::color::series_color;
use seedbed_figure::{Curves, Series, Threshold};
use seedbed_stats::aggregate::median;
use seedbed_stats::bootstrap::bootstrap_means;
use seedbed_stats::{Interval, MIN_RUNS};

/// Approximate number of points of a curve at which its band is computed.
const BAND_POINTS: usize = 50;

/// One curve per cell; `None` if no run has values over this axis.
pub(super) fn curves(
    cells: &[&CellResults],
    of: Curve,
    x: CurveAxis,
    window: usize,
) -> Option<UnnumberedFigure> {
    let window = if of.metric().is_cumulative { 1 } else { window };
    let curves_of_cells: Vec<CellCurves> = cells
        .par_iter()
        .map(|cell| CellCurves::new(cell, of, x, window))
        .collect();
    let numbered = curves_of_cells.par_iter().zip(cells).enumerate();
    let series: Vec<Series> = numbered
        .filter(|(_, (curves, _))| !curves.positions.is_empty())
        .map(|(number, (curves, cell))| curves.mean(&cell.description.name, series_color(number)))
        .collect();
    if series.is_empty() {
        return None;
    }
    let label = of.metric().label();
    let title = format!("{}, mean of all runs", capitalized(&label));
    let has_bands = series.iter().any(|series| series.band.is_some());
    let caption = caption_of_curves(cells, &label, window, has_bands);
    let caption = format!("{caption}{}", sentence_about_unknown(&curves_of_cells, x));
    let y_logarithmic = differ_by_orders_of_magnitude(&series);
    let curves = Curves {
        x_label: x.label().to_owned(),
        y_label: format!("{label}{}", if y_logarithmic { " (log scale)" } else { "" }),
        y_logarithmic,
        thresholds: if of == Curve::Return {
            thresholds(cells)
        } else {
            Vec::new()
        },
        series,
        has_legend: true,
        ..Curves::default()
    };
    Some(UnnumberedFigure {
        kind: "curves",
        title,
        caption,
        picture: picture_of_curves(curves),
    })
}

fn caption_of_curves(
    cells: &[&CellResults],
    label: &str,
    window: usize,
    has_bands: bool,
) -> String {
    let caption = format!(
        "{}{}, mean over runs{}. {}",
        capitalized(label),
        if window > 1 {
            format!(", moving average over {window} values or, at the beginning, all values so far")
        } else {
            String::new()
        },
        if has_bands {
            ", with 95 % bootstrap bands"
        } else {
            ""
        },
        sentence_about_early_ends(cells)
    );
    caption.trim().to_owned()
}

/// Maximum ratio between the medians of two curves on a linear axis. With a larger ratio, the lower
/// curve would look flat.
const MAX_RATIO_ON_LINEAR_AXIS: f64 = 100.0;

/// Whether the medians of two curves differ by more than the factor [`MAX_RATIO_ON_LINEAR_AXIS`],
/// and all values are above 0.
fn differ_by_orders_of_magnitude(series: &[Series]) -> bool {
    let y_values = |series: &Series| {
        series
            .points
            .iter()
            .map(|point| point[1])
            .collect::<Vec<f64>>()
    };
    let bands = series
        .iter()
        .flat_map(|series| series.band.iter().flatten().map(|band| band[1]));
    if bands
        .chain(series.iter().flat_map(y_values))
        .any(|value| value <= 0.0)
    {
        return false;
    }
    let medians = series
        .iter()
        .map(y_values)
        .filter(|y_values| !y_values.is_empty())
        .map(|y_values| median(&y_values));
    let [low, high] = medians.fold([f64::INFINITY, 0.0], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    high > MAX_RATIO_ON_LINEAR_AXIS * low
}

/// Sentence for the caption if some runs ended earlier than others; otherwise empty.
fn sentence_about_early_ends(cells: &[&CellResults]) -> &'static str {
    let lengths = |cell: &&CellResults| {
        cell.runs
            .iter()
            .map(|(_, run)| run.episodes_per_agent())
            .collect::<Vec<_>>()
    };
    let lengths_differ = cells
        .iter()
        .map(lengths)
        .any(|lengths| lengths.iter().min() != lengths.iter().max());
    if lengths_differ {
        "Runs that ended early, for example by solving their task, keep their last value."
    } else {
        ""
    }
}

/// Line at the return at which the task counts as solved; empty unless this return is equal for all
/// runs.
fn thresholds(cells: &[&CellResults]) -> Vec<Threshold> {
    let mut values: Vec<f64> = cells
        .iter()
        .flat_map(|cell| &cell.runs)
        .filter_map(|(_, run)| Some(run.threshold?.0))
        .collect();
    values.dedup();
    let [value] = values[..] else {
        return Vec::new();
    };
    vec![Threshold {
        name: "solved".to_owned(),
        value,
    }]
}

/// Number of positions of curves whose runs have values at different positions.
const POSITIONS: usize = 200;

/// A curve of each run of a cell, at common positions.
struct CellCurves {
    /// Positions on the horizontal axis.
    positions: Vec<f64>,
    /// Moving averages: `[runs][positions]`.
    runs: Vec<Vec<f64>>,
    /// Number of runs with values whose positions are unknown.
    unknown: usize,
}

impl CellCurves {
    fn new(cell: &CellResults, of: Curve, x: CurveAxis, window: usize) -> Self {
        let runs = cell.runs.iter().map(|(_, run)| run);
        let with_values = runs.filter(|run| !run.curve(of).is_empty());
        let (mut known, mut unknown) = (Vec::new(), 0);
        for run in with_values {
            match positions(run, of, x) {
                Some(positions) => known.push((positions, trailing_means(&run.curve(of), window))),
                None => unknown += 1,
            }
        }
        let positions = common_positions(&known, x);
        let at_positions = |(own, values): &(Vec<f64>, Vec<f64>)| {
            let newest = |x: &f64| values[own.partition_point(|own| own <= x).max(1) - 1];
            positions.iter().map(newest).collect()
        };
        Self {
            runs: known.iter().map(at_positions).collect(),
            positions,
            unknown,
        }
    }

    /// The mean over runs, with its band.
    fn mean(&self, name: &str, color: [u8; 3]) -> Series {
        let mean = |position: usize| {
            self.runs.iter().map(|run| run[position]).sum::<f64>() / self.runs.len() as f64
        };
        let x = |position: usize| self.positions[position];
        let points = (0..self.positions.len()).map(|position| [x(position), mean(position)]);
        Series {
            name: name.to_owned(),
            color,
            points: points.collect(),
            band: (self.runs.len() >= MIN_RUNS).then(|| band(&self.runs, x)),
            ..Series::default()
        }
    }
}

/// Where the values of a curve are on the horizontal axis; `None` if it is unknown.
fn positions(run: &RunResult, of: Curve, x: CurveAxis) -> Option<Vec<f64>> {
    let episodes = run.episodes_of_curve(of);
    match x {
        CurveAxis::Episodes => Some(episodes.into_iter().map(f64::from).collect()),
        CurveAxis::EnvSteps => {
            let steps = run.steps_of_episodes();
            let after = |episodes: u32| match episodes {
                0 => Some(0.0),
                episodes => steps.get(episodes as usize - 1).map(|steps| *steps as f64),
            };
            episodes.into_iter().map(after).collect()
        }
        CurveAxis::GradientSteps => {
            let rounds = run.episodes_of_curve(Curve::GradientSteps);
            let mut sums = vec![0.0];
            for steps in run.curve(Curve::GradientSteps) {
                sums.push(sums[sums.len() - 1] + steps);
            }
            let after = |episodes: u32| sums[rounds.partition_point(|round| *round <= episodes)];
            (sums.len() > 1).then(|| episodes.into_iter().map(after).collect())
        }
    }
}

/// Positions at which all runs have values: over episodes those of the longest run; over steps equally spaced ones
/// from the first at which all runs have a value to the end of the longest run.
fn common_positions(runs: &[(Vec<f64>, Vec<f64>)], x: CurveAxis) -> Vec<f64> {
    let positions = || runs.iter().map(|(positions, _)| positions);
    let Some(longest) = positions().max_by_key(|positions| positions.len()) else {
        return Vec::new();
    };
    if x == CurveAxis::Episodes {
        return longest.clone();
    }
    let firsts = positions().filter_map(|positions| positions.first());
    let first = firsts.fold(0.0, |one: f64, other| one.max(*other));
    let lasts = positions().filter_map(|positions| positions.last());
    let last = lasts.fold(first, |one: f64, other| one.max(*other));
    let position = |index: usize| first + (last - first) * index as f64 / (POSITIONS - 1) as f64;
    (0..POSITIONS).map(position).collect()
}

/// Sentence about runs that are not drawn; empty if all are.
fn sentence_about_unknown(cells: &[CellCurves], x: CurveAxis) -> String {
    let unknown: usize = cells.iter().map(|cell| cell.unknown).sum();
    if unknown == 0 {
        return String::new();
    }
    format!(" Left out: {unknown} runs that do not have {}.", x.label())
}

/// 95 % bootstrap intervals of the mean over runs.   `moving_averages: [runs][positions]` → (x,
/// low, high)
fn band(moving_averages: &[Vec<f64>], x: impl Fn(usize) -> f64) -> Vec<[f64; 3]> {
    let last = moving_averages[0].len() - 1;
    let sections = BAND_POINTS.min(last).max(1);
    let positions: Vec<usize> = (0..=sections)
        .map(|section| section * last / sections)
        .collect();
    let values_of_run =
        |run: &Vec<f64>| -> Vec<f64> { positions.iter().map(|&position| run[position]).collect() };
    let runs: Vec<Vec<f64>> = moving_averages.iter().map(values_of_run).collect();
    let estimates = bootstrap_means(&runs);
    let band_point = |(position, interval): (&usize, Interval)| match interval {
        Interval::Known { low, high } => Some([x(*position), low, high]),
        Interval::TooFewRuns { .. } => None,
    };
    positions
        .iter()
        .zip(estimates.into_iter().map(|estimate| estimate.interval))
        .filter_map(band_point)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::design::cell::CellDescription;
    use seedbed_figure::Panel;

    fn constant_series(height: f64) -> Series {
        Series {
            points: vec![[0.0, 2.0], [1.0, height], [2.0, height]],
            ..Series::default()
        }
    }

    /// One run with the values 0.1, 0.2 and 0.6 of a curve after 10, 20 and 30 episodes.
    fn cell_with(curve: Curve) -> CellResults {
        let curves = Curve::WITH_ROUND_VALUES.iter().map(|other| {
            let values = if *other == curve {
                &[0.1, 0.2, 0.6][..]
            } else {
                &[]
            };
            values.to_vec()
        });
        let run = RunResult {
            episodes: vec![10, 20, 30],
            curves: curves.collect(),
            ..RunResult::default()
        };
        let mut cell = CellResults::without_runs(CellDescription::for_test("cell", 30, Vec::new()));
        cell.runs = vec![(0, run)];
        cell
    }

    /// A curve of what was measured in each round is averaged; one of everything so far has its own values,
    /// because an average would be of an earlier time.
    #[test]
    fn cumulative_curves_are_not_averaged() {
        for (curve, last, is_averaged) in [
            (Curve::TeamCoverage, 0.6, false),
            (Curve::Coverage, 0.6, false),
            (Curve::EffectiveAgents, 0.6, false),
            (Curve::FirstCoverage, 0.6, false),
            (Curve::VisitationEntropy, 0.6, false),
            (Curve::NewCoverage, 0.3, true),
            (Curve::ValueLoss, 0.3, true),
        ] {
            let cell = cell_with(curve);
            let figure = curves(&[&cell], curve, CurveAxis::Episodes, 25).unwrap();
            let Panel::Curves(panel) = &figure.picture.rows[0].panels[0] else {
                panic!("{curve:?} has curves");
            };
            let [_, _, [episodes, value]] = panel.series[0].points[..] else {
                panic!("{curve:?} has three points");
            };
            assert!(
                episodes == 30.0 && (value - last).abs() < 1e-6,
                "{curve:?}: {value}"
            );
            assert_eq!(figure.caption.contains("moving average"), is_averaged);
        }
    }

    fn points(cell: &CellResults, of: Curve, x: CurveAxis) -> Vec<[f64; 2]> {
        let figure = curves(&[cell], of, x, 1).unwrap();
        let Panel::Curves(panel) = &figure.picture.rows[0].panels[0] else {
            panic!("a figure of curves");
        };
        panel.series[0].points.clone()
    }

    /// Two agents whose episodes ended at steps 10 and 30, and 20 and 40: both have finished one after 20 steps,
    /// and two after 40, with mean returns of 2 and 6.
    #[test]
    fn curves_over_steps_have_values_where_all_agents_have_finished() {
        let mut cell = cell_with(Curve::TeamCoverage);
        cell.runs[0].1 = RunResult {
            returns: vec![vec![1.0, 5.0], vec![3.0, 7.0]],
            episode_ends: vec![vec![10, 30], vec![20, 40]],
            env_steps: 40,
            ..RunResult::default()
        };
        let points = points(&cell, Curve::Return, CurveAxis::EnvSteps);
        assert_eq!(points.len(), POSITIONS);
        assert_eq!((points[0], points[POSITIONS - 2][1]), ([20.0, 2.0], 2.0));
        assert_eq!(points[POSITIONS - 1], [40.0, 6.0]);
    }

    /// Rounds of 3 gradient steps after 10, 20 and 30 episodes: the coverage 0.2 is after 6 of them.
    #[test]
    fn gradient_steps_are_added_up() {
        let mut cell = cell_with(Curve::TeamCoverage);
        let place = |curve: Curve| {
            let mut curves = Curve::WITH_ROUND_VALUES.iter();
            curves.position(|other| *other == curve).unwrap()
        };
        cell.runs[0].1.curves[place(Curve::GradientSteps)] = vec![3.0; 3];
        let points = points(&cell, Curve::TeamCoverage, CurveAxis::GradientSteps);
        let at = |steps: f64| points.iter().rfind(|point| point[0] <= steps).unwrap()[1];
        assert_eq!((points[0][0], points[POSITIONS - 1][0]), (3.0, 9.0));
        assert!(
            [(5.9, 0.1), (6.1, 0.2), (9.0, 0.6)]
                .iter()
                .all(|(steps, value)| (at(*steps) - value).abs() < 1e-6)
        );
    }

    /// Runs that earlier versions stored.
    #[test]
    fn runs_without_steps_are_left_out_and_counted() {
        let mut cell = cell_with(Curve::TeamCoverage);
        let run = cell.runs[0].1.clone();
        assert!(curves(&[&cell], Curve::TeamCoverage, CurveAxis::EnvSteps, 1).is_none());
        let known = RunResult {
            episode_ends: vec![(1..=30).map(|episode| episode * 5).collect()],
            ..run
        };
        cell.runs.push((1, known));
        let figure = curves(&[&cell], Curve::TeamCoverage, CurveAxis::EnvSteps, 1).unwrap();
        assert!(
            figure
                .caption
                .ends_with("Left out: 1 runs that do not have environment steps of the team."),
            "{}",
            figure.caption
        );
    }

    /// Each curve has a constant value after its first point, and the first point does not change
    /// the median.
    #[test]
    fn curves_that_differ_by_orders_of_magnitude_have_a_logarithmic_axis() {
        assert!(differ_by_orders_of_magnitude(&[
            constant_series(200.0),
            constant_series(1.0)
        ]));
        assert!(
            !differ_by_orders_of_magnitude(&[constant_series(200.0), constant_series(3.0)]),
            "both curves are visible on a linear axis"
        );
        assert!(
            !differ_by_orders_of_magnitude(&[constant_series(200.0), constant_series(0.0)]),
            "0 has no logarithm"
        );
        let band_below_zero = Series {
            band: Some(vec![[0.0, -1.0, 3.0]]),
            ..constant_series(1.0)
        };
        assert!(!differ_by_orders_of_magnitude(&[
            constant_series(200.0),
            band_below_zero
        ]));
        assert!(!differ_by_orders_of_magnitude(&[]));
    }
}
