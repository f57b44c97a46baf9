//! Distributions of start coordinates and of numbers that are drawn for a run.

use rand::RngExt;
use rand_distr::{Distribution as _, Normal};

use seedbed_random::Stream;

/// The distribution of a random number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distribution {
    /// Always this number.
    Constant(f64),
    /// Uniform from low to high.
    Uniform {
        /// Minimum.
        low: f64,
        /// Maximum.
        high: f64,
    },
    /// Gaussian.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        deviation: f64,
    },
    /// Each whole number from `from` to `to`, with equal probability.
    WholeNumber {
        /// Minimum.
        from: i32,
        /// Maximum.
        to: i32,
    },
}

impl Distribution {
    /// Draws a number in single precision.
    pub(crate) fn draw_f32(&self, random: &mut Stream) -> f32 {
        self.draw(random).clamp(f32::MIN.into(), f32::MAX.into()) as f32
    }

    /// Draws a number.
    pub fn draw(&self, random: &mut Stream) -> f64 {
        match *self {
            Self::Constant(value) => value,
            Self::Uniform { low, high } => low + (high - low) * random.random::<f64>(),
            Self::Normal { mean, deviation } => {
                Normal::new(mean, deviation).map_or(mean, |normal| normal.sample(random))
            }
            Self::WholeNumber { from, to } => f64::from(random.random_range(from..=to)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_random::{Purpose, stream};

    /// Mean and standard deviation of 10,000 draws.
    fn moments(distribution: Distribution) -> (f64, f64) {
        let mut random = stream(0, Purpose::Reset, 0, 0);
        let draws: Vec<_> = (0..10_000)
            .map(|_| distribution.draw(&mut random))
            .collect();
        let mean = draws.iter().sum::<f64>() / 1e4;
        (
            mean,
            (draws.iter().map(|draw| (draw - mean).powi(2)).sum::<f64>() / 1e4).sqrt(),
        )
    }

    /// The standard errors of the moments of 10,000 draws are about 1 % of the standard deviation.
    /// The standard deviation of a uniform distribution is its width / √12.
    #[test]
    fn draws_have_the_moments_of_the_distribution() {
        assert_eq!(moments(Distribution::Constant(2.5)), (2.5, 0.0));
        for (distribution, expected) in [
            (
                Distribution::Uniform {
                    low: -1.0,
                    high: 3.0,
                },
                (1.0, 4.0 / 12.0_f64.sqrt()),
            ),
            (
                Distribution::Normal {
                    mean: -2.0,
                    deviation: 0.5,
                },
                (-2.0, 0.5),
            ),
            // Eight numbers: a variance of (8² − 1) / 12.
            (
                Distribution::WholeNumber { from: -1, to: 6 },
                (2.5, (63.0 / 12.0_f64).sqrt()),
            ),
        ] {
            let (mean, deviation) = moments(distribution);
            assert!(
                (mean - expected.0).abs() < 0.04 * expected.1,
                "{distribution:?}: {mean}"
            );
            assert!(
                (deviation / expected.1 - 1.0).abs() < 0.03,
                "{distribution:?}: {deviation}"
            );
        }
    }
}
