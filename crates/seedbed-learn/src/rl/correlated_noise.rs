//! Noise that is correlated in time: each number has mean 0 and variance 1, whatever the correlation.
//!
//! It is a sum of N processes that each keep a share `ρᵢ` of themselves in a step (Uhlenbeck & Ornstein 1930, in discrete time):
//!
//! ```text
//! xᵢ ← ρᵢ xᵢ + √(1 − ρᵢ²) w,   w ~ 𝒩(0, 1);   noise = Σᵢ xᵢ / √N
//! ```
//!
//! All processes begin with a draw from 𝒩(0, 1), which is their stationary distribution. A process of Ornstein and
//! Uhlenbeck with correlation time τ has N = 1 and `ρ = exp(−1/τ)` (Lillicrap et al. 2016 explore with it). Pink noise,
//! whose power spectrum falls as 1/f (Eberhard et al. 2023), is the sum for times τ = 1, 2, 4, … steps: their spectra
//! add up to 1/f between the frequencies 1/τ of the first and the last.

use rand::Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::math;

/// How numbers of different steps are correlated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Correlation {
    /// Not at all.
    White,
    /// Pink noise, up to times of this number of steps.
    Pink {
        /// Number of steps, such as the longest episode.
        steps: u32,
    },
    /// By `exp(−n/τ)` for numbers that are n steps apart.
    OrnsteinUhlenbeck {
        /// Correlation time τ in steps.
        time: f32,
    },
    /// The number never changes.
    Constant,
}

/// Noise for the components of an action. Its state, which changes in each step, is kept by its user: `[components × N]`.
#[derive(Clone, Debug, PartialEq)]
pub struct CorrelatedNoise {
    /// ρ and √(1 − ρ²) of each process: `[N]`.
    processes: Vec<(f32, f32)>,
}

impl CorrelatedNoise {
    /// Noise whose components are independent of each other.
    #[must_use]
    pub fn new(correlation: Correlation) -> Self {
        let kept = match correlation {
            Correlation::White => vec![0.0],
            Correlation::Pink { steps } => pink_shares(steps),
            Correlation::OrnsteinUhlenbeck { time } => vec![math::exp(-1.0 / time)],
            Correlation::Constant => vec![1.0],
        };
        let with_added = |share: f32| (share, (1.0 - share * share).sqrt());
        Self {
            processes: kept.into_iter().map(with_added).collect(),
        }
    }

    /// Begins an episode: draws the state.
    pub fn begin(&self, components: usize, state: &mut Vec<f32>, random: &mut impl Rng) {
        state.clear();
        for _ in 0..components * self.processes.len() {
            state.push(StandardNormal.sample(random));
        }
    }

    /// The noise of one component in the present step.
    #[must_use]
    pub fn component(&self, index: usize, state: &[f32]) -> f32 {
        let count = self.processes.len();
        let processes = &state[index * count..(index + 1) * count];
        processes.iter().sum::<f32>() / (count as f32).sqrt()
    }

    /// Goes on to the next step.
    pub fn advance(&self, state: &mut [f32], random: &mut impl Rng) {
        for processes in state.chunks_exact_mut(self.processes.len()) {
            for (x, &(kept, added)) in processes.iter_mut().zip(&self.processes) {
                let white: f32 = StandardNormal.sample(random);
                *x = kept * *x + added * white;
            }
        }
    }
}

/// The shares that the processes of pink noise keep: of times 1, 2, 4, … up to `steps`.
fn pink_shares(steps: u32) -> Vec<f32> {
    let count = 1 + steps.max(1).ilog2();
    (0..count)
        .map(|power| math::exp(-1.0 / (1_u32 << power) as f32))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_random::{Purpose, stream};

    /// Episodes of noise of one component: `[episodes][steps]`.
    fn episodes(correlation: Correlation, count: u32, steps: usize) -> Vec<Vec<f64>> {
        let noise = CorrelatedNoise::new(correlation);
        let episode = |number| {
            let mut random = stream(7, Purpose::Trial, 0, number);
            let mut state = Vec::new();
            noise.begin(1, &mut state, &mut random);
            let mut numbers = Vec::with_capacity(steps);
            for _ in 0..steps {
                numbers.push(f64::from(noise.component(0, &state)));
                noise.advance(&mut state, &mut random);
            }
            numbers
        };
        (0..count).map(episode).collect()
    }

    /// Mean over episodes of the product of the numbers of two steps.
    fn correlation_of(episodes: &[Vec<f64>], one: usize, other: usize) -> f64 {
        let products = episodes.iter().map(|numbers| numbers[one] * numbers[other]);
        products.sum::<f64>() / episodes.len() as f64
    }

    /// exp(−n/τ) with τ = 20: 0.368 after 20 steps. Of 4,000 products of normal numbers with correlation ρ, the mean has a
    /// standard error of √((1 + ρ²)/4000), at most 0.0224: tolerances are four of them.
    #[test]
    fn correlations_are_those_of_the_formulas() {
        let ornstein_uhlenbeck = Correlation::OrnsteinUhlenbeck { time: 20.0 };
        for (correlation, after_one, after_twenty) in [
            (Correlation::White, 0.0, 0.0),
            (ornstein_uhlenbeck, (-0.05_f64).exp(), (-1.0_f64).exp()),
            (Correlation::Constant, 1.0, 1.0),
        ] {
            let episodes = episodes(correlation, 4000, 31);
            for (one, other, expected) in [
                (0, 0, 1.0),
                (30, 30, 1.0),
                (0, 1, after_one),
                (10, 30, after_twenty),
            ] {
                let found = correlation_of(&episodes, one, other);
                assert!(
                    (found - expected).abs() < 0.09,
                    "{correlation:?}, steps {one} and {other}: {found}, expected {expected}"
                );
            }
        }
    }

    /// Power at the frequencies 1/16 and 1/128 of a step: in pink noise 8 times as much at the lower one, in white noise as
    /// much, in that of Ornstein and Uhlenbeck with long times 64 times as much. The power of 2,000 episodes has a
    /// relative standard error of 1/√2000, and that of a ratio of 3.2 %; the sum of processes differs from 1/f by up to
    /// some per cent.
    #[test]
    fn the_spectrum_of_pink_noise_falls_as_one_over_the_frequency() {
        let steps = 1024;
        let power = |episodes: &[Vec<f64>], period: f64| {
            let of_episode = |numbers: &Vec<f64>| {
                let (mut real, mut imaginary) = (0.0, 0.0);
                for (step, number) in numbers.iter().enumerate() {
                    let (sin, cos) = (std::f64::consts::TAU * step as f64 / period).sin_cos();
                    real += number * cos;
                    imaginary += number * sin;
                }
                real * real + imaginary * imaginary
            };
            episodes.iter().map(of_episode).sum::<f64>()
        };
        for (correlation, low, high) in [
            (Correlation::White, 0.85, 1.15),
            (Correlation::Pink { steps: 1024 }, 6.8, 9.2),
            (Correlation::OrnsteinUhlenbeck { time: 1e4 }, 50.0, 80.0),
        ] {
            let episodes = episodes(correlation, 2000, steps);
            let ratio = power(&episodes, 128.0) / power(&episodes, 16.0);
            assert!((low..high).contains(&ratio), "{correlation:?}: {ratio}");
        }
    }

    /// 10 processes for 1,000 steps (times 1 to 512), whose sum has variance 1 too.
    #[test]
    fn pink_noise_has_unit_variance() {
        assert_eq!(pink_shares(1000).len(), 10);
        let episodes = episodes(Correlation::Pink { steps: 1000 }, 4000, 2);
        let variance = correlation_of(&episodes, 1, 1);
        assert!((variance - 1.0).abs() < 0.09, "{variance}");
    }
}
