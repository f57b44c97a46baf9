//! Uniformly random actions: the control that learning has to beat.

use rand::RngExt;

use super::{ActScratch, Agent, Tensor, UpdateReport};
use crate::env::{Action, Choice, Spec};
use crate::experience::Experience;
use crate::random::Stream;

/// An agent that chooses uniformly and learns nothing.
pub struct RandomAgent {
    actions: Vec<Action>,
}

impl RandomAgent {
    /// A random agent for a task.
    #[must_use]
    pub fn new(spec: &Spec) -> Self {
        Self {
            actions: spec.actions.clone(),
        }
    }
}

impl Agent for RandomAgent {
    fn act(
        &self,
        _: &[f32],
        random: &mut Stream,
        _: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    ) {
        for ((action, log_prob), component) in action.iter_mut().zip(log_prob).zip(&self.actions) {
            *action = match &component.choice {
                Choice::Discrete(values) => random.random_range(0..values.len()) as f32,
                Choice::Continuous => {
                    random.random_range(component.quantity.range[0]..=component.quantity.range[1])
                }
            };
            *log_prob = -entropy(component);
        }
    }

    fn update(&mut self, _: &Experience<'_>) -> UpdateReport {
        let entropy = self.actions.iter().map(entropy).sum();
        UpdateReport {
            ratio_deviation: 1.0,
            largest_ratio: 1.0,
            entropy,
            ..UpdateReport::default()
        }
    }

    fn is_finite(&self) -> bool {
        true
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        Vec::new()
    }

    fn save(&self) -> Vec<u8> {
        Vec::new()
    }

    fn restore(&mut self, _: &[u8]) -> Result<(), String> {
        Ok(())
    }
}

/// The entropy of a uniform choice, nats: the logarithm of how much there is to choose from.
fn entropy(component: &Action) -> f32 {
    match &component.choice {
        Choice::Discrete(values) => (values.len() as f32).ln(),
        Choice::Continuous => (component.quantity.range[1] - component.quantity.range[0]).ln(),
    }
}
