//! Values of parameters, drawn from their distributions.

use rand::RngExt;

use super::file::{Distribution, Parameter};
use seedbed_input::Located;
use seedbed_random::Stream;

/// A value that replaces `{}`.
#[derive(Clone, Debug)]
pub(super) struct Value<'a> {
    /// The text.
    pub text: String,
    /// Its place in the tuning file, if it stands there.
    pub place: Option<&'a Located<String>>,
}

/// Number of digits after the first one of drawn numbers.
const MORE_DIGITS: usize = 3;

impl Parameter {
    /// Draws a value. Each distribution takes one number from the stream.
    pub(super) fn draw(&self, stream: &mut Stream) -> Value<'_> {
        match &*self.draw {
            Distribution::Uniform(low, high) => {
                let (low, high) = (low.get(), high.get());
                let share = stream.random::<f64>();
                number(low + share * (high - low), [low, high])
            }
            Distribution::LogUniform(low, high) => {
                let (low, high) = (low.get(), high.get());
                let share = stream.random::<f64>();
                number(
                    (low.ln() + share * (high.ln() - low.ln())).exp(),
                    [low, high],
                )
            }
            Distribution::Integer(low, high) => {
                Value::unnamed(stream.random_range(*low..=*high).to_string())
            }
            Distribution::Choice(values) => {
                Value::named(&values[stream.random_range(0..values.len() as u64) as usize])
            }
        }
    }

    /// The first and the last number, or all texts: if these are valid, most draws are.
    pub(super) fn extremes(&self) -> Vec<Value<'_>> {
        let ends = |ends: [f64; 2]| ends.map(|end| number(end, ends)).to_vec();
        match &*self.draw {
            Distribution::Uniform(low, high) => ends([low.get(), high.get()]),
            Distribution::LogUniform(low, high) => ends([low.get(), high.get()]),
            Distribution::Integer(low, high) => [low, high]
                .map(|end| Value::unnamed(end.to_string()))
                .to_vec(),
            Distribution::Choice(values) => values.iter().map(Value::named).collect(),
        }
    }
}

/// Share of a range that counts as its edge.
const EDGE: f64 = 0.1;

impl Distribution {
    /// Whether a drawn value is at an edge of the range: better ones may lie beyond. Of texts, the smallest and the largest of at
    /// least three numbers.
    pub(super) fn is_at_an_edge(&self, text: &str) -> bool {
        let Ok(value) = text.parse::<f64>() else {
            return false;
        };
        let share = match self {
            Self::Uniform(low, high) => (value - low.get()) / (high.get() - low.get()),
            Self::LogUniform(low, high) => (value / low.get()).ln() / (high.get() / low.get()).ln(),
            Self::Integer(low, high) => {
                let ends = [low, high].map(|end| f64::from(*end));
                return high - low >= 2 && ends.contains(&value);
            }
            Self::Choice(texts) => return is_extreme_of(value, texts),
        };
        !(EDGE..=1.0 - EDGE).contains(&share)
    }
}

/// Whether a number is the smallest or the largest of at least three different ones.
fn is_extreme_of(value: f64, texts: &[Located<String>]) -> bool {
    let numbers: Option<Vec<f64>> = texts.iter().map(|text| text.parse().ok()).collect();
    numbers.is_some_and(|numbers| {
        let is_below = numbers.iter().any(|other| *other < value);
        let is_above = numbers.iter().any(|other| *other > value);
        numbers.len() >= 3 && is_below != is_above
    })
}

impl<'a> Value<'a> {
    fn unnamed(text: String) -> Self {
        Self { text, place: None }
    }

    fn named(text: &'a Located<String>) -> Self {
        Self {
            text: text.value().clone(),
            place: Some(text),
        }
    }
}

/// A number with four significant digits, so that people can write it down; an end of its range if
/// rounding would leave the range.
fn number(value: f64, [low, high]: [f64; 2]) -> Value<'static> {
    let rounded: f64 = format!("{value:.MORE_DIGITS$e}").parse().unwrap_or(value);
    Value::unnamed(rounded.clamp(low, high).to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_random::{Purpose, stream};

    fn draws(draw: &str) -> Vec<String> {
        let text = format!("(set: [\"x={{}}\"], draw: {draw})");
        let parameter: Parameter = seedbed_input::parse("x.ron", text).unwrap().value;
        let draw = |index| {
            let mut stream = stream(0, Purpose::TuningConfiguration, 0, index);
            parameter.draw(&mut stream).text
        };
        (0..2000).map(draw).collect()
    }

    fn numbers(draw: &str) -> Vec<f64> {
        draws(draw)
            .iter()
            .map(|text| text.parse().unwrap())
            .collect()
    }

    /// The logarithm of a log-uniform number from 0.0001 to 0.01 is on average that of 0.001, with a
    /// standard deviation of ln 100 / √12; the mean of 2000 is within five standard errors.
    #[test]
    fn log_uniform_numbers_are_uniform_in_their_logarithm() {
        let numbers = numbers("LogUniform(1e-4, 1e-2)");
        assert!(numbers.iter().all(|number| (1e-4..=1e-2).contains(number)));
        let mean = numbers.iter().map(|number| number.ln()).sum::<f64>() / 2000.0;
        let error = 100_f64.ln() / 12_f64.sqrt() / 2000_f64.sqrt();
        assert!((mean - 1e-3_f64.ln()).abs() < 5.0 * error, "{mean}");
        let below = numbers.iter().filter(|number| **number < 1e-3).count();
        assert!((900..1100).contains(&below), "{below}");
    }

    /// The outer tenths of a range, of its logarithm, and the ends of lists.
    #[test]
    fn values_at_the_edges_of_ranges_are_seen() {
        for (draw, inside, at_edges) in [
            ("Uniform(-1, 3)", ["-0.6", "2.6"], ["-0.61", "2.61"]),
            (
                "LogUniform(1e-4, 1e-2)",
                ["0.00016", "0.0063"],
                ["0.00015", "0.0064"],
            ),
            ("Integer(1, 3)", ["2", "2"], ["1", "3"]),
            (r#"Choice(["0.1", "1", "10"])"#, ["1", "1"], ["0.1", "10"]),
        ] {
            let text = format!("(set: [\"x={{}}\"], draw: {draw})");
            let parameter: Parameter = seedbed_input::parse("x.ron", text).unwrap().value;
            assert!(
                inside
                    .iter()
                    .all(|text| !parameter.draw.is_at_an_edge(text)),
                "{draw}"
            );
            assert!(
                at_edges
                    .iter()
                    .all(|text| parameter.draw.is_at_an_edge(text)),
                "{draw}"
            );
        }
        for draw in [
            r#"Choice(["true", "false", "1"])"#,
            r#"Choice(["1", "2"])"#,
            "Integer(0, 1)",
        ] {
            let text = format!("(set: [\"x={{}}\"], draw: {draw})");
            let parameter: Parameter = seedbed_input::parse("x.ron", text).unwrap().value;
            assert!(!parameter.draw.is_at_an_edge("1"), "{draw}");
        }
    }

    #[test]
    fn uniform_numbers_have_four_digits_and_stay_in_their_range() {
        let numbers = numbers("Uniform(-1, 3)");
        let mean = numbers.iter().sum::<f64>() / 2000.0;
        assert!(
            (mean - 1.0).abs() < 5.0 * 4.0 / 12_f64.sqrt() / 2000_f64.sqrt(),
            "{mean}"
        );
        for text in draws("Uniform(0.99991, 0.99994)") {
            assert!(
                ["0.99991", "0.99994", "0.9999"].contains(&text.as_str()),
                "{text}"
            );
        }
        assert_eq!(number(0.001_234_56, [0.0, 1.0]).text, "0.001235");
        assert_eq!(number(123_456.0, [0.0, 1e6]).text, "123500");
    }

    #[test]
    fn integers_and_choices_include_all_values() {
        for draw in ["Integer(2, 4)", r#"Choice(["2", "3", "4"])"#] {
            let mut values = draws(draw);
            values.sort();
            values.dedup();
            assert_eq!(values, ["2", "3", "4"], "{draw}");
        }
    }
}
