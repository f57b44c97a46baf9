//! The typical size of positive numbers whose distribution has a heavy tail and changes over time:
//! the mean of the latest medians.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// The medians of the latest batches, whose mean is the scale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MedianScale {
    /// Maximal number of medians.
    capacity: usize,
    medians: VecDeque<f32>,
}

/// Minimal scale, which keeps ratios to it finite.
const MIN_SCALE: f32 = 1e-12;

impl MedianScale {
    /// A scale that is the mean of at most `capacity` latest medians.
    ///
    /// # Panics
    /// If `capacity` is 0.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        assert!(capacity > 0, "capacity must be positive");
        Self {
            capacity,
            medians: VecDeque::with_capacity(capacity),
        }
    }

    /// Adds the median of a batch, and removes the oldest median if there are too many. Reorders
    /// `numbers`; does nothing if `numbers` is empty.
    pub fn update(&mut self, numbers: &mut [f32]) {
        if numbers.is_empty() {
            return;
        }
        if self.medians.len() == self.capacity {
            self.medians.pop_front();
        }
        self.medians.push_back(median(numbers));
    }

    /// The mean of the medians, but at least 10⁻¹²; none before the first update.
    #[must_use]
    pub fn scale(&self) -> Option<f32> {
        let mean = self.medians.iter().sum::<f32>() / self.medians.len() as f32;
        (!self.medians.is_empty()).then_some(mean.max(MIN_SCALE))
    }
}

/// The middle of the sorted numbers, or the mean of the two in the middle.
fn median(numbers: &mut [f32]) -> f32 {
    let is_even = numbers.len().is_multiple_of(2);
    let (smaller, &mut middle, _) =
        numbers.select_nth_unstable_by(numbers.len() / 2, f32::total_cmp);
    let other_middle = smaller
        .iter()
        .copied()
        .max_by(f32::total_cmp)
        .filter(|_| is_even);
    0.5 * (other_middle.unwrap_or(middle) + middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Medians 2, (2 + 8)/2 = 5 and 11, of which the latest two are averaged: 2, 3.5, 8.
    #[test]
    fn medians_by_hand() {
        let mut scale = MedianScale::new(2);
        assert_eq!(scale.scale(), None);
        scale.update(&mut []);
        assert_eq!(scale.scale(), None);
        scale.update(&mut [900.0, 1.0, 2.0]);
        assert_eq!(scale.scale(), Some(2.0));
        scale.update(&mut [8.0, 1.0, 2.0, 70.0]);
        assert_eq!(scale.scale(), Some(3.5));
        scale.update(&mut [11.0]);
        assert_eq!(scale.scale(), Some(8.0));
    }

    #[test]
    fn the_scale_of_zeros_is_positive() {
        let mut scale = MedianScale::new(3);
        scale.update(&mut [0.0; 4]);
        assert!(scale.scale().is_some_and(|scale| scale > 0.0));
    }
}
