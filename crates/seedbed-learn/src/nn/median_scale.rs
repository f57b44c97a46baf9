//! The typical size of positive numbers whose distribution has a heavy tail and drifts: the mean of
//! the latest medians.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// The medians of the latest batches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MedianScale {
    kept: usize,
    medians: VecDeque<f32>,
}

/// Below this, numbers count as 0. A bound from below keeps ratios finite.
const MINIMUM: f32 = 1e-12;

impl MedianScale {
    /// A scale that will be the mean of the latest `kept` medians.
    ///
    /// # Panics
    /// If it would keep none.
    #[must_use]
    pub fn new(kept: usize) -> Self {
        assert!(kept > 0, "a mean of at least one median");
        Self {
            kept,
            medians: VecDeque::with_capacity(kept),
        }
    }

    /// Takes in the median of a batch and forgets the oldest beyond those kept. `numbers` are
    /// reordered; without any nothing moves.
    pub fn update(&mut self, numbers: &mut [f32]) {
        if numbers.is_empty() {
            return;
        }
        if self.medians.len() == self.kept {
            self.medians.pop_front();
        }
        self.medians.push_back(median(numbers));
    }

    /// The mean of the medians, bounded from below; nothing before the first update.
    #[must_use]
    pub fn scale(&self) -> Option<f32> {
        let mean = self.medians.iter().sum::<f32>() / self.medians.len() as f32;
        (!self.medians.is_empty()).then_some(mean.max(MINIMUM))
    }
}

/// The middle of the sorted numbers, or the mean of the two in the middle.
fn median(numbers: &mut [f32]) -> f32 {
    let even = numbers.len().is_multiple_of(2);
    let (below, &mut middle, _) = numbers.select_nth_unstable_by(numbers.len() / 2, f32::total_cmp);
    let lower = below
        .iter()
        .copied()
        .max_by(f32::total_cmp)
        .filter(|_| even);
    0.5 * (lower.unwrap_or(middle) + middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Medians 2, (2 + 8)/2 = 5 and 11, of which the latest two are kept: 2, 3.5, 8.
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
    fn a_scale_of_zeros_is_no_zero() {
        let mut scale = MedianScale::new(3);
        scale.update(&mut [0.0; 4]);
        assert!(scale.scale().is_some_and(|scale| scale > 0.0));
    }
}
