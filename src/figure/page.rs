//! Puts panels on a page.

use super::drawing::{Anchor, Area, Drawing, Lettering};
use super::font::{Weight, fitted};
use super::frame::HEAD;
use super::{
    Curves, Figure, HeatMap, Intervals, Panel, ParallelCoordinates, PngError, Row, Scatter, pixels,
};

const HEADING: f64 = 15.0;
const MARGIN: f64 = 8.0;
const GAP: f64 = 10.0;

impl Figure {
    /// The page's height.
    #[must_use]
    pub fn height(&self) -> f64 {
        let gaps = GAP * self.rows.len().saturating_sub(1) as f64;
        2.0 * MARGIN + self.head() + gaps + self.rows.iter().map(|row| row.height).sum::<f64>()
    }

    /// Makes the page so wide and so high; the rows keep their shares of the height.
    pub fn fit(&mut self, width: f64, height: f64) {
        let fixed = self.height() - self.rows.iter().map(|row| row.height).sum::<f64>();
        let factor = ((height - fixed) / (self.height() - fixed)).max(0.0);
        self.width = width;
        self.rows.iter_mut().for_each(|row| row.height *= factor);
    }

    /// As the text of an SVG file.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut drawing = Drawing::default();
        let page = Area {
            x: 0.0,
            y: 0.0,
            width: self.width,
            height: self.height(),
        }
        .within([MARGIN; 4]);
        if !self.title.is_empty() {
            let title = fitted(&self.title, page.width, HEADING, Weight::Medium);
            drawing.text(
                [page.x, page.y + HEADING],
                &title,
                Lettering::new(HEADING, Anchor::Start).bold(),
            );
        }
        let mut y = page.y + self.head();
        for row in &self.rows {
            row.draw(
                &Area {
                    y,
                    height: row.height,
                    ..page
                },
                &mut drawing,
            );
            y += row.height + GAP;
        }
        drawing.into_svg(
            self.width,
            self.height(),
            &self.alternative(),
            &self.description,
        )
    }

    /// As the bytes of a PNG file with `scale` pixels for each CSS pixel.
    ///
    /// # Errors
    /// The page has no extent, or too many pixels for memory.
    pub fn png(&self, scale: f64) -> Result<Vec<u8>, PngError> {
        pixels::draw(&self.svg(), scale)
    }

    fn head(&self) -> f64 {
        if self.title.is_empty() { 0.0 } else { 28.0 }
    }

    /// The title, or else that of the first panel that has one.
    fn alternative(&self) -> String {
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
    fn draw(&self, area: &Area, drawing: &mut Drawing) {
        let beside = self.key.as_ref().map_or(0.0, |key| key.width() + GAP);
        let panels = area.within([0.0, beside, 0.0, 0.0]);
        let count = self.panels.len().max(1) as f64;
        let width = (panels.width - GAP * (count - 1.0)) / count;
        let mut x = panels.x;
        for panel in &self.panels {
            panel.draw(&Area { x, width, ..panels }, drawing);
            x += width + GAP;
        }
        if let Some(key) = &self.key {
            let place = Area {
                x: panels.right() + GAP,
                width: key.width(),
                ..panels
            };
            key.draw(&place.within([HEAD + 12.0, 0.0, 24.0, 0.0]), drawing);
        }
    }
}

impl Panel {
    fn draw(&self, area: &Area, drawing: &mut Drawing) {
        match self {
            Self::Curves(curves) => curves.draw(area, drawing),
            Self::ParallelCoordinates(states) => states.draw(area, drawing),
            Self::Scatter(points) => points.draw(area, drawing),
            Self::HeatMap(counts) => counts.draw(area, drawing),
            Self::Intervals(rows) => rows.draw(area, drawing),
            Self::Blank => {}
        }
    }

    fn title(&self) -> &str {
        match self {
            Self::Curves(Curves { title, .. })
            | Self::ParallelCoordinates(ParallelCoordinates { title, .. })
            | Self::Scatter(Scatter { title, .. })
            | Self::HeatMap(HeatMap { title, .. })
            | Self::Intervals(Intervals { title, .. }) => title,
            Self::Blank => "",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        DensityPicture, IntervalRow, Key, ScatterPoint, Series, StateLine, States, Threshold,
    };
    use super::*;
    use crate::env::Quantity;

    fn quantity(name: &str) -> Quantity {
        Quantity {
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
            legend: true,
            ..Curves::default()
        }
    }

    fn states(states: States) -> Panel {
        let axes = vec![
            quantity("x"),
            quantity("y"),
            quantity("an angular velocity with a long name"),
        ];
        Panel::ParallelCoordinates(ParallelCoordinates {
            title: "states".to_owned(),
            axes,
            states,
        })
    }

    /// One of each.
    fn page() -> Figure {
        let line = StateLine {
            fractions: vec![0.0, 0.5, 1.0],
            color: [0; 3],
        };
        let density = DensityPicture {
            pixels: vec![0, 1, 5, 9],
            width: 2,
            most: 9,
        };
        let point = ScatterPoint {
            at: [0.0, 9.0],
            color: [1, 2, 3],
        };
        let (x, y, title) = (quantity("x"), quantity("y"), "pair".to_owned());
        let heat = HeatMap {
            title: title.clone(),
            x: x.clone(),
            y: y.clone(),
            counts: vec![0, 1, 2, 3],
            columns: 2,
            most: 3,
        };
        let row = IntervalRow {
            name: "a".to_owned(),
            estimate: Some(1.0),
            interval: Some([0.0, 2.0]),
            n: 5,
            color: [0; 3],
        };
        let rows: Vec<(Vec<Panel>, Option<Key>)> = vec![
            (vec![Panel::Curves(curves()), Panel::Blank], None),
            (
                vec![
                    states(States::Lines(vec![line; 3])),
                    states(States::Density(density)),
                ],
                Some(Key::Counts {
                    label: "states".to_owned(),
                    most: 9,
                }),
            ),
            (
                vec![
                    Panel::Scatter(Scatter {
                        title,
                        x,
                        y,
                        points: vec![point; 4],
                    }),
                    Panel::HeatMap(heat),
                ],
                Some(Key::Gradual {
                    label: "episode".to_owned(),
                    range: [0.0, 50.0],
                }),
            ),
            (
                vec![Panel::Intervals(Intervals {
                    rows: vec![row; 2],
                    ..Intervals::default()
                })],
                Some(Key::Names(vec![("agent 0".to_owned(), [9; 3])])),
            ),
        ];
        let rows = rows
            .into_iter()
            .map(|(panels, key)| Row {
                height: 200.0,
                panels,
                key,
            })
            .collect();
        Figure {
            title: "A & B".to_owned(),
            description: "All panels".to_owned(),
            width: 600.0,
            rows,
        }
    }

    #[test]
    fn a_figure_tells_what_it_is() {
        let svg = page().svg();
        assert!(
            svg.contains("<title>A &amp; B</title>\n<desc>All panels</desc>"),
            "{svg}"
        );
        assert!(svg.contains(">agent &lt;0&gt;</text>"));
        let untitled = Figure {
            title: String::new(),
            ..page()
        };
        assert!(untitled.svg().contains("<title>returns</title>"));
    }

    #[test]
    fn the_same_data_give_the_same_bytes() {
        assert_eq!(page().svg(), page().svg());
        assert_eq!(page().png(1.0).unwrap(), page().png(1.0).unwrap());
    }

    /// 3 lines of states of one colour; a curve with a gap is a dot and a line; 4 points and 2 estimates are dots as well.
    #[test]
    fn every_datum_is_drawn_once() {
        let svg = page().svg();
        let count = |text: &str| svg.matches(text).count();
        assert_eq!(count("stroke=\"#000000\" stroke-width=\"0.7\""), 3);
        assert_eq!(count("stroke=\"#000000\" stroke-width=\"1.8\""), 1);
        assert_eq!(count("<circle"), 1 + 4 + 2);
        assert_eq!(count("<image"), 2);
        assert_eq!(count("<svg"), count("</svg>"));
    }

    /// Width and height stand in bytes 16 to 23 of a PNG file.
    #[test]
    fn pixels_are_as_many_as_wanted() {
        let png = page().png(2.0).unwrap();
        let number = |at: usize| u32::from_be_bytes(png[at..at + 4].try_into().unwrap());
        assert_eq!((number(16), number(20)), (1200, 2 * page().height() as u32));
        let mut wide = page();
        wide.fit(1e6, 100.0);
        assert!(
            wide.png(2.0)
                .unwrap_err()
                .to_string()
                .starts_with("a picture of 2000000 × ")
        );
    }

    #[test]
    fn a_page_can_be_fitted() {
        let mut page = page();
        page.fit(800.0, 700.0);
        assert!((page.height() - 700.0).abs() < 1e-9 && page.width == 800.0);
    }

    /// Two pages that differ in a word differ in pixels: the lettering is there whatever fonts the machine has.
    #[test]
    fn words_are_drawn() {
        let named = |title: &str| Figure {
            title: title.to_owned(),
            rows: Vec::new(),
            ..page()
        };
        assert_ne!(
            named("σ = 0.1").png(1.0).unwrap(),
            named("σ = 0.2").png(1.0).unwrap()
        );
        assert_ne!(named("σ").png(1.0).unwrap(), named("θ").png(1.0).unwrap());
    }
}
