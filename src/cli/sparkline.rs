//! Sparklines: curves drawn with block characters in one line of text.

const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Draws `values` with `columns` block characters, or fewer if there are fewer values. Each block
/// shows the mean of consecutive values by its height, on a scale from `low` to `high`; NaN is a dot.
pub(super) fn sparkline(values: &[f64], columns: usize, [low, high]: [f64; 2]) -> String {
    let columns = columns.min(values.len());
    let first_index = |column: usize| column * values.len() / columns.max(1);
    (0..columns)
        .map(|column| {
            block(
                mean(&values[first_index(column)..first_index(column + 1)]),
                low,
                high,
            )
        })
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn block(value: f64, low: f64, high: f64) -> char {
    if value.is_nan() {
        return '·';
    }
    let height = if high > low {
        (value - low) / (high - low)
    } else {
        0.0
    };
    BLOCKS[((height * 8.0) as usize).min(7)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_rise_with_values() {
        let values: Vec<f64> = (0..8).map(f64::from).collect();
        assert_eq!(sparkline(&values, 8, [0.0, 7.0]), "▁▂▃▄▅▆▇█");
        assert_eq!(
            sparkline(&values, 4, [0.0, 8.0]),
            "▁▃▅▇",
            "means 0.5, 2.5, 4.5, 6.5 of 8"
        );
        assert_eq!(sparkline(&[3.0; 5], 3, [3.0, 3.0]), "▁▁▁");
        assert_eq!(sparkline(&[], 3, [0.0, 1.0]), "");
        assert_eq!(sparkline(&[0.0, f64::NAN, 7.0], 3, [0.0, 7.0]), "▁·█");
    }
}
