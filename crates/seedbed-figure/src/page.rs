//! Arranges panels on a page.

use super::font::{Weight, fit_text};
use super::pair::is_to_scale;
use super::panel_axes::{TITLE_HEIGHT, draw_titles_of_row};
use super::svg::{Anchor, Rect, SvgWriter, TextStyle};
use super::{
    Curves, Drawing, Figure, HeatMap, Intervals, Key, NumberGrid, Panel, ParallelCoordinates,
    Picture, Pixels, RenderError, Row, Scatter, Theme, pdf, pixels,
};

const HEADING_SIZE: f64 = 15.0;
const MARGIN: f64 = 8.0;
const GAP: f64 = 10.0;

/// Share of the width of a page that a key may take beside several maps. A wider one is below them.
pub const MAX_SHARE_OF_KEY: f64 = 0.2;

/// What surrounds the plot of a map: labels on the left, title and labels below.
const WIDTH_OF_LABELS: f64 = 60.0;
const HEIGHT_OF_LABELS: f64 = 68.0;

impl Figure {
    /// Height of the page.
    #[must_use]
    pub fn height(&self) -> f64 {
        let gaps = GAP * self.rows.len().saturating_sub(1) as f64;
        2.0 * MARGIN
            + self.title_height()
            + gaps
            + self.rows.iter().map(|row| row.height).sum::<f64>()
    }

    /// Sets the width and height of the page. The heights of the rows keep their proportions; keys keep their heights.
    pub fn resize(&mut self, width: f64, height: f64) {
        let of_panels: f64 = self.rows_of_panels().map(|row| row.height).sum();
        let others = self.height() - of_panels;
        let factor = ((height - others) / of_panels).max(0.0);
        self.width = width;
        let rows = self.rows.iter_mut().filter(|row| !row.is_key());
        rows.for_each(|row| row.height *= factor);
    }

    /// All rows but those of keys.
    pub fn rows_of_panels(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| !row.is_key())
    }

    /// The text of an SVG file.
    #[must_use]
    pub fn svg(&self) -> String {
        self.svg_scaled(1.0, Theme::Paper)
    }

    /// The text of an SVG file in which all lengths, also those of letters, are multiplied by `scale`.
    pub(super) fn svg_scaled(&self, scale: f64, theme: Theme) -> String {
        let mut svg = SvgWriter::new(theme);
        let page_area = Rect {
            x: 0.0,
            y: 0.0,
            width: self.width,
            height: self.height(),
        }
        .inset([MARGIN; 4]);
        if !self.title.is_empty() {
            let title = fit_text(&self.title, page_area.width, HEADING_SIZE, Weight::Medium);
            svg.text(
                [page_area.x, page_area.y + HEADING_SIZE],
                &title,
                TextStyle::new(HEADING_SIZE, Anchor::Start).bold(),
            );
        }
        let mut y = page_area.y + self.title_height();
        let mut unused = self.unused_above_first_row();
        let mut key_above = None;
        for row in &self.rows {
            let unused = std::mem::take(&mut unused);
            let area = Rect {
                y: y - unused,
                height: row.height + unused,
                ..page_area
            };
            let repeats_key = row.has_maps() && row.key == key_above;
            row.draw(&area, !repeats_key, &mut svg);
            key_above.clone_from(&row.key);
            y += row.height + GAP;
        }
        svg.into_svg(
            [self.width, self.height()],
            scale,
            &self.alt_text(),
            &self.description,
        )
    }

    /// The bytes of a PNG file with `scale` pixels per CSS pixel in each direction, or fewer if a side
    /// would have more than 20,000 pixels.
    ///
    /// # Errors
    /// The page is empty.
    pub fn png(&self, scale: f64) -> Result<Vec<u8>, RenderError> {
        self.png_for_print(1.0, scale * pixels::PIXELS_PER_INCH, Theme::Paper)
    }

    /// The bytes of a PNG file in which all lengths are multiplied by `scale`, with this resolution or a lower one if a side
    /// would have more than 20,000 pixels.
    pub(super) fn png_for_print(
        &self,
        scale: f64,
        pixels_per_inch: f64,
        theme: Theme,
    ) -> Result<Vec<u8>, RenderError> {
        let pixels_per_length = scale * pixels_per_inch / pixels::PIXELS_PER_INCH;
        let fitting = pixels_per_length.min(pixels::MAX_SIDE / self.width.max(self.height()));
        let resolution = pixels_per_inch * fitting / pixels_per_length;
        pixels::draw(&self.svg_scaled(1.0, theme), fitting)?.into_png(resolution)
    }

    /// The bytes of a PDF file with one page, in which all lengths are multiplied by `scale`. Fonts are embedded, text can be
    /// selected, and lines are lines.
    pub(super) fn pdf(&self, scale: f64, theme: Theme) -> Result<Vec<u8>, RenderError> {
        pdf::pdf(&self.svg_scaled(1.0, theme), &self.alt_text(), scale)
    }

    /// The image that [`png`](Self::png) encodes.
    ///
    /// # Errors
    /// The page is empty, or too large for memory.
    pub fn pixels(&self, scale: f64) -> Result<Pixels, RenderError> {
        pixels::draw(&self.svg(), scale)
    }

    fn title_height(&self) -> f64 {
        if self.title.is_empty() { 0.0 } else { 28.0 }
    }

    /// Height of the titles that neither the figure nor the panels of its first row have, which these panels fill.
    fn unused_above_first_row(&self) -> f64 {
        let panels = self.rows.first().map_or(&[][..], |row| &row.panels);
        let mut titles = panels.iter().map(Panel::title);
        if self.title.is_empty() && titles.all(str::is_empty) {
            TITLE_HEIGHT - GAP
        } else {
            0.0
        }
    }

    /// Leaves out the title of the page, and that of the only panel that has one.
    pub(super) fn clear_titles(&mut self) {
        self.title.clear();
        let panels = self.rows.iter_mut().flat_map(|row| &mut row.panels);
        let mut titled: Vec<&mut Panel> = panels.filter(|it| !it.title().is_empty()).collect();
        if let [only] = &mut titled[..] {
            only.clear_title();
        }
    }

    /// The title of the figure; without one, the title of the first panel that has a title.
    fn alt_text(&self) -> String {
        let titles = self
            .rows
            .iter()
            .flat_map(|row| &row.panels)
            .map(Panel::title);
        std::iter::once(self.title.as_str())
            .chain(titles)
            .find(|title| !title.is_empty())
            .unwrap_or_default()
            .to_owned()
    }
}

impl Row {
    /// Width of all panels together, beside the key, on a page of this width.
    pub(super) fn width_of_panels(&self, page: f64) -> f64 {
        page - 2.0 * MARGIN - self.key_width()
    }

    /// The row or, if its panels of states would be too narrow on a page of this width, several rows of fewer panels. Rows of maps
    /// to scale are no higher than these. A key that would take a large part of the page is a row of its own.
    pub(super) fn split_for(mut self, page: f64) -> Vec<Self> {
        let columns = self.panels.len().max(1);
        let width = self.width_of_panels(page);
        let needed = self.panels.iter().map(Panel::min_width).fold(0.0, f64::max);
        let fitting_in = |width: f64| ((width / needed.max(1.0)) as usize).clamp(1, columns);
        let fitting = fitting_in(width);
        let is_wide_key = self.key_width() > MAX_SHARE_OF_KEY * page;
        if is_wide_key
            && needed > 0.0
            && fitting_in(page - 2.0 * MARGIN) > 1
            && let Some(key) = self.key.take()
        {
            let mut rows = self.split_for(page);
            rows.push(Self::of_key(key, page));
            return rows;
        }
        let column_width = width / fitting as f64 - GAP;
        if fitting == columns || needed == 0.0 {
            let height_to_scale = height_of_maps(&self.panels, column_width);
            self.height = self.height.min(height_to_scale.unwrap_or(self.height));
            return vec![self];
        }
        let panels = self.panels.iter().filter(|panel| **panel != Panel::Blank);
        let panels: Vec<Panel> = panels.cloned().collect();
        let row = |panels: &[Panel]| {
            let height_to_scale = height_of_maps(panels, column_width);
            let mut panels = panels.to_vec();
            panels.resize(fitting, Panel::Blank);
            Self {
                height: height_to_scale.unwrap_or(self.height),
                panels,
                key: self.key.clone(),
            }
        };
        panels.chunks(fitting).map(row).collect()
    }

    /// Whether this is the key of the rows above.
    pub(super) fn is_key(&self) -> bool {
        matches!(self.panels[..], [Panel::Key(_)])
    }

    /// A row with the key of the rows above, on a page of this width.
    #[must_use]
    pub fn of_key(key: Key, page: f64) -> Self {
        Self {
            height: key.height_below(page - 2.0 * MARGIN),
            panels: vec![Panel::Key(key)],
            key: None,
        }
    }

    fn key_width(&self) -> f64 {
        self.key.as_ref().map_or(0.0, |key| key.width() + GAP)
    }

    fn has_maps(&self) -> bool {
        let mut panels = self.panels.iter();
        panels.any(|panel| matches!(panel, Panel::Scatter(_) | Panel::HeatMap(_)))
    }

    /// Draws the row. Without its key, the place of the key is empty.
    fn draw(&self, area: &Rect, shows_key: bool, svg: &mut SvgWriter) {
        let panels_area = area.inset([0.0, self.key_width(), 0.0, 0.0]);
        let count = self.panels.len().max(1) as f64;
        let width = (panels_area.width - GAP * (count - 1.0)) / count;
        let mut x = panels_area.x;
        for panel in &self.panels {
            panel.draw(
                &Rect {
                    x,
                    width,
                    ..panels_area
                },
                svg,
            );
            x += width + GAP;
        }
        draw_titles_of_row(svg);
        if let Some(key) = self.key.as_ref().filter(|_| shows_key) {
            let key_area = Rect {
                x: panels_area.right() + GAP,
                width: key.width(),
                ..panels_area
            };
            key.draw(&key_area.inset([TITLE_HEIGHT + 12.0, 0.0, 24.0, 0.0]), svg);
        }
    }
}

/// Height of the highest of maps to scale of this width; `None` if a panel is no such map.
fn height_of_maps(panels: &[Panel], column_width: f64) -> Option<f64> {
    let drawn = panels.iter().filter(|panel| **panel != Panel::Blank);
    let heights: Option<Vec<f64>> = drawn
        .map(|panel| panel.height_of_map(column_width))
        .collect();
    heights?.into_iter().reduce(f64::max)
}

impl Panel {
    /// Width that a panel of states needs; 0 of other panels, which fit themselves to any width.
    fn min_width(&self) -> f64 {
        match self {
            Self::Scatter(_) | Self::HeatMap(_) => 110.0,
            Self::ParallelCoordinates(_) => 250.0,
            _ => 0.0,
        }
    }

    /// Height over width of a map to scale; `None` of other panels.
    #[must_use]
    pub fn aspect_of_map(&self) -> Option<f64> {
        let (lines, x, y) = match self {
            Self::Scatter(scatter) => (&scatter.lines, &scatter.x, &scatter.y),
            Self::HeatMap(map) => (&map.lines, &map.x, &map.y),
            _ => return None,
        };
        let [width, height] = [x, y].map(|axis| f64::from(axis.range[1] - axis.range[0]));
        is_to_scale([x, y], lines).then_some(height / width)
    }

    /// Height of a panel of this width with a map to scale, without empty space; `None` of other panels.
    #[must_use]
    pub fn height_of_map(&self, width: f64) -> Option<f64> {
        let aspect = self.aspect_of_map()?;
        let height = ((width - WIDTH_OF_LABELS) * aspect).clamp(60.0, 500.0);
        Some(height + HEIGHT_OF_LABELS)
    }

    fn draw(&self, area: &Rect, svg: &mut SvgWriter) {
        match self {
            Self::Curves(curves) => curves.draw(area, svg),
            Self::ParallelCoordinates(states) => states.draw(area, svg),
            Self::Scatter(points) => points.draw(area, svg),
            Self::HeatMap(counts) => counts.draw(area, svg),
            Self::Intervals(rows) => rows.draw(area, svg),
            Self::NumberGrid(numbers) => numbers.draw(area, svg),
            Self::Drawing(shapes) => shapes.draw(area, svg),
            Self::Picture(picture) => picture.draw(area, svg),
            Self::Key(key) => key.draw_below(area, svg),
            Self::Blank => {}
        }
    }

    fn title(&self) -> &str {
        match self {
            Self::Curves(Curves { title, .. })
            | Self::ParallelCoordinates(ParallelCoordinates { title, .. })
            | Self::Scatter(Scatter { title, .. })
            | Self::HeatMap(HeatMap { title, .. })
            | Self::Intervals(Intervals { title, .. })
            | Self::NumberGrid(NumberGrid { title, .. })
            | Self::Drawing(Drawing { title, .. })
            | Self::Picture(Picture { title, .. }) => title,
            Self::Key(_) | Self::Blank => "",
        }
    }

    fn clear_title(&mut self) {
        match self {
            Self::Curves(Curves { title, .. })
            | Self::ParallelCoordinates(ParallelCoordinates { title, .. })
            | Self::Scatter(Scatter { title, .. })
            | Self::HeatMap(HeatMap { title, .. })
            | Self::Intervals(Intervals { title, .. })
            | Self::NumberGrid(NumberGrid { title, .. })
            | Self::Drawing(Drawing { title, .. })
            | Self::Picture(Picture { title, .. }) => title.clear(),
            Self::Key(_) | Self::Blank => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        Cells, DensityImage, IntervalRow, Key, ScatterPoint, Series, StateLine, States, Threshold,
    };
    use super::*;
    use crate::Axis;

    fn axis(name: &str) -> Axis {
        Axis {
            outside: [0.0; 2],
            nan: 0.0,
            name: name.to_owned(),
            unit: "m/s".to_owned(),
            range: [-1.0, 1.0],
        }
    }

    fn curves() -> Curves {
        let series = Series {
            name: "agent <0>".to_owned(),
            points: vec![[0.0, 0.0], [1.0, f64::NAN], [2.0, 4.0], [3.0, 5.0]],
            band: Some(vec![[0.0, -1.0, 1.0], [3.0, 4.0, 6.0]]),
            ..Series::default()
        };
        let thresholds = vec![Threshold {
            name: "solved".to_owned(),
            value: 4.0,
        }];
        Curves {
            title: "returns".to_owned(),
            series: vec![series],
            thresholds,
            has_legend: true,
            ..Curves::default()
        }
    }

    fn states(states: States) -> Panel {
        let axes = vec![
            axis("x"),
            axis("y"),
            axis("an angular velocity with a long name"),
        ];
        Panel::ParallelCoordinates(ParallelCoordinates {
            title: "states".to_owned(),
            axes,
            states,
        })
    }

    fn panels_of_states() -> Vec<Panel> {
        let line = StateLine {
            axis_positions: vec![0.0, 0.5, 1.0],
            color: [0; 3],
        };
        let density = DensityImage {
            pixels: vec![0, 1, 5, 9],
            width: 2,
            max_count: 9,
        };
        vec![
            states(States::Lines(vec![line; 3])),
            states(States::Density(density)),
        ]
    }

    fn panels_of_pairs() -> Vec<Panel> {
        let (x, y, title) = (axis("x"), axis("y"), "pair".to_owned());
        let point = ScatterPoint {
            position: [0.0, 9.0],
            color: [1, 2, 3],
        };
        let heat_map = HeatMap {
            title: title.clone(),
            x: x.clone(),
            y: y.clone(),
            cells: Cells::Counts {
                counts: vec![0, 1, 2, 3],
                max_count: 3,
            },
            columns: 2,
            lines: vec![vec![[-0.5, -2.0], [-0.5, 0.5]]],
        };
        let scatter = Scatter {
            title,
            x,
            y,
            points: vec![point; 4],
            lines: Vec::new(),
        };
        vec![Panel::Scatter(scatter), Panel::HeatMap(heat_map)]
    }

    fn panel_of_intervals() -> Panel {
        let row = IntervalRow {
            name: "a".to_owned(),
            estimate: Some(1.0),
            interval: Some([0.0, 2.0]),
            margin: None,
            n: 5,
            color: [0; 3],
        };
        Panel::Intervals(Intervals {
            rows: vec![row; 2],
            ..Intervals::default()
        })
    }

    /// A figure with one panel of each kind.
    fn figure_with_all_panels() -> Figure {
        let row = |panels, key| Row {
            height: 200.0,
            panels,
            key,
        };
        let counts = Key::Counts {
            label: "states".to_owned(),
            max_count: 9,
        };
        let episodes = Key::Continuous {
            label: "episode".to_owned(),
            range: [0.0, 50.0],
        };
        let agents = Key::Categories(vec![("agent 0".to_owned(), [9; 3])]);
        Figure {
            title: "A & B".to_owned(),
            description: "All panels".to_owned(),
            width: 600.0,
            rows: vec![
                row(vec![Panel::Curves(curves()), Panel::Blank], None),
                row(panels_of_states(), Some(counts)),
                row(panels_of_pairs(), Some(episodes)),
                row(vec![panel_of_intervals()], Some(agents)),
            ],
        }
    }

    #[test]
    fn svg_contains_the_title_and_the_description() {
        let svg = figure_with_all_panels().svg();
        assert!(
            svg.contains("<title>A &amp; B</title>\n<desc>All panels</desc>"),
            "{svg}"
        );
        assert!(svg.contains(">agent &lt;0&gt;</text>"));
        let untitled = Figure {
            title: String::new(),
            ..figure_with_all_panels()
        };
        assert!(untitled.svg().contains("<title>returns</title>"));
    }

    #[test]
    fn equal_figures_give_equal_bytes() {
        assert_eq!(
            figure_with_all_panels().svg(),
            figure_with_all_panels().svg()
        );
        assert_eq!(
            figure_with_all_panels().png(1.0).unwrap(),
            figure_with_all_panels().png(1.0).unwrap()
        );
    }

    /// There are 3 state lines, a curve with a gap (a dot and a line), 4 scatter points (dots) and
    /// 2 estimates (dots).
    #[test]
    fn every_value_is_drawn_exactly_once() {
        let svg = figure_with_all_panels().svg();
        let count = |text: &str| svg.matches(text).count();
        assert_eq!(count("stroke=\"#000000\" stroke-width=\"0.7\""), 3);
        assert_eq!(count("stroke=\"#000000\" stroke-width=\"1.8\""), 1);
        assert_eq!(count("<circle"), 1 + 4 + 2);
        assert_eq!(count("<image"), 2);
        assert_eq!(count("<svg"), count("</svg>"));
    }

    /// Bytes 16 to 23 of a PNG file are its width and height.
    #[test]
    fn png_has_the_requested_size() {
        let size = |png: &[u8]| {
            [16, 20].map(|offset| u32::from_be_bytes(png[offset..offset + 4].try_into().unwrap()))
        };
        let png = figure_with_all_panels().png(2.0).unwrap();
        let height = figure_with_all_panels().height() as u32;
        assert_eq!(size(&png), [1200, 2 * height]);
    }

    /// A page for a column of a paper: 8.4 cm are 238.1 points, and 992 pixels at 300 per inch, or 11811 per meter.
    #[test]
    fn pages_for_print_have_their_size_and_resolution() {
        let mut figure = figure_with_all_panels();
        let scale = 8.0 / 9.0;
        figure.width = 8.4 / 2.54 * 96.0 / scale;
        let svg = figure.svg_scaled(scale, Theme::Paper);
        assert!(
            svg.contains("width=\"317.48\"") && svg.contains("viewBox=\"0 0 357.17 "),
            "{}",
            &svg[..300]
        );
        let png = figure.png_for_print(scale, 300.0, Theme::Paper).unwrap();
        assert_eq!(png[16..20], 992_u32.to_be_bytes());
        let resolution = png.windows(4).position(|name| name == b"pHYs").unwrap();
        assert_eq!(png[resolution + 4..resolution + 8], 11811_u32.to_be_bytes());
        let pdf = figure.pdf(scale, Theme::Paper).unwrap();
        let text = String::from_utf8_lossy(&pdf);
        assert!(text.starts_with("%PDF-") && text.contains("/MediaBox[0 0 238.11"));
        assert!(text.contains("/FontFile2") && text.contains("Roboto-Regular"));
        assert_eq!(pdf, figure.pdf(scale, Theme::Paper).unwrap());
    }

    #[test]
    fn png_of_a_figure_that_is_too_large_has_a_smaller_scale() {
        let mut wide = figure_with_all_panels();
        wide.resize(40_000.0, 800.0);
        let error = wide.pixels(2.0).unwrap_err().to_string();
        assert!(error.starts_with("cannot draw an image of 80000 × 1600 pixels"));
        let png = wide.png(2.0).unwrap();
        assert_eq!(png[16..20], 20_000_u32.to_be_bytes());
        assert_eq!(png[20..24], 400_u32.to_be_bytes());
    }

    /// Three square maps, of which two fit beside each other on a page of 380 pixels.
    #[test]
    fn narrow_pages_have_rows_of_fewer_maps() {
        let axis = |name: &str, range| Axis {
            name: name.to_owned(),
            unit: "m".to_owned(),
            range,
            outside: [0.0; 2],
            nan: 0.0,
        };
        let map = Panel::HeatMap(HeatMap {
            title: String::new(),
            x: axis("x", [-2.0, 2.0]),
            y: axis("y", [-2.0, 2.0]),
            cells: Cells::Counts {
                counts: vec![1; 4],
                max_count: 1,
            },
            columns: 2,
            lines: vec![vec![[0.0, 0.0], [0.0, 1.0]]],
        });
        let row = Row {
            height: 250.0,
            panels: vec![map.clone(), map.clone(), map],
            key: None,
        };
        let rows = row.clone().split_for(300.0);
        let panels: Vec<usize> = rows.iter().map(|row| row.panels.len()).collect();
        assert_eq!(panels, [2, 2]);
        assert_eq!(rows[1].panels[1], Panel::Blank);
        // 284 / 2 − 10 − 60 + 68 pixels.
        assert!((rows[0].height - 140.0).abs() < 1e-9, "{}", rows[0].height);
        // 364 / 3 − 10 − 60 would be less than the smallest map of 60 pixels.
        let fitting = Row {
            height: 128.0,
            ..row.clone()
        };
        assert_eq!(row.split_for(380.0), [fitting]);
    }

    /// A key of 78 pixels and a gap of 10 take more than a fifth of a page of 300: it is below two rows of two.
    #[test]
    fn keys_are_below_maps_in_narrow_pages() {
        let axis = || axis("x");
        let map = Panel::HeatMap(HeatMap {
            title: String::new(),
            x: axis(),
            y: axis(),
            cells: Cells::Counts {
                counts: vec![1; 4],
                max_count: 1,
            },
            columns: 2,
            lines: Vec::new(),
        });
        let key = Key::Counts {
            label: "states per cell".to_owned(),
            max_count: 100,
        };
        let row = Row {
            height: 250.0,
            panels: vec![map; 4],
            key: Some(key.clone()),
        };
        let rows = row.clone().split_for(300.0);
        let panels: Vec<usize> = rows.iter().map(|row| row.panels.len()).collect();
        assert_eq!(panels, [2, 2, 1]);
        assert_eq!(rows[2].panels, [Panel::Key(key.clone())]);
        assert!(rows.iter().all(|row| row.key.is_none()));
        let beside = row.split_for(450.0);
        assert!(beside.iter().all(|row| row.key.as_ref() == Some(&key)));
    }

    #[test]
    fn resize_sets_the_width_and_height() {
        let mut figure = figure_with_all_panels();
        figure.resize(800.0, 700.0);
        assert!((figure.height() - 700.0).abs() < 1e-9 && figure.width == 800.0);
    }

    /// Text is drawn with the fonts of this crate, also on machines without fonts: figures with
    /// different titles differ in pixels.
    #[test]
    fn different_titles_give_different_pixels() {
        let figure_with_title = |title: &str| Figure {
            title: title.to_owned(),
            rows: Vec::new(),
            ..figure_with_all_panels()
        };
        assert_ne!(
            figure_with_title("σ = 0.1").png(1.0).unwrap(),
            figure_with_title("σ = 0.2").png(1.0).unwrap()
        );
        assert_ne!(
            figure_with_title("σ").png(1.0).unwrap(),
            figure_with_title("θ").png(1.0).unwrap()
        );
    }

    /// A title that is too wide for its panel makes those beside it as small.
    #[test]
    fn titles_of_a_row_have_one_size() {
        let sizes = |titles: [&str; 2]| {
            let panel = |title: &str| {
                Panel::Curves(Curves {
                    title: title.to_owned(),
                    ..Curves::default()
                })
            };
            let figure = Figure {
                title: String::new(),
                description: String::new(),
                width: 400.0,
                rows: vec![Row {
                    height: 200.0,
                    panels: titles.map(panel).to_vec(),
                    key: None,
                }],
            };
            let svg = figure.svg();
            titles.map(|title| {
                let end = svg.rfind(&format!(">{title}<")).unwrap();
                let size = svg[..end].rfind("font-size=\"").unwrap() + 11;
                svg[size..].split('"').next().unwrap().to_owned()
            })
        };
        let [own, shared] = sizes(["own", "shared"]);
        assert_eq!(own, shared);
        let [beside, wide] = sizes(["own", "shared experience and RND"]);
        assert_eq!(beside, wide);
        assert!(beside.parse::<f64>().unwrap() < own.parse().unwrap());
    }
}
