//! The figures that a study asks for, from its runs to pictures.

mod measures;

use rayon::prelude::*;

use self::measures::{groups, intervals, profiles, unsolved};
use super::Drawn;
use crate::env::{Quantity, Spec};
use crate::figure::color::agent_color;
use crate::figure::{
    Curves, DensityPicture, Figure as Picture, Key, Panel, ParallelCoordinates, Row, Series,
    States, Threshold,
};
use crate::record::visitation::{Axes, Density, Seen};
use crate::study::figure::{Figure, Upto};
use crate::study::measure::{Curve, moving_average, widened};
use crate::study::results::{CellResults, Results};
use crate::study::statistics::aggregate::median;
use crate::study::statistics::bootstrap::estimates;
use crate::study::statistics::{Interval, LEAST_RUNS};

/// Places along a curve at which its band is worked out, about.
const BAND_PLACES: usize = 50;

/// All figures of a study; those that no run can fill yet are left out.
pub(super) fn draw(results: &Results) -> Vec<Drawn> {
    let drawn = results
        .study
        .figures
        .par_iter()
        .map(|figure| drawn(results, figure));
    let drawn: Vec<Option<(Words, Picture)>> = drawn.collect();
    let numbered = (1..).zip(drawn.into_iter().flatten());
    numbered
        .map(|(number, (words, picture))| finish(number, words, picture))
        .collect()
}

/// What stands around a figure.
struct Words {
    kind: &'static str,
    title: String,
    caption: String,
}

fn finish(number: usize, words: Words, picture: Picture) -> Drawn {
    let Words {
        kind,
        title,
        caption,
    } = words;
    let picture = Picture {
        title: title.clone(),
        description: caption.clone(),
        ..picture
    };
    Drawn {
        name: format!("{number}-{kind}"),
        title,
        caption,
        picture,
    }
}

fn drawn(results: &Results, figure: &Figure) -> Option<(Words, Picture)> {
    let cells: Vec<&CellResults> = results
        .shown_by(figure)
        .into_iter()
        .filter(|cell| !cell.runs.is_empty())
        .collect();
    if cells.is_empty() {
        return None;
    }
    let main = results.study.main_measure();
    let (kind, title, caption, picture) = match figure {
        Figure::Curves { of, window, .. } => curves(&cells, **of, window.get() as usize),
        Figure::Agents { window, .. } => agents(&cells, window.get() as usize),
        Figure::Visitation { episodes, .. } => visitation(&cells, episodes)?,
        Figure::Intervals { measure, over, .. } => intervals(
            &groups(&cells, over),
            measure.as_ref().map_or(main, |measure| **measure),
        ),
        Figure::Unsolved { .. } => unsolved(&cells),
        Figure::Profiles { measure, over, .. } => profiles(
            &groups(&cells, over),
            measure.as_ref().map_or(main, |measure| **measure),
        ),
    };
    let title = if figure.title().is_empty() {
        title
    } else {
        figure.title().to_owned()
    };
    Some((
        Words {
            kind,
            title,
            caption,
        },
        picture,
    ))
}

/// Kind, title, caption, picture.
type Made = (&'static str, String, String, Picture);

fn in_one_panel(curves: Curves) -> Picture {
    let row = Row {
        height: 360.0,
        panels: vec![Panel::Curves(curves)],
        key: None,
    };
    Picture {
        title: String::new(),
        description: String::new(),
        width: 760.0,
        rows: vec![row],
    }
}

/// The colour of the number-th cell of a figure.
fn color(number: usize) -> [u8; 3] {
    agent_color(COLORS[number % COLORS.len()] + 8 * (number / COLORS.len()) as u32)
}

/// Agents' colours in an order that begins with those that differ most.
const COLORS: [u32; 8] = [4, 5, 2, 6, 0, 1, 7, 3];

fn curves(cells: &[&CellResults], of: Curve, window: usize) -> Made {
    let series: Vec<Series> = cells
        .par_iter()
        .enumerate()
        .map(|(number, cell)| mean_curve(cell, of, window, number))
        .collect();
    let title = format!("{}, mean of all runs", capital(of.title()));
    let caption = format!(
        "{}{}, mean over runs{}. {}",
        capital(of.title()),
        if window > 1 {
            format!(", moving average of {window}")
        } else {
            String::new()
        },
        if series.iter().any(|series| series.band.is_some()) {
            " with bootstrap bands of 95 %"
        } else {
            ""
        },
        ended_early(cells)
    );
    let y_logarithmic = are_far_apart(&series);
    let curves = Curves {
        x_label: "episodes of each agent".to_owned(),
        y_label: format!(
            "{}{}",
            of.title(),
            if y_logarithmic { " (log scale)" } else { "" }
        ),
        y_logarithmic,
        thresholds: if of == Curve::Return {
            thresholds(cells)
        } else {
            Vec::new()
        },
        series,
        legend: true,
        ..Curves::default()
    };
    (
        "curves",
        title,
        caption.trim().to_owned(),
        in_one_panel(curves),
    )
}

/// Curves of which one would squash another to nothing are told apart by their ratio.
const FAR_APART: f64 = 100.0;

/// Whether all is above 0, and the medians of two curves differ by that factor.
fn are_far_apart(series: &[Series]) -> bool {
    let heights = |series: &Series| {
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
        .chain(series.iter().flat_map(heights))
        .any(|value| value <= 0.0)
    {
        return false;
    }
    let medians = series
        .iter()
        .map(heights)
        .filter(|heights| !heights.is_empty())
        .map(|heights| median(&heights));
    let [low, high] = medians.fold([f64::INFINITY, 0.0], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    high > FAR_APART * low
}

/// What became of runs that ended before others did.
fn ended_early(cells: &[&CellResults]) -> &'static str {
    let lengths = |cell: &&CellResults| {
        cell.runs
            .iter()
            .map(|(_, run)| run.episodes_per_agent())
            .collect::<Vec<_>>()
    };
    let uneven = cells
        .iter()
        .map(lengths)
        .any(|lengths| lengths.iter().min() != lengths.iter().max());
    if uneven {
        "A run that ended early, such as by solving its task, counts on with its last value."
    } else {
        ""
    }
}

/// The level at which the task counts as solved, if it is the same for all.
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

fn mean_curve(cell: &CellResults, of: Curve, window: usize, number: usize) -> Series {
    let longest = cell
        .runs
        .iter()
        .map(|(_, run)| run)
        .max_by_key(|run| run.curve(of).len());
    let episodes = longest
        .map(|run| run.curve_episodes(of))
        .unwrap_or_default();
    let window = window.clamp(1, episodes.len().max(1));
    let mut smooth: Vec<Vec<f64>> = cell
        .runs
        .iter()
        .map(|(_, run)| moving_average(&run.curve(of), window))
        .collect();
    let length = smooth.iter().map(Vec::len).max().unwrap_or(0);
    smooth.retain(|run| !run.is_empty());
    for run in &mut smooth {
        run.resize(length, run.last().copied().unwrap_or_default());
    }
    let x = |place: usize| f64::from(episodes[place + window - 1]);
    let mean =
        |place: usize| smooth.iter().map(|run| run[place]).sum::<f64>() / smooth.len() as f64;
    let points = (0..length).map(|place| [x(place), mean(place)]).collect();
    let band = (smooth.len() >= LEAST_RUNS).then(|| band(&smooth, x));
    Series {
        name: cell.about.name.clone(),
        color: color(number),
        points,
        band,
        ..Series::default()
    }
}

/// 95 % of the means of redrawn runs.   `smooth: [runs][places]` → (x, low, high)
fn band(smooth: &[Vec<f64>], x: impl Fn(usize) -> f64) -> Vec<[f64; 3]> {
    let last = smooth[0].len() - 1;
    let parts = BAND_PLACES.min(last).max(1);
    let places: Vec<usize> = (0..=parts).map(|part| part * last / parts).collect();
    let runs: Vec<f64> = (0..smooth.len()).map(|run| run as f64).collect();
    let means = |redrawn: &[Vec<f64>], means: &mut [f64]| {
        for (mean, &place) in means.iter_mut().zip(&places) {
            *mean = redrawn[0]
                .iter()
                .map(|&run| smooth[run as usize][place])
                .sum::<f64>()
                / redrawn[0].len() as f64;
        }
    };
    let found = estimates(&[runs], places.len(), means);
    let known = |(place, interval): (&usize, Interval)| match interval {
        Interval::Known { low, high } => Some([x(*place), low, high]),
        Interval::TooFewRuns { .. } => None,
    };
    places
        .iter()
        .zip(found.into_iter().map(|estimate| estimate.interval))
        .filter_map(known)
        .collect()
}

fn agents(cells: &[&CellResults], window: usize) -> Made {
    let full: Vec<String> = cells.iter().map(|cell| cell.about.name.clone()).collect();
    let names = if full.iter().all(|name| name.chars().count() <= SHORT) {
        full
    } else {
        own_words(cells)
    };
    let panels: Vec<Curves> = cells
        .iter()
        .zip(names)
        .map(|(cell, name)| panel_of_agents(cell, name, window))
        .collect();
    let columns = panels.len().min(3);
    let (title, seed) = ("Single agents".to_owned(), cells[0].runs[0].0);
    let caption = format!(
        "Returns of each agent and their mean (black) in the run with seed {seed}, moving average of {window}."
    );
    (
        "agents",
        title,
        caption,
        Picture::of_curves("", "", panels, columns),
    )
}

/// Letters of a name that stands above a panel as it is.
const SHORT: usize = 30;

fn panel_of_agents(cell: &CellResults, title: String, window: usize) -> Curves {
    let run = &cell.runs[0].1;
    let curve = |values: &[f64]| -> Vec<[f64; 2]> {
        let window = window.clamp(1, values.len().max(1));
        moving_average(values, window)
            .iter()
            .enumerate()
            .map(|(place, &mean)| [(place + window) as f64, mean])
            .collect()
    };
    let of_agent = |(agent, returns): (u32, &Vec<f32>)| Series {
        color: agent_color(agent),
        points: curve(&widened(returns)),
        ..Series::default()
    };
    let mean = Series {
        color: [35, 35, 40],
        points: curve(&run.team_returns()),
        ..Series::default()
    };
    Curves {
        title,
        x_label: "episodes".to_owned(),
        y_label: "return".to_owned(),
        series: (0..)
            .zip(&run.returns)
            .map(of_agent)
            .chain([mean])
            .collect(),
        ..Curves::default()
    }
}

/// What a cell is called among others in narrow panels: its name without the words that all of them have.
fn own_words(cells: &[&CellResults]) -> Vec<String> {
    let words = |cell: &&CellResults| {
        cell.about
            .name
            .split(", ")
            .map(str::to_owned)
            .collect::<Vec<String>>()
    };
    let is_shared =
        |word: &String| cells.len() > 1 && cells.iter().all(|cell| words(cell).contains(word));
    let own = |cell| {
        words(cell)
            .into_iter()
            .filter(|word| !is_shared(word))
            .collect::<Vec<String>>()
            .join(", ")
    };
    cells
        .iter()
        .map(|cell| {
            Some(own(cell))
                .filter(|name| !name.is_empty())
                .unwrap_or(cell.about.name.clone())
        })
        .collect()
}

/// Panels side by side have this width.
const PANEL: f64 = 300.0;

fn visitation(cells: &[&CellResults], windows: &[Upto]) -> Option<Made> {
    let rows: Vec<Vec<Dense>> = windows.iter().map(|&upto| densities(cells, upto)).collect();
    let columns = rows
        .iter()
        .map(Vec::len)
        .max()
        .filter(|&columns| columns > 0)?;
    let seed = cells[0].runs[0].0;
    let caption = format!(
        "States visited in the run with seed {seed}: one axis an observation, one line a state, the darker the more lines. Each panel shows \
         an even sample of at most {} states of all agents{}.",
        crate::study::measured::STATES,
        if windows.len() > 1 {
            "; rows go from early to all training"
        } else {
            ""
        }
    );
    let picture = Picture {
        title: String::new(),
        description: String::new(),
        width: PANEL * columns as f64 + 90.0,
        rows: rows
            .into_iter()
            .filter(|row| !row.is_empty())
            .map(row_of_densities)
            .collect(),
    };
    Some(("visitation", "Visited states".to_owned(), caption, picture))
}

/// The states of one cell: what it is, its axes, and where lines are dense.
struct Dense {
    title: String,
    axes: Vec<Quantity>,
    density: Density,
}

/// Of each cell whose states were kept.
fn densities(cells: &[&CellResults], upto: Upto) -> Vec<Dense> {
    let of_cell = |(cell, name): (&&CellResults, String)| {
        let (visited, states) = cell.states(upto)?;
        let spec = spec(cell);
        let axes = axes(&spec);
        let mut density = Density::new(&axes);
        let mut fractions = Vec::new();
        for state in states.chunks_exact(spec.observation_width()) {
            axes.project(&Seen::state(0, state, 0.0), &mut fractions);
            density.add(&fractions);
        }
        let part = match upto {
            Upto::First(episodes) if episodes.get() == 1 => "first episode".to_owned(),
            Upto::First(episodes) => format!("first {} episodes", episodes.get()),
            Upto::All => "all episodes".to_owned(),
        };
        let title = format!("{name}: {part}, {visited} states");
        Some(Dense {
            title,
            axes: axes
                .all()
                .iter()
                .map(|axis| axis.quantity.clone())
                .collect(),
            density,
        })
    };
    cells
        .iter()
        .zip(own_words(cells))
        .filter_map(of_cell)
        .collect()
}

fn row_of_densities(mut row: Vec<Dense>) -> Row {
    let drawn: Vec<Vec<u32>> = row
        .iter_mut()
        .map(|dense| dense.density.draw_all().clone())
        .collect();
    let most = drawn.iter().flatten().copied().max().unwrap_or(1).max(1);
    let panel = |(Dense { title, axes, .. }, pixels): (Dense, Vec<u32>)| {
        let width = pixels.len() / crate::record::visitation::HEIGHT;
        let states = States::Density(DensityPicture {
            pixels,
            width,
            most,
        });
        Panel::ParallelCoordinates(ParallelCoordinates {
            title,
            axes,
            states,
        })
    };
    let key = Some(Key::Counts {
        label: "lines".to_owned(),
        most,
    });
    Row {
        height: 250.0,
        panels: row.into_iter().zip(drawn).map(panel).collect(),
        key,
    }
}

fn axes(spec: &Spec) -> Axes {
    Axes::of_quantities(&spec.observations, spec.time_limit, None)
}

/// As much of a task as its axes need.
fn spec(cell: &CellResults) -> Spec {
    let quantity = |(name, unit, range): &(String, String, [f32; 2])| Quantity {
        name: name.clone(),
        unit: unit.clone(),
        range: *range,
    };
    Spec {
        name: cell.about.task.clone(),
        description: String::new(),
        observations: cell.about.observations.iter().map(quantity).collect(),
        actions: Vec::new(),
        control_step: 1.0,
        time_limit: 1,
        reward_threshold: None,
    }
}

fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(height: f64) -> Series {
        Series {
            points: vec![[0.0, 2.0], [1.0, height], [2.0, height]],
            ..Series::default()
        }
    }

    /// The first value of each, 2, is not the median.
    #[test]
    fn curves_far_apart_have_a_logarithmic_axis() {
        assert!(are_far_apart(&[level(200.0), level(1.0)]));
        assert!(
            !are_far_apart(&[level(200.0), level(3.0)]),
            "all can be seen"
        );
        assert!(
            !are_far_apart(&[level(200.0), level(0.0)]),
            "0 has no logarithm"
        );
        let below = Series {
            band: Some(vec![[0.0, -1.0, 3.0]]),
            ..level(1.0)
        };
        assert!(!are_far_apart(&[level(200.0), below]));
        assert!(!are_far_apart(&[]));
    }
}
