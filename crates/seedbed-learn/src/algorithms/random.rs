//! Uniformly random actions: the baseline for learning algorithms.

use rand::RngExt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AlgorithmConfig, ScheduleError, ScheduleKind};
use crate::agent::{ActScratch, Agent, Update, UpdateReport};
use crate::experience::Experience;
use crate::math::ln;
use crate::nn::Tensor;
use crate::team::{IndependentLearners, Team, TeamContext};
use seedbed_env::{Action, Choice, TaskSpec};
use seedbed_random::Stream;

/// Uniformly random actions: the baseline for learning algorithms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, JsonSchema, Serialize, Deserialize)]
pub struct Random {}

impl Random {
    /// The only configuration: the algorithm has no parameters.
    pub const DEFAULT: Self = Self {};
}

impl AlgorithmConfig for Random {
    fn build(&self, context: &TeamContext<'_>) -> Box<dyn Team> {
        IndependentLearners::build(context, |agent| RandomAgent::new(agent.spec))
    }

    fn check_schedule(&self, _: ScheduleKind) -> Result<(), ScheduleError> {
        Ok(())
    }

    fn cost_per_step(&self, _: u32) -> f64 {
        0.0
    }
}

/// An agent that chooses actions uniformly at random and does not learn.
pub struct RandomAgent {
    actions: Vec<Action>,
}

impl RandomAgent {
    /// A random agent for a task.
    #[must_use]
    pub fn new(spec: &TaskSpec) -> Self {
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

    fn update(&mut self, _: &Experience<'_>) -> Update {
        let entropy = self.actions.iter().map(entropy).sum();
        Update::from(UpdateReport {
            entropy: Some(entropy),
            ..UpdateReport::default()
        })
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

/// Entropy of the uniform distribution of one component of an action, nats: the logarithm of the
/// number of choices, or of the length of the range.
fn entropy(component: &Action) -> f32 {
    match &component.choice {
        Choice::Discrete(values) => ln(values.len() as f32),
        Choice::Continuous => ln(component.quantity.range[1] - component.quantity.range[0]),
    }
}
