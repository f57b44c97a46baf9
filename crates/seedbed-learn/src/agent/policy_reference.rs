//! Tests the gradients of [`Policy`] against those of `tests/gradients/reference.json`, which were
//! computed by automatic differentiation.

use serde::Deserialize;

use super::action_selection::ActionSelection;
use super::network::{Descent, Network};
use super::policy::{Policy, network_shape};
use crate::nn::AdamSettings;
use crate::rl::policy_loss;
use seedbed_env::{Action, Choice, Quantity, TaskSpec};
use seedbed_input::numbers::ranged_number;

#[derive(Deserialize)]
struct Reference {
    policies: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    head: Head,
    loss: Loss,
    entropy_bonus: f32,
    sizes: Vec<usize>,
    parameters: Vec<f32>,
    states: Vec<f32>,
    actions: Vec<f32>,
    behavior: Vec<f32>,
    advantages: Vec<f32>,
    gradient: Vec<f64>,
}

#[derive(Deserialize)]
enum Head {
    Categorical {
        choices: usize,
    },
    Gaussian {
        range: [f32; 2],
        initial_deviation: f32,
    },
}

#[derive(Deserialize)]
enum Loss {
    #[serde(rename = "Simple")]
    SimplePg,
    Ppo {
        clip: f32,
    },
    OffPac {
        cap: Option<f32>,
    },
}

impl Case {
    fn policy(&self) -> (Policy, AdamSettings) {
        let (range, initial_deviation, choice) = match self.head {
            Head::Categorical { choices } => {
                ([0.0, 1.0], 1.0, Choice::Discrete(vec![0.0; choices]))
            }
            Head::Gaussian {
                range,
                initial_deviation,
            } => (range, initial_deviation, Choice::Continuous),
        };
        let quantity = |range| Quantity {
            name: "x".to_owned(),
            unit: String::new(),
            range,
        };
        let spec = TaskSpec {
            observations: vec![quantity([-1.0, 1.0]); self.sizes[0]],
            actions: vec![Action {
                quantity: quantity(range),
                choice,
            }],
            ..TaskSpec::new("test", Vec::new(), Vec::new())
        };
        let mlp = network_shape(&spec, &self.sizes[1..self.sizes.len() - 1]);
        // Adam's first step is α g / (|g| + ε), which is g α/ε if ε is much larger than any
        // gradient.
        let optimizer = AdamSettings {
            step_size: ranged_number(1e8),
            epsilon: ranged_number(1e6),
            ..AdamSettings::default()
        };
        (
            Policy::new(
                &spec,
                Network::new(mlp, self.parameters.clone(), optimizer),
                ActionSelection::Sampled,
                initial_deviation,
            ),
            optimizer,
        )
    }

    /// The derivatives ∂lossₜ/∂log π(aₜ|sₜ): `[T]`.   `log_probs: [T]`
    fn slopes(&self, log_probs: &[f32]) -> Vec<f32> {
        let steps = log_probs.iter().zip(&self.behavior).zip(&self.advantages);
        let slope = |((&log_prob, behavior), &advantage): ((&f32, &f32), &f32)| {
            let ratio = (log_prob - behavior).exp();
            match self.loss {
                Loss::SimplePg => policy_loss::simple(log_prob, advantage).slope,
                Loss::Ppo { clip } => policy_loss::ppo(ratio, advantage, clip).slope,
                Loss::OffPac { cap } => policy_loss::off_pac(log_prob, ratio, advantage, cap).slope,
            }
        };
        steps.map(slope).collect()
    }
}

/// The gradient is computed from one step of Adam; rounding to f32 adds an error of about 10⁻⁶ of
/// the largest entry of the gradient.
#[test]
fn a_step_follows_the_reference_gradient() {
    let reference: Reference =
        serde_json::from_str(include_str!("../../tests/gradients/reference.json")).unwrap();
    assert!(reference.policies.len() >= 8);
    for case in reference.policies {
        let (mut policy, optimizer) = case.policy();
        let mut log_probs = Vec::new();
        policy.evaluate(&case.states, &case.actions, &mut log_probs);
        let descent = Descent {
            regularization: 0.0,
            gradient_clip: None,
            step_size_factor: 1.0,
        };
        policy.descend(
            &case.states,
            &case.actions,
            &case.slopes(&log_probs),
            |_| case.entropy_bonus,
            &descent,
        );

        let largest = case
            .gradient
            .iter()
            .fold(0.0, |largest: f64, slope| largest.max(slope.abs()));
        let scale = optimizer.step_size.get() / optimizer.epsilon.get();
        assert_eq!(case.gradient.len(), case.parameters.len());
        for (index, expected) in case.gradient.iter().enumerate() {
            let moved =
                f64::from(case.parameters[index]) - f64::from(policy.network().parameters()[index]);
            let error = (moved / scale - expected).abs() / largest;
            assert!(
                error <= 2e-5,
                "{}[{index}]: {}, by automatic differentiation {expected}",
                case.name,
                moved / scale
            );
        }
    }
}
