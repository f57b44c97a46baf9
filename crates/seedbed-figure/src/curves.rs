//! Curves with bands over a common x axis, in one panel or in several with common axes.

use super::color::{Color, MUTED_COLOR};
use super::frame::{Frame, Plot, TICK_SIZE};
use super::legend::{self, Entry};
use super::scale::{extent, padded, padded_ratio};
use super::svg::{Anchor, Rect, Stroke, SvgWriter, TextStyle};
use super::{Figure, Panel, Row};

/// Curves in one panel. Points that are not finite leave gaps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// Title above the panel.
    pub title: String,
    /// Name of the x axis, with its unit.
    pub x_label: String,
    /// Name of the y axis, with its unit.
    pub y_label: String,
    /// Curves; later ones are drawn on top.
    pub series: Vec<Series>,
    /// Levels to compare with.
    pub thresholds: Vec<Threshold>,
    /// Range of the x axis [default: that of the data].
    pub x_range: Option<[f64; 2]>,
    /// Range of the y axis [default: that of the data].
    pub y_range: Option<[f64; 2]>,
    /// Whether the y axis is logarithmic; all values must be above 0.
    pub y_logarithmic: bool,
    /// Whether there is a legend: in a free part of the panel, or to the right if there is none.
    pub legend: bool,
}

/// One curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend; a series with an empty name is not in the legend.
    pub name: String,
    /// Color.
    pub color: Color,
    /// Points (x, y), in the order of x.
    pub points: Vec<[f64; 2]>,
    /// Interval around the curve: (x, low, high), in the order of x.
    pub band: Option<Vec<[f64; 3]>>,
    /// Whether each value holds until the next point, as in survival curves.
    pub steps: bool,
    /// Whether the curve is pale and thin, as a background to others.
    pub faint: bool,
}

/// A level to compare with: a dashed line.
#[derive(Clone, Debug, PartialEq)]
pub struct Threshold {
    /// Name of the level.
    pub name: String,
    /// Value on the y axis.
    pub value: f64,
}

impl Figure {
    /// A figure of panels with common axes, `columns` per row.
    #[must_use]
    pub fn from_curves(
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

/// Gives all panels the ranges of all data.
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

    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        let frame = Frame {
            title: &self.title,
            x_label: &self.x_label,
            y_label: &self.y_label,
            x_range: self.x_extent(),
            y_range: self.y_extent(),
            y_logarithmic: self.y_logarithmic,
            grid: true,
        };
        let entries = self.legend_entries();
        let plot = frame.plot(panel);
        let place = legend::find_free_rect(&entries, &plot.area, &self.occupied_points(&plot));
        let beside = if entries.is_empty() || place.is_some() {
            0.0
        } else {
            legend::width_beside(&entries, panel)
        };
        let plot = frame.draw(&panel.inset([0.0, beside, 0.0, 0.0]), svg);
        svg.clipped(&plot.area, |svg| {
            self.series
                .iter()
                .for_each(|series| series.draw_band(&plot, svg));
            self.thresholds
                .iter()
                .for_each(|threshold| threshold.draw(&plot, svg));
            self.series
                .iter()
                .for_each(|series| series.draw_line(&plot, svg));
        });
        self.thresholds
            .iter()
            .for_each(|threshold| threshold.draw_name(&plot, svg));
        let right = Rect {
            x: plot.area.right() + 8.0,
            width: beside,
            ..plot.area
        };
        legend::draw(&entries, &place.unwrap_or(right), &plot.area, svg);
    }

    /// Names and colors of the legend.
    fn legend_entries(&self) -> Vec<Entry<'_>> {
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

    /// Points of the page that curves, bands and names cover.
    fn occupied_points(&self, plot: &Plot) -> Vec<[f64; 2]> {
        let words = self
            .thresholds
            .iter()
            .flat_map(|threshold| threshold.occupied_points(plot));
        self.series
            .iter()
            .flat_map(|series| series.occupied_points(plot))
            .chain(words)
            .collect()
    }
}

impl Series {
    fn occupied_points(&self, plot: &Plot) -> Vec<[f64; 2]> {
        let line: Vec<[f64; 2]> = self
            .with_steps(self.points.iter().copied())
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
        [legend::sample_line(&line), legend::sample_band(&band)].concat()
    }

    fn draw_band(&self, plot: &Plot, svg: &mut SvgWriter) {
        for band in self
            .band
            .iter()
            .flat_map(|band| band.split(|point| point.iter().any(|value| !value.is_finite())))
        {
            let edge =
                |which: usize| self.with_steps(band.iter().map(|point| [point[0], point[which]]));
            let outline: Vec<[f64; 2]> = edge(1)
                .into_iter()
                .chain(edge(2).into_iter().rev())
                .map(|at| plot.at(at))
                .collect();
            if outline.len() > 2 {
                svg.fill(&outline, self.color, 0.2);
            }
        }
    }

    fn draw_line(&self, plot: &Plot, svg: &mut SvgWriter) {
        let stroke = Stroke::new(self.color, if self.faint { 1.0 } else { 1.8 });
        let stroke = Stroke {
            opacity: if self.faint { 0.6 } else { 1.0 },
            ..stroke
        };
        for points in self
            .points
            .split(|point| point.iter().any(|value| !value.is_finite()))
        {
            let points = downsampled(points, 2 * plot.area.width as usize);
            let places: Vec<[f64; 2]> = self
                .with_steps(points.into_iter())
                .into_iter()
                .map(|at| plot.at(at))
                .collect();
            match places[..] {
                [] => {}
                [place] => svg.dot(place, 2.5, self.color, 1.0),
                _ => svg.line(&places, stroke),
            }
        }
    }

    /// The points with the corners of steps between them, if the curve has steps.
    fn with_steps(&self, points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
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

/// At most four points for each of `parts` parts of the curve: the first, lowest, highest and last.
/// So a long curve looks the same, but the file does not grow with its length.
fn downsampled(points: &[[f64; 2]], parts: usize) -> Vec<[f64; 2]> {
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
    fn draw(&self, plot: &Plot, svg: &mut SvgWriter) {
        let y = plot.y.at(self.value);
        let stroke = Stroke {
            dashed: true,
            ..Stroke::new(MUTED_COLOR, 1.0)
        };
        svg.line(&[[plot.area.x, y], [plot.area.right(), y]], stroke);
    }

    fn draw_name(&self, plot: &Plot, svg: &mut SvgWriter) {
        let y = plot.y.at(self.value);
        if (plot.area.y..=plot.area.bottom()).contains(&y) {
            // Above the line, or below it if that would be outside the plot.
            let line = if y - 14.0 < plot.area.y {
                y + 12.0
            } else {
                y - 4.0
            };
            svg.text(
                [plot.area.x + 6.0, line],
                &self.name,
                TextStyle::new(TICK_SIZE, Anchor::Start).color(MUTED_COLOR),
            );
        }
    }

    /// Points that the name covers.
    fn occupied_points(&self, plot: &Plot) -> impl Iterator<Item = [f64; 2]> {
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

    /// A single high point among a hundred thousand is kept at its position.
    #[test]
    fn downsampling_keeps_outliers() {
        let mut points: Vec<[f64; 2]> = (0..100_000).map(|x| [f64::from(x), 0.0]).collect();
        points[54_321][1] = 7.0;
        let kept = downsampled(&points, 500);
        assert!(
            kept.len() <= 2000 && kept.contains(&[54_321.0, 7.0]),
            "{}",
            kept.len()
        );
        assert!(kept.is_sorted_by(|one, next| one[0] < next[0]));
        assert_eq!(downsampled(&points[..100], 500), points[..100]);
    }

    #[test]
    fn values_of_steps_hold_until_the_next() {
        let series = Series {
            steps: true,
            ..Series::default()
        };
        let stepped = series.with_steps([[0.0, 1.0], [2.0, 0.5]].into_iter());
        assert_eq!(stepped, [[0.0, 1.0], [2.0, 1.0], [2.0, 0.5]]);
    }

    /// A band of steps is wide up to its last point, where it falls.
    #[test]
    fn a_band_of_steps_is_taken_up_to_its_end() {
        let area = Rect {
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
            .occupied_points(&Plot { area, x, y })
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
        let figure = Figure::from_curves("", "", vec![panel(10.0), panel(20.0), panel(5.0)], 2);
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
