//! The lettering: Roboto, two weights of it cut down to Latin, Greek and signs of mathematics.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};

/// What an SVG asks for; where there is no Roboto, the next has letters of much the same width.
pub(super) const FAMILY: &str = "Roboto, Helvetica, Arial, sans-serif";

pub(super) const REGULAR: &[u8] = include_bytes!("fonts/Roboto-Regular.ttf");
pub(super) const MEDIUM: &[u8] = include_bytes!("fonts/Roboto-Medium.ttf");

/// How heavy letters are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Weight {
    Regular,
    Medium,
}

impl Weight {
    pub(super) fn number(self) -> u16 {
        match self {
            Self::Regular => 400,
            Self::Medium => 500,
        }
    }

    fn data(self) -> &'static [u8] {
        match self {
            Self::Regular => REGULAR,
            Self::Medium => MEDIUM,
        }
    }
}

/// CSS that brings the lettering along, for pages with figures in them: what was fitted to these letters fits.
#[must_use]
pub fn font_faces() -> String {
    let face = |weight: Weight| {
        let (number, data) = (weight.number(), BASE64_STANDARD.encode(weight.data()));
        format!(
            "@font-face{{font-family:Roboto;font-weight:{number};src:url(data:font/ttf;base64,{data})}}\n"
        )
    };
    [Weight::Regular, Weight::Medium].map(face).concat()
}

/// How wide a text is, in the unit of `size`. Letters that the font lacks count as half a square.
pub(super) fn width(text: &str, size: f64, weight: Weight) -> f64 {
    let font = FontRef::new(weight.data()).expect("the font came with the program");
    let (letters, advances) = (
        font.charmap(),
        font.glyph_metrics(Size::unscaled(), LocationRef::default()),
    );
    let unit = size
        / f64::from(
            font.metrics(Size::unscaled(), LocationRef::default())
                .units_per_em,
        );
    let advance = |letter: char| {
        letters
            .map(letter)
            .and_then(|glyph| advances.advance_width(glyph))
    };
    text.chars()
        .map(|letter| advance(letter).map_or(0.5 * size, |width| f64::from(width) * unit))
        .sum()
}

/// `text`, shortened to `room`.
pub(super) fn fitted(text: &str, room: f64, size: f64, weight: Weight) -> String {
    if width(text, size, weight) <= room {
        return text.to_owned();
    }
    let letters: Vec<char> = text.chars().collect();
    let shortened = |count: usize| {
        letters[..count]
            .iter()
            .collect::<String>()
            .trim_end()
            .to_owned()
            + "…"
    };
    let fits = |count: &usize| width(&shortened(*count), size, weight) <= room;
    (1..letters.len())
        .rev()
        .find(fits)
        .map(shortened)
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A digit of Roboto is 1151 of 2048 units wide.
    #[test]
    fn digits_have_their_width() {
        assert!((width("00", 20.48, Weight::Regular) - 23.02).abs() < 1e-9);
        assert_eq!(width("", 12.0, Weight::Regular), 0.0);
    }

    #[test]
    fn long_words_are_shortened() {
        assert_eq!(fitted("angle", 100.0, 12.0, Weight::Regular), "angle");
        let short = fitted("angular velocity", 60.0, 12.0, Weight::Regular);
        assert!(
            short.ends_with('…') && width(&short, 12.0, Weight::Regular) <= 60.0,
            "{short}"
        );
        assert_eq!(fitted("angle", 1.0, 12.0, Weight::Regular), "");
    }
}
