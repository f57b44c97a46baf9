//! Scales of axes: positions of values, ticks, and their labels.

/// Maps a range of values to a range of positions on the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    values: [f64; 2],
    positions: [f64; 2],
    logarithmic: bool,
}

impl Scale {
    pub(super) fn new(values: [f64; 2], positions: [f64; 2]) -> Self {
        Self {
            values,
            positions,
            logarithmic: false,
        }
    }

    /// Makes the scale logarithmic or linear. Values of a logarithmic scale must be above 0.
    pub(super) fn logarithmic(self, logarithmic: bool) -> Self {
        Self {
            logarithmic,
            ..self
        }
    }

    /// Values at both ends.
    pub(super) fn values(&self) -> [f64; 2] {
        self.values
    }

    pub(super) fn position(&self, value: f64) -> f64 {
        let [from, to] = self.positions;
        let [value, low, high] = [value, self.values[0], self.values[1]]
            .map(|value| if self.logarithmic { value.ln() } else { value });
        from + (value - low) / (high - low) * (to - from)
    }

    /// Ticks at about `count` round values, with their labels. Those of a logarithmic scale are equally
    /// spaced values if its range has fewer than two of 1, 2, 5, 10, 20, ….
    pub(super) fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        let [low, high] = self.values;
        if self.logarithmic {
            let ticks = logarithmic_ticks([low, high], count);
            if ticks.len() > 1 {
                return ticks;
            }
        }
        let step =
            step_of_several_ticks([low, high], round_step((high - low) / count.max(1) as f64));
        let [first, last] = multiples_within([low, high], step);
        (first..=last)
            .map(|index| index as f64 * step)
            .map(|value| (value, tick_label(value, step, low.abs().max(high.abs()))))
            .collect()
    }
}

/// The first and the last multiple of a step within a range.
fn multiples_within([low, high]: [f64; 2], step: f64) -> [i64; 2] {
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    [first, last]
}

/// A round step or, if a range has one multiple of it only, which says nothing of its length, the largest of some smaller steps
/// with several. Steps have one digit, because labels have as many decimals as it needs.
fn step_of_several_ticks(range: [f64; 2], step: f64) -> f64 {
    let has_several = |step: &f64| {
        let [first, last] = multiples_within(range, *step);
        last > first
    };
    let power = 10_f64.powf((step.log10() + 1e-9).floor());
    let smaller = [5.0, 4.0, 2.0, 1.0, 0.5, 0.4, 0.2].map(|digit| digit * power);
    let smaller = smaller.into_iter().filter(|smaller| *smaller < step);
    let mut steps = std::iter::once(step).chain(smaller);
    steps.find(has_several).unwrap_or(step)
}

/// Ticks at no more than `count` powers of ten, with their labels. If fewer than three are in the
/// range, there are also ticks at two and five times these powers.
fn logarithmic_ticks([low, high]: [f64; 2], count: usize) -> Vec<(f64, String)> {
    let (first, last) = (
        (low.log10() - 1e-9).ceil() as i32,
        (high.log10() + 1e-9).floor() as i32,
    );
    let powers = (last - first + 1).max(0) as usize;
    let values: Vec<f64> = if powers < 3 {
        let is_inside = |value: &f64| (low..=high).contains(value);
        let around = (first - 1..=last).map(|power| 10_f64.powi(power));
        let multiples = around.flat_map(|power| [1.0, 2.0, 5.0].map(|factor| factor * power));
        multiples.filter(is_inside).collect()
    } else {
        let powers_per_tick = powers.div_ceil(count.max(1));
        let shown = (first..=last).step_by(powers_per_tick);
        shown.map(|power| 10_f64.powi(power)).collect()
    };
    let label = |value| (value, format_number(value));
    values.into_iter().map(label).collect()
}

/// A round number close to `approximate`: 1, 2 or 5 times a power of ten.
fn round_step(approximate: f64) -> f64 {
    let power = 10_f64.powf(approximate.log10().floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|factor| factor * power >= 0.7 * approximate);
    factor.unwrap_or(10.0) * power
}

/// The label of a tick, with as many decimals as the step between ticks needs. If the largest
/// magnitude on the axis is at least 10⁴ or 10⁶, values are in thousands (`k`) or millions (`M`).
fn tick_label(value: f64, step: f64, max_magnitude: f64) -> String {
    let (unit, suffix) = match max_magnitude {
        1e6.. => (1e6, "M"),
        1e4.. => (1e3, "k"),
        _ => (1.0, ""),
    };
    let decimals = (-((step / unit).log10() + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    if value.abs() < step * 1e-6 {
        return "0".to_owned();
    }
    with_minus_sign(&format!("{:.decimals$}{suffix}", value / unit))
}

/// Replaces hyphens by minus signs.
pub(super) fn with_minus_sign(number: &str) -> String {
    number.replace('-', "−")
}

/// A number with at most four significant digits and no trailing zeros.
pub(super) fn format_number(value: f64) -> String {
    format_significant(value, 4)
}

/// A number with at most `digits` significant digits and no trailing zeros.
pub(super) fn format_significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let whole_digits = value.abs().max(1e-300).log10().floor() as i32 + 1;
    let decimals = (digits - whole_digits).clamp(0, 9) as usize;
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    if text == "-0" {
        "0".to_owned()
    } else {
        with_minus_sign(text)
    }
}

/// A share in percent, such as `30 %`.
pub(super) fn percent(share: f64) -> String {
    format!("{} %", format_significant(100.0 * share, 1))
}

/// Position of a count between 1 and `max_count` on a logarithmic scale, 0 to 1.
pub(super) fn log_position(count: f64, max_count: u32) -> f64 {
    if max_count > 1 {
        (count.max(1.0).ln() / f64::from(max_count).ln()).min(1.0)
    } else {
        0.0
    }
}

/// The range of the finite `values`, widened if it has no extent; 0 to 1 if there are none.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let ends =
        values
            .filter(|value| value.is_finite())
            .fold(None, |ends: Option<[f64; 2]>, value| {
                Some(ends.map_or([value; 2], |[low, high]| [low.min(value), high.max(value)]))
            });
    let [low, high] = ends.unwrap_or([0.0, 1.0]);
    if high > low {
        [low, high]
    } else {
        [
            low - 0.5_f64.max(low.abs() / 10.0),
            low + 0.5_f64.max(low.abs() / 10.0),
        ]
    }
}

/// The range with margins of 5 % at both ends; a margin does not extend beyond zero.
pub(super) fn padded([low, high]: [f64; 2]) -> [f64; 2] {
    let margin = 0.05 * (high - low);
    let lower = if low >= 0.0 {
        (low - margin).max(0.0)
    } else {
        low - margin
    };
    [
        lower,
        if high <= 0.0 {
            (high + margin).min(0.0)
        } else {
            high + margin
        },
    ]
}

/// The range of a logarithmic scale with margins of 5 % at both ends.
pub(super) fn padded_ratio([low, high]: [f64; 2]) -> [f64; 2] {
    let margin = (high / low).powf(0.05);
    [low / margin, high * margin]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64) -> Vec<String> {
        Scale::new([low, high], [0.0, 1.0])
            .ticks(5)
            .into_iter()
            .map(|(_, label)| label)
            .collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(labels(0.0, 200.0), ["0", "50", "100", "150", "200"]);
        assert_eq!(labels(-0.21, 0.21), ["−0.2", "−0.1", "0", "0.1", "0.2"]);
        assert_eq!(labels(0.0, 1.0), ["0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(
            labels(0.0, 250_000.0),
            ["0", "50k", "100k", "150k", "200k", "250k"]
        );
        assert_eq!(labels(3.0, 9.5), ["3", "4", "5", "6", "7", "8", "9"]);
    }

    /// A single tick says nothing of a length, and labels are the numbers where they stand.
    #[test]
    fn short_axes_have_several_ticks_with_their_values() {
        for end in [4.8, 1.9, 0.45, 0.19, 0.048, 19.0] {
            for count in 1..=3 {
                let ticks = Scale::new([-end, end], [0.0, 1.0]).ticks(count);
                assert!(ticks.len() > 1, "±{end}, {count}: {ticks:?}");
                for (value, label) in ticks {
                    let said: f64 = label.replace('−', "-").parse().unwrap();
                    assert!((said - value).abs() < 1e-9 * end, "{value}: {label}");
                }
            }
        }
    }

    #[test]
    fn positions_are_linear() {
        let scale = Scale::new([0.0, 4.0], [100.0, 20.0]);
        assert_eq!(
            (
                scale.position(0.0),
                scale.position(1.0),
                scale.position(4.0)
            ),
            (100.0, 80.0, 20.0)
        );
    }

    /// On a logarithmic scale, 1 is one third of the way from 0.1 to 100.
    #[test]
    fn positions_are_logarithmic() {
        let scale = Scale::new([0.1, 100.0], [0.0, 30.0]).logarithmic(true);
        assert!((scale.position(1.0) - 10.0).abs() < 1e-9 && scale.position(0.1) == 0.0);
        let labels = |count| {
            scale
                .ticks(count)
                .into_iter()
                .map(|(_, label)| label)
                .collect::<Vec<_>>()
        };
        assert_eq!(
            (labels(5), labels(2)),
            (
                ["0.1", "1", "10", "100"].map(str::to_owned).to_vec(),
                vec!["0.1".into(), "10".into()]
            )
        );
    }

    #[test]
    fn short_logarithmic_axes_have_ticks_between_powers_of_ten() {
        let labels = |low, high| {
            let scale = Scale::new([low, high], [0.0, 1.0]).logarithmic(true);
            let ticks = scale.ticks(5).into_iter();
            ticks.map(|(_, label)| label).collect::<Vec<_>>()
        };
        assert_eq!(labels(3.0, 24.0), ["5", "10", "20"]);
        assert_eq!(labels(0.9, 260.0), ["1", "10", "100"]);
        assert_eq!(labels(1.0, 50.0), ["1", "2", "5", "10", "20", "50"]);
        assert_eq!(
            labels(12.0, 19.0),
            ["12", "13", "14", "15", "16", "17", "18", "19"]
        );
    }

    #[test]
    fn numbers_have_four_significant_digits() {
        let texts = [0.0, 127.5, -6.0, 0.123_456, 12_345.6, f64::INFINITY].map(format_number);
        assert_eq!(texts, ["0", "127.5", "−6", "0.1235", "12346", "–"]);
    }

    #[test]
    fn extents_are_never_empty() {
        assert_eq!(extent([3.0, -1.0, f64::NAN].into_iter()), [-1.0, 3.0]);
        assert_eq!(extent([2.0].into_iter()), [1.5, 2.5]);
        assert_eq!(extent([].into_iter()), [0.0, 1.0]);
        assert_eq!(padded([0.0, 100.0]), [0.0, 105.0]);
    }
}
