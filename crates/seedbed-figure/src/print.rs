//! How a figure is printed: its size, the size of its letters, what is left out, and the format of its file.

use super::panel_axes::LABEL_SIZE;
use super::pixels::PIXELS_PER_INCH;
use super::{Figure, Panel, RenderError, Row, Theme};

/// Formats of files with figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text that browsers show and vector editors change.
    Svg,
    /// Pixels.
    Png,
    /// A page with embedded fonts.
    Pdf,
}

/// How a figure is printed. By default it is as it was drawn, for screens. Lengths are CSS pixels, 1/96 inch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PrintLayout {
    /// Colors and size of letters.
    pub theme: Theme,
    /// Width of the page in print.
    pub width: Option<f64>,
    /// Height of the page in print; `None` fits the content.
    pub height: Option<f64>,
    /// Size of the letters of axis labels in print. All other lengths within the figure are scaled with it. `None` is 8 points
    /// with a width in print, and as drawn without; in talks one and a half times as much.
    pub font: Option<f64>,
    /// Whether the title of the page is left out.
    pub without_title: bool,
    /// Whether legends and color keys are left out.
    pub without_legends: bool,
    /// Range of the x axis of curves.
    pub x_range: Option<[f64; 2]>,
    /// Range of the y axis of curves.
    pub y_range: Option<[f64; 2]>,
    /// Whether the x axis and the y axis of curves are logarithmic.
    pub logarithmic: [bool; 2],
}

/// Size of letters in columns of papers: 8 points.
const PRINT_FONT: f64 = 8.0 / 72.0 * PIXELS_PER_INCH;

/// Pixels per inch of a PNG with a width in print.
const PRINT_RESOLUTION: f64 = 300.0;

/// Pixels per inch of a PNG for screens.
const SCREEN_RESOLUTION: f64 = 2.0 * PIXELS_PER_INCH;

impl PrintLayout {
    /// Length in print of a unit of length within the figure.
    #[must_use]
    pub fn scale(&self) -> f64 {
        if let Some(font) = self.font {
            return font / LABEL_SIZE;
        }
        let in_papers = self.width.map_or(1.0, |_| PRINT_FONT / LABEL_SIZE);
        in_papers * self.theme.letters()
    }

    /// Width of the page within the figure; `drawn` is its width in print unless one is set.
    #[must_use]
    pub fn width_within(&self, drawn: f64) -> f64 {
        self.width.unwrap_or(drawn) / self.scale()
    }

    /// Pixels per inch of a PNG.
    #[must_use]
    pub fn resolution(&self) -> f64 {
        if self.width.is_some() {
            PRINT_RESOLUTION
        } else {
            SCREEN_RESOLUTION
        }
    }

    /// Changes the size of a figure, what it leaves out, and its ranges. `drawn`: width in print, unless one is set, as of
    /// [`width_within`](Self::width_within)
    pub fn apply(&self, figure: &mut Figure, drawn: f64) {
        if self.without_title {
            figure.clear_titles();
        }
        for row in &mut figure.rows {
            if self.without_legends {
                row.key = None;
            }
            for panel in &mut row.panels {
                if let Panel::Curves(curves) = panel {
                    curves.has_legend &= !self.without_legends;
                    curves.x_range = self.x_range.or(curves.x_range);
                    curves.y_range = self.y_range.or(curves.y_range);
                    let [x, y] = self.logarithmic;
                    curves.x_logarithmic |= x;
                    curves.y_logarithmic |= y;
                }
            }
        }
        let width = self.width_within(drawn);
        let rows = std::mem::take(&mut figure.rows).into_iter();
        figure.rows = rows.flat_map(|row| row.split_for(width)).collect();
        drop_repeated_keys(&mut figure.rows);
        for row in &mut figure.rows {
            if let [Panel::Intervals(intervals)] = &row.panels[..] {
                row.height = intervals.height_within(row.width_of_panels(width));
            }
        }
        let height = self.height.map(|height| height / self.scale());
        figure.resize(width, height.unwrap_or_else(|| figure.height()));
    }

    /// The bytes of a file with a figure to which the layout was applied.
    ///
    /// # Errors
    /// The page is empty.
    pub fn encode(&self, figure: &Figure, format: Format) -> Result<Vec<u8>, RenderError> {
        match format {
            Format::Svg => Ok(figure.svg_scaled(self.scale(), self.theme).into_bytes()),
            Format::Png => figure.png_for_print(self.scale(), self.resolution(), self.theme),
            Format::Pdf => figure.pdf(self.scale(), self.theme),
        }
    }
}

/// Removes rows of keys that are also below later rows.
fn drop_repeated_keys(rows: &mut Vec<Row>) {
    for index in (0..rows.len()).rev() {
        if rows[index].is_key() && rows[index + 1..].contains(&rows[index]) {
            rows.remove(index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Curves, Key, Series};

    fn figure() -> Figure {
        let series = Series {
            name: "agent 0".to_owned(),
            points: vec![[0.0, 1.0], [9.0, 2.0]],
            ..Series::default()
        };
        let curves = Curves {
            series: vec![series],
            has_legend: true,
            ..Curves::default()
        };
        Figure {
            title: "Returns".to_owned(),
            description: String::new(),
            width: 760.0,
            rows: vec![Row {
                height: 200.0,
                panels: vec![Panel::Curves(curves)],
                key: Some(Key::Categories(vec![("team".to_owned(), [9; 3])])),
            }],
        }
    }

    /// Letters of 12 pixels are printed with 8 points = 10.67 pixels, so that 8.4 cm = 317.48 pixels are 357.17 within the figure, and
    /// 992 pixels of 300 per inch.
    #[test]
    fn columns_of_papers_have_letters_of_eight_points() {
        let layout = PrintLayout {
            width: Some(8.4 / 2.54 * 96.0),
            height: Some(96.0),
            ..PrintLayout::default()
        };
        let mut figure = figure();
        layout.apply(&mut figure, 760.0);
        assert!((figure.width - 357.165).abs() < 1e-3);
        assert!((figure.height() - 108.0).abs() < 1e-9);
        let svg = String::from_utf8(layout.encode(&figure, Format::Svg).unwrap()).unwrap();
        assert!(svg.contains("width=\"317.48\" height=\"96\" viewBox=\"0 0 357.17 108\""));
        let png = layout.encode(&figure, Format::Png).unwrap();
        assert_eq!(
            png[16..24],
            [992_u32.to_be_bytes(), 300_u32.to_be_bytes()].concat()
        );
        assert!(
            layout
                .encode(&figure, Format::Pdf)
                .unwrap()
                .starts_with(b"%PDF-")
        );
    }

    /// Letters of talks are larger on a page of the same size.
    #[test]
    fn pages_for_talks_keep_their_size() {
        let layout = PrintLayout {
            theme: Theme::Talk,
            ..PrintLayout::default()
        };
        let mut figure = figure();
        figure.width = layout.width_within(760.0);
        layout.apply(&mut figure, 760.0);
        let png = layout.encode(&figure, Format::Png).unwrap();
        assert_eq!(png[16..20], 1520_u32.to_be_bytes());
    }

    #[test]
    fn titles_and_legends_are_left_out_and_ranges_set() {
        let layout = PrintLayout {
            without_title: true,
            without_legends: true,
            y_range: Some([0.0, 40.0]),
            ..PrintLayout::default()
        };
        let mut figure = figure();
        let height = figure.height();
        layout.apply(&mut figure, 760.0);
        let svg = figure.svg();
        for text in ["Returns", "agent 0", "team"] {
            assert!(!svg.contains(text), "{text}");
        }
        assert!(svg.contains(">40</text>"));
        assert_eq!([figure.width, figure.height()], [760.0, height - 28.0]);
        assert_eq!(
            layout.encode(&figure, Format::Svg).unwrap(),
            svg.into_bytes()
        );
    }

    /// A figure of one panel has no title at all, and its panel fills the space; several panels keep theirs, which tell them apart.
    #[test]
    fn the_title_of_the_only_panel_is_left_out_too() {
        let layout = PrintLayout {
            without_title: true,
            ..PrintLayout::default()
        };
        let drawn = |titles: &[&str]| {
            let mut figure = figure();
            let panels = titles.iter().map(|title| {
                Panel::Curves(Curves {
                    title: (*title).to_owned(),
                    ..Curves::default()
                })
            });
            figure.rows[0].panels = panels.collect();
            layout.apply(&mut figure, 760.0);
            figure.svg()
        };
        let (one, two) = (drawn(&["left"]), drawn(&["left", "right"]));
        assert!(!one.contains("left") && two.contains(">left<") && two.contains(">right<"));
        assert_eq!(one, drawn(&[""]));
        // Above the plot are 8 pixels of margin, and 10 of the 24 for a title.
        let begins_at = |svg: &str, y: &str| svg.contains(&format!(" {y}L"));
        assert!(begins_at(&one, "18") && begins_at(&two, "32") && !begins_at(&two, "18"));
    }
}
