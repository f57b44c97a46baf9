//! Curves with bands over a common abscissa, in one panel or in several on common axes.

use super::color::{Color, GREY};
use super::drawing::{Anchor, Area, Drawing, Lettering, Stroke};
use super::frame::{Frame, Plot, TICK};
use super::legend::{self, Entry};
use super::scale::{extent, padded, padded_ratio};
use super::{Figure, Panel, Row};

/// Curves in one panel. Points that are not finite leave gaps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// Stands above the panel.
    pub title: String,
    /// The abscissa, with its unit.
    pub x_label: String,
    /// The ordinate, with its unit.
    pub y_label: String,
    /// The later ones on top.
    pub series: Vec<Series>,
    /// Levels to compare with.
    pub thresholds: Vec<Threshold>,
    /// The abscissa's ends; from the data where there are none.
    pub x_range: Option<[f64; 2]>,
    /// The ordinate's ends; from the data where there are none.
    pub y_range: Option<[f64; 2]>,
    /// Whether equal ratios are equally far apart upwards; all values are above 0.
    pub y_logarithmic: bool,
    /// Whether the series' names stand in the panel: where nothing else is, or else to the right.
    pub legend: bool,
}

/// One curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Its name in the legend; an empty one has none.
    pub name: String,
    /// Its colour.
    pub color: Color,
    /// (x, y), in the order of x.
    pub points: Vec<[f64; 2]>,
    /// (x, low, high), in the order of x: an interval about the curve.
    pub band: Option<Vec<[f64; 3]>>,
    /// Whether each value holds until the next, as in survival curves.
    pub steps: bool,
    /// Drawn pale and thin, behind what matters.
    pub faint: bool,
}

/// A level to compare with: a dashed line.
#[derive(Clone, Debug, PartialEq)]
pub struct Threshold {
    /// What the level is.
    pub name: String,
    /// Where it is.
    pub value: f64,
}

impl Figure {
    /// Panels on common axes, row by row, `columns` in each.
    #[must_use]
    pub fn of_curves(
        title: &str,
        description: &str,
        mut panels: Vec<Curves>,
        columns: usize,
    ) -> Self {
        share_axes(&mut panels);
        let columns = columns.clamp(1, panels.len().max(1));
        let rows = panels.chunks(columns).map(|curves| Row {
            height: 250.0,
            panels: curves
                .iter()
                .cloned()
                .map(Panel::Curves)
                .chain((curves.len()..columns).map(|_| Panel::Blank))
                .collect(),
            key: None,
        });
        let width = if columns == 1 {
            480.0
        } else {
            320.0 * columns as f64
        };
        Self {
            title: title.to_owned(),
            description: description.to_owned(),
            width,
            rows: rows.collect(),
        }
    }
}

/// All panels get the ends that hold the data of each.
fn share_axes(panels: &mut [Curves]) {
    let x = extent(panels.iter().flat_map(Curves::x_extent));
    let y = extent(panels.iter().flat_map(Curves::y_extent));
    for panel in panels {
        panel.x_range.get_or_insert(x);
        panel.y_range.get_or_insert(y);
    }
}

impl Curves {
    fn x_extent(&self) -> [f64; 2] {
        let xs = self
            .series
            .iter()
            .flat_map(|series| series.points.iter().map(|point| point[0]));
        self.x_range.unwrap_or_else(|| extent(xs))
    }

    fn y_extent(&self) -> [f64; 2] {
        let of_series = |series: &Series| {
            let band = series
                .band
                .iter()
                .flatten()
                .flat_map(|[_, low, high]| [*low, *high]);
            series
                .points
                .iter()
                .map(|point| point[1])
                .chain(band)
                .collect::<Vec<_>>()
        };
        let data = self
            .series
            .iter()
            .flat_map(of_series)
            .chain(self.thresholds.iter().map(|threshold| threshold.value));
        self.y_range.unwrap_or_else(|| {
            if self.y_logarithmic {
                padded_ratio(extent(data))
            } else {
                padded(extent(data))
            }
        })
    }

    pub(super) fn draw(&self, panel: &Area, drawing: &mut Drawing) {
        let frame = Frame {
            title: &self.title,
            x_label: &self.x_label,
            y_label: &self.y_label,
            x_range: self.x_extent(),
            y_range: self.y_extent(),
            y_logarithmic: self.y_logarithmic,
            grid: true,
        };
        let entries = self.entries();
        let plot = frame.plot(panel);
        let place = legend::free_place(&entries, &plot.area, &self.taken(&plot));
        let beside = if entries.is_empty() || place.is_some() {
            0.0
        } else {
            legend::width_beside(&entries, panel)
        };
        let plot = frame.draw(&panel.within([0.0, beside, 0.0, 0.0]), drawing);
        drawing.clipped(&plot.area, |drawing| {
            self.series
                .iter()
                .for_each(|series| series.draw_band(&plot, drawing));
            self.thresholds
                .iter()
                .for_each(|threshold| threshold.draw(&plot, drawing));
            self.series
                .iter()
                .for_each(|series| series.draw_line(&plot, drawing));
        });
        self.thresholds
            .iter()
            .for_each(|threshold| threshold.write(&plot, drawing));
        let right = Area {
            x: plot.area.right() + 8.0,
            width: beside,
            ..plot.area
        };
        legend::draw(&entries, &place.unwrap_or(right), &plot.area, drawing);
    }

    /// What the legend tells.
    fn entries(&self) -> Vec<Entry<'_>> {
        let named = self
            .series
            .iter()
            .filter(|series| self.legend && !series.name.is_empty());
        named
            .map(|series| Entry {
                name: &series.name,
                color: series.color,
            })
            .collect()
    }

    /// Places of the page that curves, bands and words take.
    fn taken(&self, plot: &Plot) -> Vec<[f64; 2]> {
        let words = self
            .thresholds
            .iter()
            .flat_map(|threshold| threshold.taken(plot));
        self.series
            .iter()
            .flat_map(|series| series.taken(plot))
            .chain(words)
            .collect()
    }
}

impl Series {
    fn taken(&self, plot: &Plot) -> Vec<[f64; 2]> {
        let line: Vec<[f64; 2]> = self
            .stepped(self.points.iter().copied())
            .into_iter()
            .map(|at| plot.at(at))
            .collect();
        let place = |&[x, low, high]: &[f64; 3]| [plot.x.at(x), plot.y.at(low), plot.y.at(high)];
        let mut band: Vec<[f64; 3]> = Vec::new();
        for next in self.band.iter().flatten().map(place) {
            let corner = band
                .last()
                .filter(|_| self.steps)
                .map(|before| [next[0], before[1], before[2]]);
            band.extend(corner.into_iter().chain([next]));
        }
        [legend::traced(&line), legend::covered(&band)].concat()
    }

    fn draw_band(&self, plot: &Plot, drawing: &mut Drawing) {
        for band in self
            .band
            .iter()
            .flat_map(|band| band.split(|point| point.iter().any(|value| !value.is_finite())))
        {
            let edge =
                |which: usize| self.stepped(band.iter().map(|point| [point[0], point[which]]));
            let outline: Vec<[f64; 2]> = edge(1)
                .into_iter()
                .chain(edge(2).into_iter().rev())
                .map(|at| plot.at(at))
                .collect();
            if outline.len() > 2 {
                drawing.fill(&outline, self.color, 0.2);
            }
        }
    }

    fn draw_line(&self, plot: &Plot, drawing: &mut Drawing) {
        let stroke = Stroke::new(self.color, if self.faint { 1.0 } else { 1.8 });
        let stroke = Stroke {
            opacity: if self.faint { 0.6 } else { 1.0 },
            ..stroke
        };
        for points in self
            .points
            .split(|point| point.iter().any(|value| !value.is_finite()))
        {
            let points = thinned(points, 2 * plot.area.width as usize);
            let places: Vec<[f64; 2]> = self
                .stepped(points.into_iter())
                .into_iter()
                .map(|at| plot.at(at))
                .collect();
            match places[..] {
                [] => {}
                [place] => drawing.dot(place, 2.5, self.color, 1.0),
                _ => drawing.line(&places, stroke),
            }
        }
    }

    /// With the corners of steps, where there are steps.
    fn stepped(&self, points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
        let mut stepped: Vec<[f64; 2]> = Vec::new();
        for point in points {
            let corner = stepped
                .last()
                .filter(|_| self.steps)
                .map(|before| [point[0], before[1]]);
            stepped.extend(corner);
            stepped.push(point);
        }
        stepped
    }
}

/// No more than about four points for each of `parts` parts of the curve: its first, lowest, highest and last.
fn thinned(points: &[[f64; 2]], parts: usize) -> Vec<[f64; 2]> {
    let each = points.len().div_ceil(parts.max(1)).max(1);
    if each <= 4 {
        return points.to_vec();
    }
    let kept = points.chunks(each).flat_map(|part| {
        let by_height = |one: &&usize, other: &&usize| part[**one][1].total_cmp(&part[**other][1]);
        let indices: Vec<usize> = (0..part.len()).collect();
        let ends = [
            indices.first(),
            indices.iter().min_by(by_height),
            indices.iter().max_by(by_height),
            indices.last(),
        ];
        let mut kept: Vec<usize> = ends.into_iter().flatten().copied().collect();
        kept.sort_unstable();
        kept.dedup();
        kept.into_iter().map(|index| part[index])
    });
    kept.collect()
}

impl Threshold {
    fn draw(&self, plot: &Plot, drawing: &mut Drawing) {
        let y = plot.y.at(self.value);
        let stroke = Stroke {
            dashed: true,
            ..Stroke::new(GREY, 1.0)
        };
        drawing.line(&[[plot.area.x, y], [plot.area.right(), y]], stroke);
    }

    fn write(&self, plot: &Plot, drawing: &mut Drawing) {
        let y = plot.y.at(self.value);
        if (plot.area.y..=plot.area.bottom()).contains(&y) {
            // Above the line, unless that is cut off.
            let line = if y - 14.0 < plot.area.y {
                y + 12.0
            } else {
                y - 4.0
            };
            drawing.text(
                [plot.area.x + 6.0, line],
                &self.name,
                Lettering::new(TICK, Anchor::Start).color(GREY),
            );
        }
    }

    /// Places that its name takes.
    fn taken(&self, plot: &Plot) -> impl Iterator<Item = [f64; 2]> {
        let y = plot.y.at(self.value);
        let letters = self.name.chars().count();
        let x = plot.area.x;
        (0..8 * letters).flat_map(move |index| {
            [6.0, -6.0].map(|above| [x + 6.0 + 0.7 * index as f64, y - above])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::scale::Scale;
    use super::*;

    /// A spike of one point among a hundred thousand is kept, in its place.
    #[test]
    fn thinning_keeps_what_stands_out() {
        let mut points: Vec<[f64; 2]> = (0..100_000).map(|x| [f64::from(x), 0.0]).collect();
        points[54_321][1] = 7.0;
        let kept = thinned(&points, 500);
        assert!(
            kept.len() <= 2000 && kept.contains(&[54_321.0, 7.0]),
            "{}",
            kept.len()
        );
        assert!(kept.is_sorted_by(|one, next| one[0] < next[0]));
        assert_eq!(thinned(&points[..100], 500), points[..100]);
    }

    #[test]
    fn steps_hold_until_the_next() {
        let series = Series {
            steps: true,
            ..Series::default()
        };
        let stepped = series.stepped([[0.0, 1.0], [2.0, 0.5]].into_iter());
        assert_eq!(stepped, [[0.0, 1.0], [2.0, 1.0], [2.0, 0.5]]);
    }

    /// A band of steps is wide up to its last place, where it falls.
    #[test]
    fn a_band_of_steps_is_taken_up_to_its_end() {
        let area = Area {
            x: 0.0,
            y: 0.0,
            width: 100.0,
            height: 100.0,
        };
        let [x, y] = [[0.0, 100.0], [100.0, 0.0]].map(|places| Scale::new([0.0, 100.0], places));
        let taken = |steps: bool| {
            let band = Some(vec![[0.0, 40.0, 90.0], [100.0, 0.0, 0.0]]);
            Series {
                band,
                steps,
                ..Series::default()
            }
            .taken(&Plot { area, x, y })
        };
        let near_the_end = |places: Vec<[f64; 2]>| {
            places
                .iter()
                .any(|[x, y]| (85.0..95.0).contains(x) && *y < 30.0)
        };
        assert!(near_the_end(taken(true)) && !near_the_end(taken(false)));
    }

    #[test]
    fn panels_share_their_axes() {
        let panel = |high: f64| Curves {
            series: vec![Series {
                points: vec![[0.0, 0.0], [high, high]],
                ..Series::default()
            }],
            ..Curves::default()
        };
        let figure = Figure::of_curves("", "", vec![panel(10.0), panel(20.0), panel(5.0)], 2);
        assert_eq!(
            figure
                .rows
                .iter()
                .map(|row| row.panels.len())
                .collect::<Vec<_>>(),
            [2, 2]
        );
        let Panel::Curves(first) = &figure.rows[0].panels[0] else {
            panic!("curves")
        };
        assert_eq!(
            (first.x_range, first.y_range),
            (Some([0.0, 20.0]), Some([0.0, 21.0]))
        );
    }
}
