//! Colours on a white page, told apart with any colour vision.

use super::key::position;

/// Red, green, blue.
pub type Color = [u8; 3];

/// Lettering.
pub(super) const INK: Color = [35, 35, 40];
/// Lettering of less weight.
pub(super) const GREY: Color = [95, 95, 105];
/// Axes.
pub(super) const AXIS: Color = [130, 130, 140];
/// Lines that lead the eye.
pub(super) const GRID: Color = [230, 230, 235];

/// The colour of an agent on white: the hue that it has on dark ground, dark enough to be read. After 8 agents lighter, then darker tints.
#[must_use]
pub fn agent_color(agent: u32) -> Color {
    let base = BASE[agent as usize % BASE.len()];
    match (agent as usize / BASE.len()) % 3 {
        0 => base,
        1 => base.map(|channel| channel / 3 * 2 + 80),
        _ => base.map(|channel| channel / 5 * 3),
    }
}

/// After Okabe and Ito, "Color Universal Design"; yellow is darkened for white ground, and grey stands for black.
const BASE: [Color; 8] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [196, 174, 0],
    [0, 98, 178],
    [213, 94, 0],
    [204, 121, 167],
    [120, 120, 120],
];

/// A perceptual map for something that runs from low to high: dark violet to light green.   `share`: 0 to 1
#[must_use]
pub fn gradual(share: f64) -> Color {
    // The lightest end would not be seen on white.
    between(&VIRIDIS, 0.9 * share.clamp(0.0, 1.0))
}

/// A perceptual map for counts on a logarithmic scale: pale for one, dark for the most, white for none.   `count` of at most `most`
#[must_use]
pub fn of_count(count: u32, most: u32) -> Color {
    if count == 0 {
        [255; 3]
    } else {
        dense(position(f64::from(count), most))
    }
}

/// Pale at 0, dark at 1.
pub(super) fn dense(share: f64) -> Color {
    between(&MAGMA, 0.95 * (1.0 - share.clamp(0.0, 1.0)))
}

/// By S. van der Walt and N. Smith (matplotlib): nine stops of each map, equally far apart.
const VIRIDIS: [Color; 9] = [
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
const MAGMA: [Color; 9] = [
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

fn between(stops: &[Color; 9], share: f64) -> Color {
    let place = share * 8.0;
    let lower = (place as usize).min(7);
    let part = place - lower as f64;
    let mix = |channel: usize| {
        let [low, high] = [stops[lower][channel], stops[lower + 1][channel]].map(f64::from);
        (low + part * (high - low)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance, roughly.
    fn luminance([red, green, blue]: Color) -> f64 {
        0.2126 * f64::from(red) + 0.7152 * f64::from(green) + 0.0722 * f64::from(blue)
    }

    #[test]
    fn agents_differ_and_are_seen_on_white() {
        let mut colors: Vec<Color> = (0..24).map(agent_color).collect();
        assert!(
            colors.iter().all(|&color| luminance(color) < 200.0),
            "{colors:?}"
        );
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), 24);
        assert_eq!(agent_color(24), agent_color(0));
    }

    #[test]
    fn maps_go_one_way() {
        let shares = || (0..=100).map(|percent| f64::from(percent) / 100.0);
        let lights: Vec<f64> = shares().map(|share| luminance(gradual(share))).collect();
        assert!(lights.is_sorted(), "{lights:?}");
        let darks: Vec<f64> = shares().map(|share| -luminance(dense(share))).collect();
        assert!(darks.is_sorted(), "{darks:?}");
    }

    /// 10 of 100 is half way on a logarithmic scale.
    #[test]
    fn counts_are_logarithmic() {
        assert_eq!(of_count(0, 100), [255; 3]);
        assert_eq!(of_count(10, 100), dense(0.5));
        assert_eq!(of_count(100, 100), dense(1.0));
        assert_eq!(of_count(1, 1), dense(0.0));
    }
}
