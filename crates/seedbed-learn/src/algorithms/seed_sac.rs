//! Seed-SAC: soft actor-critic (Haarnoja et al. 2018) for continuous actions, from the replay buffer of
//! a team.
//!
//! A learner has a policy, critics and a temperature. Each agent acts by a learner of its own, or all
//! by one. All learn from the same transitions, and differ as in Seed TD (thesis §2.4, §3.4): by their
//! initial networks, towards which training may be regularized, by fixed random rewards z for
//! transitions, by fixed random networks that are added to critics (randomized priors, Osband, Aslanides
//! & Cassirer 2018), and by the targets of their policies' entropies.
//!
//! This file is the learner; `SoftLearner::update` is a gradient step. [`config`] has the
//! parameters, and [`team`] the agents with their replay buffer. Formulas are in [`rl`](crate::rl).

pub mod config;
pub mod team;
#[cfg(test)]
mod tests;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use self::config::{SeedSac, Temperature};
pub use self::team::SoftTeam;
use super::value_based::minibatch::discount_after;
use super::value_based::perturbation::Perturbation;
use crate::agent::bonus::{BonusModel, TransitionPairs};
use crate::agent::critic::{Critic, SavedCritic};
use crate::agent::network::{LearnedState, Network};
use crate::agent::squashed_policy::SquashedPolicy;
use crate::agent::{AgentContext, UpdateReport};
use crate::cancellation::cancellation_point;
use crate::experience::replay::Replay;
use crate::math::{exp, ln};
use crate::nn::{Activations, Adam, Initial, Tensor};
use crate::rl::soft_actor_critic;
use crate::scaling::Scaling;
use crate::team::HasBonusModel;
use seedbed_random::{Purpose, Stream, stream};

/// The settings and the data that all learners learn with.
struct LearningContext<'a> {
    config: &'a SeedSac,
    replay: &'a Replay,
    scaling: &'a Scaling,
}

/// A policy with its critics and its temperature.
struct SoftLearner {
    number: u32,
    run_seed: u64,
    policy: SquashedPolicy,
    critics: Vec<Critic>,
    temperature: LearnedTemperature,
    perturbation: Perturbation,
    bonus_model: Option<BonusModel>,
    /// Number of gradient steps so far.
    updates: u64,
    /// Transitions are drawn from this stream.
    random: Stream,
    /// Actions and critics are drawn from this stream.
    noise: Stream,
    totals: Totals,
    work: Workspace,
}

/// The temperature, which descends its loss unless it is fixed.
struct LearnedTemperature {
    log_alpha: f32,
    optimizer: Option<Adam>,
    target_entropy: f32,
}

/// Sums over the gradient steps of one round.
#[derive(Clone, Copy, Default)]
struct Totals {
    updates: u32,
    policy_updates: u32,
    value_loss: f64,
    policy_loss: f64,
    entropy: f64,
    prediction_error: Option<f32>,
}

/// Buffers that are reused from one minibatch of B transitions to the next.
#[derive(Default)]
struct Workspace {
    /// Observations before the actions, then those after the last of n steps: `[2B × width]`.
    observations: Vec<f32>,
    /// The latter, while transitions are drawn: `[B × width]`.
    next_observations: Vec<f32>,
    /// Relative actions: `[B × d]`.
    actions: Vec<f32>,
    /// Sums of n discounted rewards with seeds and bonuses: `[B]`.
    rewards: Vec<f32>,
    /// γⁿ, or 0 after the end of an episode: `[B]`.
    discounts: Vec<f32>,
    /// All transitions for the bonus model, and for each its row and its factor. None without a bonus
    /// model.
    pairs: Option<(TransitionPairs, Vec<(usize, f32)>)>,
    bonuses: Vec<f32>,
    /// Scaled observations: `[2B × width]`.
    states: Vec<f32>,
    /// Inputs of critics: `[B × (width + d)]`.
    inputs: Vec<f32>,
    /// Numbers of the M critics that have been drawn for the target.
    drawn: Vec<usize>,
    target_activations: Activations,
    /// Values of several critics: `[critics × B]`.
    values: Vec<f32>,
    targets: Vec<f32>,
    gradient: Vec<f32>,
    /// How much each critic contributes to the value of each action: `[critics × B]`.
    weights: Vec<f32>,
    /// Derivatives of the value with respect to actions: `[B × d]`.
    slopes: Vec<f32>,
}

/// What a checkpoint holds of a learner. The rest derives from the scenario.
#[derive(Serialize, Deserialize)]
struct SavedLearner<L, V, A> {
    policy: L,
    critics: Vec<SavedCritic<L, V>>,
    log_alpha: f32,
    optimizer: Option<A>,
    updates: u64,
    bonus_model: Option<Vec<u8>>,
}

impl SoftLearner {
    /// The learner of an agent, which has not learned yet.
    fn new(config: &SeedSac, agent: &AgentContext<'_>) -> Self {
        let AgentContext {
            run_seed,
            agent: number,
            team,
            spec,
            ..
        } = *agent;
        let bonus_model = BonusModel::new(&config.bonus, agent);
        let pairs = bonus_model.as_ref();
        let pairs = pairs.map(|_| (TransitionPairs::new(spec), Vec::new()));
        let parameters = InitialParameters::draw(config, agent);
        let has_seeds = team.seeds.sigma() > 0.0;
        let policy_shape = config.policy_shape(spec);
        let policy = Network::new(policy_shape, parameters.policy, config.policy_optimizer);
        Self {
            number,
            run_seed,
            policy: SquashedPolicy::new(spec, policy),
            critics: critics(config, agent, parameters.critics),
            temperature: LearnedTemperature::new(config, agent),
            perturbation: Perturbation {
                run_seed,
                model: number,
                seed_distribution: has_seeds.then_some(*team.seeds),
                mask: 1.0,
            },
            bonus_model,
            updates: 0,
            random: stream(run_seed, Purpose::Replay, number, 0),
            noise: stream(run_seed, Purpose::UpdateNoise, number, 0),
            totals: Totals::default(),
            work: Workspace {
                pairs,
                ..Workspace::default()
            },
        }
    }

    /// Prepares for a round, which draws from its own streams.
    fn begin_round(&mut self, round: u32) {
        self.random = stream(self.run_seed, Purpose::Replay, self.number, round);
        self.noise = stream(self.run_seed, Purpose::UpdateNoise, self.number, round);
        self.totals = Totals::default();
    }

    /// One gradient step of the critics, and one of policy and temperature if it is their turn.
    fn update(&mut self, context: &LearningContext<'_>) {
        cancellation_point();
        let config = context.config;
        self.updates += 1;
        let updates_policy = self
            .updates
            .is_multiple_of(config.policy_every.get().into());
        self.draw_minibatch(context);
        self.add_bonuses();
        let work = &mut self.work;
        context.scaling.apply(&work.observations, &mut work.states);
        let evaluated = if updates_policy {
            &work.states[..]
        } else {
            &work.states[work.states.len() / 2..]
        };
        self.policy.sample(evaluated, &mut self.noise);
        self.descend(config, updates_policy);
    }

    /// The gradient steps, after an action has been sampled in each state after a transition, and if the
    /// policy is updated also in those before.
    fn descend(&mut self, config: &SeedSac, updates_policy: bool) {
        let alpha = self.temperature.alpha();
        let first_next = if updates_policy {
            self.work.rewards.len()
        } else {
            0
        };
        self.compute_targets(config, alpha, first_next);
        self.update_critics(config);
        if updates_policy {
            self.update_policy(config, alpha);
        }
        for critic in &mut self.critics {
            critic.move_target(config.target_rate.get_f32());
        }
        self.totals.updates += 1;
    }

    /// Draws the transitions of the next gradient step.
    fn draw_minibatch(&mut self, context: &LearningContext<'_>) {
        let count = context.config.minibatch.get() as usize;
        let own_count = (context.config.own_share.get() * count as f64).round() as usize;
        self.work.clear();
        for row in 0..count {
            let index = self.draw_index(context.replay, row < own_count);
            self.push_return(context, row, index);
        }
        let Workspace {
            observations,
            next_observations,
            ..
        } = &mut self.work;
        observations.append(next_observations);
    }

    /// Index of a transition of the agent's own, or of the whole team. If the agent has hardly any, it may
    /// be of the team in place of an own one.
    fn draw_index(&mut self, replay: &Replay, is_own: bool) -> usize {
        let mut index = replay.draw_index(&mut self.random);
        for _ in 0..replay.len() {
            if !is_own || replay.origin(index).agent == self.number {
                break;
            }
            index = replay.draw_index(&mut self.random);
        }
        index
    }

    /// Adds a transition with the n rewards that begin with it, or fewer if the episode ends or has not
    /// continued yet.
    fn push_return(&mut self, context: &LearningContext<'_>, row: usize, index: usize) {
        let (config, replay) = (context.config, context.replay);
        let first = replay.get(index);
        let (mut last, mut last_index) = (first, index);
        let (mut sum, mut factor) = (0.0, 1.0);
        for step in 1..=config.n_step.get() {
            sum += factor * (last.reward + self.perturbation.reward_seed(last.origin));
            if let Some((pairs, rows)) = &mut self.work.pairs {
                pairs.push(&last);
                rows.push((row, factor));
            }
            factor *= config.discount.get_f32();
            if step == config.n_step.get() {
                break;
            }
            let Some(next) = replay.successor(last_index) else {
                break;
            };
            (last, last_index) = (replay.get(next), next);
        }
        let work = &mut self.work;
        work.observations.extend_from_slice(first.state);
        work.next_observations.extend_from_slice(last.next_state);
        let ranges = self.policy.ranges();
        ranges.append_relative(first.action, &mut work.actions);
        work.rewards.push(sum);
        work.discounts
            .push(discount_after(factor, last.status, config.time_limit));
    }

    /// Adds the bonuses of all transitions, computed with the present bonus model.
    fn add_bonuses(&mut self) {
        let Workspace {
            pairs,
            bonuses,
            rewards,
            ..
        } = &mut self.work;
        let (Some(bonus_model), Some((pairs, rows))) = (&mut self.bonus_model, pairs) else {
            return;
        };
        bonus_model.compute_bonuses_of_pairs(pairs, &mut self.random, bonuses);
        for ((row, factor), bonus) in rows.iter().zip(bonuses) {
            rewards[*row] += factor * *bonus;
        }
    }

    /// Computes the targets of the critics with M of them. The actions after the transitions are the
    /// samples from number `first_next` on.
    fn compute_targets(&mut self, config: &SeedSac, alpha: f32, first_next: usize) {
        let work = &mut self.work;
        let batch = work.rewards.len();
        let width = work.actions.len() / batch;
        let actions = &self.policy.actions()[first_next * width..];
        let after = &work.states[work.states.len() / 2..];
        join_rows(after, actions, batch, &mut work.inputs);
        let [count, all] = [config.target_critics.get() as usize, self.critics.len()];
        draw_without_replacement(count, all, &mut self.noise, &mut work.drawn);
        work.values.clear();
        for &critic in &work.drawn {
            let (inputs, activations) = (&work.inputs, &mut work.target_activations);
            self.critics[critic].append_target_values(inputs, activations, &mut work.values);
        }
        soft_actor_critic::targets(
            &work.rewards,
            &work.discounts,
            &work.values,
            &self.policy.log_probs()[first_next..],
            alpha,
            &mut work.targets,
        );
    }

    /// One gradient step of each critic on ½ mean (Q(s, a) − y)² + ½ λ ‖θ − θ̂‖².
    fn update_critics(&mut self, config: &SeedSac) {
        let work = &mut self.work;
        let batch = work.rewards.len();
        let before = &work.states[..work.states.len() / 2];
        join_rows(before, &work.actions, batch, &mut work.inputs);
        let mut loss = 0.0;
        for critic in &mut self.critics {
            work.values.clear();
            critic.append_values(&work.inputs, &mut work.values);
            loss +=
                soft_actor_critic::squared_error(&work.values, &work.targets, &mut work.gradient);
            critic.descend(&work.inputs, &work.gradient, &config.descent());
        }
        self.totals.value_loss += f64::from(loss) / self.critics.len() as f64;
    }

    /// One gradient step of the policy on mean(α log π(a|s) − Q(s, a)) + ½ λ ‖φ − φ̂‖², and one of the
    /// temperature.
    fn update_policy(&mut self, config: &SeedSac, alpha: f32) {
        let work = &mut self.work;
        let batch = work.rewards.len();
        let before = &work.states[..work.states.len() / 2];
        let actions = &self.policy.actions()[..work.actions.len()];
        join_rows(before, actions, batch, &mut work.inputs);
        work.values.clear();
        for critic in &mut self.critics {
            critic.append_values(&work.inputs, &mut work.values);
        }
        let combination = config.policy_value;
        let value = soft_actor_critic::combine(&work.values, batch, combination, &mut work.weights);
        work.slopes.clear();
        work.slopes.resize(work.actions.len(), 0.0);
        let columns = before.len() / batch..work.inputs.len() / batch;
        let weights = work.weights.chunks_exact(batch);
        for (critic, weights) in self.critics.iter_mut().zip(weights) {
            critic.add_input_gradient(weights, columns.clone(), &mut work.slopes);
        }
        self.policy
            .descend(&work.states, &work.slopes, alpha, &config.descent());
        let log_probs = &self.policy.log_probs()[..batch];
        let entropy = -log_probs.iter().sum::<f32>() / batch as f32;
        self.temperature.descend(log_probs);
        self.totals.policy_updates += 1;
        self.totals.entropy += f64::from(entropy);
        self.totals.policy_loss -= f64::from(alpha * entropy + value);
    }

    fn is_finite(&self) -> bool {
        self.policy.network().is_finite()
            && self.critics.iter().all(Critic::is_finite)
            && self.temperature.alpha().is_finite()
            && self.bonus_model.as_ref().is_none_or(BonusModel::is_finite)
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors: Vec<Tensor<'_>> = self.policy.tensors().collect();
        for (number, critic) in self.critics.iter().enumerate() {
            tensors.extend(critic.tensors(number));
        }
        tensors.push(Tensor::list("temperature", vec![self.temperature.alpha()]));
        tensors.extend(self.bonus_model.iter().flat_map(BonusModel::own_tensors));
        tensors
    }

    /// The initial parameters of the networks, and the seeds of the bonus model, if it has any.
    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        let policy = self.policy.network().initial_tensors("initial.policy");
        let mut tensors: Vec<Tensor<'_>> = policy.collect();
        for (number, critic) in self.critics.iter().enumerate() {
            tensors.extend(critic.initial_tensors(number));
        }
        tensors.extend(self.bonus_model.iter().flat_map(BonusModel::seed_tensors));
        tensors
    }

    fn save(&self) -> Vec<u8> {
        let saved = SavedLearner {
            policy: self.policy.network().learned_state(),
            critics: self.critics.iter().map(Critic::saved).collect(),
            log_alpha: self.temperature.log_alpha,
            optimizer: self.temperature.optimizer.as_ref(),
            updates: self.updates,
            bonus_model: self.bonus_model.as_ref().map(BonusModel::save),
        };
        postcard::to_stdvec(&saved).expect("plain numbers always serialize")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: SavedLearner<LearnedState, Vec<f32>, Adam> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        let is_same_kind = saved.critics.len() == self.critics.len()
            && saved.optimizer.is_some() == self.temperature.optimizer.is_some();
        if !is_same_kind {
            return Err(
                "the checkpoint is of a learner with other critics or another `temperature`"
                    .to_owned(),
            );
        }
        self.policy.network_mut().restore(saved.policy)?;
        for (critic, saved) in self.critics.iter_mut().zip(saved.critics) {
            critic.restore(saved)?;
        }
        self.temperature.log_alpha = saved.log_alpha;
        self.temperature.optimizer = saved.optimizer;
        self.updates = saved.updates;
        match (&mut self.bonus_model, saved.bonus_model) {
            (Some(bonus_model), Some(bytes)) => bonus_model.restore(&bytes),
            (None, None) => Ok(()),
            _ => Err("the checkpoint is of a run with another `bonus`".to_owned()),
        }
    }
}

impl HasBonusModel for SoftLearner {
    fn bonus_model(&self) -> Option<&BonusModel> {
        self.bonus_model.as_ref()
    }

    fn bonus_model_mut(&mut self) -> Option<&mut BonusModel> {
        self.bonus_model.as_mut()
    }
}

/// The part of an agent seed that initializes networks.
struct InitialParameters {
    policy: Vec<f32>,
    critics: Vec<Vec<f32>>,
}

impl InitialParameters {
    /// Those of an agent. What the team says is the same for all is that of agent 0.
    fn draw(config: &SeedSac, agent: &AgentContext<'_>) -> Self {
        let (policy, critic) = (
            config.policy_shape(agent.spec),
            config.critic_shape(agent.spec),
        );
        let draw = |number| {
            let mut random = stream(agent.run_seed, Purpose::InitialParameters, number, 0);
            let initial = agent.team.initial;
            Self {
                policy: policy.initial_parameters(initial, &mut random),
                critics: (0..config.critics.get())
                    .map(|_| critic.initial_parameters(initial, &mut random))
                    .collect(),
            }
        };
        let (mut own, same) = (draw(agent.agent), agent.team.same_initial);
        if same.includes_policy() {
            own.policy = draw(0).policy;
        }
        if same.includes_value() {
            own.critics = draw(0).critics;
        }
        own
    }
}

/// The critics of an agent, with its priors.
fn critics(
    config: &SeedSac,
    agent: &AgentContext<'_>,
    initial_parameters: Vec<Vec<f32>>,
) -> Vec<Critic> {
    let shape = config.critic_shape(agent.spec);
    let scale = config.prior_scale.get_f32();
    let mut random = stream(agent.run_seed, Purpose::ValuePrior, agent.agent, 0);
    let critic = |parameters| {
        let network = Network::new(shape.clone(), parameters, config.critic_optimizer);
        let prior = (scale > 0.0).then(|| {
            let parameters = shape.initial_parameters(Initial::Random, &mut random);
            (parameters, scale)
        });
        Critic::new(network, prior)
    };
    initial_parameters.into_iter().map(critic).collect()
}

impl LearnedTemperature {
    fn new(config: &SeedSac, agent: &AgentContext<'_>) -> Self {
        match config.temperature {
            Temperature::Fixed { alpha } => Self {
                log_alpha: ln(alpha.get_f32()),
                optimizer: None,
                target_entropy: 0.0,
            },
            Temperature::Automatic {
                initial,
                entropy,
                ladder,
            } => {
                let others = (agent.team.count.get() - 1).max(1);
                let place = f64::from(agent.agent) / f64::from(others);
                let target = entropy.get() + place * ladder.get();
                Self {
                    log_alpha: ln(initial.get_f32()),
                    optimizer: Some(Adam::new(config.policy_optimizer, 1)),
                    target_entropy: (target * agent.spec.action_width() as f64) as f32,
                }
            }
        }
    }

    fn alpha(&self) -> f32 {
        exp(self.log_alpha)
    }

    /// One step of Adam on log α.
    fn descend(&mut self, log_probs: &[f32]) {
        if let Some(optimizer) = &mut self.optimizer {
            let slope = soft_actor_critic::log_temperature_slope(log_probs, self.target_entropy);
            let log_alpha = std::slice::from_mut(&mut self.log_alpha);
            optimizer.descend(log_alpha, &[slope], 1.0);
        }
    }
}

impl Totals {
    /// Statistics of learning in this round.
    fn report(&self) -> UpdateReport {
        let mean = |sum: f64, count: u32| (count > 0).then(|| (sum / f64::from(count)) as f32);
        UpdateReport {
            value_loss: mean(self.value_loss, self.updates),
            policy_loss: mean(self.policy_loss, self.policy_updates),
            entropy: mean(self.entropy, self.policy_updates),
            prediction_error: self.prediction_error,
            ..UpdateReport::default()
        }
    }
}

impl Workspace {
    /// Removes the transitions of the last gradient step.
    fn clear(&mut self) {
        let Self {
            observations,
            next_observations,
            actions,
            rewards,
            discounts,
            ..
        } = self;
        [observations, next_observations, actions, rewards, discounts]
            .into_iter()
            .for_each(Vec::clear);
        if let Some((pairs, rows)) = &mut self.pairs {
            pairs.clear();
            rows.clear();
        }
    }
}

/// Draws `count` of the first `all` numbers; all in their order if there are no more.
fn draw_without_replacement(count: usize, all: usize, random: &mut Stream, drawn: &mut Vec<usize>) {
    drawn.clear();
    drawn.extend(0..all);
    if count < all {
        for place in 0..count {
            drawn.swap(place, random.random_range(place..all));
        }
        drawn.truncate(count);
    }
}

/// Appends each row of `right` to the row of `left`.   `[rows × a]`, `[rows × b]` → `joined: [rows
/// × (a + b)]`
fn join_rows(left: &[f32], right: &[f32], rows: usize, joined: &mut Vec<f32>) {
    joined.clear();
    let (left_width, right_width) = (left.len() / rows, right.len() / rows);
    let rows = left.chunks_exact(left_width);
    for (left, right) in rows.zip(right.chunks_exact(right_width)) {
        joined.extend_from_slice(left);
        joined.extend_from_slice(right);
    }
}
