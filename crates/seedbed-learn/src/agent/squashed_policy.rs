//! A stochastic policy over continuous actions that are squashed into their ranges (Haarnoja et al.
//! 2018): a network with a mean and the logarithm of a deviation per component of an action.
//!
//! Actions are relative to their ranges: −1 and 1 are the ends. Formulas are in
//! [`rl::squashed_gaussian`](crate::rl::squashed_gaussian).

use rand::{Rng, RngExt};
use rand_distr::{Distribution as _, StandardNormal};

use super::action_random::ActionDraw;
use super::action_selection::ActionSelection;
use super::network::{Descent, Network};
use super::network_info::{Head, HeadKind};
use crate::math;
use crate::nn::{Activation, Mlp, Tensor};
use crate::rl::squashed_gaussian::{self, LOG_DEVIATION_BOUNDS, squash};
use seedbed_env::{Action, Choice, TaskSpec};

/// A policy over actions of d components.
pub(crate) struct SquashedPolicy {
    network: Network,
    ranges: ActionRanges,
    /// Outputs of the network for the latest sampled rows: `[N × 2d]`.
    outputs: Vec<f32>,
    noise: Vec<f32>,
    actions: Vec<f32>,
    log_densities: Vec<f32>,
    /// log π of the sampled actions: `[N]`.
    log_probs: Vec<f32>,
    output_gradient: Vec<f32>,
}

/// Center and half the range of each component of an action.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ActionRanges(Vec<[f32; 2]>);

/// The shape of a policy network for a task.
pub(crate) fn network_shape(spec: &TaskSpec, hidden: &[usize], activation: Activation) -> Mlp {
    let mut sizes = vec![spec.observation_width()];
    sizes.extend(hidden);
    sizes.push(2 * spec.action_width());
    Mlp::new(&sizes).with_activation(activation)
}

/// The meaning of the outputs of a policy network for a task.
pub(crate) fn heads(spec: &TaskSpec) -> Vec<Head> {
    let ranges = ActionRanges::of_task(spec).0;
    let head = |(index, (action, [center, half_range])): (usize, (&Action, [f32; 2]))| Head {
        name: action.quantity.name.clone(),
        unit: action.quantity.unit.clone(),
        first_output: 2 * index,
        outputs: 2,
        kind: HeadKind::SquashedGaussian {
            center,
            half_range,
            log_deviation_clamp: LOG_DEVIATION_BOUNDS,
            formula: HeadKind::SQUASHED_GAUSSIAN,
        },
    };
    let actions = spec.actions.iter().zip(ranges).enumerate();
    actions.map(head).collect()
}

/// What is wrong with the actions of a task, if they are not all continuous.
pub(crate) fn fault_of_actions(spec: &TaskSpec) -> Option<String> {
    let mut actions = spec.actions.iter();
    let discrete = actions.find(|action| action.choice != Choice::Continuous)?;
    Some(format!(
        "the action `{}` of `{}` is discrete",
        discrete.quantity.name, spec.name
    ))
}

impl ActionRanges {
    pub(crate) fn of_task(spec: &TaskSpec) -> Self {
        let ranges = spec.actions.iter().map(|action| action.quantity.range);
        Self(
            ranges
                .map(|[low, high]| [0.5 * (low + high), 0.5 * (high - low)])
                .collect(),
        )
    }

    /// Appends an action in the units of its components, limited to its ranges, as a relative one.
    pub(crate) fn append_relative(&self, action: &[f32], relative: &mut Vec<f32>) {
        for (action, [center, half_range]) in action.iter().zip(&self.0) {
            relative.push(((action - center) / half_range).clamp(-1.0, 1.0));
        }
    }

    /// Chooses an action uniformly from the ranges, and writes the logarithm of its density.
    /// → `action`, `log_prob`: `[d]`
    pub(crate) fn choose_uniformly(
        &self,
        random: &mut impl Rng,
        action: &mut [f32],
        log_prob: &mut [f32],
    ) {
        let components = action.iter_mut().zip(log_prob);
        for ((action, log_prob), [center, half_range]) in components.zip(&self.0) {
            *action = half_range.mul_add(random.random_range(-1.0..=1.0), *center);
            *log_prob = -math::ln(2.0 * half_range);
        }
    }

    /// Chooses an action from the distribution that a row of outputs describes, and writes the logarithm
    /// of the density of each component; the probability of a greedy action is taken as 1.
    /// `outputs: [2d]` → `action`, `log_prob`: `[d]`
    pub(crate) fn choose(
        &self,
        outputs: &[f32],
        selection: ActionSelection,
        draw: &mut ActionDraw<'_>,
        (action, log_prob): (&mut [f32], &mut [f32]),
    ) {
        let components = action.iter_mut().zip(log_prob).zip(&self.0);
        for (((action, log_prob), [center, half_range]), outputs) in
            components.zip(outputs.as_chunks::<2>().0)
        {
            let (relative, density) = choose_component(*outputs, selection, draw);
            *action = half_range.mul_add(relative, *center);
            *log_prob = density.map_or(0.0, |density| density - math::ln(*half_range));
        }
    }
}

/// A relative action, and the logarithm of its density unless it is greedy.
fn choose_component(
    [mean, output]: [f32; 2],
    selection: ActionSelection,
    draw: &mut ActionDraw<'_>,
) -> (f32, Option<f32>) {
    let scale = match selection {
        ActionSelection::Greedy => return (squash(mean), None),
        ActionSelection::Sampled | ActionSelection::Correlated { .. } => 0.0,
        ActionSelection::Tempered { temperature } => 0.5 * math::ln(temperature.get_f32()),
    };
    let log_deviation = squashed_gaussian::clamp(output) + scale;
    let (action, log_density) = squashed_gaussian::sample_one(mean, log_deviation, draw.normal());
    (action, Some(log_density))
}

impl SquashedPolicy {
    pub(crate) fn new(spec: &TaskSpec, network: Network) -> Self {
        Self {
            network,
            ranges: ActionRanges::of_task(spec),
            outputs: Vec::new(),
            noise: Vec::new(),
            actions: Vec::new(),
            log_densities: Vec::new(),
            log_probs: Vec::new(),
            output_gradient: Vec::new(),
        }
    }

    /// Samples an action in each state.   `states: [N × observation width]`
    pub(crate) fn sample(&mut self, states: &[f32], random: &mut impl Rng) {
        let mlp = self.network.mlp();
        let count = states.len() / mlp.inputs() * mlp.outputs() / 2;
        self.noise.clear();
        for _ in 0..count {
            self.noise.push(StandardNormal.sample(random));
        }
        self.evaluate(states);
    }

    /// Samples an action in each state with the present noise.
    fn evaluate(&mut self, states: &[f32]) {
        let width = self.network.mlp().outputs();
        self.outputs.clear();
        self.outputs.extend_from_slice(self.network.forward(states));
        let (actions, log_densities) = (&mut self.actions, &mut self.log_densities);
        squashed_gaussian::sample(&self.outputs, &self.noise, actions, log_densities);
        self.log_probs.clear();
        let rows = self.log_densities.chunks_exact(width / 2);
        self.log_probs
            .extend(rows.map(|row| row.iter().sum::<f32>()));
    }

    /// Samples an action in each state with this noise.
    #[cfg(test)]
    pub(crate) fn sample_with(&mut self, states: &[f32], noise: &[f32]) {
        self.noise = noise.to_vec();
        self.evaluate(states);
    }

    /// The relative actions of the latest sampled rows: `[N × d]`.
    pub(crate) fn actions(&self) -> &[f32] {
        &self.actions
    }

    /// log π of these actions: `[N]`.
    pub(crate) fn log_probs(&self) -> &[f32] {
        &self.log_probs
    }

    /// One gradient step on mean(α log π(a|s) − Q(s, a)) of the first B sampled rows.
    /// `states: [N × observation width]`, `value_slopes` (∂Q/∂a): `[B × d]`
    pub(crate) fn descend(
        &mut self,
        states: &[f32],
        value_slopes: &[f32],
        temperature: f32,
        descent: &Descent,
    ) {
        let count = value_slopes.len();
        let batch = 2 * count / self.network.mlp().outputs();
        squashed_gaussian::policy_gradient(
            &self.outputs[..2 * count],
            (&self.noise[..count], &self.actions[..count]),
            value_slopes,
            (temperature, batch),
            &mut self.output_gradient,
        );
        self.network.descend(states, &self.output_gradient, descent);
    }

    pub(crate) fn ranges(&self) -> &ActionRanges {
        &self.ranges
    }

    pub(crate) fn tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        self.network.tensors("policy")
    }

    pub(crate) fn network(&self) -> &Network {
        &self.network
    }

    pub(crate) fn network_mut(&mut self) -> &mut Network {
        &mut self.network
    }
}
