//! What an agent draws its actions from, and what it keeps from step to step of an episode.

use rand::{Rng, RngExt};
use rand_distr::{Distribution as _, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::rl::correlated_noise::CorrelatedNoise;
use seedbed_random::Stream;

/// The random stream of an agent's actions, and what its present episode has drawn for several steps.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ActionRandom {
    /// The random stream.
    pub stream: Stream,
    /// State of correlated noise; empty before the first step of an episode.
    noise: Vec<f32>,
    /// A choice that is repeated, for each component of an action that has one.
    repeated: Vec<RepeatedChoice>,
}

/// A choice that is repeated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct RepeatedChoice {
    choice: usize,
    steps_left: u32,
}

impl From<Stream> for ActionRandom {
    fn from(stream: Stream) -> Self {
        Self {
            stream,
            noise: Vec::new(),
            repeated: Vec::new(),
        }
    }
}

impl ActionRandom {
    /// Forgets what the episode before has drawn.
    pub fn begin_episode(&mut self) {
        self.noise.clear();
        self.repeated.clear();
    }

    /// The numbers for the next action of this number of components: those of `noise`, or independent ones.
    pub(crate) fn begin_action<'a>(
        &'a mut self,
        noise: Option<&'a CorrelatedNoise>,
        components: usize,
    ) -> ActionDraw<'a> {
        if let Some(noise) = noise {
            if self.noise.is_empty() {
                noise.begin(components, &mut self.noise, &mut self.stream);
            } else {
                noise.advance(&mut self.noise, &mut self.stream);
            }
        }
        ActionDraw {
            random: self,
            noise,
            component: 0,
        }
    }

    /// The choice that a component repeats in this step, if any.
    pub(crate) fn repeated_choice(&mut self, component: usize) -> Option<usize> {
        let repeated = self.repeated.get_mut(component)?;
        repeated.steps_left = repeated.steps_left.checked_sub(1)?;
        Some(repeated.choice)
    }

    /// Repeats a choice in the next `steps`.
    pub(crate) fn repeat(&mut self, component: usize, choice: usize, steps: u32) {
        let count = self.repeated.len().max(component + 1);
        self.repeated.resize(count, RepeatedChoice::default());
        self.repeated[component] = RepeatedChoice {
            choice,
            steps_left: steps,
        };
    }
}

/// The numbers that an action is drawn from, one after another for its components.
pub(crate) struct ActionDraw<'a> {
    random: &'a mut ActionRandom,
    noise: Option<&'a CorrelatedNoise>,
    /// The component that is drawn next.
    component: usize,
}

impl ActionDraw<'_> {
    /// A standard normal number for the next component.
    pub(crate) fn normal(&mut self) -> f32 {
        self.correlated_normal()
            .unwrap_or_else(|| StandardNormal.sample(&mut self.random.stream))
    }

    /// The random stream.
    pub(crate) fn stream(&mut self) -> &mut Stream {
        &mut self.random.stream
    }

    /// A number that is uniform in [0, 1), for the next component: the quantile of a correlated one.
    pub(crate) fn uniform(&mut self) -> f32 {
        match self.correlated_normal() {
            Some(normal) => quantile(normal),
            None => self.random.stream.random(),
        }
    }

    fn correlated_normal(&mut self) -> Option<f32> {
        let component = self.component;
        self.component += 1;
        let noise = self.noise?;
        Some(noise.component(component, &self.random.noise))
    }
}

/// The share of standard normal numbers that are smaller; below 1.
fn quantile(normal: f32) -> f32 {
    let share = 0.5 * libm::erfc(-f64::from(normal) * std::f64::consts::FRAC_1_SQRT_2);
    (share as f32).min(1.0 - f32::EPSILON)
}

/// Draws a number n with a probability in proportion to 1/n² (Dabney et al. 2021, with μ = 2). At most 10,000, which has
/// the rest of the probability.
pub(crate) fn draw_duration(random: &mut impl Rng) -> u32 {
    zeta_of_two(random.random())
}

/// The number n with Σ_{i<n} p(i) ≤ `uniform` < Σ_{i≤n} p(i), where p(i) = 6 / (π i)².
fn zeta_of_two(uniform: f64) -> u32 {
    let total = std::f64::consts::PI.powi(2) / 6.0;
    let (mut n, mut below) = (1_u32, 1.0 / total);
    while uniform >= below && n < 10_000 {
        n += 1;
        below += 1.0 / (f64::from(n).powi(2) * total);
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_random::{Purpose, stream};

    /// From tables: Φ(−1) = 0.158655, Φ(0) = 0.5, Φ(1.96) = 0.975002.
    #[test]
    fn quantiles_are_those_of_normal_numbers() {
        for (normal, expected) in [(-1.0, 0.158_655), (0.0, 0.5), (1.96, 0.975_002)] {
            assert!((quantile(normal) - expected).abs() < 1e-6, "{normal}");
        }
        assert!(quantile(9.0) < 1.0);
    }

    /// 6/π² = 0.608 for 1, and 0.152 for 2.
    #[test]
    fn durations_have_the_probabilities_of_the_zeta_distribution() {
        for (uniform, expected) in [(0.0, 1), (0.607, 1), (0.609, 2), (0.759, 2), (0.761, 3)] {
            assert_eq!(zeta_of_two(uniform), expected, "{uniform}");
        }
        assert_eq!(zeta_of_two(1.0 - 1e-12), 10_000);
    }

    #[test]
    fn a_choice_is_repeated_for_its_steps_and_not_in_the_next_episode() {
        let mut random = ActionRandom::from(stream(0, Purpose::Action, 0, 0));
        assert_eq!(random.repeated_choice(1), None);
        random.repeat(1, 5, 2);
        let choices = [1, 1, 1, 0].map(|component| random.repeated_choice(component));
        assert_eq!(choices, [Some(5), Some(5), None, None]);
        random.repeat(1, 5, 2);
        random.begin_episode();
        assert_eq!(random.repeated_choice(1), None);
    }
}
