//! Color keys of panels: a list of names, or a color bar with a scale.

use super::color::{self, Color, MUTED_COLOR};
use super::font::{Weight, fit_text, text_width};
use super::legend::{self, Entry};
use super::panel_axes::{LABEL_SIZE, TICK_SIZE};
use super::scale::{Scale, format_number, format_significant, log_position};
use super::svg::{Anchor, Rect, Stroke, SvgWriter, TextStyle};
use super::theme::Theme;

/// Color key of a row of panels.
#[derive(Clone, Debug, PartialEq)]
pub enum Key {
    /// One color per name.
    Categories(Vec<(String, Color)>),
    /// The colors of [`color::sequential_color`] from a low to a high value.
    Continuous {
        /// Name of the value, with its unit.
        label: String,
        /// Values at the lower and the upper end.
        range: [f64; 2],
    },
    /// The colors of [`color::density_color`], labeled with percentages of `total`.
    Shares {
        /// Name of what is counted.
        label: String,
        /// The count with the darkest color.
        max_count: u32,
        /// The count that is 100 %.
        total: u64,
    },
    /// The colors of [`color::density_color`], labeled with counts from 1 to the maximum.
    Counts {
        /// Name of what is counted.
        label: String,
        /// The count with the darkest color.
        max_count: u32,
    },
    /// The colors of [`color::difference_color`], which show the square roots of differences of
    /// shares, labeled with percentages.
    Differences {
        /// Name of the difference.
        label: String,
        /// The largest difference of shares, 0 to 1.
        max: f64,
    },
}

const BAR_WIDTH: f64 = 12.0;
const LINE_HEIGHT: f64 = 17.0;

/// Distance of a bar below panels from both sides.
const SIDE_OF_BAR: f64 = 48.0;

/// A color bar.
struct Bar<'a> {
    label: &'a str,
    /// The color at a share of the bar, from 0 at its low end to 1.
    color_of: fn(Theme, f64) -> Color,
    /// Shares of the bar with labels.
    ticks: Vec<(f64, String)>,
}

impl Key {
    /// Width of the key beside panels, in CSS pixels.
    pub(super) fn width(&self) -> f64 {
        match self {
            Self::Categories(names) => {
                let names = names.iter().map(|(name, _)| name.as_str());
                (widest(names) + 30.0).min(180.0)
            }
            _ => self.bar().map_or(0.0, |bar| width_of_bar(&bar.ticks)),
        }
    }

    /// Height of the key below panels of this width together, in CSS pixels.
    pub(super) fn height_below(&self, width: f64) -> f64 {
        match self {
            Self::Categories(names) => legend::height_of_lines(&entries(names), width),
            _ => 44.0,
        }
    }

    /// Draws the key beside panels.
    pub(super) fn draw(&self, area: &Rect, svg: &mut SvgWriter) {
        if let Self::Categories(names) = self {
            draw_names(names, area, svg);
        } else if let Some(bar) = self.bar() {
            bar.draw(area, svg);
        }
    }

    /// Draws the key below panels.
    pub(super) fn draw_below(&self, area: &Rect, svg: &mut SvgWriter) {
        if let Self::Categories(names) = self {
            legend::draw_lines(&entries(names), area, svg);
        } else if let Some(bar) = self.bar() {
            bar.draw_lying(area, svg);
        }
    }

    /// The bar of a key that is one.
    fn bar(&self) -> Option<Bar<'_>> {
        let density: fn(Theme, f64) -> Color = Theme::density_color;
        let (label, color_of, ticks) = match self {
            Self::Categories(_) => return None,
            Self::Continuous { label, range } => {
                let scale = Scale::new(*range, [0.0, 1.0]);
                let color_of: fn(Theme, f64) -> Color =
                    |theme, share| theme.color(color::sequential_color(share));
                let ticks = ticks_with_ends(&scale, *range);
                (
                    label,
                    color_of,
                    placed(ticks, |value| scale.position(value)),
                )
            }
            Self::Shares {
                label,
                max_count,
                total,
            } => {
                let ticks = share_ticks(*max_count, *total);
                let place = |count| log_position(count, *max_count);
                (label, density, placed(ticks, place))
            }
            Self::Counts { label, max_count } => {
                let place = |count: u32| log_position(count.into(), *max_count);
                (label, density, placed(count_ticks(*max_count), place))
            }
            Self::Differences { label, max } => {
                let color_of: fn(Theme, f64) -> Color =
                    |theme, share| theme.difference_color(2.0 * share - 1.0);
                let place = |root| f64::midpoint(root, 1.0);
                (label, color_of, placed(difference_ticks(*max), place))
            }
        };
        Some(Bar {
            label,
            color_of,
            ticks,
        })
    }
}

/// Ticks with their places as shares of a bar.
fn placed<T>(
    ticks: impl IntoIterator<Item = (T, String)>,
    place: impl Fn(T) -> f64,
) -> Vec<(f64, String)> {
    let ticks = ticks.into_iter();
    ticks.map(|(value, text)| (place(value), text)).collect()
}

/// Names with their colors, as entries of a legend.
fn entries(names: &[(String, Color)]) -> Vec<Entry<'_>> {
    names
        .iter()
        .map(|(name, color)| Entry {
            name,
            color: *color,
        })
        .collect()
}

impl Bar<'_> {
    /// Draws the bar upright, with its label rotated to its right.
    fn draw(&self, area: &Rect, svg: &mut SvgWriter) {
        let step = area.height / f64::from(STEPS);
        for index in 0..STEPS {
            // Each step overlaps the next one, so that no white gap is visible between them.
            let y = area.bottom() - step * f64::from(index + 1);
            let part = Rect {
                x: area.x,
                y,
                width: BAR_WIDTH,
                height: if index == 0 { step } else { step + 0.5 },
            };
            svg.rectangle_of_theme(&part, self.color_of_step(index, svg), 1.0);
        }
        let middle = [area.right() - 4.0, area.y + area.height / 2.0];
        let length = area.height + ROOM_AROUND;
        let label = fit_text(self.label, length, LABEL_SIZE, Weight::Regular);
        svg.text(
            middle,
            &label,
            TextStyle::new(LABEL_SIZE, Anchor::Middle).upward(),
        );
        for (share, text) in &self.ticks {
            draw_tick(area, svg, area.bottom() - share * area.height, text);
        }
    }

    fn color_of_step(&self, index: u32, svg: &SvgWriter) -> Color {
        (self.color_of)(svg.theme(), (f64::from(index) + 0.5) / f64::from(STEPS))
    }

    /// Draws the bar from left to right, with its label above and numbers below that do not touch.
    fn draw_lying(&self, area: &Rect, svg: &mut SvgWriter) {
        let bar = Rect {
            x: area.x + SIDE_OF_BAR,
            y: area.y + 14.0,
            width: area.width - 2.0 * SIDE_OF_BAR,
            height: BAR_WIDTH,
        };
        for index in 0..STEPS {
            let step = bar.width / f64::from(STEPS);
            let is_last = index + 1 == STEPS;
            let part = Rect {
                x: bar.x + step * f64::from(index),
                width: if is_last { step } else { step + 0.5 },
                ..bar
            };
            svg.rectangle_of_theme(&part, self.color_of_step(index, svg), 1.0);
        }
        let label = fit_text(self.label, area.width, LABEL_SIZE, Weight::Regular);
        let middle = bar.x + bar.width / 2.0;
        svg.text(
            [middle, area.y + 9.0],
            &label,
            TextStyle::new(LABEL_SIZE, Anchor::Middle),
        );
        let mut end = f64::NEG_INFINITY;
        for (share, text) in &self.ticks {
            let (x, half) = (
                bar.x + share * bar.width,
                text_width(text, TICK_SIZE, Weight::Regular) / 2.0,
            );
            if x - half < end + 4.0 {
                continue;
            }
            end = x + half;
            svg.line(
                &[[x, bar.bottom()], [x, bar.bottom() + 3.0]],
                Stroke::new(MUTED_COLOR, 1.0),
            );
            svg.text(
                [x, bar.bottom() + 14.0],
                text,
                TextStyle::new(TICK_SIZE, Anchor::Middle).color(MUTED_COLOR),
            );
        }
    }
}

/// Width of the widest text.
fn widest<'a>(texts: impl Iterator<Item = &'a str>) -> f64 {
    let widths = texts.map(|text| text_width(text, TICK_SIZE, Weight::Regular));
    widths.fold(0.0, f64::max)
}

/// Width of a color bar with the labels of its ticks, and the label of all on their right.
fn width_of_bar<T>(ticks: &[(T, String)]) -> f64 {
    let texts = ticks.iter().map(|(_, text)| text.as_str());
    (widest(texts) + 38.0).max(78.0)
}

/// Ticks of a scale from 0 to 1: at its ends, and at round values that are not too close to them.
fn ticks_with_ends(scale: &Scale, range: [f64; 2]) -> Vec<(f64, String)> {
    let [low, high] = range.map(|end| (end, format_number(end)));
    let inner = scale.ticks(4).into_iter();
    let inner = inner.filter(|(value, _)| (0.1..0.9).contains(&scale.position(*value)));
    std::iter::once(low).chain(inner).chain([high]).collect()
}

/// Ticks of a scale of differences up to `max`: square roots of shares of `max`, with labels.
fn difference_ticks(max: f64) -> [(f64, String); 5] {
    [-1.0, -0.5, 0.0, 0.5, 1.0].map(|root: f64| {
        let percent = 100.0 * max * root * root * root.signum();
        (root, format!("{} %", format_significant(percent, 2)))
    })
}

/// Ticks of a scale of counts: at 1, at powers of ten that are not too close to `max_count`, and at
/// `max_count`.
fn count_ticks(max_count: u32) -> Vec<(u32, String)> {
    let powers_of_ten = (0..10)
        .map(|power| 10_u32.pow(power))
        .take_while(|&count| count < max_count && log_position(f64::from(count), max_count) < 0.9);
    let mut counts: Vec<u32> = powers_of_ten.collect();
    counts.push(max_count.max(1));
    counts.dedup();
    counts
        .into_iter()
        .map(|count| (count, with_thousands_separators(count)))
        .collect()
}

/// Ticks of a scale of percentages, as counts with their labels: at its ends, a count of 1 and `max_count`, and at
/// powers of ten that are not too close to them.
fn share_ticks(max_count: u32, total: u64) -> Vec<(f64, String)> {
    let percent = |count: f64| 100.0 * count / total.max(1) as f64;
    let powers_of_ten = (-9..=2).map(|power| 10_f64.powi(power) * total as f64 / 100.0);
    let is_clear = |count: &f64| (0.1..0.9).contains(&log_position(*count, max_count));
    let lowest = (max_count > 1).then_some(1.0);
    let shown_counts = lowest
        .into_iter()
        .chain(powers_of_ten.filter(is_clear))
        .chain([f64::from(max_count)]);
    shown_counts
        .map(|count| {
            (
                count,
                format!("{} %", format_significant(percent(count), 2)),
            )
        })
        .collect()
}

/// A count with commas as thousands separators.
fn with_thousands_separators(count: u32) -> String {
    let digits = count.to_string();
    let leading_count = digits.len() % 3;
    let groups = digits.as_bytes()[leading_count..]
        .chunks(3)
        .map(|group| String::from_utf8_lossy(group).into_owned());
    let leading_group = (leading_count > 0).then(|| digits[..leading_count].to_owned());
    leading_group
        .into_iter()
        .chain(groups)
        .collect::<Vec<_>>()
        .join(",")
}

fn draw_names(names: &[(String, Color)], area: &Rect, svg: &mut SvgWriter) {
    let max_names = ((area.height / LINE_HEIGHT) as usize).max(1);
    for (line, (name, color)) in names.iter().take(max_names).enumerate() {
        let y = area.y + LINE_HEIGHT * (line as f64 + 0.5);
        svg.line(&[[area.x, y], [area.x + 16.0, y]], Stroke::new(*color, 3.0));
        let name = if line + 1 == max_names && names.len() > max_names {
            format!("and {} more", names.len() - line)
        } else {
            fit_text(name, area.width - 22.0, TICK_SIZE, Weight::Regular)
        };
        svg.text(
            [area.x + 22.0, y + 4.0],
            &name,
            TextStyle::new(TICK_SIZE, Anchor::Start),
        );
    }
}

/// Length by which the label of a color bar may be longer than the bar, which is shorter than its row.
const ROOM_AROUND: f64 = 56.0;

/// Number of rectangles of a color bar.
const STEPS: u32 = 64;

fn draw_tick(area: &Rect, svg: &mut SvgWriter, y: f64, text: &str) {
    svg.line(
        &[[area.x + BAR_WIDTH, y], [area.x + BAR_WIDTH + 3.0, y]],
        Stroke::new(MUTED_COLOR, 1.0),
    );
    svg.text(
        [area.x + BAR_WIDTH + 6.0, y + 4.0],
        text,
        TextStyle::new(TICK_SIZE, Anchor::Start).color(MUTED_COLOR),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0.005, 0.01, 0.1 and 1 % of 20,000 are 1, 2, 20 and 200. There are no ticks at 0.01 and 10 %, which are too close
    /// to the ends.
    #[test]
    fn ticks_of_shares_are_round() {
        let shares = share_ticks(2469, 20_000);
        assert_eq!(
            shares
                .iter()
                .map(|(_, text)| text.as_str())
                .collect::<Vec<_>>(),
            ["0.005 %", "0.1 %", "1 %", "12 %"]
        );
        assert!((shares[1].0 - 20.0).abs() < 1e-9 && shares[3].0 == 2469.0);
    }

    /// The widest label, `0.0091 %`, does not touch the label of the scale.
    #[test]
    fn keys_with_long_labels_are_wider() {
        let shares = |max_count, total| Key::Shares {
            label: "share".to_owned(),
            max_count,
            total,
        };
        assert_eq!(shares(12, 100).width().to_bits(), 78.0_f64.to_bits());
        let long = shares(132, 10_989);
        let text = text_width("0.0091 %", TICK_SIZE, Weight::Regular);
        assert!(long.width() >= BAR_WIDTH + 6.0 + text + LABEL_SIZE + 4.0);
    }

    #[test]
    fn ticks_of_counts_are_round() {
        let texts = |max_count| {
            count_ticks(max_count)
                .into_iter()
                .map(|(_, text)| text)
                .collect::<Vec<_>>()
        };
        assert_eq!(texts(12_345), ["1", "10", "100", "1,000", "12,345"]);
        assert_eq!(texts(1), ["1"]);
        assert_eq!(texts(120), ["1", "10", "120"]);
    }
}
