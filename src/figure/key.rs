//! What colours mean: names, or a bar with its scale.

use super::color::{self, Color, GREY};
use super::drawing::{Anchor, Area, Drawing, Lettering, Stroke};
use super::font::{Weight, fitted, width};
use super::frame::{LABEL, TICK};
use super::scale::{Scale, significant};

/// What the colours of a row of panels mean.
#[derive(Clone, Debug, PartialEq)]
pub enum Key {
    /// One colour a name.
    Names(Vec<(String, Color)>),
    /// The colours of [`color::gradual`] from a low to a high value.
    Gradual {
        /// What runs from low to high, with its unit.
        label: String,
        /// The values at both ends.
        range: [f64; 2],
    },
    /// The same as shares, from 1 to the most of `of`.
    Shares {
        /// What is counted.
        label: String,
        /// The largest count.
        most: u32,
        /// All that is counted.
        of: u64,
    },
    /// The colours of [`color::of_count`], from 1 to the most.
    Counts {
        /// What is counted.
        label: String,
        /// The largest count.
        most: u32,
    },
}

const BAR: f64 = 12.0;
const LINE: f64 = 17.0;

impl Key {
    /// The room that it takes beside the panels.
    pub(super) fn width(&self) -> f64 {
        match self {
            Self::Names(names) => {
                let widest = names
                    .iter()
                    .map(|(name, _)| width(name, TICK, Weight::Regular))
                    .fold(0.0, f64::max);
                (widest + 30.0).min(180.0)
            }
            Self::Gradual { .. } | Self::Counts { .. } | Self::Shares { .. } => 78.0,
        }
    }

    pub(super) fn draw(&self, area: &Area, drawing: &mut Drawing) {
        match self {
            Self::Names(names) => draw_names(names, area, drawing),
            Self::Gradual { label, range } => {
                bar(area, drawing, label, color::gradual);
                let scale = Scale::new(*range, [area.bottom(), area.y]);
                let ticks = scale.ticks(4).into_iter();
                ticks.for_each(|(value, text)| tick(area, drawing, scale.at(value), &text));
            }
            Self::Shares { label, most, of } => {
                bar(area, drawing, label, color::dense);
                for (count, text) in round_shares(*most, *of) {
                    tick(
                        area,
                        drawing,
                        area.bottom() - position(count, *most) * area.height,
                        &text,
                    );
                }
            }
            Self::Counts { label, most } => {
                bar(area, drawing, label, color::dense);
                for (count, text) in round_counts(*most) {
                    let place = area.bottom() - position(f64::from(count), *most) * area.height;
                    tick(area, drawing, place, &text);
                }
            }
        }
    }
}

/// Where a count stands between 1 and `most` on a logarithmic scale, 0 to 1.
pub(super) fn position(count: f64, most: u32) -> f64 {
    if most > 1 {
        (count.max(1.0).ln() / f64::from(most).ln()).min(1.0)
    } else {
        0.0
    }
}

/// 1, powers of ten that are not too near to the end, and the most.
fn round_counts(most: u32) -> Vec<(u32, String)> {
    let tens = (0..10)
        .map(|power| 10_u32.pow(power))
        .take_while(|&count| count < most && position(f64::from(count), most) < 0.9);
    let mut counts: Vec<u32> = tens.collect();
    counts.push(most.max(1));
    counts.dedup();
    counts
        .into_iter()
        .map(|count| (count, grouped(count)))
        .collect()
}

/// Powers of ten that are not too near to the end, and the most, as per cent of `of`: each as the count that it is.
fn round_shares(most: u32, of: u64) -> Vec<(f64, String)> {
    let percent = |count: f64| 100.0 * count / of.max(1) as f64;
    let tens = (-9..=2).map(|power| 10_f64.powi(power) * of as f64 / 100.0);
    let fitting = tens
        .filter(|&count| count >= 1.0 && count < f64::from(most) && position(count, most) < 0.9);
    fitting
        .chain([f64::from(most)])
        .map(|count| (count, format!("{} %", significant(percent(count), 2))))
        .collect()
}

/// With a comma for each thousand.
fn grouped(count: u32) -> String {
    let digits = count.to_string();
    let head = digits.len() % 3;
    let groups = digits.as_bytes()[head..]
        .chunks(3)
        .map(|group| String::from_utf8_lossy(group).into_owned());
    let head = (head > 0).then(|| digits[..head].to_owned());
    head.into_iter().chain(groups).collect::<Vec<_>>().join(",")
}

fn draw_names(names: &[(String, Color)], area: &Area, drawing: &mut Drawing) {
    let room = ((area.height / LINE) as usize).max(1);
    for (line, (name, color)) in names.iter().take(room).enumerate() {
        let y = area.y + LINE * (line as f64 + 0.5);
        drawing.line(&[[area.x, y], [area.x + 16.0, y]], Stroke::new(*color, 3.0));
        let name = if line + 1 == room && names.len() > room {
            format!("and {} more", names.len() - line)
        } else {
            fitted(name, area.width - 22.0, TICK, Weight::Regular)
        };
        drawing.text(
            [area.x + 22.0, y + 4.0],
            &name,
            Lettering::new(TICK, Anchor::Start),
        );
    }
}

/// The bar, with what it is of written upwards at the right.
fn bar(area: &Area, drawing: &mut Drawing, label: &str, map: fn(f64) -> Color) {
    const STEPS: u32 = 64;
    let step = area.height / f64::from(STEPS);
    for index in 0..STEPS {
        // Each step reaches under the next, so that no white shines through between them.
        let y = area.bottom() - step * f64::from(index + 1);
        let part = Area {
            x: area.x,
            y,
            width: BAR,
            height: if index == 0 { step } else { step + 0.5 },
        };
        drawing.rectangle(&part, map((f64::from(index) + 0.5) / f64::from(STEPS)), 1.0);
    }
    let middle = [area.right() - 4.0, area.y + area.height / 2.0];
    let label = fitted(label, area.height, LABEL, Weight::Regular);
    drawing.text(
        middle,
        &label,
        Lettering::new(LABEL, Anchor::Middle).upwards(),
    );
}

fn tick(area: &Area, drawing: &mut Drawing, y: f64, text: &str) {
    drawing.line(
        &[[area.x + BAR, y], [area.x + BAR + 3.0, y]],
        Stroke::new(GREY, 1.0),
    );
    drawing.text(
        [area.x + BAR + 6.0, y + 4.0],
        text,
        Lettering::new(TICK, Anchor::Start).color(GREY),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of 20 000 the shares 0.01, 0.1, 1 and 10 % are 2, 20, 200 and 2000; 10 % stands too near to 12 %.
    #[test]
    fn shares_are_round() {
        let shares = round_shares(2469, 20_000);
        assert_eq!(
            shares
                .iter()
                .map(|(_, text)| text.as_str())
                .collect::<Vec<_>>(),
            ["0.01 %", "0.1 %", "1 %", "12 %"]
        );
        assert!((shares[1].0 - 20.0).abs() < 1e-9 && shares[3].0 == 2469.0);
    }

    #[test]
    fn counts_are_round() {
        let texts = |most| {
            round_counts(most)
                .into_iter()
                .map(|(_, text)| text)
                .collect::<Vec<_>>()
        };
        assert_eq!(texts(12_345), ["1", "10", "100", "1,000", "12,345"]);
        assert_eq!(texts(1), ["1"]);
        assert_eq!(texts(120), ["1", "10", "120"]);
    }
}
