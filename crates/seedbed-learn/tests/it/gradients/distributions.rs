//! Distributions of actions.

use seedbed_learn::rl::{categorical, gaussian, squashed_gaussian};
use serde::Deserialize;

use super::{assert_close, check_cases, reference};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CategoricalCase {
    name: String,
    logits: Vec<f32>,
    log_probs: Vec<f64>,
    entropy: f64,
    /// `[choice × logit]`
    log_prob_gradients: Vec<f64>,
    entropy_gradient: Vec<f64>,
}

#[test]
fn categorical_distributions_match_the_reference() {
    check_cases(&reference().categorical, 7, |case| {
        let (name, choices) = (&case.name, case.logits.len());
        let mut log_probs = case.logits.clone();
        categorical::log_softmax_in_place(&mut log_probs, choices);
        let probabilities: Vec<f32> = log_probs.iter().copied().map(f32::exp).collect();
        assert_close(
            &format!("{name}: log-probability"),
            &log_probs,
            &case.log_probs,
        );
        assert_close(
            &format!("{name}: entropy"),
            &[categorical::entropy(&log_probs, &probabilities)],
            &[case.entropy],
        );

        let mut gradients = vec![f32::NAN; choices * choices];
        for (choice, gradient) in gradients.chunks_exact_mut(choices).enumerate() {
            categorical::log_prob_gradient(&probabilities, choice, 1.0, gradient);
        }
        assert_close(
            &format!("{name}: gradient of log-probability"),
            &gradients,
            &case.log_prob_gradients,
        );
        let mut gradient = vec![0.0; choices];
        categorical::add_entropy_gradient(&log_probs, &probabilities, 1.0, &mut gradient);
        assert_close(
            &format!("{name}: gradient of entropy"),
            &gradient,
            &case.entropy_gradient,
        );
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GaussianCase {
    action: f32,
    mean: f32,
    log_deviation: f32,
    log_density: f64,
    /// With respect to μ and log σ.
    gradient: [f64; 2],
    entropy: f64,
}

#[test]
fn gaussian_distributions_match_the_reference() {
    check_cases(&reference().gaussian, 7, |case| {
        let &GaussianCase {
            action,
            mean,
            log_deviation,
            ..
        } = case;
        let name =
            |what| format!("action {action}, mean {mean}, log-deviation {log_deviation}: {what}");
        assert_close(
            &name("log-density"),
            &[gaussian::log_density(action, mean, log_deviation)],
            &[case.log_density],
        );
        assert_close(
            &name("gradient"),
            &gaussian::log_density_gradient(action, mean, log_deviation),
            &case.gradient,
        );
        assert_close(
            &name("entropy"),
            &[gaussian::entropy(log_deviation)],
            &[case.entropy],
        );
    });
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SquashedGaussianCase {
    mean: f32,
    log_deviation: f32,
    noise: f32,
    action: f64,
    log_density: f64,
    /// Of ¾ log π(a) − 2a, with respect to μ and log σ.
    gradient: Vec<f64>,
}

#[test]
fn squashed_gaussian_distributions_match_the_reference() {
    check_cases(&reference().squashed_gaussian, 5, |case| {
        let (outputs, noise) = ([case.mean, case.log_deviation], [case.noise]);
        let name = |what| format!("μ {}, log σ {}: {what}", case.mean, case.log_deviation);
        let (mut actions, mut log_densities) = (Vec::new(), Vec::new());
        squashed_gaussian::sample(&outputs, &noise, &mut actions, &mut log_densities);
        assert_close(&name("action"), &actions, &[case.action]);
        assert_close(&name("log-density"), &log_densities, &[case.log_density]);
        let mut gradient = Vec::new();
        let samples = (&noise[..], &actions[..]);
        squashed_gaussian::policy_gradient(&outputs, samples, &[2.0], (0.75, 1), &mut gradient);
        assert_close(&name("gradient"), &gradient, &case.gradient);
    });
}
