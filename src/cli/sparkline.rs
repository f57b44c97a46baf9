//! Sparklines: curves drawn with block characters in one line of text.

const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Draws `values` with `columns` block characters. The height of each block is the mean of its part of the values,
/// on a scale from `low` to `high`.
pub(super) fn sparkline(values: &[f64], columns: usize, [low, high]: [f64; 2]) -> String {
    let columns = columns.min(values.len());
    let bound = |column: usize| column * values.len() / columns.max(1);
    (0..columns)
        .map(|column| block(mean(&values[bound(column)..bound(column + 1)]), low, high))
        .collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn block(value: f64, low: f64, high: f64) -> char {
    let share = if high > low {
        (value - low) / (high - low)
    } else {
        0.0
    };
    BLOCKS[((share * 8.0) as usize).min(7)]
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
    }
}
