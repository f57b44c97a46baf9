//! Writes the elements of an SVG file.

use std::fmt::Write;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use super::color::{Color, TEXT_COLOR};
use super::font::{FONT_FAMILY, Weight};
use super::pixels;
use super::theme::Theme;

/// A rectangle on the page; y grows downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn right(&self) -> f64 {
        self.x + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.y + self.height
    }

    /// The rectangle without margins, in the order of CSS: top, right, bottom, left.
    pub(super) fn inset(&self, [top, right, bottom, left]: [f64; 4]) -> Self {
        let (width, height) = (self.width - left - right, self.height - top - bottom);
        Self {
            x: self.x + left,
            y: self.y + top,
            width: width.max(1.0),
            height: height.max(1.0),
        }
    }
}

/// Style of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub(super) color: Color,
    pub(super) width: f64,
    pub(super) opacity: f64,
    pub(super) dashed: bool,
    /// Whether the ends are half discs.
    pub(super) has_round_ends: bool,
}

impl Stroke {
    pub(super) fn new(color: Color, width: f64) -> Self {
        Self {
            color,
            width,
            opacity: 1.0,
            dashed: false,
            has_round_ends: false,
        }
    }

    pub(super) fn round(self) -> Self {
        Self {
            has_round_ends: true,
            ..self
        }
    }
}

/// The part of a text that is at its position: `text-anchor` of SVG.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Style of a text.
#[derive(Clone, Copy, Debug)]
pub(super) struct TextStyle {
    pub(super) size: f64,
    pub(super) anchor: Anchor,
    pub(super) color: Color,
    pub(super) weight: Weight,
    /// Whether the text is rotated to read upward.
    pub(super) upward: bool,
    /// Whether the text has a white rim, to be read on top of lines.
    pub(super) has_rim: bool,
}

impl TextStyle {
    pub(super) fn new(size: f64, anchor: Anchor) -> Self {
        Self {
            size,
            anchor,
            color: TEXT_COLOR,
            weight: Weight::Regular,
            upward: false,
            has_rim: false,
        }
    }

    pub(super) fn with_rim(self) -> Self {
        Self {
            has_rim: true,
            ..self
        }
    }

    pub(super) fn color(self, color: Color) -> Self {
        Self { color, ..self }
    }

    pub(super) fn bold(self) -> Self {
        Self {
            weight: Weight::Medium,
            ..self
        }
    }

    pub(super) fn upward(self) -> Self {
        Self {
            upward: true,
            ..self
        }
    }
}

/// The elements of an SVG file, in the order in which they are drawn.
#[derive(Debug, Default)]
pub(super) struct SvgWriter {
    theme: Theme,
    elements: String,
    /// Titles of the panels of a row that are not drawn yet.
    titles: Vec<PanelTitle>,
}

/// Title of a panel, which is drawn with those of the other panels of its row.
#[derive(Debug)]
pub(super) struct PanelTitle {
    pub(super) text: String,
    pub(super) x: f64,
    /// Upper edge of the panel.
    pub(super) y: f64,
    pub(super) max_width: f64,
    /// Length of the text before it.
    pub(super) place: usize,
}

impl SvgWriter {
    pub(super) fn new(theme: Theme) -> Self {
        Self {
            theme,
            elements: String::new(),
            titles: Vec::new(),
        }
    }

    /// Keeps a title, given its place in the text.
    pub(super) fn add_title(&mut self, title: impl FnOnce(usize) -> PanelTitle) {
        self.titles.push(title(self.elements.len()));
    }

    pub(super) fn take_titles(&mut self) -> Vec<PanelTitle> {
        std::mem::take(&mut self.titles)
    }

    /// Draws something at a place in the text.
    pub(super) fn insert_at(&mut self, place: usize, draw: impl FnOnce(&mut Self)) {
        let after = self.elements.split_off(place);
        draw(self);
        self.elements.push_str(&after);
    }

    /// Colors of the page.
    pub(super) fn theme(&self) -> Theme {
        self.theme
    }

    /// A color of the theme as hexadecimal number.
    fn hex(&self, on_white: Color) -> String {
        hex(self.theme.color(on_white))
    }

    /// The complete SVG file, shown with `scale` CSS pixels per unit of length.
    pub(super) fn into_svg(
        self,
        size: [f64; 2],
        scale: f64,
        title: &str,
        description: &str,
    ) -> String {
        let [w, h] = size.map(format_length);
        let [shown_width, shown_height] = size.map(|side| format_length(side * scale));
        let (title, description) = (escape(title), escape(description));
        let page = self.hex([255; 3]);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{shown_width}\" height=\"{shown_height}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             font-family=\"{FONT_FAMILY}\">\n<title>{title}</title>\n<desc>{description}</desc>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"{page}\"/>\n{}</svg>\n",
            self.elements
        )
    }

    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        self.elements
            .write_fmt(element)
            .and_then(|()| self.elements.write_char('\n'))
            .expect("writing to a string cannot fail");
    }

    /// Clips everything that `draw` draws to `area`.
    pub(super) fn clipped(&mut self, area: &Rect, draw: impl FnOnce(&mut Self)) {
        let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(format_length);
        let view = format!("{x} {y} {width} {height}");
        // A nested <svg> needs no id, in contrast to a <clipPath>: ids would have to be unique on a
        // page with several figures.
        self.push(format_args!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" viewBox=\"{view}\" overflow=\"hidden\">"
        ));
        draw(self);
        self.push(format_args!("</svg>"));
    }

    /// Draws a line through points.
    pub(super) fn line(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        let color = self.theme.color(stroke.color);
        let (path, style) = (path(points), style(Stroke { color, ..stroke }));
        self.push(format_args!("<path d=\"{path}\" fill=\"none\" {style}/>"));
    }

    /// Attributes of a rim in the color of the page, which keeps a text or a mark legible on any other color.
    fn rim(&self) -> String {
        let color = self.hex([255; 3]);
        format!(
            " stroke=\"{color}\" stroke-opacity=\"0.8\" stroke-width=\"2.5\" stroke-linejoin=\"round\" paint-order=\"stroke\""
        )
    }

    /// Draws a filled polygon with a rim.
    pub(super) fn polygon_with_rim(&mut self, points: &[[f64; 2]], color: Color) {
        let (path, color, rim) = (path(points), self.hex(color), self.rim());
        self.push(format_args!("<path d=\"{path}Z\" fill=\"{color}\"{rim}/>"));
    }

    /// Draws a filled polygon.
    pub(super) fn polygon(&mut self, points: &[[f64; 2]], color: Color, opacity: f64) {
        let (path, color, opacity) = (path(points), self.hex(color), format_length(opacity));
        self.push(format_args!(
            "<path d=\"{path}Z\" fill=\"{color}\" fill-opacity=\"{opacity}\"/>"
        ));
    }

    /// Draws a rectangle in a color that is chosen for white pages.
    pub(super) fn rectangle(&mut self, area: &Rect, fill: Color, opacity: f64) {
        self.rectangle_of_theme(area, self.theme.color(fill), opacity);
    }

    /// Draws a rectangle in a color that is chosen for this theme.
    pub(super) fn rectangle_of_theme(&mut self, area: &Rect, fill: Color, opacity: f64) {
        let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(format_length);
        let (fill, opacity) = (hex(fill), format_length(opacity));
        self.push(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" fill=\"{fill}\" fill-opacity=\"{opacity}\"/>"
        ));
    }

    pub(super) fn dot(&mut self, [x, y]: [f64; 2], radius: f64, color: Color, opacity: f64) {
        let [x, y, radius, opacity] = [x, y, radius, opacity].map(format_length);
        let color = self.hex(color);
        self.push(format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" fill=\"{color}\" fill-opacity=\"{opacity}\"/>"));
    }

    /// Draws a text whose baseline is at a position.
    pub(super) fn text(&mut self, [x, y]: [f64; 2], text: &str, text_style: TextStyle) {
        let [x, y, size] = [x, y, text_style.size].map(format_length);
        let anchor = match text_style.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let rotation = if text_style.upward {
            format!(" transform=\"rotate(-90 {x} {y})\"")
        } else {
            String::new()
        };
        let rim = if text_style.has_rim {
            self.rim()
        } else {
            String::new()
        };
        let (weight, color, text) = (
            text_style.weight.number(),
            self.hex(text_style.color),
            escape(text),
        );
        self.push(format_args!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" font-weight=\"{weight}\" text-anchor=\"{anchor}\" fill=\"{color}\"{rim}{rotation}>\
             {text}</text>"
        ));
    }

    /// Draws pixels, row by row from the top, in colors that are chosen for this theme, stretched over `area`.
    /// `colors: [height × width]`
    pub(super) fn image_of_colors(
        &mut self,
        area: &Rect,
        colors: impl Iterator<Item = Color>,
        width: usize,
        is_pixelated: bool,
    ) {
        let colors: Vec<Color> = colors.collect();
        if !colors.is_empty() {
            self.image(area, &pixels::png_of_colors(&colors, width), is_pixelated);
        }
    }

    /// Draws a PNG image, stretched over `area`; its pixels have sharp edges if `is_pixelated`,
    /// otherwise they are interpolated.
    pub(super) fn image(&mut self, area: &Rect, png: &[u8], is_pixelated: bool) {
        let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(format_length);
        let (rendering, data) = (
            if is_pixelated { "pixelated" } else { "auto" },
            BASE64_STANDARD.encode(png),
        );
        self.push(format_args!(
            "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" preserveAspectRatio=\"none\" \
             style=\"image-rendering:{rendering}\" href=\"data:image/png;base64,{data}\"/>"
        ));
    }
}

fn path(points: &[[f64; 2]]) -> String {
    let mut path = String::new();
    for (index, &[x, y]) in points.iter().enumerate() {
        path.push(if index == 0 { 'M' } else { 'L' });
        path.push_str(&format_length(x));
        path.push(' ');
        path.push_str(&format_length(y));
    }
    path
}

fn style(stroke: Stroke) -> String {
    let mut style = format!(
        "stroke=\"{}\" stroke-width=\"{}\"",
        hex(stroke.color),
        format_length(stroke.width)
    );
    if stroke.opacity < 1.0 {
        style = format!(
            "{style} stroke-opacity=\"{}\"",
            format_length(stroke.opacity)
        );
    }
    if stroke.has_round_ends {
        style += " stroke-linecap=\"round\"";
    }
    style
        + if stroke.dashed {
            " stroke-dasharray=\"5 4\""
        } else {
            " stroke-linejoin=\"round\""
        }
}

fn hex([red, green, blue]: Color) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// A length or an opacity with at most two decimals: a hundredth of a pixel is not visible.
fn format_length(value: f64) -> String {
    let text = format!("{:.2}", if value.is_finite() { value } else { 0.0 });
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// Replaces characters that are markup in XML by entities, and removes control characters and others that
/// XML does not allow, and controls that change the direction of text.
fn escape(text: &str) -> String {
    let is_removed = |letter: char| {
        letter.is_control()
            || matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{fffe}' | '\u{ffff}')
    };
    let allowed = text.chars().filter(|letter| !is_removed(*letter));
    allowed.fold(String::new(), |mut text, letter| {
        match letter {
            '&' => text.push_str("&amp;"),
            '<' => text.push_str("&lt;"),
            '>' => text.push_str("&gt;"),
            '"' => text.push_str("&quot;"),
            letter => text.push(letter),
        }
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_at_most_two_decimals() {
        assert_eq!(
            [1.0, 0.126, -0.001, 120.5, f64::NAN].map(format_length),
            ["1", "0.13", "0", "120.5", "0"]
        );
    }

    #[test]
    fn text_is_escaped() {
        assert_eq!(
            escape("a < b & \"c\"\u{7}\u{9b}\u{202e}\u{ffff}"),
            "a &lt; b &amp; &quot;c&quot;"
        );
    }

    #[test]
    fn a_line_is_a_path() {
        let mut svg = SvgWriter::default();
        svg.line(
            &[[0.0, 1.0], [2.5, 3.0]],
            Stroke {
                dashed: true,
                ..Stroke::new([255, 0, 128], 1.5)
            },
        );
        let expected = "<path d=\"M0 1L2.5 3\" fill=\"none\" stroke=\"#ff0080\" stroke-width=\"1.5\" stroke-dasharray=\"5 4\"/>\n";
        assert_eq!(svg.elements, expected);
    }
}
