//! A value model: a trained network, its target network, and optionally a fixed random network
//! (prior) that is added to both.

use serde::{Deserialize, Serialize};

use super::config::{Composition, Fit};
use super::exploration::Chooser;
use super::index::{self, Heads, IndexSamples};
use super::minibatch::{Minibatch, discount_after};
use super::perturbation::Perturbation;
use crate::agent::bonus::BonusModel;
use crate::agent::network::{Descent, LearnedState, Network};
use crate::agent::{AgentContext, UpdateReport, ValueBuffers};
use crate::cancellation::cancellation_point;
use crate::experience::Episode;
use crate::experience::replay::Replay;
use crate::math;
use crate::nn::{Activations, Initial, Mlp, Tensor, network_tensors};
use crate::rl::{categorical, q_learning};
use crate::scaling::Scaling;
use crate::team::HasBonusModel;
use seedbed_input::numbers::Positive;
use seedbed_random::{Purpose, Stream, stream};

/// A value model, by which any number of agents may act.
pub struct ValueModel {
    network: Network,
    /// Parameters of the target network.
    target_parameters: Vec<f32>,
    prior: Option<Prior>,
    perturbation: Perturbation,
    /// Initial state of the network, from which least-squares value iteration starts in every
    /// round; none for models that continue from their present parameters.
    initial_state: Option<LearnedState>,
    /// Number of gradient steps so far.
    descents: u64,
    bonus_model: Option<BonusModel>,
    random: Stream,
    /// Indices that values depend on are drawn from this stream.
    index_random: Stream,
    totals: Totals,
    work: Workspace,
}

/// The settings and the data that all models of a team learn with.
pub struct LearningContext<'a> {
    pub(super) composition: &'a Composition,
    pub(super) replay: &'a Replay,
    pub(super) scaling: &'a Scaling,
    /// Number of agents K.
    pub(super) agents: usize,
    /// Number of choices of an action.
    pub(super) choices: usize,
    /// Number of steps of each agent so far.
    pub(super) steps: u64,
}

/// A fixed random network that is added to the learned values.
struct Prior {
    parameters: Vec<f32>,
    /// Factor on its outputs.
    scale: f32,
}

/// Buffers that are reused from one minibatch to the next.
#[derive(Default)]
struct Workspace {
    minibatch: Minibatch,
    /// Observations before the B actions, then those after them: `[2B × width]`.
    observations: Vec<f32>,
    /// The same, scaled: `[2B × width]`.
    states: Vec<f32>,
    bonuses: Vec<f32>,
    /// Activations of the prior network in all states.
    prior: Activations,
    /// Values by the target network after the actions: `[B × outputs]`.
    next_values: ValueBuffers,
    /// Values by the trained network before the actions, and after them if these choose the next
    /// actions: `[B or 2B × outputs]`.
    values: Vec<f32>,
    targets: Vec<f32>,
    gradient: Vec<f32>,
    /// Values for single indices, if they depend on one.
    index_samples: IndexSamples,
    /// Probabilities of the choices in the first state of the minibatch.
    probabilities: Vec<f32>,
}

/// Sums over the gradient steps of one round.
#[derive(Clone, Copy, Default)]
struct Totals {
    descents: u32,
    loss: f64,
    entropy: f64,
    prediction_error: Option<f32>,
}

/// What a checkpoint holds of a model. The rest derives from the scenario.
#[derive(Serialize, Deserialize)]
struct Saved<L, V> {
    learned: L,
    target: V,
    descents: u64,
    bonus_model: Option<Vec<u8>>,
}

impl Prior {
    /// The prior of a model; none if its scale is 0.
    fn draw(mlp: &Mlp, composition: &Composition, run_seed: u64, model: u32) -> Option<Self> {
        let scale = composition.prior_scale;
        (scale > 0.0).then(|| {
            let mut random = stream(run_seed, Purpose::ValuePrior, model, 0);
            let mut parameters = mlp.initial_parameters(Initial::Random, &mut random);
            if let Some(settings) = &composition.index {
                index::remove_mean(mlp, settings.dimension, &mut parameters);
            }
            Self { parameters, scale }
        })
    }
}

impl ValueModel {
    /// Model number `index` of a team, which has not learned yet. `first_follower` is the first
    /// agent that acts by it.
    pub(super) fn new(
        index: u32,
        composition: &Composition,
        mlp: Mlp,
        first_follower: &AgentContext<'_>,
    ) -> Self {
        let (run_seed, team) = (first_follower.run_seed, first_follower.team);
        let has_own_initial = !team.same_initial.includes_value();
        let drawn_for = if has_own_initial { index } else { 0 };
        let initial_parameters = mlp.initial_parameters(
            team.initial,
            &mut stream(run_seed, Purpose::InitialParameters, drawn_for, 0),
        );
        let prior = Prior::draw(&mlp, composition, run_seed, index);
        let network = Network::new(
            mlp,
            initial_parameters.clone(),
            composition.learning.optimizer,
        );
        let seed_distribution = composition.has_reward_seeds.then_some(*team.seeds);
        let bonus_model = BonusModel::new(&composition.bonus, first_follower);
        let minibatch = bonus_model.as_ref().map_or_else(Minibatch::default, |_| {
            Minibatch::for_bonus_model(first_follower.spec)
        });
        Self {
            initial_state: matches!(composition.fit, Fit::Lsvi { .. })
                .then(|| network.learned_state().clone()),
            network,
            target_parameters: initial_parameters,
            prior,
            perturbation: Perturbation {
                run_seed,
                model: index,
                seed_distribution,
                mask: composition.mask,
            },
            descents: 0,
            bonus_model,
            random: stream(run_seed, Purpose::Replay, index, 0),
            index_random: stream(run_seed, Purpose::TrainedIndices, index, 0),
            totals: Totals::default(),
            work: Workspace {
                minibatch,
                ..Workspace::default()
            },
        }
    }

    /// Prepares for a round, which draws its minibatches from its own stream.
    pub(super) fn begin_round(&mut self, round: u32) {
        let Perturbation {
            run_seed, model, ..
        } = self.perturbation;
        self.random = stream(run_seed, Purpose::Replay, model, round);
        self.index_random = stream(run_seed, Purpose::TrainedIndices, model, round);
        self.totals = Totals::default();
    }

    /// Values Q(s, ·) of scaled observations, or their heads if they depend on an index.
    /// `states: [B × width]` → `[B × outputs]`
    pub(super) fn values<'a>(
        &self,
        states: &[f32],
        buffers: &'a mut ValueBuffers,
    ) -> &'a mut [f32] {
        let ValueBuffers {
            activations,
            values,
        } = buffers;
        let (mlp, parameters) = (self.network.mlp(), self.network.parameters());
        values.clear();
        values.extend_from_slice(mlp.forward(parameters, states, activations));
        self.add_prior(self.prior_values(states, activations), values);
        values
    }

    /// Outputs of the prior network.   `states: [B × width]` → `[B × outputs]`, or empty without a
    /// prior
    fn prior_values<'a>(&self, states: &[f32], activations: &'a mut Activations) -> &'a [f32] {
        let mlp = self.network.mlp();
        match &self.prior {
            Some(prior) => mlp.forward(&prior.parameters, states, activations),
            None => &[],
        }
    }

    /// Adds the scaled outputs of the prior network to values.
    fn add_prior(&self, prior_values: &[f32], values: &mut [f32]) {
        let Some(prior) = &self.prior else { return };
        for (value, prior_value) in values.iter_mut().zip(prior_values) {
            *value += prior.scale * prior_value;
        }
    }

    /// The number of the model in its team, from 0.
    pub(super) fn number(&self) -> usize {
        self.perturbation.model as usize
    }

    /// Takes the configured number of gradient steps, or none as long as the replay buffer has
    /// fewer transitions than a minibatch.
    pub fn learn(&mut self, context: &LearningContext<'_>) {
        let learning = &context.composition.learning;
        if context.replay.len() < learning.minibatch.get() as usize {
            return;
        }
        match context.composition.fit {
            Fit::Td => (0..learning.minibatches.get()).for_each(|_| self.descend(context, true)),
            Fit::Lsvi { iterations } => self.iterate_values(context, iterations.get()),
        }
    }

    /// Least-squares value iteration: a sequence of regressions, the first on rewards alone, each
    /// further one on the values of the one before.
    fn iterate_values(&mut self, context: &LearningContext<'_>, iterations: u32) {
        if let Some(initial_state) = &self.initial_state {
            self.network.reset_to(initial_state);
        }
        for iteration in 0..iterations {
            self.target_parameters
                .copy_from_slice(self.network.parameters());
            for _ in 0..context.composition.learning.minibatches.get() {
                cancellation_point();
                self.descend(context, iteration > 0);
            }
        }
    }

    /// One gradient step on ½ mean w (r + z + γ max Q′(s′, ·) − Q(s, a))² + ½ λ ‖θ − θ̂‖² (thesis
    /// §2.4), or on the mean of such losses for several indices. γ is 0 if `bootstrap` is false.
    fn descend(&mut self, context: &LearningContext<'_>, bootstrap: bool) {
        self.draw_minibatch(context, bootstrap);
        self.add_bonuses();
        self.compute_values(context);
        let loss = self.compute_gradient(context.composition);
        let Workspace {
            states, gradient, ..
        } = &self.work;
        self.network
            .descend(states, gradient, &descent(context.composition));
        self.accumulate_stats(context, loss);
        self.descents += 1;
        let is_value_iteration = self.initial_state.is_some();
        let target_every = context.composition.learning.target_every.get();
        if !is_value_iteration && self.descents.is_multiple_of(target_every.into()) {
            self.target_parameters
                .copy_from_slice(self.network.parameters());
        }
    }

    /// Computes the loss and its gradient with respect to the outputs of the network; returns the loss.
    fn compute_gradient(&mut self, composition: &Composition) -> f32 {
        let Workspace {
            minibatch,
            next_values,
            values,
            targets,
            gradient,
            index_samples,
            ..
        } = &mut self.work;
        let (values, later_values) = values.split_at_mut(next_values.values.len());
        let choosing_values = if composition.double {
            &*later_values
        } else {
            &next_values.values[..]
        };
        if let Some(settings) = &composition.index {
            let heads = Heads {
                present: values,
                next: &next_values.values,
                choosing: choosing_values,
            };
            return index_samples.compute_gradient(settings, minibatch, heads, gradient);
        }
        q_learning::targets(
            &minibatch.rewards,
            &minibatch.discounts,
            &next_values.values,
            choosing_values,
            targets,
        );
        let (actions, weights) = (&minibatch.actions, &minibatch.weights);
        q_learning::squared_error(values, actions, targets, weights, gradient)
    }

    /// Draws the transitions of the next gradient step, and their indices.
    fn draw_minibatch(&mut self, context: &LearningContext<'_>, bootstrap: bool) {
        let learning = &context.composition.learning;
        let Self {
            work:
                Workspace {
                    minibatch,
                    observations,
                    states,
                    index_samples,
                    ..
                },
            perturbation,
            random,
            index_random,
            ..
        } = self;
        let index = context.composition.index.as_ref();
        let discount = if bootstrap {
            learning.discount.get_f32()
        } else {
            0.0
        };
        minibatch.clear();
        index_samples.noise.clear();
        for _ in 0..learning.minibatch.get() {
            let transition = context.replay.draw(random);
            let reward = transition.reward + perturbation.reward_seed(transition.origin);
            let discount = discount_after(discount, transition.status, learning.time_limit);
            minibatch.push(
                &transition,
                reward,
                discount,
                perturbation.weight(transition.origin),
            );
            if let Some(settings) = index {
                let noise = &mut index_samples.noise;
                perturbation.append_noise(transition.origin, settings.dimension, noise);
            }
        }
        if let Some(settings) = index {
            index_samples.draw(settings, learning.minibatch.get() as usize, index_random);
        }
        observations.clone_from(&minibatch.states);
        observations.extend_from_slice(&minibatch.next_states);
        context.scaling.apply(observations, states);
    }

    /// Adds the bonuses of the minibatch's transitions, computed with the present bonus model.
    fn add_bonuses(&mut self) {
        let Workspace {
            minibatch, bonuses, ..
        } = &mut self.work;
        let (Some(bonus_model), Some(pairs)) = (&mut self.bonus_model, &minibatch.pairs) else {
            return;
        };
        bonus_model.compute_bonuses_of_pairs(pairs, &mut self.random, bonuses);
        for (reward, bonus) in minibatch.rewards.iter_mut().zip(bonuses) {
            *reward += *bonus;
        }
    }

    /// Computes the values of the minibatch's states. All that one network evaluates is one batch.
    fn compute_values(&mut self, context: &LearningContext<'_>) {
        let mut work = std::mem::take(&mut self.work);
        let Workspace {
            states,
            prior,
            next_values,
            values,
            ..
        } = &mut work;
        let earlier = states.len() / 2;
        let evaluated = if context.composition.double {
            states.len()
        } else {
            earlier
        };
        values.clear();
        values.extend_from_slice(self.network.forward(&states[..evaluated]));
        let mlp = self.network.mlp();
        let later_values = mlp.forward(
            &self.target_parameters,
            &states[earlier..],
            &mut next_values.activations,
        );
        next_values.values.clear();
        next_values.values.extend_from_slice(later_values);
        let prior_values = self.prior_values(states, prior);
        self.add_prior(prior_values, values);
        self.add_prior(
            &prior_values[prior_values.len() / 2..],
            &mut next_values.values,
        );
        self.work = work;
    }

    /// Adds the loss, and the entropy of the policy in the first state of the minibatch, to the
    /// totals. Overwrites the values of this state.
    fn accumulate_stats(&mut self, context: &LearningContext<'_>, loss: f32) {
        let values = match context.composition.index {
            Some(_) => &mut self.work.index_samples.values,
            None => &mut self.work.values,
        };
        let row = &mut values[..context.choices];
        let chooser = Chooser {
            agent: self.perturbation.model as usize,
            agents: context.agents,
            steps: context.steps,
        };
        context.composition.exploration.log_probs(chooser, row);
        self.totals.descents += 1;
        self.totals.loss += f64::from(loss);
        let probabilities = &mut self.work.probabilities;
        probabilities.clear();
        probabilities.extend_from_slice(row);
        math::exp_in_place(probabilities);
        self.totals.entropy += f64::from(categorical::entropy(row, probabilities));
    }

    /// Notes the error of the bonus model before it learned in this round.
    pub(super) fn set_prediction_error(&mut self, error: Option<f32>) {
        self.totals.prediction_error = error;
    }

    /// Unscaled bonuses of steps evenly spread over an episode; empty without a bonus.
    pub(super) fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<f32> {
        self.bonus_model
            .as_mut()
            .map_or_else(Vec::new, |bonus_model| {
                bonus_model.probe_bonuses(episode, round)
            })
    }

    /// Statistics of learning in this round.
    pub(super) fn report(&self) -> UpdateReport {
        let descents = self.totals.descents;
        let mean = |sum: f64| (descents > 0).then(|| (sum / f64::from(descents)) as f32);
        UpdateReport {
            gradient_steps: Some(descents),
            value_loss: mean(self.totals.loss),
            entropy: mean(self.totals.entropy),
            prediction_error: self.totals.prediction_error,
            ..UpdateReport::default()
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.network.is_finite() && self.bonus_model.as_ref().is_none_or(BonusModel::is_finite)
    }

    /// The networks whose outputs are the values for one index: the trained one, and the prior if
    /// there is one.   `shape`: of a network that values the choices
    pub(super) fn tensors_for_index(&self, index: &[f32], shape: &Mlp) -> Vec<Tensor<'static>> {
        let prior = self.prior.as_ref().map(|prior| &prior.parameters[..]);
        let networks = [("value", Some(self.network.parameters())), ("prior", prior)];
        let mut tensors = Vec::new();
        for (role, parameters) in networks {
            let Some(parameters) = parameters else {
                continue;
            };
            let folded = index::fold(self.network.mlp(), parameters, index);
            tensors.extend(network_tensors(shape, &folded, role).map(Tensor::into_owned));
        }
        tensors
    }

    pub(super) fn tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let mlp = self.network.mlp();
        let prior = self.prior.iter();
        let prior = prior.flat_map(|prior| network_tensors(mlp, &prior.parameters, "prior"));
        self.network
            .tensors("value")
            .chain(network_tensors(mlp, &self.target_parameters, "target"))
            .chain(prior)
            .chain(self.bonus_model.iter().flat_map(BonusModel::own_tensors))
    }

    /// The tensors of the bonus model, if the team shares one model.
    pub(super) fn shared_tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let bonus_models = self.bonus_model.iter();
        bonus_models.flat_map(BonusModel::shared_tensors)
    }

    /// The initial parameters of the network, and the seeds of the bonus model, if it has any.
    pub(super) fn initial_tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let bonus_models = self.bonus_model.iter();
        let seeds = bonus_models.flat_map(BonusModel::seed_tensors);
        self.network.initial_tensors("initial.value").chain(seeds)
    }

    pub(super) fn save(&self) -> Vec<u8> {
        let bonus_model = self.bonus_model.as_ref().map(BonusModel::save);
        let saved = Saved {
            learned: self.network.learned_state(),
            target: &self.target_parameters,
            descents: self.descents,
            bonus_model,
        };
        postcard::to_stdvec(&saved).expect("plain numbers always serialize")
    }

    pub(super) fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<LearnedState, Vec<f32>> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        if saved.target.len() != self.target_parameters.len() {
            return Err(format!(
                "the checkpoint has {} parameters of a target network; expected {}",
                saved.target.len(),
                self.target_parameters.len()
            ));
        }
        self.network.restore(saved.learned)?;
        (self.target_parameters, self.descents) = (saved.target, saved.descents);
        match (&mut self.bonus_model, saved.bonus_model) {
            (Some(bonus_model), Some(bytes)) => bonus_model.restore(&bytes),
            (None, None) => Ok(()),
            _ => Err("the checkpoint is of a run with another `bonus`".to_owned()),
        }
    }
}

impl HasBonusModel for ValueModel {
    fn bonus_model(&self) -> Option<&BonusModel> {
        self.bonus_model.as_ref()
    }

    fn bonus_model_mut(&mut self) -> Option<&mut BonusModel> {
        self.bonus_model.as_mut()
    }
}

fn descent(composition: &Composition) -> Descent {
    Descent {
        regularization: composition.regularization,
        gradient_clip: composition.learning.gradient_clip.map(Positive::get_f32),
        step_size_factor: 1.0,
    }
}

#[cfg(test)]
mod tests;
