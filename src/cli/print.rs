//! Options of commands that draw figures for papers.

use clap::{Args, ValueEnum};

use super::CliError;
use seedbed_figure::{PrintLayout, Theme};

/// How a figure is printed in a paper.
#[derive(Debug, Args)]
pub(super) struct PrintArgs {
    /// Colors and size of letters
    #[arg(long, value_enum, value_name = "THEME", default_value = "paper")]
    theme: PrintTheme,
    /// Width in print, e.g. 8.4cm, 84mm, 3.3in, 238pt or 320px; a PNG is rendered with 300 pixels per inch [default: 760px]
    #[arg(long, value_name = "LENGTH", value_parser = parse_side)]
    width: Option<f64>,
    /// Height in print, in the same units [default: fits the content]
    #[arg(long, value_name = "LENGTH", value_parser = parse_side)]
    height: Option<f64>,
    /// Size of the letters of axis labels in print; lines and ticks are scaled with it [default: 8pt with --width, else 12px; in talks one and a half times as much]
    #[arg(long, value_name = "LENGTH", value_parser = parse_length)]
    font: Option<f64>,
    /// Leave out the title of the page, and that of its panel if there is one only
    #[arg(long)]
    no_title: bool,
    /// Leave out legends and color keys
    #[arg(long)]
    no_legend: bool,
    /// Range of the x axis of returns and curves, e.g. 0..200
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    x_range: Option<[f64; 2]>,
    /// Range of the y axis of returns and curves
    #[arg(long, value_name = "A..B", value_parser = parse_range, allow_hyphen_values = true)]
    y_range: Option<[f64; 2]>,
    /// Logarithmic axes of returns and curves: x, y or x,y. Values of 0 and below are left out
    #[arg(long, value_enum, value_delimiter = ',', value_name = "AXIS,AXIS")]
    log: Vec<LogAxis>,
}

/// Colors and size of letters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PrintTheme {
    /// White page, letters of 12px, or 8pt with --width
    Paper,
    /// White page, letters one and a half times as large
    Talk,
    /// Dark page
    Dark,
}

/// An axis that is logarithmic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum LogAxis {
    /// The horizontal axis
    X,
    /// The vertical axis
    Y,
}

impl PrintArgs {
    /// The layout of a figure; an error if a logarithmic axis shall begin at 0 or below.
    pub(super) fn layout(&self) -> Result<PrintLayout, CliError> {
        let logarithmic = [LogAxis::X, LogAxis::Y].map(|axis| self.log.contains(&axis));
        let ranges = [("x", self.x_range), ("y", self.y_range)];
        for ((axis, range), is_logarithmic) in ranges.into_iter().zip(logarithmic) {
            if is_logarithmic && range.is_some_and(|[low, _]| low <= 0.0) {
                return Err(CliError::Usage(format!(
                    "--{axis}-range with --log {axis}: expected a range above 0"
                )));
            }
        }
        Ok(PrintLayout {
            theme: match self.theme {
                PrintTheme::Paper => Theme::Paper,
                PrintTheme::Talk => Theme::Talk,
                PrintTheme::Dark => Theme::Dark,
            },
            logarithmic,
            width: self.width,
            height: self.height,
            font: self.font,
            without_title: self.no_title,
            without_legends: self.no_legend,
            x_range: self.x_range,
            y_range: self.y_range,
        })
    }
}

/// Parses a length in print, e.g. `8.4cm`, to CSS pixels.
fn parse_length(text: &str) -> Result<f64, String> {
    let units = [
        ("cm", 96.0 / 2.54),
        ("mm", 96.0 / 25.4),
        ("in", 96.0),
        ("pt", 96.0 / 72.0),
        ("px", 1.0),
    ];
    let length = units.into_iter().find_map(|(unit, pixels)| {
        let number: f64 = text.strip_suffix(unit)?.trim().parse().ok()?;
        Some(number * pixels)
    });
    length
        .filter(|length| (4.0..=10_000.0).contains(length))
        .ok_or_else(|| {
            "expected a number with cm, mm, in, pt or px, e.g. 8.4cm, from 4px to 10000px"
                .to_owned()
        })
}

/// Parses a length of a page, e.g. `8.4cm`, to CSS pixels.
fn parse_side(text: &str) -> Result<f64, String> {
    let length = parse_length(text)?;
    if length < 72.0 {
        return Err("expected at least 72px = 1.9cm = 54pt".to_owned());
    }
    Ok(length)
}

/// Parses a range of an axis, e.g. `-1..1`.
fn parse_range(text: &str) -> Result<[f64; 2], String> {
    let ends = text.split_once("..").and_then(|(from, to)| {
        let ends = [from.parse::<f64>().ok()?, to.parse::<f64>().ok()?];
        (ends[0].is_finite() && ends[1].is_finite() && ends[0] < ends[1]).then_some(ends)
    });
    ends.ok_or_else(|| "expected A..B with A below B, e.g. 0..200".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_a_unit() {
        let pixels = |text| parse_length(text).map(|length| (length * 100.0).round() / 100.0);
        assert_eq!(
            ["8.4cm", "84 mm", "1in", "72pt", "320px"].map(pixels),
            [Ok(317.48), Ok(317.48), Ok(96.0), Ok(96.0), Ok(320.0)]
        );
        for wrong in ["8.4", "cm", "-3cm", "0px", "nancm", "1e9cm", "8,4cm"] {
            assert!(
                parse_length(wrong)
                    .unwrap_err()
                    .starts_with("expected a number with cm")
            );
        }
        assert!(parse_side("8pt").is_err() && parse_side("2cm").is_ok());
        assert_eq!(parse_range("-1..2.5"), Ok([-1.0, 2.5]));
        for wrong in ["1..1", "..5", "2..1", "a..b", "0..inf"] {
            assert!(parse_range(wrong).is_err(), "{wrong}");
        }
    }
}
