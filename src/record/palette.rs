//! One colour for each agent, the same in every picture of the workbench, and colour maps for numbers.
//!
//! Equal steps of a colour map look equally large, to people with any colour vision.

use std::sync::LazyLock;

use colorous::{Gradient, INFERNO, VIRIDIS};

/// The colour of an agent, told apart by people with any colour vision as far as 8 colours allow; agents 8–15 wear lighter
/// and agents 16–23 darker tints of the same, then they repeat.
#[must_use]
pub fn agent_color(agent: u32) -> [u8; 3] {
    let base = BASE[agent as usize % BASE.len()];
    match (agent as usize / BASE.len()) % 3 {
        0 => base,
        1 => base.map(|channel| channel / 2 + 127),
        _ => base.map(|channel| (u16::from(channel) * 3 / 5) as u8),
    }
}

/// After Okabe and Ito, "Color Universal Design"; black is left out and blue raised, for dark backgrounds.
const BASE: [[u8; 3]; 8] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 170, 125],
    [240, 228, 66],
    [90, 120, 235],
    [225, 95, 20],
    [214, 130, 180],
    [170, 170, 170],
];

/// The colours of what was cut off at its time limit, and of what came to an end of its own.
pub const OUTCOMES: [[u8; 3]; 2] = [[86, 180, 233], [225, 95, 20]];

/// The colour of a number from 0, dark, to 1, bright: Viridis, without its darkest tenth, which is lost on a dark background.
#[must_use]
pub fn sequential(share: f32) -> [u8; 3] {
    SEQUENTIAL[level(share)]
}

/// The colour of a number from 0, black, to 1, bright: Inferno, as the viewer draws densities.
#[must_use]
pub fn glow(share: f32) -> [u8; 3] {
    GLOW[level(share)]
}

/// The colour of a difference from −1, blue, over 0, black, to 1, orange.
#[must_use]
pub fn diverging(difference: f32) -> [u8; 3] {
    let [half, end] = if difference < 0.0 {
        [[30, 110, 220], [150, 205, 255]]
    } else {
        [[215, 95, 10], [255, 200, 120]]
    };
    let share = 2.0 * difference.abs().min(1.0);
    if share < 1.0 {
        mixed([0, 0, 4], half, share)
    } else {
        mixed(half, end, share - 1.0)
    }
}

fn mixed(one: [u8; 3], other: [u8; 3], share: f32) -> [u8; 3] {
    std::array::from_fn(|channel| {
        (f32::from(one[channel]) * (1.0 - share) + f32::from(other[channel]) * share).round() as u8
    })
}

fn level(share: f32) -> usize {
    (share.clamp(0.0, 1.0) * 255.0).round() as usize
}

type Colors = LazyLock<[[u8; 3]; 256]>;

static SEQUENTIAL: Colors = LazyLock::new(|| colors(VIRIDIS, 0.1));
static GLOW: Colors = LazyLock::new(|| colors(INFERNO, 0.0));

/// Some gradient's colours between `from` and its end.
fn colors(gradient: Gradient, from: f64) -> [[u8; 3]; 256] {
    std::array::from_fn(|level| {
        gradient
            .eval_continuous(from + (1.0 - from) * level as f64 / 255.0)
            .as_array()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_four_agents_have_twenty_four_colors() {
        let mut colors: Vec<_> = (0..24).map(agent_color).collect();
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), 24);
    }

    #[test]
    fn tints_are_lighter_then_darker() {
        assert_eq!(agent_color(0), [230, 159, 0]);
        assert_eq!(agent_color(8), [242, 206, 127]);
        assert_eq!(agent_color(16), [138, 95, 0]);
        assert_eq!(agent_color(24), agent_color(0));
    }

    /// Perceived lightness, 0 to 1, after ITU-R BT.709 without gamma.
    fn lightness([red, green, blue]: [u8; 3]) -> f32 {
        (0.2126 * f32::from(red) + 0.7152 * f32::from(green) + 0.0722 * f32::from(blue)) / 255.0
    }

    /// The ends of matplotlib's maps: Viridis ends with (253, 231, 37), Inferno begins with (0, 0, 4).
    #[test]
    fn maps_grow_brighter_throughout() {
        let share = |step: u8| f32::from(step) / 50.0;
        let blue = |share: f32| diverging(-share);
        for map in [sequential, glow, diverging, blue] {
            assert!(
                (0..50).all(|step| lightness(map(share(step))) < lightness(map(share(step + 1))))
            );
        }
        let near = |one: [u8; 3], other: [u8; 3]| {
            one.iter()
                .zip(other)
                .all(|(one, other)| one.abs_diff(other) < 6)
        };
        assert!(
            near(sequential(1.0), [253, 231, 37]) && near(glow(0.0), [0, 0, 4]),
            "{:?} {:?}",
            sequential(1.0),
            glow(0.0)
        );
        assert_eq!(diverging(0.0), [0, 0, 4]);
    }
}
