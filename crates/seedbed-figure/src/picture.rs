//! A picture with its own proportions.

use super::Pixels;
use super::panel_axes::{TITLE_HEIGHT, draw_title};
use super::svg::{Rect, SvgWriter};

/// A picture, as large as the panel allows.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Title above the panel.
    pub title: String,
    /// The picture.
    pub pixels: Pixels,
}

impl Picture {
    pub(super) fn draw(&self, panel: &Rect, svg: &mut SvgWriter) {
        draw_title(&self.title, panel, panel.x + 4.0, svg);
        let area = panel.inset([TITLE_HEIGHT, 4.0, 4.0, 4.0]);
        let Ok(png) = self.pixels.clone().into_png(1.0) else {
            return; // a picture without pixels
        };
        svg.image(&self.place_in(&area), &png, false);
    }

    /// The largest rectangle in the middle of the area that has the picture's proportions.
    fn place_in(&self, area: &Rect) -> Rect {
        let [width, height] = [self.pixels.width, self.pixels.height].map(f64::from);
        let scale = (area.width / width).min(area.height / height);
        Rect {
            x: area.x + 0.5 * (area.width - scale * width),
            y: area.y + 0.5 * (area.height - scale * height),
            width: scale * width,
            height: scale * height,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of 2 by 1 pixels in an area of 96 by 96 below the title and within margins: 96 by 48, in the middle.
    #[test]
    fn pictures_keep_their_proportions() {
        let picture = Picture {
            title: String::new(),
            pixels: Pixels {
                width: 2,
                height: 1,
                rgb: vec![255; 6],
            },
        };
        let panel = Rect {
            x: 0.0,
            y: 0.0,
            width: 104.0,
            height: 24.0 + 4.0 + 96.0,
        };
        let mut svg = SvgWriter::default();
        picture.draw(&panel, &mut svg);
        let text = svg.into_svg([104.0, 124.0], 1.0, "", "");
        let place = "<image x=\"4\" y=\"48\" width=\"96\" height=\"48\"";
        assert!(text.contains(place), "{text}");
    }
}
