//! Colors that people with any color vision can distinguish. This module has colors for white
//! pages, [`dark`] has colors for dark screens.
//!
//! Series with the same index have similar hues on both backgrounds.

use super::key::log_position;

pub mod dark;

/// Red, green and blue.
pub type Color = [u8; 3];

/// Color of text.
pub const TEXT_COLOR: Color = [35, 35, 40];
/// Color of less important text.
pub const MUTED_COLOR: Color = [95, 95, 105];
/// Color of axes.
pub(super) const AXIS_COLOR: Color = [130, 130, 140];
/// Color of grid lines.
pub(super) const GRID_COLOR: Color = [230, 230, 235];

/// The color of the series with this index on white. There are eight hues; indices 8–15 have
/// lighter tints and indices 16–23 darker tints of the same hues, and then colors repeat.
#[must_use]
pub fn categorical_color(index: u32) -> Color {
    let hue = HUES[index as usize % HUES.len()];
    match (index as usize / HUES.len()) % 3 {
        0 => hue,
        1 => hue.map(|channel| channel / 3 * 2 + 80),
        _ => hue.map(|channel| channel / 5 * 3),
    }
}

/// After Okabe and Ito, "Color Universal Design"; yellow is darker, to be visible on white, and
/// gray replaces black.
const HUES: [Color; 8] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [196, 174, 0],
    [0, 98, 178],
    [213, 94, 0],
    [204, 121, 167],
    [120, 120, 120],
];

/// The color of a value on white, from 0 (dark violet) to 1 (light green): Viridis without its
/// lightest tenth, which is hard to see on white.
#[must_use]
pub fn sequential_color(share: f64) -> Color {
    interpolate(&VIRIDIS, 0.9 * share.clamp(0.0, 1.0))
}

/// The color of a count on white, on a logarithmic scale: white for 0, pale for 1, dark for
/// `max_count` or more.
#[must_use]
pub fn count_color(count: u32, max_count: u32) -> Color {
    if count == 0 {
        [255; 3]
    } else {
        density_color(log_position(f64::from(count), max_count))
    }
}

/// The color of a density on white, from 0 (pale) to 1 (dark): Magma, reversed.
#[must_use]
pub fn density_color(share: f64) -> Color {
    interpolate(&MAGMA, 0.95 * (1.0 - share.clamp(0.0, 1.0)))
}

/// Nine equidistant colors of a color map by S. van der Walt and N. Smith (matplotlib). Dark
/// screens use the maps of `colorous`, which are smoothed and differ from these colors by up to two
/// levels. They are not used here, because published figures would change.
type Stops = [Color; 9];

const VIRIDIS: Stops = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];
const MAGMA: Stops = [
    [0, 0, 4],
    [28, 16, 68],
    [79, 18, 123],
    [129, 37, 129],
    [181, 54, 122],
    [229, 80, 100],
    [251, 135, 97],
    [254, 194, 135],
    [252, 253, 191],
];

fn interpolate(stops: &Stops, share: f64) -> Color {
    let position = share * 8.0;
    let lower = (position as usize).min(7);
    let fraction = position - lower as f64;
    let mix = |channel: usize| {
        let [low, high] = [stops[lower][channel], stops[lower + 1][channel]].map(f64::from);
        (low + fraction * (high - low)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance, approximately.
    fn luminance([red, green, blue]: Color) -> f64 {
        0.2126 * f64::from(red) + 0.7152 * f64::from(green) + 0.0722 * f64::from(blue)
    }

    #[test]
    fn categorical_colors_differ_and_are_visible_on_white() {
        let mut colors: Vec<Color> = (0..24).map(categorical_color).collect();
        assert!(
            colors.iter().all(|&color| luminance(color) < 200.0),
            "{colors:?}"
        );
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), 24);
        assert_eq!(categorical_color(24), categorical_color(0));
    }

    #[test]
    fn color_maps_are_monotonic_in_luminance() {
        let shares = || (0..=100).map(|percent| f64::from(percent) / 100.0);
        let rising: Vec<f64> = shares()
            .map(|share| luminance(sequential_color(share)))
            .collect();
        assert!(rising.is_sorted(), "{rising:?}");
        let falling: Vec<f64> = shares()
            .map(|share| -luminance(density_color(share)))
            .collect();
        assert!(falling.is_sorted(), "{falling:?}");
    }

    /// 10 of 100 is half way on a logarithmic scale.
    #[test]
    fn count_colors_are_logarithmic() {
        assert_eq!(count_color(0, 100), [255; 3]);
        assert_eq!(count_color(10, 100), density_color(0.5));
        assert_eq!(count_color(100, 100), density_color(1.0));
        assert_eq!(count_color(1, 1), density_color(0.0));
    }
}
