//! Curves with bands over a common x axis, in one panel or in several with common axes.

use super::color::{Color, MUTED_COLOR};
use super::font::{Weight, text_width};
use super::legend::{self, Entry};
use super::panel_axes::{PanelAxes, Plot, TICK_SIZE};
use super::scale::{extent, padded, padded_ratio, with_minus_sign};
use super::svg::{Anchor, Rect, Stroke, SvgWriter, TextStyle};
use super::{Figure, Panel, Row};

/// Curves in one panel. Non-finite points leave gaps in a curve.
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
    /// Horizontal lines at values to compare with.
    pub thresholds: Vec<Threshold>,
    /// Range of the x axis [default: range of the data].
    pub x_range: Option<[f64; 2]>,
    /// Range of the y axis [default: range of the data].
    pub y_range: Option<[f64; 2]>,
    /// Ticks of the x axis with their labels [default: round values].
    pub x_ticks: Vec<(f64, String)>,
    /// Whether the x axis is logarithmic. Points at 0 or below are left out. The axis is linear if no point is above 0.
    pub x_logarithmic: bool,
    /// Whether the y axis is logarithmic. Curves have gaps at values of 0 or below. The axis is linear if no value is above 0.
    pub y_logarithmic: bool,
    /// Whether to draw a legend. It is drawn in a part of the panel without curves, or to the right
    /// of the panel if there is no such part.
    pub has_legend: bool,
}

/// Length of the longest axis with a tick at each whole number.
const MAX_WHOLE: f64 = 6.0;

/// One curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend; a series with an empty name is not in the legend.
    pub name: String,
    /// Color.
    pub color: Color,
    /// Points (x, y) in ascending order of x.
    pub points: Vec<[f64; 2]>,
    /// Interval around the curve: (x, low, high) in ascending order of x. Where an end is infinite, the
    /// band is open: it extends to the edge of the panel.
    pub band: Option<Vec<[f64; 3]>>,
    /// Whether the curve is constant between points and has steps at points, like a survival curve.
    pub has_steps: bool,
    /// Whether the curve is thin and transparent, as a background for other curves.
    pub is_faint: bool,
}

/// A value to compare with, drawn as a dashed horizontal line.
#[derive(Clone, Debug, PartialEq)]
pub struct Threshold {
    /// Name of the value.
    pub name: String,
    /// Value on the y axis.
    pub value: f64,
}

impl Figure {
    /// A figure of panels with common axes, with `columns` panels per row.
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

/// Gives all panels without a set range a common range, which includes the ranges of all panels.
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
        let y_values = |series: &Series| {
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
        let values = self
            .series
            .iter()
            .flat_map(y_values)
            .chain(self.thresholds.iter().map(|threshold| threshold.value));
        self.y_range.unwrap_or_else(|| {
            if self.y_logarithmic {
                padded_ratio(extent(values))
            } else {
                padded(extent(values))
            }
        })
    }

    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        if self.x_logarithmic || self.y_logarithmic {
            self.above_zero().draw_drawable(panel, svg);
        } else {
            self.draw_drawable(panel, svg);
        }
    }

    /// The curves without what has no place on logarithmic axes.
    fn above_zero(&self) -> Self {
        let mut drawable = self.clone();
        let points = || self.series.iter().flat_map(|series| &series.points);
        let [has_x, has_y] = [0, 1].map(|axis| points().any(|point| point[axis] > 0.0));
        drawable.x_logarithmic &= has_x;
        drawable.y_logarithmic &= has_y;
        if drawable.x_logarithmic {
            for series in &mut drawable.series {
                series.points.retain(|point| point[0] > 0.0);
                if let Some(band) = &mut series.band {
                    band.retain(|part| part[0] > 0.0);
                }
            }
        }
        if drawable.y_logarithmic {
            drawable.series.iter_mut().for_each(Series::leave_out_zero);
            drawable
                .thresholds
                .retain(|threshold| threshold.value > 0.0);
        }
        drawable
    }

    /// Ticks at all whole numbers of a short axis if its points are at whole numbers, such as episodes; empty
    /// for round values.
    fn ticks_of_x(&self) -> Vec<(f64, String)> {
        let [low, high] = self.x_extent();
        let mut points = self.series.iter().flat_map(|series| &series.points);
        let are_whole = points.all(|[x, _]| x.fract() == 0.0);
        if !self.x_ticks.is_empty() || self.x_logarithmic || !are_whole || high - low > MAX_WHOLE {
            return self.x_ticks.clone();
        }
        let whole = low.ceil() as i64..=high.floor() as i64;
        whole
            .map(|x| (x as f64, with_minus_sign(&x.to_string())))
            .collect()
    }

    fn draw_drawable(&self, panel: &Rect, svg: &mut SvgWriter) {
        let x_ticks = self.ticks_of_x();
        let axes = PanelAxes {
            title: &self.title,
            x_label: &self.x_label,
            y_label: &self.y_label,
            x_range: self.x_extent(),
            y_range: self.y_extent(),
            x_ticks: &x_ticks,
            logarithmic: [self.x_logarithmic, self.y_logarithmic],
            has_grid: true,
        };
        let entries = self.legend_entries();
        let plot = axes.plot(panel);
        let place = legend::place(&entries, panel, &plot.area, &self.occupied_points(&plot));
        let plot = axes.draw(&panel.inset(place.margins()), svg);
        self.draw_data(&plot, svg);
        legend::draw(&entries, &place, panel, &plot.area, svg);
    }

    /// Draws bands, thresholds and curves, in this order, and the names of thresholds.
    fn draw_data(&self, plot: &Plot, svg: &mut SvgWriter) {
        svg.clipped(&plot.area, |svg| {
            self.series
                .iter()
                .for_each(|series| series.draw_band(plot, svg));
            self.thresholds
                .iter()
                .for_each(|threshold| threshold.draw(plot, svg));
            self.series
                .iter()
                .for_each(|series| series.draw_line(plot, svg));
        });
        self.thresholds
            .iter()
            .for_each(|threshold| threshold.draw_name(plot, svg));
    }

    /// Names and colors of the legend.
    fn legend_entries(&self) -> Vec<Entry<'_>> {
        let series_with_names = self
            .series
            .iter()
            .filter(|series| self.has_legend && !series.name.is_empty());
        series_with_names
            .map(|series| Entry {
                name: &series.name,
                color: series.color,
            })
            .collect()
    }

    /// Points of the page that are covered by curves, bands and names of thresholds.
    fn occupied_points(&self, plot: &Plot) -> Vec<[f64; 2]> {
        let name_points = self
            .thresholds
            .iter()
            .flat_map(|threshold| threshold.occupied_points(plot));
        self.series
            .iter()
            .flat_map(|series| series.occupied_points(plot))
            .chain(name_points)
            .collect()
    }
}

impl Series {
    /// Makes gaps where values are 0 or below, and opens bands that reach 0.
    fn leave_out_zero(&mut self) {
        for point in &mut self.points {
            if point[1] <= 0.0 {
                point[1] = f64::NAN;
            }
        }
        for [_, low, high] in self.band.iter_mut().flatten() {
            if *low <= 0.0 {
                *low = f64::NEG_INFINITY;
            }
            if *high <= 0.0 {
                *high = f64::NAN;
            }
        }
    }

    fn occupied_points(&self, plot: &Plot) -> Vec<[f64; 2]> {
        let line: Vec<[f64; 2]> = self
            .with_steps(self.points.iter().copied())
            .into_iter()
            .map(|point| plot.position(point))
            .collect();
        let position = |&[x, low, high]: &[f64; 3]| {
            [
                plot.x.position(x),
                plot.y.position(low),
                plot.y.position(high),
            ]
        };
        let mut band: Vec<[f64; 3]> = Vec::new();
        for next in self.closed_band(plot).iter().map(position) {
            let corner = band
                .last()
                .filter(|_| self.has_steps)
                .map(|before| [next[0], before[1], before[2]]);
            band.extend(corner.into_iter().chain([next]));
        }
        [legend::sample_line(&line), legend::sample_band(&band)].concat()
    }

    /// The band, whose open ends are at the edges of the panel.
    fn closed_band(&self, plot: &Plot) -> Vec<[f64; 3]> {
        let [bottom, top] = plot.y.values();
        let closed = |&[x, low, high]: &[f64; 3]| {
            let low = if low == f64::NEG_INFINITY {
                bottom
            } else {
                low
            };
            let high = if high == f64::INFINITY { top } else { high };
            [x, low, high]
        };
        self.band.iter().flatten().map(closed).collect()
    }

    fn draw_band(&self, plot: &Plot, svg: &mut SvgWriter) {
        let band = self.closed_band(plot);
        for band in band.split(|point| point.iter().any(|value| !value.is_finite())) {
            let band_edge =
                |column: usize| self.with_steps(band.iter().map(|point| [point[0], point[column]]));
            let outline: Vec<[f64; 2]> = band_edge(1)
                .into_iter()
                .chain(band_edge(2).into_iter().rev())
                .map(|point| plot.position(point))
                .collect();
            if outline.len() > 2 {
                svg.polygon(&outline, self.color, 0.2);
            }
        }
    }

    fn draw_line(&self, plot: &Plot, svg: &mut SvgWriter) {
        let stroke = Stroke::new(self.color, if self.is_faint { 1.0 } else { 1.8 });
        let stroke = Stroke {
            opacity: if self.is_faint { 0.6 } else { 1.0 },
            ..stroke
        };
        for points in self
            .points
            .split(|point| point.iter().any(|value| !value.is_finite()))
        {
            let points = downsampled(points, 2 * plot.area.width as usize);
            let positions: Vec<[f64; 2]> = self
                .with_steps(points.into_iter())
                .into_iter()
                .map(|point| plot.position(point))
                .collect();
            match positions[..] {
                [] => {}
                [position] => svg.dot(position, 2.5, self.color, 1.0),
                _ => svg.line(&positions, stroke),
            }
        }
    }

    /// The points of the curve and, if the curve has steps, the corners between them.
    fn with_steps(&self, points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
        let mut stepped: Vec<[f64; 2]> = Vec::new();
        for point in points {
            let corner = stepped
                .last()
                .filter(|_| self.has_steps)
                .map(|before| [point[0], before[1]]);
            stepped.extend(corner);
            stepped.push(point);
        }
        stepped
    }
}

/// Downsamples a curve to at most four points for each of `parts` parts: the first, lowest, highest
/// and last point. A long curve looks the same, but the file does not grow with its length.
fn downsampled(points: &[[f64; 2]], parts: usize) -> Vec<[f64; 2]> {
    let points_per_part = points.len().div_ceil(parts.max(1)).max(1);
    if points_per_part <= 4 {
        return points.to_vec();
    }
    let sampled = points.chunks(points_per_part).flat_map(|part| {
        let by_y = |one: &&usize, other: &&usize| part[**one][1].total_cmp(&part[**other][1]);
        let indices: Vec<usize> = (0..part.len()).collect();
        let first_extremes_last = [
            indices.first(),
            indices.iter().min_by(by_y),
            indices.iter().max_by(by_y),
            indices.last(),
        ];
        let mut sampled_indices: Vec<usize> =
            first_extremes_last.into_iter().flatten().copied().collect();
        sampled_indices.sort_unstable();
        sampled_indices.dedup();
        sampled_indices.into_iter().map(|index| part[index])
    });
    sampled.collect()
}

impl Threshold {
    fn draw(&self, plot: &Plot, svg: &mut SvgWriter) {
        let y = plot.y.position(self.value);
        let stroke = Stroke {
            dashed: true,
            ..Stroke::new(MUTED_COLOR, 1.0)
        };
        svg.line(&[[plot.area.x, y], [plot.area.right(), y]], stroke);
    }

    fn draw_name(&self, plot: &Plot, svg: &mut SvgWriter) {
        if let Some(baseline) = self.baseline_of_name(plot) {
            svg.text(
                [plot.area.x + 6.0, baseline],
                &self.name,
                TextStyle::new(TICK_SIZE, Anchor::Start)
                    .color(MUTED_COLOR)
                    .with_rim(),
            );
        }
    }

    /// The name is above the line, or below it if there is no space above; `None` if the line is outside the plot.
    fn baseline_of_name(&self, plot: &Plot) -> Option<f64> {
        let y = plot.y.position(self.value);
        let is_inside = (plot.area.y..=plot.area.bottom()).contains(&y);
        let baseline = if y - 14.0 < plot.area.y {
            y + 12.0
        } else {
            y - 4.0
        };
        is_inside.then_some(baseline)
    }

    /// Points of the page that the name covers.
    fn occupied_points(&self, plot: &Plot) -> impl Iterator<Item = [f64; 2]> {
        let baseline = self.baseline_of_name(plot);
        let x = plot.area.x + 6.0;
        let width = text_width(&self.name, TICK_SIZE, Weight::Regular);
        let letters = move |y: f64| legend::sample_line(&[[x, y], [x + width, y]]);
        let heights = baseline.into_iter().flat_map(|y| [y - TICK_SIZE, y + 2.0]);
        heights.flat_map(letters)
    }
}

#[cfg(test)]
mod tests {
    use super::super::scale::Scale;
    use super::*;

    /// Six episodes have ticks 0 to 5, not 0.5; longer axes, and points between whole numbers, have round values.
    #[test]
    fn few_whole_numbers_have_ticks_at_each() {
        let ticks = |xs: &[f64]| {
            let series = Series {
                points: xs.iter().map(|&x| [x, 0.0]).collect(),
                ..Series::default()
            };
            let curves = Curves {
                series: vec![series],
                ..Curves::default()
            };
            let labels: Vec<String> = curves.ticks_of_x().into_iter().map(|tick| tick.1).collect();
            labels.join(" ")
        };
        assert_eq!(ticks(&[0.0, 1.0, 2.0]), "0 1 2");
        assert_eq!(ticks(&[-1.0, 5.0]), "−1 0 1 2 3 4 5");
        assert_eq!(ticks(&[0.0, 7.0]), "");
        assert_eq!(ticks(&[0.0, 0.5, 1.0]), "");
    }

    /// Wherever a line with a name is, the legend leaves its name free: letters are 9 pixels high, and end 2 below their line.
    #[test]
    fn legends_do_not_cover_names_of_lines() {
        let area = Rect {
            x: 0.0,
            y: 0.0,
            width: 200.0,
            height: 100.0,
        };
        let y = Scale::new([0.0, 100.0], [100.0, 0.0]);
        let x = Scale::new([0.0, 1.0], [0.0, 200.0]);
        let plot = Plot { area, x, y };
        let entries = [Entry {
            name: "seed 0",
            color: [0; 3],
        }];
        for value in 0..=100 {
            let threshold = Threshold {
                name: "solved: 475".to_owned(),
                value: f64::from(value),
            };
            let letters: Vec<[f64; 2]> = threshold.occupied_points(&plot).collect();
            let legend::Place::Inside(legend) =
                legend::place(&entries, &area, &plot.area, &letters)
            else {
                panic!("there is room inside");
            };
            let baseline = threshold.baseline_of_name(&plot).unwrap();
            let is_beside = legend.x > 6.0 + text_width("solved: 475", TICK_SIZE, Weight::Regular);
            let is_above_or_below = legend.bottom() < baseline - 9.0 || legend.y > baseline + 2.0;
            assert!(is_beside || is_above_or_below, "{value}");
        }
    }

    /// A single high point among 100,000 points is kept at its position.
    #[test]
    fn downsampling_keeps_outliers() {
        let mut points: Vec<[f64; 2]> = (0..100_000).map(|x| [f64::from(x), 0.0]).collect();
        points[54_321][1] = 7.0;
        let sampled = downsampled(&points, 500);
        assert!(
            sampled.len() <= 2000 && sampled.contains(&[54_321.0, 7.0]),
            "{}",
            sampled.len()
        );
        assert!(sampled.is_sorted_by(|one, next| one[0] < next[0]));
        assert_eq!(downsampled(&points[..100], 500), points[..100]);
    }

    #[test]
    fn step_curves_hold_each_value_until_the_next_point() {
        let series = Series {
            has_steps: true,
            ..Series::default()
        };
        let stepped = series.with_steps([[0.0, 1.0], [2.0, 0.5]].into_iter());
        assert_eq!(stepped, [[0.0, 1.0], [2.0, 1.0], [2.0, 0.5]]);
    }

    /// On an axis from 0 to 100, an open end is at the edge of the panel.
    #[test]
    fn an_open_band_extends_to_the_edge() {
        let area = Rect {
            x: 0.0,
            y: 0.0,
            width: 100.0,
            height: 100.0,
        };
        let [x, y] =
            [[0.0, 100.0], [100.0, 0.0]].map(|positions| Scale::new([0.0, 100.0], positions));
        let series = Series {
            band: Some(vec![[0.0, 20.0, 40.0], [50.0, 30.0, f64::INFINITY]]),
            ..Series::default()
        };
        let plot = Plot { area, x, y };
        assert_eq!(
            series.closed_band(&plot),
            [[0.0, 20.0, 40.0], [50.0, 30.0, 100.0]]
        );
        let mut svg = SvgWriter::default();
        series.draw_band(&plot, &mut svg);
        let text = svg.into_svg([100.0, 100.0], 1.0, "", "");
        assert!(text.contains("M0 80L50 70L50 0L0 60Z"), "{text}");
    }

    /// A band with steps keeps its width up to its last point, a band without steps narrows before.
    #[test]
    fn a_band_of_steps_occupies_the_page_up_to_its_last_point() {
        let area = Rect {
            x: 0.0,
            y: 0.0,
            width: 100.0,
            height: 100.0,
        };
        let [x, y] =
            [[0.0, 100.0], [100.0, 0.0]].map(|positions| Scale::new([0.0, 100.0], positions));
        let occupied = |has_steps: bool| {
            let band = Some(vec![[0.0, 40.0, 90.0], [100.0, 0.0, 0.0]]);
            Series {
                band,
                has_steps,
                ..Series::default()
            }
            .occupied_points(&Plot { area, x, y })
        };
        let occupies_the_end = |positions: Vec<[f64; 2]>| {
            positions
                .iter()
                .any(|[x, y]| (85.0..95.0).contains(x) && *y < 30.0)
        };
        assert!(occupies_the_end(occupied(true)) && !occupies_the_end(occupied(false)));
    }

    /// On logarithmic axes, a curve through (0, 5), (1, 10), (10, 0) and (100, 1000) is two dots.
    #[test]
    fn logarithmic_axes_leave_out_zero() {
        let series = Series {
            points: vec![[0.0, 5.0], [1.0, 10.0], [10.0, 0.0], [100.0, 1000.0]],
            band: Some(vec![[1.0, -1.0, 20.0], [100.0, 900.0, 1100.0]]),
            ..Series::default()
        };
        let curves = Curves {
            series: vec![series],
            x_logarithmic: true,
            y_logarithmic: true,
            ..Curves::default()
        };
        let drawable = curves.above_zero();
        let [first, gap, last] = drawable.series[0].points[..] else {
            panic!("{drawable:?}")
        };
        assert_eq!([first, last], [[1.0, 10.0], [100.0, 1000.0]]);
        assert!(gap[1].is_nan());
        assert_eq!(drawable.x_extent(), [1.0, 100.0]);
        let open = drawable.series[0].band.as_ref().unwrap()[0];
        assert_eq!(open, [1.0, f64::NEG_INFINITY, 20.0]);
        let mut svg = SvgWriter::default();
        let area = Rect {
            x: 0.0,
            y: 0.0,
            width: 300.0,
            height: 200.0,
        };
        curves.draw(&area, &mut svg);
        let text = svg.into_svg([300.0, 200.0], 1.0, "", "");
        assert!(text.matches("<circle").count() == 2 && !text.contains("NaN"));
        assert!(
            [">1<", ">10<", ">100<"]
                .iter()
                .all(|tick| text.contains(tick))
        );
        let below_zero = Curves {
            series: vec![Series {
                points: vec![[0.0, -5.0], [1.0, -3.0]],
                ..Series::default()
            }],
            y_logarithmic: true,
            ..Curves::default()
        };
        assert!(!below_zero.above_zero().y_logarithmic);
    }

    #[test]
    fn panels_have_common_axes() {
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
