//! The font: two weights of Roboto, reduced to Latin, Greek and mathematical characters.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};

/// Font families of SVG files. The families after Roboto have characters of similar width.
pub(super) const FONT_FAMILY: &str = "Roboto, Helvetica, Arial, sans-serif";

pub(super) const REGULAR: &[u8] = include_bytes!("fonts/Roboto-Regular.ttf");
pub(super) const MEDIUM: &[u8] = include_bytes!("fonts/Roboto-Medium.ttf");

/// Weight of the font.
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

/// CSS that embeds the font, for HTML pages with figures. Texts in figures were fitted to the
/// widths of this font.
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

/// Width of a text, in the unit of `size`. A character that the font lacks counts as half of
/// `size`.
pub(super) fn text_width(text: &str, size: f64, weight: Weight) -> f64 {
    let font = FontRef::new(weight.data()).expect("the font is part of this crate");
    let (glyphs, advances) = (
        font.charmap(),
        font.glyph_metrics(Size::unscaled(), LocationRef::default()),
    );
    let size_per_unit = size
        / f64::from(
            font.metrics(Size::unscaled(), LocationRef::default())
                .units_per_em,
        );
    let advance = |letter: char| {
        glyphs
            .map(letter)
            .and_then(|glyph| advances.advance_width(glyph))
    };
    text.chars()
        .map(|letter| advance(letter).map_or(0.5 * size, |width| f64::from(width) * size_per_unit))
        .sum()
}

/// `text`, shortened with an ellipsis if it is wider than `max_width`.
pub(super) fn fit_text(text: &str, max_width: f64, size: f64, weight: Weight) -> String {
    if text_width(text, size, weight) <= max_width {
        return text.to_owned();
    }
    let characters: Vec<char> = text.chars().collect();
    let shortened = |count: usize| {
        characters[..count]
            .iter()
            .collect::<String>()
            .trim_end()
            .to_owned()
            + "…"
    };
    let fits = |count: &usize| text_width(&shortened(*count), size, weight) <= max_width;
    (1..characters.len())
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
    fn digits_have_the_width_of_roboto() {
        assert!((text_width("00", 20.48, Weight::Regular) - 23.02).abs() < 1e-9);
        assert_eq!(text_width("", 12.0, Weight::Regular), 0.0);
    }

    #[test]
    fn long_texts_are_shortened() {
        assert_eq!(fit_text("angle", 100.0, 12.0, Weight::Regular), "angle");
        let short = fit_text("angular velocity", 60.0, 12.0, Weight::Regular);
        assert!(
            short.ends_with('…') && text_width(&short, 12.0, Weight::Regular) <= 60.0,
            "{short}"
        );
        assert_eq!(fit_text("angle", 1.0, 12.0, Weight::Regular), "");
    }
}
