//! Writes the elements of an SVG file.

use std::fmt::Write;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use super::color::{Color, INK};
use super::font::{FAMILY, Weight};

/// A rectangle on the page; y grows downwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Area {
    pub(super) fn right(&self) -> f64 {
        self.x + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.y + self.height
    }

    /// Without margins, in the order of CSS: top, right, bottom, left.
    pub(super) fn within(&self, [top, right, bottom, left]: [f64; 4]) -> Self {
        let (width, height) = (self.width - left - right, self.height - top - bottom);
        Self {
            x: self.x + left,
            y: self.y + top,
            width: width.max(1.0),
            height: height.max(1.0),
        }
    }
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub(super) color: Color,
    pub(super) width: f64,
    pub(super) opacity: f64,
    pub(super) dashed: bool,
}

impl Stroke {
    pub(super) fn new(color: Color, width: f64) -> Self {
        Self {
            color,
            width,
            opacity: 1.0,
            dashed: false,
        }
    }
}

/// Which end of a text stands at its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// How a text is set.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lettering {
    pub(super) size: f64,
    pub(super) anchor: Anchor,
    pub(super) color: Color,
    pub(super) weight: Weight,
    /// Read upwards.
    pub(super) upwards: bool,
}

impl Lettering {
    pub(super) fn new(size: f64, anchor: Anchor) -> Self {
        Self {
            size,
            anchor,
            color: INK,
            weight: Weight::Regular,
            upwards: false,
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

    pub(super) fn upwards(self) -> Self {
        Self {
            upwards: true,
            ..self
        }
    }
}

/// The elements drawn so far, the later ones on top.
#[derive(Debug, Default)]
pub(super) struct Drawing {
    elements: String,
}

impl Drawing {
    /// Encloses what was drawn in a page.
    pub(super) fn into_svg(
        self,
        width: f64,
        height: f64,
        title: &str,
        description: &str,
    ) -> String {
        let (w, h, title, description) = (
            number(width),
            number(height),
            escaped(title),
            escaped(description),
        );
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" role=\"img\" \
             font-family=\"{FAMILY}\">\n<title>{title}</title>\n<desc>{description}</desc>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            self.elements
        )
    }

    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        self.elements
            .write_fmt(element)
            .and_then(|()| self.elements.write_char('\n'))
            .expect("a string takes any text");
    }

    /// What `draw` draws is cut off at the edges of `area`.
    pub(super) fn clipped(&mut self, area: &Area, draw: impl FnOnce(&mut Self)) {
        let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(number);
        let view = format!("{x} {y} {width} {height}");
        // A nested picture needs no name, which would have to be unique where several figures are on one page.
        self.push(format_args!(
            "<svg x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" viewBox=\"{view}\" overflow=\"hidden\">"
        ));
        draw(self);
        self.push(format_args!("</svg>"));
    }

    /// A line through points.
    pub(super) fn line(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        let (path, style) = (path(points), style(stroke));
        self.push(format_args!("<path d=\"{path}\" fill=\"none\" {style}/>"));
    }

    /// A filled shape.
    pub(super) fn fill(&mut self, points: &[[f64; 2]], color: Color, opacity: f64) {
        let (path, color, opacity) = (path(points), hex(color), number(opacity));
        self.push(format_args!(
            "<path d=\"{path}Z\" fill=\"{color}\" fill-opacity=\"{opacity}\"/>"
        ));
    }

    pub(super) fn rectangle(&mut self, area: &Area, fill: Color, opacity: f64) {
        let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(number);
        let (fill, opacity) = (hex(fill), number(opacity));
        self.push(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" fill=\"{fill}\" fill-opacity=\"{opacity}\"/>"
        ));
    }

    pub(super) fn dot(&mut self, [x, y]: [f64; 2], radius: f64, color: Color, opacity: f64) {
        let [x, y, radius, opacity] = [x, y, radius, opacity].map(number);
        let color = hex(color);
        self.push(format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{radius}\" fill=\"{color}\" fill-opacity=\"{opacity}\"/>"));
    }

    /// A text whose base line goes through a place.
    pub(super) fn text(&mut self, [x, y]: [f64; 2], text: &str, lettering: Lettering) {
        let [x, y, size] = [x, y, lettering.size].map(number);
        let anchor = match lettering.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let turn = if lettering.upwards {
            format!(" transform=\"rotate(-90 {x} {y})\"")
        } else {
            String::new()
        };
        let (weight, color, text) = (
            lettering.weight.number(),
            hex(lettering.color),
            escaped(text),
        );
        self.push(format_args!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" font-weight=\"{weight}\" text-anchor=\"{anchor}\" fill=\"{color}\"{turn}>\
             {text}</text>"
        ));
    }

    /// A picture made of pixels, stretched over `area`.
    pub(super) fn image(&mut self, area: &Area, png: &[u8], sharp: bool) {
        let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(number);
        let (rendering, data) = (
            if sharp { "pixelated" } else { "auto" },
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
        path.push_str(&number(x));
        path.push(' ');
        path.push_str(&number(y));
    }
    path
}

fn style(stroke: Stroke) -> String {
    let mut style = format!(
        "stroke=\"{}\" stroke-width=\"{}\"",
        hex(stroke.color),
        number(stroke.width)
    );
    if stroke.opacity < 1.0 {
        style = format!("{style} stroke-opacity=\"{}\"", number(stroke.opacity));
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

/// A hundredth of a pixel is finer than any eye.
fn number(value: f64) -> String {
    let text = format!("{:.2}", if value.is_finite() { value } else { 0.0 });
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// Without what XML would take for markup, or does not allow at all.
fn escaped(text: &str) -> String {
    let allowed = text.chars().filter(|letter| !letter.is_control());
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
    fn numbers_are_short() {
        assert_eq!(
            [1.0, 0.126, -0.001, 120.5, f64::NAN].map(number),
            ["1", "0.13", "0", "120.5", "0"]
        );
    }

    #[test]
    fn words_are_no_markup() {
        assert_eq!(
            escaped("a < b & \"c\"\u{7}"),
            "a &lt; b &amp; &quot;c&quot;"
        );
    }

    #[test]
    fn a_line_is_a_path() {
        let mut drawing = Drawing::default();
        drawing.line(
            &[[0.0, 1.0], [2.5, 3.0]],
            Stroke {
                dashed: true,
                ..Stroke::new([255, 0, 128], 1.5)
            },
        );
        let wanted = "<path d=\"M0 1L2.5 3\" fill=\"none\" stroke=\"#ff0080\" stroke-width=\"1.5\" stroke-dasharray=\"5 4\"/>\n";
        assert_eq!(drawing.elements, wanted);
    }
}
