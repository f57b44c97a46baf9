//! Agents as skills: an agent is rewarded for states by which a network tells it from the others (Eysenbach et al. 2019).

use rand::RngExt;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::scaled_states::{self, ScaledStates};
use super::{BonusConfig, BonusScale, GainModel, ModelSharing, Steps, TrainingData, same_kind};
use crate::agent::AgentContext;
use crate::agent::network::{Descent, LearnedState, Network};
use crate::cancellation::cancellation_point;
use crate::experience::Episode;
use crate::math::{exp, ln};
use crate::nn::{AdamSettings, Initial, Mlp, Tensor};
use crate::rl::categorical::log_softmax_in_place;
use seedbed_env::TaskSpec;
use seedbed_input::limits::short_list;
use seedbed_input::numbers::{Count, NonNegative, ranged_count, ranged_number};
use seedbed_random::{Purpose, Stream, stream};

/// How surely a network tells from the state that a step leads to which agent of the team visits it: log q(k|s) − log(1/K) for
/// agent k of K, as for the skills of DIAYN (Eysenbach, Gupta, Ibarz & Levine 2019, Eq. 3). It is negative in states that
/// others visit more.
///
/// The team shares one network, which learns from its newest episodes. Inputs are observations whose display ranges are
/// scaled to −1 to 1. In DIAYN one policy has the skill as an input; here each agent has its own networks.
#[derive(Clone, Debug, PartialEq, JsonSchema, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Discriminator {
    /// Weight of the bonus.
    pub weight: NonNegative,
    /// Number of gradient steps per update.
    pub minibatches: Count<100_000>,
    /// Number of states per gradient step.
    pub minibatch: Count<100_000>,
    /// Number of units of each hidden layer.
    #[serde(deserialize_with = "short_list")]
    pub hidden: Vec<Count<4096>>,
    /// Optimizer of the network.
    pub optimizer: AdamSettings,
}

impl Default for Discriminator {
    fn default() -> Self {
        Self {
            weight: ranged_number(0.01),
            minibatches: ranged_count(60),
            minibatch: ranged_count(64),
            hidden: vec![ranged_count(32), ranged_count(32)],
            optimizer: AdamSettings::default(),
        }
    }
}

impl BonusConfig for Discriminator {
    fn sharing(&self) -> ModelSharing {
        ModelSharing::Shared
    }

    /// Gains are logarithms already, and can be negative.
    fn scale(&self) -> BonusScale {
        BonusScale::Raw {
            weight: self.weight,
            shown: ranged_number((4.0 * self.weight.get()).clamp(1e-6, 1e30)),
            lowest: ranged_number(1.0),
        }
    }

    fn build(&self, owner: u32, context: &AgentContext<'_>) -> Box<dyn GainModel> {
        Box::new(DiscriminatorModel::new(self, owner, context))
    }

    /// The number of agents is not known here.
    fn memory(&self, spec: &TaskSpec) -> u64 {
        Network::memory(&Mlp::new(&layer_sizes(self, spec, 64)))
    }

    fn formula(&self) -> String {
        format!(
            "{} Network: tanh between the layers. Gain of agent k of K: output k of log softmax(network(x)), plus log K.",
            scaled_states::formula()
        )
    }

    fn inputs(&self, spec: &TaskSpec) -> Vec<String> {
        scaled_states::names(spec)
    }
}

/// Sizes of the layers, from the inputs to the outputs, one for each agent.
fn layer_sizes(config: &Discriminator, spec: &TaskSpec, agents: usize) -> Vec<usize> {
    let hidden = config.hidden.iter().map(|units| units.get() as usize);
    let inputs = [spec.observation_width()].into_iter();
    inputs.chain(hidden).chain([agents]).collect()
}

struct DiscriminatorModel {
    config: Discriminator,
    agent: usize,
    agents: usize,
    states: ScaledStates,
    network: Network,
    /// Observations: `[N × width]`.
    rows: Vec<f32>,
    /// The agents that visited the rows of a minibatch: `[N]`.
    visitors: Vec<u32>,
    /// Log probabilities, or their gradient: `[N × K]`.
    outputs: Vec<f32>,
}

impl DiscriminatorModel {
    fn new(config: &Discriminator, owner: u32, context: &AgentContext<'_>) -> Self {
        let agents = context.team.count.get() as usize;
        let mlp = Mlp::new(&layer_sizes(config, context.spec, agents));
        let mut random = stream(context.run_seed, Purpose::ModelParameters, owner, 0);
        let initial_parameters = mlp.initial_parameters(Initial::Random, &mut random);
        Self {
            network: Network::new(mlp, initial_parameters, config.optimizer),
            config: config.clone(),
            agent: context.agent as usize,
            agents,
            states: ScaledStates::new(context.spec),
            rows: Vec::new(),
            visitors: Vec::new(),
            outputs: Vec::new(),
        }
    }

    /// Writes log q of each agent in the states of `rows` to `outputs`.
    fn compute_log_probabilities(&mut self) {
        self.states.scale(&self.rows);
        let logits = self.network.forward(self.states.all());
        self.outputs.clear();
        self.outputs.extend_from_slice(logits);
        log_softmax_in_place(&mut self.outputs, self.agents);
    }

    /// Draws a minibatch of the states that steps of the episodes lead to. `ends` are the numbers of steps up to the end of
    /// each episode.
    fn draw(&mut self, episodes: &[&Episode], ends: &[usize], random: &mut Stream) {
        let steps = ends.last().copied().unwrap_or(0);
        self.rows.clear();
        self.visitors.clear();
        for _ in 0..self.config.minibatch.get() {
            let position = random.random_range(0..steps);
            let index = ends.partition_point(|&end| end <= position);
            let episode = episodes[index];
            let step = position + episode.length() - ends[index];
            let state =
                &episode.observations[(step + 1) * self.states.width()..][..self.states.width()];
            self.rows.extend_from_slice(state);
            self.visitors.push(episode.agent);
        }
    }

    /// A gradient step on the cross-entropy of the drawn states, whose gradient by the logits is q − 1 for the visitor, and
    /// q for the others.
    fn descend(&mut self) {
        self.compute_log_probabilities();
        let share = (self.visitors.len() as f32).recip();
        for (row, visitor) in self
            .outputs
            .chunks_exact_mut(self.agents)
            .zip(&self.visitors)
        {
            for (agent, number) in row.iter_mut().enumerate() {
                let is_visitor = agent == *visitor as usize;
                *number = share * (exp(*number) - f32::from(u8::from(is_visitor)));
            }
        }
        let descent = Descent {
            regularization: 0.0,
            gradient_clip: None,
            step_size_factor: 1.0,
        };
        self.network
            .descend(self.states.all(), &self.outputs, &descent);
    }
}

impl GainModel for DiscriminatorModel {
    fn compute_gains(&mut self, steps: &Steps<'_>, _: &mut Stream, gains: &mut Vec<f32>) {
        self.rows.clear();
        let next = steps.episode.observations.get(self.states.width()..);
        for state in next
            .unwrap_or_default()
            .chunks_exact(self.states.width())
            .step_by(steps.stride)
        {
            self.rows.extend_from_slice(state);
        }
        self.compute_log_probabilities();
        let log_count = ln(self.agents as f32);
        let of_agent = self.outputs.chunks_exact(self.agents);
        gains.clear();
        gains.extend(of_agent.map(|row| row[self.agent] + log_count));
    }

    fn learn(&mut self, data: &TrainingData<'_>, random: &mut Stream) -> Option<f32> {
        let mut steps = 0;
        let mut ends = Vec::new();
        for episode in data.new_episodes {
            steps += episode.length();
            ends.push(steps);
        }
        if steps > 0 {
            for _ in 0..self.config.minibatches.get() {
                cancellation_point();
                self.draw(data.new_episodes, &ends, random);
                self.descend();
            }
        }
        None
    }

    fn copy_learned(&mut self, trained: &dyn GainModel) {
        let trained: &Self = same_kind(trained);
        self.network.copy_parameters(&trained.network);
    }

    fn is_finite(&self) -> bool {
        self.network.is_finite()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let network = self.network.tensors("discriminator");
        network.chain(self.states.tensors()).collect()
    }

    fn save(&self) -> Vec<u8> {
        postcard::to_stdvec(self.network.learned_state()).expect("plain numbers always serialize")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let learned: LearnedState =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        self.network.restore(learned)
    }
}
