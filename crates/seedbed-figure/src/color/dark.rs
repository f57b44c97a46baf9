//! Colors for dark screens.

use std::sync::LazyLock;

use colorous::{Gradient, INFERNO, VIRIDIS};

use super::Color;

/// The color of an agent on a dark background: one of eight, or gray for all further agents.
#[must_use]
pub fn agent_color(agent: u32) -> Color {
    if agent < super::AGENT_COLORS {
        categorical_color(agent)
    } else {
        OTHERS_COLOR
    }
}

/// Color of agents without a color of their own.
pub const OTHERS_COLOR: Color = [105, 105, 112];

/// The color of the series with this index on a dark background. There are eight hues; indices 8–15
/// have lighter tints and indices 16–23 darker tints of the same hues, and then colors repeat.
#[must_use]
pub fn categorical_color(index: u32) -> Color {
    let hue = HUES[index as usize % HUES.len()];
    match (index as usize / HUES.len()) % 3 {
        0 => hue,
        1 => hue.map(|channel| channel / 2 + 127),
        _ => hue.map(|channel| (u16::from(channel) * 3 / 5) as u8),
    }
}

/// The colors of [`super::HUES`], changed so that they are visible on dark and on white screens.
const HUES: [Color; 8] = [
    [139, 133, 31],
    [67, 69, 126],
    [44, 129, 119],
    [143, 85, 255],
    [229, 181, 176],
    [101, 71, 29],
    [192, 183, 235],
    [0, 238, 0],
];

/// Color of curves of the whole team, which is visible on dark and on white screens.
pub const TEAM_COLOR: Color = [145, 145, 145];

/// The color of a value from 0 (dark) to 1 (bright): Viridis without its darkest tenth, which is
/// hard to see on black.
#[must_use]
pub fn sequential_color(share: f32) -> Color {
    static COLOR_MAP: ColorMap = LazyLock::new(|| color_map(VIRIDIS, 0.1));
    COLOR_MAP[index_in_map(share)]
}

/// The color of a density from 0 (black) to 1 (bright): Inferno.
#[must_use]
pub fn density_color(share: f32) -> Color {
    static COLOR_MAP: ColorMap = LazyLock::new(|| color_map(INFERNO, 0.0));
    COLOR_MAP[index_in_map(share)]
}

/// The color of a difference between −1 (blue) and 1 (orange); 0 is black.
#[must_use]
pub fn diverging_color(difference: f32) -> Color {
    let [middle_color, end_color] = if difference < 0.0 {
        [[30, 110, 220], [150, 205, 255]]
    } else {
        [[215, 95, 10], [255, 200, 120]]
    };
    let share = 2.0 * difference.abs().min(1.0);
    if share < 1.0 {
        interpolate([0, 0, 4], middle_color, share)
    } else {
        interpolate(middle_color, end_color, share - 1.0)
    }
}

fn interpolate(one: Color, other: Color, share: f32) -> Color {
    std::array::from_fn(|channel| {
        (f32::from(one[channel]) * (1.0 - share) + f32::from(other[channel]) * share).round() as u8
    })
}

fn index_in_map(share: f32) -> usize {
    (share.clamp(0.0, 1.0) * 255.0).round() as usize
}

type ColorMap = LazyLock<[Color; 256]>;

/// 256 colors of a gradient, from the position `start` (0 to 1) to its end.
fn color_map(gradient: Gradient, start: f64) -> [Color; 256] {
    std::array::from_fn(|index_in_map| {
        gradient
            .eval_continuous(start + (1.0 - start) * index_in_map as f64 / 255.0)
            .as_array()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_24_categorical_colors_differ() {
        let mut colors: Vec<_> = (0..24).map(categorical_color).collect();
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), 24);
    }

    #[test]
    fn tints_are_lighter_then_darker() {
        assert_eq!(categorical_color(0), [139, 133, 31]);
        assert_eq!(categorical_color(8), [196, 193, 142]);
        assert_eq!(categorical_color(16), [83, 79, 18]);
        assert_eq!(categorical_color(24), categorical_color(0));
    }

    /// Perceived lightness, 0 to 1, after ITU-R BT.709 without gamma.
    fn lightness([red, green, blue]: Color) -> f32 {
        (0.2126 * f32::from(red) + 0.7152 * f32::from(green) + 0.0722 * f32::from(blue)) / 255.0
    }

    /// Viridis ends with (253, 231, 37), Inferno begins with (0, 0, 4).
    #[test]
    fn color_maps_become_brighter_monotonically() {
        let share = |step: u8| f32::from(step) / 50.0;
        let blue = |share: f32| diverging_color(-share);
        for map in [sequential_color, density_color, diverging_color, blue] {
            assert!(
                (0..50).all(|step| lightness(map(share(step))) < lightness(map(share(step + 1))))
            );
        }
        let is_close = |one: Color, other: Color| {
            one.iter()
                .zip(other)
                .all(|(one, other)| one.abs_diff(other) < 6)
        };
        assert!(
            is_close(sequential_color(1.0), [253, 231, 37])
                && is_close(density_color(0.0), [0, 0, 4]),
            "{:?} {:?}",
            sequential_color(1.0),
            density_color(0.0)
        );
        assert_eq!(diverging_color(0.0), [0, 0, 4]);
    }
}
