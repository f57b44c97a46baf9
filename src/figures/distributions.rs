//! Example distributions of two quantities, each as parallel coordinates and as a scatter plot.
//!
//! They show how to read parallel coordinates (Inselberg, "The plane with parallel coordinates",
//! The Visual Computer 1, 1985): a point is a line, and points on a line cross at a common point.

use rand::RngExt;
use rand_distr::StandardNormal;
use seedbed_figure::color::sequential_color;
use seedbed_figure::{
    Axis, Color, Figure, Panel, ParallelCoordinates, Row, Scatter, ScatterPoint, StateLine, States,
};
use seedbed_random::{Purpose, Stream, stream};

/// A distribution of two quantities x and y, pure numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Independent standard normal x and y.
    Normal,
    /// Standard normal x and y with correlation 0.95.
    PositiveCorrelation,
    /// Standard normal x and y with correlation -0.95.
    NegativeCorrelation,
    /// Uniform in the square from -2 to 2.
    Square,
    /// Two normal clusters around (-1.5, -1.5) and (1.5, 1.5), standard deviation 0.35.
    Clusters,
    /// Uniform angle on a circle of radius 2, normal radius with standard deviation 0.1.
    Ring,
    /// Uniform x from -2 to 2, y = x² - 2 plus normal noise with standard deviation 0.1.
    Parabola,
}

/// Number of points of each distribution.
const POINTS: usize = 80;

/// Range of both axes. All points are within it.
const RANGE: [f32; 2] = [-3.0, 3.0];

/// Correlation of the correlated normal distributions, except for its sign.
const CORRELATION: f64 = 0.95;

/// Page width and row height in CSS pixels. The areas of scatter plots are squares, about.
const WIDTH: f64 = 760.0;
const ROW_HEIGHT: f64 = 204.0;

/// Number of distributions in a row.
const COLUMNS: usize = 2;

/// The figure of these distributions, or of all if there are none: two panels for each, with the
/// same points in the same colors. A color is that of the value of x.
#[must_use]
pub fn figure(distributions: &[Distribution]) -> Figure {
    let distributions = match distributions {
        [] => Distribution::ALL,
        _ => distributions,
    };
    Figure {
        title: "Distributions of two quantities as parallel coordinates and as scatter plots"
            .to_owned(),
        description: description(distributions),
        width: WIDTH,
        rows: distributions.chunks(COLUMNS).map(row).collect(),
    }
}

fn description(distributions: &[Distribution]) -> String {
    let names: Vec<&str> = distributions.iter().map(|it| it.name()).collect();
    format!(
        "{POINTS} points of each distribution ({}), on the left as lines across the axes x and y, on the right as \
         points, in colors from dark for small x to light for large x.",
        names.join(", ")
    )
}

fn row(distributions: &[Distribution]) -> Row {
    let mut panels: Vec<Panel> = distributions.iter().flat_map(|it| it.panels()).collect();
    panels.resize(2 * COLUMNS, Panel::Blank);
    Row {
        height: ROW_HEIGHT,
        panels,
        key: None,
    }
}

impl Distribution {
    /// All distributions.
    pub const ALL: &[Self] = &[
        Self::Normal,
        Self::PositiveCorrelation,
        Self::NegativeCorrelation,
        Self::Square,
        Self::Clusters,
        Self::Ring,
        Self::Parabola,
    ];

    /// Name in the figure.
    fn name(self) -> &'static str {
        match self {
            Self::Normal => "independent normal",
            Self::PositiveCorrelation => "positive correlation",
            Self::NegativeCorrelation => "negative correlation",
            Self::Square => "uniform square",
            Self::Clusters => "two clusters",
            Self::Ring => "ring",
            Self::Parabola => "parabola",
        }
    }

    /// `POINTS` points (x, y), the same in every figure.
    fn points(self) -> Vec<[f64; 2]> {
        let random = &mut stream(0, Purpose::ExamplePoints, self as u32, 0);
        (0..POINTS).map(|_| self.draw(random)).collect()
    }

    /// Draws a point (x, y).
    fn draw(self, random: &mut Stream) -> [f64; 2] {
        match self {
            Self::Normal => [normal(random), normal(random)],
            Self::PositiveCorrelation => correlated(CORRELATION, random),
            Self::NegativeCorrelation => correlated(-CORRELATION, random),
            Self::Square => [
                random.random_range(-2.0..2.0),
                random.random_range(-2.0..2.0),
            ],
            Self::Clusters => {
                let center = if random.random() { 1.5 } else { -1.5 };
                [0; 2].map(|_| center + 0.35 * normal(random))
            }
            Self::Ring => {
                let angle = random.random_range(0.0..std::f64::consts::TAU);
                let radius = 2.0 + 0.1 * normal(random);
                [radius * libm::cos(angle), radius * libm::sin(angle)]
            }
            Self::Parabola => {
                let x: f64 = random.random_range(-2.0..2.0);
                [x, x * x - 2.0 + 0.1 * normal(random)]
            }
        }
    }

    /// Parallel coordinates and scatter plot of the same points.
    fn panels(self) -> [Panel; 2] {
        let points = self.points().into_iter();
        let points: Vec<ScatterPoint> = points
            .map(|point| ScatterPoint {
                position: point.map(|value| value as f32),
                color: color(point[0]),
            })
            .collect();
        let lines = points.iter().map(|point| StateLine {
            axis_positions: point.position.map(axis_position).to_vec(),
            color: point.color,
        });
        let parallel_coordinates = ParallelCoordinates {
            title: self.name().to_owned(),
            axes: vec![axis("x"), axis("y")],
            states: States::Lines(lines.collect()),
        };
        let scatter = Scatter {
            title: String::new(),
            x: axis("x"),
            y: axis("y"),
            points,
            lines: Vec::new(),
        };
        [
            Panel::ParallelCoordinates(parallel_coordinates),
            Panel::Scatter(scatter),
        ]
    }
}

fn normal(random: &mut Stream) -> f64 {
    random.sample(StandardNormal)
}

/// Standard normal x, and y = ρ x + √(1 − ρ²) ε with standard normal ε, whose correlation is ρ.
fn correlated(correlation: f64, random: &mut Stream) -> [f64; 2] {
    let x = normal(random);
    let rest = (1.0 - correlation * correlation).sqrt();
    [x, correlation * x + rest * normal(random)]
}

fn axis(name: &str) -> Axis {
    Axis {
        outside: [0.0; 2],
        nan: 0.0,
        name: name.to_owned(),
        unit: String::new(),
        range: RANGE,
    }
}

/// Position on an axis, from 0 to 1.
fn axis_position(value: f32) -> f32 {
    let [low, high] = RANGE;
    ((value - low) / (high - low)).clamp(0.0, 1.0)
}

/// The color of a point, from x = −2.5 to 2.5.
fn color(x: f64) -> Color {
    sequential_color((x + 2.5) / 5.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of a function of 20,000 points.
    fn mean(distribution: Distribution, function: impl Fn(f64, f64) -> f64) -> f64 {
        const COUNT: u32 = 20_000;
        let random = &mut stream(1, Purpose::ExamplePoints, 0, 0);
        let values = (0..COUNT).map(|_| {
            let [x, y] = distribution.draw(random);
            function(x, y)
        });
        values.sum::<f64>() / f64::from(COUNT)
    }

    /// Means of a function against its expectation, within 5 standard errors of the mean, which are
    /// 5 d / √20,000 = 0.0354 d with d the standard deviation of the function.
    #[test]
    fn distributions_have_their_moments() {
        use Distribution::*;
        type Function = fn(f64, f64) -> f64;
        let x_square: Function = |x, _| x * x;
        let product: Function = |x, y| x * y;
        let radius: Function = |x, y| x.hypot(y);
        for (distribution, function, expected, deviation) in [
            (Normal, x_square, 1.0, 2_f64.sqrt()),
            (Normal, product, 0.0, 1.0),
            // Var(x y) = 1 + ρ².
            (PositiveCorrelation, product, 0.95, 1.38),
            (NegativeCorrelation, product, -0.95, 1.38),
            // E x² = 4/3; Var x² = 16/5 − 16/9.
            (Square, x_square, 4.0 / 3.0, 1.193),
            (Square, product, 0.0, 4.0 / 3.0),
            // E x² = 1.5² + 0.35²; E x y = 1.5²; Var x² = 4 · 1.5² · 0.35² + 2 · 0.35⁴.
            (Clusters, x_square, 2.3725, 1.07),
            (Clusters, product, 2.25, 0.753),
            (Ring, radius, 2.0, 0.1),
            (Ring, product, 0.0, 2_f64.sqrt()),
            (Parabola, |x, y| y - x * x, -2.0, 0.1),
            (Parabola, x_square, 4.0 / 3.0, 1.193),
        ] {
            let error = (mean(distribution, function) - expected).abs();
            assert!(
                error < 0.0354 * deviation,
                "{distribution:?}: {error} from {expected}"
            );
        }
    }

    #[test]
    fn all_points_are_within_the_axes() {
        let ends = RANGE.map(f64::from);
        for distribution in Distribution::ALL {
            let points = distribution.points();
            assert_eq!(points.len(), POINTS);
            let is_within = |value: &f64| (ends[0]..=ends[1]).contains(value);
            assert!(points.iter().flatten().all(is_within), "{distribution:?}");
        }
    }

    /// Panels of the same points: the line of (x, y) begins at (x + 3) / 6 and ends at (y + 3) / 6.
    #[test]
    fn both_panels_show_the_same_points() {
        let [Panel::ParallelCoordinates(left), Panel::Scatter(right)] = Distribution::Ring.panels()
        else {
            panic!("expected parallel coordinates and a scatter plot");
        };
        let States::Lines(lines) = left.states else {
            panic!("expected lines");
        };
        assert_eq!(lines.len(), right.points.len());
        for (line, point) in lines.iter().zip(&right.points) {
            assert_eq!(
                line.axis_positions,
                point.position.map(|it| (it + 3.0) / 6.0)
            );
            assert_eq!(line.color, point.color);
        }
    }

    #[test]
    fn the_figure_has_two_panels_for_each_distribution() {
        let panels = |distributions: &[Distribution]| -> Vec<usize> {
            let rows = figure(distributions).rows.into_iter();
            rows.map(|row| row.panels.iter().filter(|it| **it != Panel::Blank).count())
                .collect()
        };
        assert_eq!(panels(&[]), [4, 4, 4, 2]);
        assert_eq!(panels(&[Distribution::Ring]), [2]);
    }
}
