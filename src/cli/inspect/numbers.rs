//! Numbers as texts for people.

use seedbed::text::without_trailing_zeros;

/// A share in percent, which is not shown as 0 unless it is 0.
pub(super) fn format_percent(share: Option<f64>) -> String {
    match share.filter(|share| share.is_finite()) {
        None => "–".to_owned(),
        Some(share) if 0.0 < share && share < 0.0005 => "< 0.1 %".to_owned(),
        Some(share) => format!("{:.1} %", 100.0 * share),
    }
}

/// Formats a number with four significant digits, but at most six decimals, without trailing zeros.
/// Digits before the decimal point are never rounded.
pub(super) fn format_number(value: f64) -> String {
    match value {
        f64::INFINITY => return "∞".to_owned(),
        f64::NEG_INFINITY => return "−∞".to_owned(),
        _ if value.is_nan() => return "NaN".to_owned(),
        _ => {}
    }
    let integer_digits = if value == 0.0 {
        0
    } else {
        value.abs().log10().floor() as i32 + 1
    };
    let text = format!("{value:.*}", (4 - integer_digits).clamp(0, 6) as usize);
    without_trailing_zeros(&text).to_owned()
}

/// The number, or a dash if there is none.
pub(super) fn format_or_dash(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), format_number)
}

pub(super) fn with_thousands_separators(number: u64) -> String {
    indicatif::HumanCount(number).to_string()
}

/// Smallest and largest value other than NaN; `None` without such values.
pub(super) fn min_max(values: &[f64]) -> Option<[f64; 2]> {
    let numbers = values.iter().filter(|value| !value.is_nan());
    let extremes = numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| {
        [low.min(value), high.max(value)]
    });
    (extremes[0] <= extremes[1]).then_some(extremes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_significant_digits() {
        let numbers = [
            0.0,
            195.0,
            -1_234.56,
            0.012_342,
            1e6,
            f64::NAN,
            f64::NEG_INFINITY,
            -0.000_000_1,
        ]
        .map(format_number);
        assert_eq!(
            numbers,
            ["0", "195", "-1235", "0.01234", "1000000", "NaN", "−∞", "0"]
        );
        assert_eq!(format_or_dash(None), "–");
        assert_eq!(
            [0.0, 1e-5, 0.0005, 0.3].map(|share| format_percent(Some(share))),
            ["0.0 %", "< 0.1 %", "0.1 %", "30.0 %"]
        );
    }

    #[test]
    fn the_range_of_values_leaves_nan_out() {
        assert_eq!(min_max(&[f64::NAN, 2.0, -1.0]), Some([-1.0, 2.0]));
        assert_eq!(min_max(&[f64::NAN]), None);
    }
}
