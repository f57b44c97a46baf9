//! Colors that people with any color vision can distinguish. This module has colors for white
//! pages, [`dark`] has colors for dark screens.
//!
//! Series with the same index have similar hues on both backgrounds.

pub mod dark;
#[cfg(test)]
mod vision;

/// Red, green and blue.
pub type Color = [u8; 3];

/// Color of text.
pub const TEXT_COLOR: Color = [35, 35, 40];
/// Color of less important text.
pub const MUTED_COLOR: Color = [95, 95, 105];
/// Color of curves of the whole team, on white.
pub const TEAM_COLOR: Color = [35, 35, 40];
/// Color of axes.
pub(super) const AXIS_COLOR: Color = [130, 130, 140];
/// Color of grid lines.
pub(super) const GRID_COLOR: Color = [230, 230, 235];

/// Number of agents with a color of their own. More colors could not be told apart.
pub const AGENT_COLORS: u32 = 8;

/// The color of an agent on white: one of eight, or gray for all further agents.
#[must_use]
pub fn agent_color(agent: u32) -> Color {
    if agent < AGENT_COLORS {
        categorical_color(agent)
    } else {
        OTHERS_COLOR
    }
}

/// Color of agents without a color of their own, on white.
pub const OTHERS_COLOR: Color = [165, 165, 172];

/// The color of the series with this index on white. There are eight colors; indices 8–15 have
/// darker and indices 16–23 grayer variants, and then colors repeat.
#[must_use]
pub fn categorical_color(index: u32) -> Color {
    let hue = HUES[index as usize % HUES.len()];
    match (index as usize / HUES.len()) % 3 {
        0 => hue,
        1 => hue.map(|channel| channel / 5 * 3),
        _ => hue.map(|channel| channel / 2 + 50),
    }
}

/// The color of a curve or a dot of its own, by its number: the colors of [`categorical_color`], first those that are easily seen
/// on white, in an order in which the first ones differ most.
#[must_use]
pub fn series_color(number: usize) -> Color {
    const ORDER: [u32; HUES.len()] = [1, 0, 2, 3, 5, 4, 6, 7];
    categorical_color(ORDER[number % HUES.len()] + (number / HUES.len() * HUES.len()) as u32)
}

/// The difference of any two of these colors is at least 20 (CIEDE2000), with normal vision and with
/// each of the three kinds of color blindness; so is their difference from [`TEAM_COLOR`] with normal
/// vision. Found by a random search.
const HUES: [Color; 8] = [
    [161, 121, 7],
    [44, 61, 119],
    [35, 129, 119],
    [146, 82, 250],
    [230, 182, 175],
    [91, 67, 25],
    [170, 184, 235],
    [35, 252, 22],
];

/// The color of a value on white, from 0 (dark violet) to 1 (light green): Viridis without its
/// lightest tenth, which is hard to see on white.
#[must_use]
pub fn sequential_color(share: f64) -> Color {
    interpolate(&VIRIDIS, 0.9 * share.clamp(0.0, 1.0))
}

/// The color of a density on white, from 0 (pale) to 1 (dark): Magma, reversed.
#[must_use]
pub fn density_color(share: f64) -> Color {
    interpolate(&MAGMA, 0.95 * (1.0 - share.clamp(0.0, 1.0)))
}

/// The color of a difference on white, from −1 (blue) over 0 (white) to 1 (orange).
#[must_use]
pub fn difference_color(difference: f64) -> Color {
    const ENDS: [[Color; 2]; 2] = [
        [[120, 170, 225], [0, 75, 160]],
        [[240, 160, 80], [190, 80, 0]],
    ];
    let [middle, end] = ENDS[usize::from(difference > 0.0)];
    let share = 2.0 * difference.abs().min(1.0);
    if share < 1.0 {
        mix([255; 3], middle, share)
    } else {
        mix(middle, end, share - 1.0)
    }
}

/// The amount of light, 0 to 1, of a channel of sRGB.
pub(super) fn linear(channel: u8) -> f64 {
    let share = f64::from(channel) / 255.0;
    if share <= 0.04045 {
        share / 12.92
    } else {
        ((share + 0.055) / 1.055).powf(2.4)
    }
}

fn mix(one: Color, other: Color, share: f64) -> Color {
    let channel = |index: usize| {
        let [from, to] = [one[index], other[index]].map(f64::from);
        (from + share * (to - from)).round() as u8
    };
    [0, 1, 2].map(channel)
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
    mix(stops[lower], stops[lower + 1], fraction)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Contrast of WCAG 2.1: (L + 0.05) / (l + 0.05) with the relative luminances of the lighter and the darker color.
    pub(in super::super) fn contrast(one: Color, other: Color) -> f64 {
        let luminance = |color: Color| {
            let [red, green, blue] = color.map(linear);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        let [one, other] = [one, other].map(luminance);
        (one.max(other) + 0.05) / (one.min(other) + 0.05)
    }

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

    /// Pairs of agents can be distinguished with any color vision, on white and on dark screens, and
    /// from the team.
    #[test]
    fn agents_have_different_colors_with_any_color_vision() {
        for (color, team) in [
            (categorical_color as fn(u32) -> Color, TEAM_COLOR),
            (dark::categorical_color, dark::TEAM_COLOR),
        ] {
            let colors: Vec<Color> = (0..8).map(color).collect();
            let pairs = || (0..8).flat_map(|one| (0..one).map(move |other| (one, other)));
            for vision in vision::VISIONS {
                let seen: Vec<_> = colors.iter().map(|color| vision.lab(*color)).collect();
                for (one, other) in pairs() {
                    let difference = vision::ciede2000(seen[one], seen[other]);
                    assert!(
                        difference >= 20.0,
                        "{vision:?}: {one}, {other}: {difference:.1}"
                    );
                }
            }
            let normal = vision::Vision::Normal;
            let from_team = |color: &Color| vision::ciede2000(normal.lab(*color), normal.lab(team));
            let nearest = colors.iter().map(from_team).fold(f64::INFINITY, f64::min);
            assert!(nearest >= 19.5, "{nearest:.1} from the team");
        }
    }

    /// Graphics need a contrast of 3.
    #[test]
    fn the_first_series_are_easily_seen_on_white() {
        for number in 0..5 {
            let contrast = contrast(series_color(number), [255; 3]);
            assert!(contrast > 3.0, "series {number}: {contrast}");
        }
        let mut all: Vec<Color> = (0..24).map(series_color).collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 24);
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

    #[test]
    fn differences_are_white_in_the_middle() {
        let colors = [-1.0, -0.5, 0.0, 0.5, 2.0].map(difference_color);
        let expected = [
            [0, 75, 160],
            [120, 170, 225],
            [255; 3],
            [240, 160, 80],
            [190, 80, 0],
        ];
        assert_eq!(colors, expected);
    }
}
