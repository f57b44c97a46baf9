//! Stochastic policies: a network whose outputs are the parameters of one distribution per
//! component of an action (thesis §1.5.4).
//!
//! A discrete component has one logit per choice. A continuous component has a mean and the
//! logarithm of a standard deviation, both relative to the action's range: an output of ±1 is an
//! end of the range. The environment clamps samples beyond the range.

use super::ActScratch;
use super::action_random::{ActionDraw, ActionRandom};
use super::action_selection::ActionSelection;
use super::network::{Descent, Network};
use super::network_info::{Head, HeadKind};
use crate::math;
use crate::nn::{Mlp, Tensor};
use crate::rl::correlated_noise::CorrelatedNoise;
use crate::rl::{categorical, gaussian};
use seedbed_env::{Action, Choice, TaskSpec};

/// A policy over actions of C components.
pub(crate) struct Policy {
    network: Network,
    selection: ActionSelection,
    /// The noise of `ActionSelection::Correlated`.
    noise: Option<CorrelatedNoise>,
    components: Vec<Component>,
    /// Outputs of the network for the latest evaluated rows, with log-probabilities in place of
    /// logits: `[N × outputs]`.
    outputs: Vec<f32>,
    /// Exponentials of `outputs`, the probabilities of choices: `[N × outputs]`.
    probabilities: Vec<f32>,
    output_gradient: Vec<f32>,
}

/// One row of the outputs, with log-probabilities in place of logits, and their exponentials.
#[derive(Clone, Copy)]
struct OutputRow<'a> {
    outputs: &'a [f32],
    probabilities: &'a [f32],
}

/// One component of an action.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Component {
    /// Index of its first output in a row of the network's outputs.
    start: usize,
    distribution: ComponentDistribution,
}

/// The distribution of one component of an action.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ComponentDistribution {
    Categorical {
        choices: usize,
    },
    Gaussian {
        center: f32,
        half_range: f32,
        initial_log_deviation: f32,
    },
}

/// Bounds of the logarithm of a relative standard deviation: from almost greedy to far beyond the
/// range.
const LOG_DEVIATION_BOUNDS: [f32; 2] = [-4.0, 1.0];

/// The shape of a policy network for a task, with `hidden` layers.
pub(crate) fn network_shape(spec: &TaskSpec, hidden: &[usize]) -> Mlp {
    let outputs = components(spec, 1.0)
        .last()
        .map_or(0, |component| component.start + component.width());
    let sizes: Vec<usize> = [spec.observation_width()]
        .into_iter()
        .chain(hidden.iter().copied())
        .chain([outputs])
        .collect();
    Mlp::new(&sizes)
}

/// The meaning of the outputs of a policy network for a task: see [`Policy::new`].
pub(crate) fn heads(spec: &TaskSpec, initial_deviation: f32) -> Vec<Head> {
    let head = |(component, action): (&Component, &Action)| Head {
        name: action.quantity.name.clone(),
        unit: action.quantity.unit.clone(),
        first_output: component.start,
        outputs: component.width(),
        kind: component.distribution.head_kind(&action.choice),
    };
    let components = components(spec, initial_deviation);
    components.iter().zip(&spec.actions).map(head).collect()
}

impl ComponentDistribution {
    fn head_kind(self, choice: &Choice) -> HeadKind {
        match self {
            Self::Categorical { .. } => HeadKind::Categorical {
                values: match choice {
                    Choice::Discrete(values) => values.clone(),
                    Choice::Continuous => Vec::new(),
                },
                formula: HeadKind::CATEGORICAL,
            },
            Self::Gaussian {
                center,
                half_range,
                initial_log_deviation,
            } => HeadKind::Gaussian {
                center,
                half_range,
                log_deviation_offset: initial_log_deviation,
                log_deviation_clamp: LOG_DEVIATION_BOUNDS,
                formula: HeadKind::GAUSSIAN,
            },
        }
    }
}

impl Policy {
    /// A policy over the task's actions. The standard deviation of continuous actions is initially
    /// about `initial_deviation`, as a share of half their range.
    pub(crate) fn new(
        spec: &TaskSpec,
        network: Network,
        selection: ActionSelection,
        initial_deviation: f32,
    ) -> Self {
        let components = components(spec, initial_deviation);
        Self {
            network,
            selection,
            noise: selection.noise(spec),
            components,
            outputs: Vec::new(),
            probabilities: Vec::new(),
            output_gradient: Vec::new(),
        }
    }

    /// Chooses an action, and writes the log-probability of each of its components.
    /// `observation: [observation width]` → `action`, `log_prob`: `[C]`
    pub(crate) fn sample(
        &self,
        observation: &[f32],
        random: &mut ActionRandom,
        scratch: &mut ActScratch,
        action: &mut [f32],
        log_prob: &mut [f32],
    ) {
        let outputs = self.network.mlp().forward(
            self.network.parameters(),
            observation,
            &mut scratch.activations,
        );
        scratch.outputs.clear();
        scratch.outputs.extend_from_slice(outputs);
        let mut draw = random.begin_action(self.noise.as_ref(), self.components.len());
        for ((component, action), log_prob) in self.components.iter().zip(action).zip(log_prob) {
            let outputs = component.slice_mut(&mut scratch.outputs);
            component.normalize(outputs);
            (*action, *log_prob) = component.choose(outputs, self.selection, &mut draw);
        }
    }

    /// log π(aₜ|sₜ) of each component of each action.   `states: [N × observation width]`,
    /// `actions: [N × C]` → `log_probs: [N × C]`
    pub(crate) fn evaluate(&mut self, states: &[f32], actions: &[f32], log_probs: &mut Vec<f32>) {
        let width = self.network.mlp().outputs();
        self.outputs.clear();
        self.outputs.extend_from_slice(self.network.forward(states));
        self.normalize_outputs();
        log_probs.clear();
        let actions = actions.chunks_exact(self.components.len());
        for (row, actions) in self.outputs.chunks_exact(width).zip(actions) {
            for (component, &action) in self.components.iter().zip(actions) {
                log_probs.push(component.log_prob(component.slice(row), action));
            }
        }
    }

    /// Replaces logits by log-probabilities, and computes probabilities.
    fn normalize_outputs(&mut self) {
        if let [component] = self.components.as_slice() {
            component.normalize(&mut self.outputs);
        } else {
            for row in self.outputs.chunks_exact_mut(self.network.mlp().outputs()) {
                for component in &self.components {
                    component.normalize(component.slice_mut(row));
                }
            }
        }
        self.probabilities.clone_from(&self.outputs);
        math::exp_in_place(&mut self.probabilities);
    }

    /// Mean entropy over the latest evaluated rows, nats.
    pub(crate) fn mean_entropy(&self) -> f32 {
        let rows = self.rows();
        let count = rows.len().max(1) as f32;
        let entropy = |row: OutputRow<'_>| {
            let components = self.components.iter();
            components
                .map(|component| component.entropy(row))
                .sum::<f32>()
        };
        rows.map(entropy).sum::<f32>() / count
    }

    /// One gradient step on the mean of (loss − `entropy_weight(row)` · entropy) of the latest evaluated
    /// rows. `slopes` are ∂lossₜ/∂log π(a_{t,c}|sₜ).   `states: [N × observation width]`,
    /// `actions`, `slopes`: `[N × C]`
    pub(crate) fn descend(
        &mut self,
        states: &[f32],
        actions: &[f32],
        slopes: &[f32],
        entropy_weight: impl Fn(usize) -> f32,
        descent: &Descent,
    ) {
        let (width, count) = (self.network.mlp().outputs(), self.components.len());
        self.output_gradient.resize(self.outputs.len(), 0.0);
        let weight = count as f32 / slopes.len() as f32;
        let mut output_gradient = std::mem::take(&mut self.output_gradient);
        let rows = self.rows().zip(output_gradient.chunks_exact_mut(width));
        let actions = actions.chunks_exact(count).zip(slopes.chunks_exact(count));
        for (index, ((row, gradient), (actions, slopes))) in rows.zip(actions).enumerate() {
            let entropy_weight = entropy_weight(index);
            for ((component, &action), slope) in self.components.iter().zip(actions).zip(slopes) {
                let gradient = component.slice_mut(gradient);
                component.gradient(row, action, weight * slope, gradient);
                if entropy_weight > 0.0 {
                    component.add_entropy_gradient(row, -weight * entropy_weight, gradient);
                }
            }
        }
        self.network.descend(states, &output_gradient, descent);
        self.output_gradient = output_gradient;
    }

    /// The latest evaluated rows.
    fn rows(&self) -> impl ExactSizeIterator<Item = OutputRow<'_>> {
        let width = self.network.mlp().outputs();
        let rows = self.outputs.chunks_exact(width);
        rows.zip(self.probabilities.chunks_exact(width))
            .map(|(outputs, probabilities)| OutputRow {
                outputs,
                probabilities,
            })
    }

    pub(crate) fn tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        self.network.tensors("policy")
    }

    /// Number of components C of an action.
    pub(crate) fn component_count(&self) -> usize {
        self.components.len()
    }

    pub(crate) fn network(&self) -> &Network {
        &self.network
    }

    pub(crate) fn network_mut(&mut self) -> &mut Network {
        &mut self.network
    }
}

fn components(spec: &TaskSpec, initial_deviation: f32) -> Vec<Component> {
    let mut start = 0;
    let component = |action: &Action| {
        let distribution = match &action.choice {
            Choice::Discrete(values) => ComponentDistribution::Categorical {
                choices: values.len(),
            },
            Choice::Continuous => {
                let [low, high] = action.quantity.range;
                let (center, half_range) = (0.5 * (low + high), 0.5 * (high - low));
                ComponentDistribution::Gaussian {
                    center,
                    half_range,
                    initial_log_deviation: math::ln(initial_deviation),
                }
            }
        };
        let component = Component {
            start,
            distribution,
        };
        start += component.width();
        component
    };
    spec.actions.iter().map(component).collect()
}

impl Component {
    fn width(&self) -> usize {
        match self.distribution {
            ComponentDistribution::Categorical { choices } => choices,
            ComponentDistribution::Gaussian { .. } => 2,
        }
    }

    fn slice<'a>(&self, row: &'a [f32]) -> &'a [f32] {
        &row[self.start..self.start + self.width()]
    }

    /// Its outputs and their exponentials.
    fn slices<'a>(&self, row: OutputRow<'a>) -> [&'a [f32]; 2] {
        [self.slice(row.outputs), self.slice(row.probabilities)]
    }

    fn slice_mut<'a>(&self, row: &'a mut [f32]) -> &'a mut [f32] {
        &mut row[self.start..self.start + self.width()]
    }

    /// Replaces the logits of one or more rows by log-probabilities; leaves means and deviations
    /// unchanged.
    fn normalize(&self, outputs: &mut [f32]) {
        if let ComponentDistribution::Categorical { choices } = self.distribution {
            categorical::log_softmax_in_place(outputs, choices);
        }
    }

    /// Returns an action and its log-probability under the distribution that it was sampled from;
    /// the probability of a greedy action is taken as 1. May change `outputs`.
    fn choose(
        &self,
        outputs: &mut [f32],
        selection: ActionSelection,
        draw: &mut ActionDraw<'_>,
    ) -> (f32, f32) {
        match self.distribution {
            ComponentDistribution::Categorical { .. } => choose_category(outputs, selection, draw),
            ComponentDistribution::Gaussian { .. } => {
                let (mean, log_deviation) = self.moments(outputs);
                let log_deviation = match selection {
                    ActionSelection::Sampled | ActionSelection::Correlated { .. } => log_deviation,
                    ActionSelection::Tempered { temperature } => {
                        log_deviation + 0.5 * math::ln(temperature.get_f32())
                    }
                    ActionSelection::Greedy => return (mean, 0.0),
                };
                let action = math::exp(log_deviation) * draw.normal() + mean;
                (action, gaussian::log_density(action, mean, log_deviation))
            }
        }
    }

    fn log_prob(&self, outputs: &[f32], action: f32) -> f32 {
        match self.distribution {
            ComponentDistribution::Categorical { .. } => outputs[action as usize],
            ComponentDistribution::Gaussian { .. } => {
                let (mean, log_deviation) = self.moments(outputs);
                gaussian::log_density(action, mean, log_deviation)
            }
        }
    }

    fn entropy(&self, row: OutputRow<'_>) -> f32 {
        let [outputs, probabilities] = self.slices(row);
        match self.distribution {
            ComponentDistribution::Categorical { .. } => {
                categorical::entropy(outputs, probabilities)
            }
            ComponentDistribution::Gaussian { .. } => gaussian::entropy(self.moments(outputs).1),
        }
    }

    /// Writes `weight` · ∂log π(a)/∂outputs to `gradient`.
    fn gradient(&self, row: OutputRow<'_>, action: f32, weight: f32, gradient: &mut [f32]) {
        let [outputs, probabilities] = self.slices(row);
        match self.distribution {
            ComponentDistribution::Categorical { .. } => {
                categorical::log_prob_gradient(probabilities, action as usize, weight, gradient);
            }
            ComponentDistribution::Gaussian {
                half_range,
                initial_log_deviation,
                ..
            } => {
                let (mean, log_deviation) = self.moments(outputs);
                let [mean_slope, log_deviation_slope] =
                    gaussian::log_density_gradient(action, mean, log_deviation);
                gradient[0] = weight * mean_slope * half_range;
                gradient[1] = if has_deviation_gradient(outputs[1], initial_log_deviation) {
                    weight * log_deviation_slope
                } else {
                    0.0
                };
            }
        }
    }

    /// Adds `weight` · ∂H/∂outputs to `gradient`, where H is the entropy.
    fn add_entropy_gradient(&self, row: OutputRow<'_>, weight: f32, gradient: &mut [f32]) {
        let [outputs, probabilities] = self.slices(row);
        match self.distribution {
            ComponentDistribution::Categorical { .. } => {
                categorical::add_entropy_gradient(outputs, probabilities, weight, gradient);
            }
            ComponentDistribution::Gaussian {
                initial_log_deviation,
                ..
            } => {
                // H is log σ plus a constant.
                gradient[1] += if has_deviation_gradient(outputs[1], initial_log_deviation) {
                    weight
                } else {
                    0.0
                };
            }
        }
    }

    /// Mean and logarithm of the standard deviation, in the action's unit.
    fn moments(&self, outputs: &[f32]) -> (f32, f32) {
        match self.distribution {
            ComponentDistribution::Categorical { .. } => {
                unreachable!("a categorical component has no moments")
            }
            ComponentDistribution::Gaussian {
                center,
                half_range,
                initial_log_deviation,
            } => {
                let relative = (outputs[1] + initial_log_deviation)
                    .clamp(LOG_DEVIATION_BOUNDS[0], LOG_DEVIATION_BOUNDS[1]);
                (
                    center + half_range * outputs[0],
                    relative + math::ln(half_range),
                )
            }
        }
    }
}

fn choose_category(
    log_probs: &mut [f32],
    selection: ActionSelection,
    draw: &mut ActionDraw<'_>,
) -> (f32, f32) {
    match selection {
        ActionSelection::Sampled | ActionSelection::Correlated { .. } => {}
        ActionSelection::Tempered { temperature } => {
            categorical::temper(log_probs, temperature.get_f32());
        }
        ActionSelection::Greedy => return (categorical::most_likely(log_probs) as f32, 0.0),
    }
    let choice = categorical::choose(log_probs, draw.uniform());
    (choice as f32, log_probs[choice])
}

/// Whether a log-deviation is within its bounds; outside of them its gradient is 0.
fn has_deviation_gradient(output: f32, initial_log_deviation: f32) -> bool {
    (LOG_DEVIATION_BOUNDS[0]..=LOG_DEVIATION_BOUNDS[1]).contains(&(output + initial_log_deviation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::action_selection::ActionNoise;
    use crate::nn::{AdamSettings, Initial};
    use seedbed_env::Quantity;
    use seedbed_input::numbers::ranged_number;
    use seedbed_random::{Purpose, stream};

    fn spec(choices: Vec<Choice>) -> TaskSpec {
        let quantity = |name: &str, range| Quantity {
            name: name.to_owned(),
            unit: String::new(),
            range,
        };
        TaskSpec {
            observations: vec![quantity("x", [-1.0, 1.0]); 3],
            actions: choices
                .into_iter()
                .map(|choice| Action {
                    quantity: quantity("a", [-2.0, 6.0]),
                    choice,
                })
                .collect(),
            ..TaskSpec::new("test", Vec::new(), Vec::new())
        }
    }

    fn mixed_policy(selection: ActionSelection) -> Policy {
        let spec = spec(vec![
            Choice::Discrete(vec![0.0, 1.0, 2.0]),
            Choice::Continuous,
            Choice::Continuous,
        ]);
        let mlp = network_shape(&spec, &[8]);
        assert_eq!(mlp.outputs(), 3 + 2 + 2);
        let initial_parameters = mlp.initial_parameters(
            Initial::Random,
            &mut stream(3, Purpose::InitialParameters, 0, 0),
        );
        Policy::new(
            &spec,
            Network::new(mlp, initial_parameters, AdamSettings::default()),
            selection,
            0.5,
        )
    }

    /// Outputs with log-probabilities in place of logits, and their exponentials.
    fn normalized(policy: &Policy, raw_outputs: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let mut row = raw_outputs.to_vec();
        for component in &policy.components {
            component.normalize(component.slice_mut(&mut row));
        }
        let probabilities = row.iter().copied().map(math::exp).collect();
        (row, probabilities)
    }

    fn output_row<'a>(outputs: &'a [f32], probabilities: &'a [f32]) -> OutputRow<'a> {
        OutputRow {
            outputs,
            probabilities,
        }
    }

    /// The gradient of log π(a) with respect to the outputs agrees with central differences.
    #[test]
    fn output_gradient_agrees_with_central_differences() {
        let policy = mixed_policy(ActionSelection::Sampled);
        let raw_outputs = [0.3_f32, -0.2, 0.9, 0.4, -0.6, -1.1, 0.2];
        let actions = [2.0_f32, 3.5, -1.0];
        let log_prob = |raw_outputs: &[f32]| -> f32 {
            let mut row = raw_outputs.to_vec();
            let log_probs = policy
                .components
                .iter()
                .zip(actions)
                .map(|(component, action)| {
                    component.normalize(component.slice_mut(&mut row));
                    component.log_prob(component.slice(&row), action)
                });
            log_probs.sum()
        };
        let (row, probabilities) = normalized(&policy, &raw_outputs);
        let mut gradient = [0.0; 7];
        for (component, action) in policy.components.iter().zip(actions) {
            let (row, gradient) = (output_row(&row, &probabilities), &mut gradient);
            component.gradient(row, action, 1.0, component.slice_mut(gradient));
        }
        for index in 0..raw_outputs.len() {
            let (mut above, mut below) = (raw_outputs, raw_outputs);
            above[index] += 1e-2;
            below[index] -= 1e-2;
            let numeric = (log_prob(&above) - log_prob(&below)) / 2e-2;
            assert!(
                (numeric - gradient[index]).abs() < 5e-3,
                "{index}: {numeric} {}",
                gradient[index]
            );
        }
    }

    /// The gradient of the entropy with respect to the outputs agrees with central differences.
    #[test]
    fn entropy_gradient_agrees_with_central_differences() {
        let policy = mixed_policy(ActionSelection::Sampled);
        let raw_outputs = [0.3_f32, -0.2, 0.9, 0.4, -0.6, -1.1, 0.2];
        let entropy = |raw_outputs: &[f32]| -> f32 {
            let (row, probabilities) = normalized(&policy, raw_outputs);
            let row = output_row(&row, &probabilities);
            let components = policy.components.iter();
            components.map(|component| component.entropy(row)).sum()
        };
        let ((row, probabilities), mut gradient) = (normalized(&policy, &raw_outputs), [0.0; 7]);
        for component in &policy.components {
            let row = output_row(&row, &probabilities);
            component.add_entropy_gradient(row, 1.0, component.slice_mut(&mut gradient));
        }
        for index in 0..raw_outputs.len() {
            let (mut above, mut below) = (raw_outputs, raw_outputs);
            above[index] += 1e-2;
            below[index] -= 1e-2;
            let numeric = (entropy(&above) - entropy(&below)) / 2e-2;
            assert!(
                (numeric - gradient[index]).abs() < 5e-3,
                "{index}: {numeric} {}",
                gradient[index]
            );
        }
    }

    const STATE: [f32; 3] = [0.1, -0.4, 0.7];

    /// The action in [`STATE`], always drawn from the same random stream, and the log-probabilities
    /// of its components.
    fn select(selection: ActionSelection) -> ([f32; 3], [f32; 3]) {
        let (mut action, mut log_prob) = ([0.0; 3], [0.0; 3]);
        mixed_policy(selection).sample(
            &STATE,
            &mut stream(5, Purpose::Action, 0, 0).into(),
            &mut ActScratch::default(),
            &mut action,
            &mut log_prob,
        );
        (action, log_prob)
    }

    #[test]
    fn greedy_actions_are_the_most_likely_choice_and_the_mean() {
        let mut policy = mixed_policy(ActionSelection::Sampled);
        let (greedy, greedy_log_prob) = select(ActionSelection::Greedy);
        policy.evaluate(&STATE, &greedy, &mut Vec::new());
        let gaussian = policy.components[1];
        assert_eq!(
            greedy[0],
            categorical::most_likely(&policy.outputs[..3]) as f32
        );
        assert_eq!(
            (greedy[1], greedy_log_prob),
            (
                gaussian.moments(gaussian.slice(&policy.outputs)).0,
                [0.0; 3]
            )
        );
    }

    /// At τ = ¼, a Gaussian has half the standard deviation, and the log-probability of an action
    /// is its log-probability under this narrower distribution.
    #[test]
    fn tempered_actions_of_a_gaussian_are_closer_to_the_mean() {
        let mut policy = mixed_policy(ActionSelection::Sampled);
        let (sampled, _) = select(ActionSelection::Sampled);
        let (tempered, log_prob) = select(ActionSelection::Tempered {
            temperature: ranged_number(0.25),
        });
        policy.evaluate(&STATE, &sampled, &mut Vec::new());
        let gaussian = policy.components[1];
        let (mean, log_deviation) = gaussian.moments(gaussian.slice(&policy.outputs));
        assert!(
            (2.0 * (tempered[1] - mean) - (sampled[1] - mean)).abs() < 1e-5,
            "{tempered:?} {sampled:?}"
        );
        assert!(
            (log_prob[1] - gaussian::log_density(tempered[1], mean, log_deviation - 2.0_f32.ln()))
                .abs()
                < 1e-4
        );
    }

    /// One number for a whole episode: an action that changes only with the state, and between episodes has the frequencies
    /// and moments of independent ones, with the same log-probabilities. Tolerances are four standard errors of 4,000 episodes.
    #[test]
    fn correlated_actions_have_the_distribution_of_the_policy() {
        let noise = ActionNoise::Constant;
        let policy = mixed_policy(ActionSelection::Correlated { noise });
        let mut random = ActionRandom::from(stream(5, Purpose::Action, 0, 0));
        let mut scratch = ActScratch::default();
        let (mut choices, mut deviations) = ([0.0_f32; 3], Vec::new());
        let mut evaluated = mixed_policy(ActionSelection::Sampled);
        for _ in 0..4000 {
            random.begin_episode();
            let (mut action, mut log_prob) = ([0.0; 3], [0.0; 3]);
            policy.sample(
                &STATE,
                &mut random,
                &mut scratch,
                &mut action,
                &mut log_prob,
            );
            let (mut again, mut log_probs) = ([0.0; 3], Vec::new());
            policy.sample(&STATE, &mut random, &mut scratch, &mut again, &mut log_prob);
            assert_eq!(action, again);
            evaluated.evaluate(&STATE, &action, &mut log_probs);
            assert!(
                log_probs
                    .iter()
                    .zip(log_prob)
                    .all(|(a, b)| (a - b).abs() < 1e-4)
            );
            choices[action[0] as usize] += 1.0;
            let (mean, log_deviation) =
                evaluated.components[1].moments(evaluated.components[1].slice(&evaluated.outputs));
            deviations.push((action[1] - mean) / log_deviation.exp());
        }
        for (count, log_prob) in choices.iter().zip(&evaluated.outputs) {
            let share = log_prob.exp();
            let error = (share * (1.0 - share) / 4000.0).sqrt();
            assert!((count / 4000.0 - share).abs() < 4.0 * error, "{choices:?}");
        }
        let mean = deviations.iter().sum::<f32>() / 4000.0;
        let square = deviations.iter().map(|number| number * number).sum::<f32>() / 4000.0;
        assert!(
            mean.abs() < 0.064 && (square - 1.0).abs() < 0.09,
            "{mean} {square}"
        );
    }

    /// Sampled actions have the log-probabilities that `evaluate` computes, and the mean and the
    /// standard deviation of the distribution.
    #[test]
    fn samples_agree_with_evaluation() {
        let mut policy = mixed_policy(ActionSelection::Sampled);
        let mut random = stream(5, Purpose::Action, 0, 0).into();
        let mut scratch = ActScratch::default();
        let (mut actions, mut log_probs) = (vec![0.0; 3 * 4000], vec![0.0; 3 * 4000]);
        for (action, log_prob) in actions
            .chunks_exact_mut(3)
            .zip(log_probs.chunks_exact_mut(3))
        {
            policy.sample(&STATE, &mut random, &mut scratch, action, log_prob);
        }
        let mut evaluated = Vec::new();
        policy.evaluate(&STATE.repeat(4000), &actions, &mut evaluated);
        assert!(
            evaluated
                .iter()
                .zip(&log_probs)
                .all(|(a, b)| (a - b).abs() < 1e-4)
        );

        let (mean, log_deviation) =
            policy.components[1].moments(policy.components[1].slice(&policy.outputs));
        let second_components: Vec<f32> = actions.iter().skip(1).step_by(3).copied().collect();
        let sample_mean = second_components.iter().sum::<f32>() / 4000.0;
        let squared_deviations = second_components.iter().map(|a| (a - sample_mean).powi(2));
        let sample_deviation = (squared_deviations.sum::<f32>() / 4000.0).sqrt();
        // Tolerances are four standard errors: σ/√4000 = 1.6 % of σ for the mean, 1.1 % for the
        // deviation.
        assert!(
            (sample_mean - mean).abs() < 0.065 * log_deviation.exp(),
            "{sample_mean} {mean}"
        );
        assert!(
            (sample_deviation / log_deviation.exp() - 1.0).abs() < 0.045,
            "{sample_deviation} {}",
            log_deviation.exp()
        );
    }
}
