//! Appearance of figures in papers, talks and on dark pages.

use super::color::{self, Color, dark};
use super::scale::log_position;

/// Appearance of a figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Theme {
    /// White page, small letters.
    #[default]
    Paper,
    /// White page, letters of one and a half times the size.
    Talk,
    /// Dark page: each color has its hue, and a lightness that is inverted.
    Dark,
}

/// Lightness (OKLab, 0 to 1) of a dark page.
const DARK_PAGE: f64 = 0.2;

/// Exponent of the inversion. Below 1, gray text stays light on dark pages.
const INVERSION: f64 = 0.75;

impl Theme {
    /// Size of letters relative to that in papers.
    pub(super) fn letters(self) -> f64 {
        match self {
            Self::Paper | Self::Dark => 1.0,
            Self::Talk => 1.5,
        }
    }

    /// The color that a page of this theme has in place of a color on white.
    #[must_use]
    pub fn color(self, on_white: Color) -> Color {
        match self {
            Self::Paper | Self::Talk => on_white,
            Self::Dark => {
                let [lightness, a, b] = oklab(on_white);
                let darkness = (1.0 - lightness).clamp(0.0, 1.0);
                let inverted = DARK_PAGE + (1.0 - DARK_PAGE) * darkness.powf(INVERSION);
                from_oklab([inverted, a, b])
            }
        }
    }

    /// The color of a count from 1 to `max_count`, on a logarithmic scale; the page for 0.
    pub(super) fn count_color(self, count: u32, max_count: u32) -> Color {
        if count == 0 {
            return self.color([255; 3]);
        }
        self.density_color(log_position(f64::from(count), max_count))
    }

    /// The color of a density from 0, which is near the page, to 1.
    pub(super) fn density_color(self, share: f64) -> Color {
        match self {
            Self::Paper | Self::Talk => color::density_color(share),
            Self::Dark => {
                let share = MIN_DENSITY + (1.0 - MIN_DENSITY) * share.clamp(0.0, 1.0);
                dark::density_color(share as f32)
            }
        }
    }

    /// The color of a difference from −1 (blue) over 0, which is the page, to 1 (orange).
    pub(super) fn difference_color(self, difference: f64) -> Color {
        match self {
            Self::Dark if difference != 0.0 => dark::diverging_color(difference as f32),
            Self::Paper | Self::Talk | Self::Dark => {
                self.color(color::difference_color(difference))
            }
        }
    }
}

/// Position on the dark color map of a single state, which must be seen on the page.
const MIN_DENSITY: f64 = 0.25;

/// Lightness and the two opponent colors of Ottosson's OKLab (2020), from sRGB.
fn oklab(color: Color) -> [f64; 3] {
    let [red, green, blue] = color.map(color::linear);
    let long = (0.412_221_470_8 * red + 0.536_332_536_3 * green + 0.051_445_992_9 * blue).cbrt();
    let medium = (0.211_903_498_2 * red + 0.680_699_545_1 * green + 0.107_396_956_6 * blue).cbrt();
    let short = (0.088_302_461_9 * red + 0.281_718_837_6 * green + 0.629_978_700_5 * blue).cbrt();
    [
        0.210_454_255_3 * long + 0.793_617_785_0 * medium - 0.004_072_046_8 * short,
        1.977_998_495_1 * long - 2.428_592_205_0 * medium + 0.450_593_709_9 * short,
        0.025_904_037_1 * long + 0.782_771_766_2 * medium - 0.808_675_766_0 * short,
    ]
}

/// The nearest color of sRGB, channel by channel.
fn from_oklab([lightness, a, b]: [f64; 3]) -> Color {
    let long = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let medium = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let short = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    let linear = [
        4.076_741_662_1 * long - 3.307_711_591_3 * medium + 0.230_969_929_2 * short,
        -1.268_438_004_6 * long + 2.609_757_401_1 * medium - 0.341_319_396_5 * short,
        -0.004_196_086_3 * long - 0.703_418_614_7 * medium + 1.707_614_701_0 * short,
    ];
    linear.map(|channel| {
        let channel = channel.clamp(0.0, 1.0);
        let share = if channel <= 0.003_130_8 {
            12.92 * channel
        } else {
            1.055 * channel.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * share).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::tests::contrast;
    use crate::color::{MUTED_COLOR, TEXT_COLOR, categorical_color, density_color};

    /// Red of sRGB in OKLab, as B. Ottosson prints it: 0.628, 0.2249, 0.1258.
    #[test]
    fn colors_have_their_coordinates_in_oklab() {
        let red = oklab([255, 0, 0]);
        let expected = [0.628, 0.2249, 0.1258];
        for (found, expected) in red.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-3, "{red:?}");
        }
        for color in [[255, 0, 0], [0, 0, 0], [255; 3], [12, 200, 99]] {
            assert_eq!(from_oklab(oklab(color)), color);
        }
    }

    /// 10 of 100 is half way on a logarithmic scale.
    #[test]
    fn colors_of_counts_are_logarithmic() {
        let paper = |count, max| Theme::Paper.count_color(count, max);
        assert_eq!(paper(0, 100), [255; 3]);
        assert_eq!(paper(10, 100), density_color(0.5));
        assert_eq!(paper(100, 100), density_color(1.0));
        assert_eq!(paper(1, 1), density_color(0.0));
    }

    /// On dark pages, more states are brighter, and one state is seen.
    #[test]
    fn densities_and_differences_stand_out_from_dark_pages() {
        let page = Theme::Dark.color([255; 3]);
        assert_eq!(Theme::Dark.count_color(0, 9), page);
        assert_eq!(Theme::Dark.difference_color(0.0), page);
        let [one, all] = [1, 9].map(|count| contrast(Theme::Dark.count_color(count, 9), page));
        assert!(one > 1.2 && all > 10.0, "{one} {all}");
    }

    #[test]
    fn dark_pages_are_dark_and_what_is_on_them_is_seen() {
        let page = Theme::Dark.color([255; 3]);
        assert!(page.iter().all(|&channel| channel < 40), "{page:?}");
        let seen = |color: Color| contrast(Theme::Dark.color(color), page);
        assert!(seen(TEXT_COLOR) > 9.0 && seen(MUTED_COLOR) > 4.5);
        for index in 0..8 {
            let contrast = seen(categorical_color(index));
            assert!(contrast > 2.0, "color {index}: {contrast}");
        }
        assert_eq!(Theme::Talk.color([12, 13, 14]), [12, 13, 14]);
    }
}
