//! The colors of the page: those of figures on light pages, and those of recordings on dark ones.

use serde::Serialize;

use seedbed_figure::Color;
use seedbed_figure::color::{self, dark};

/// Colors of both themes.
#[derive(Debug, Serialize)]
pub(super) struct Palette {
    light: Theme,
    dark: Theme,
}

/// Colors of one theme. Scales are evenly spaced colors from the lowest to the highest value.
#[derive(Debug, Serialize)]
struct Theme {
    page: Color,
    text: Color,
    tick: Color,
    axis: Color,
    muted: Color,
    warning: Color,
    brush: Color,
    categorical: Vec<Color>,
    sequential: Vec<Color>,
    density: Vec<Color>,
    /// From −1 to 1.
    difference: Vec<Color>,
}

/// Number of colors of a scale.
const STOPS: u8 = 17;

impl Default for Palette {
    fn default() -> Self {
        Self {
            light: Theme {
                page: [255; 3],
                text: color::TEXT_COLOR,
                tick: color::MUTED_COLOR,
                axis: [130, 130, 140],
                muted: [140, 140, 150],
                warning: [176, 58, 0],
                brush: [0, 98, 178],
                categorical: (0..color::AGENT_COLORS)
                    .map(color::categorical_color)
                    .collect(),
                sequential: scale(color::sequential_color),
                density: scale(color::density_color),
                difference: scale(|share| color::difference_color(2.0 * share - 1.0)),
            },
            dark: Theme {
                page: [22, 22, 26],
                text: [232, 232, 236],
                tick: [165, 165, 176],
                axis: [125, 125, 135],
                muted: [120, 120, 130],
                warning: [255, 160, 90],
                brush: [86, 180, 233],
                categorical: (0..color::AGENT_COLORS)
                    .map(dark::categorical_color)
                    .collect(),
                sequential: scale(|share| dark::sequential_color(share as f32)),
                density: scale(|share| dark::density_color(0.15 + 0.85 * share as f32)),
                difference: scale(|share| dark::diverging_color(2.0 * share as f32 - 1.0)),
            },
        }
    }
}

fn scale(color: impl Fn(f64) -> Color) -> Vec<Color> {
    let last = STOPS - 1;
    let shares = (0..=last).map(|stop| f64::from(stop) / f64::from(last));
    shares.map(color).collect()
}
