//! One value model: a network that learns, the target network behind it, and the fixed random one
//! that may be added to both.

use serde::{Deserialize, Serialize};

use super::config::{Composition, Fit};
use super::minibatch::{Minibatch, remaining};
use super::perturbation::Perturbation;
use crate::agent::curiosity::Curiosity;
use crate::agent::network::{Descent, Learned, Network};
use crate::agent::scaling::Scaling;
use crate::agent::{AgentContext, Tensor, UpdateReport};
use crate::experience::replay::Replay;
use crate::experience::{Episode, Experience};
use crate::nn::{Activations, Initial, Mlp};
use crate::rl::{categorical, q_learning};
use seedbed_env::input::numbers::Positive;
use seedbed_env::random::{Purpose, Stream, stream};

/// A value model, which any number of agents may follow.
pub struct ValueModel {
    network: Network,
    target: Vec<f32>,
    prior: Option<Prior>,
    perturbation: Perturbation,
    /// Parameters from which least-squares value iteration starts again in every round; none for
    /// models that are fitted from their present parameters.
    start: Option<Learned>,
    /// Gradient steps so far.
    descents: u64,
    curiosity: Option<Curiosity>,
    random: Stream,
    totals: Totals,
    work: Workspace,
}

/// What models learn from, and how.
pub struct LearningContext<'a> {
    pub(super) composition: &'a Composition,
    pub(super) replay: &'a Replay,
    pub(super) scaling: &'a Scaling,
    /// Steps of each agent so far.
    pub(super) steps: u64,
}

/// A fixed random network, and how much it counts.
struct Prior {
    parameters: Vec<f32>,
    scale: f32,
}

/// Room for values of many states, one for each thread that asks for them.
#[derive(Debug, Default)]
pub(super) struct Evaluation {
    activations: Activations,
    values: Vec<f32>,
}

/// Room that is reused from one minibatch to the next.
#[derive(Default)]
struct Workspace {
    minibatch: Minibatch,
    scaled: Vec<f32>,
    scaled_next: Vec<f32>,
    bonuses: Vec<f32>,
    now: Evaluation,
    next: Evaluation,
    online_next: Evaluation,
    targets: Vec<f32>,
    gradient: Vec<f32>,
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
    curiosity: Option<Vec<u8>>,
}

impl ValueModel {
    /// Model number `index` of a team at its seed. `first_follower` is the first agent that follows
    /// it.
    pub(super) fn new(
        index: u32,
        composition: &Composition,
        mlp: Mlp,
        first_follower: &AgentContext<'_>,
    ) -> Self {
        let (run_seed, team) = (first_follower.run_seed, first_follower.team);
        let seed = mlp.initial(
            team.initial,
            &mut stream(run_seed, Purpose::InitialParameters, index, 0),
        );
        let prior = (composition.prior_scale > 0.0).then(|| Prior {
            parameters: mlp.initial(
                Initial::Random,
                &mut stream(run_seed, Purpose::ValuePrior, index, 0),
            ),
            scale: composition.prior_scale,
        });
        let network = Network::new(mlp, seed.clone(), composition.learning.optimiser);
        let seeds = composition.seeded.then_some(team.seeds);
        let curiosity = Curiosity::new(&composition.bonus, first_follower);
        let minibatch = curiosity.as_ref().map_or_else(Minibatch::default, |_| {
            Minibatch::for_curiosity(first_follower.spec)
        });
        Self {
            start: matches!(composition.fit, Fit::Lsvi { .. }).then(|| network.learned().clone()),
            network,
            target: seed,
            prior,
            perturbation: Perturbation {
                run_seed,
                model: index,
                seeds,
                mask: composition.mask,
            },
            descents: 0,
            curiosity,
            random: stream(run_seed, Purpose::Replay, index, 0),
            totals: Totals::default(),
            work: Workspace {
                minibatch,
                ..Workspace::default()
            },
        }
    }

    /// A round begins: its minibatches are drawn from a stream of their own.
    pub(super) fn begin_round(&mut self, round: u32) {
        let Perturbation {
            run_seed, model, ..
        } = self.perturbation;
        self.random = stream(run_seed, Purpose::Replay, model, round);
        self.totals = Totals::default();
    }

    /// Q(s, ·) of scaled states.   `states: [B × width]` → `[B × choices]`
    pub(super) fn values<'a>(&self, states: &[f32], buffers: &'a mut Evaluation) -> &'a mut [f32] {
        self.values_with(self.network.parameters(), states, buffers);
        &mut buffers.values
    }

    fn values_with(&self, parameters: &[f32], states: &[f32], buffers: &mut Evaluation) {
        let Evaluation {
            activations,
            values,
        } = buffers;
        values.clear();
        values.extend_from_slice(self.network.mlp().forward(parameters, states, activations));
        self.add_prior(states, activations, values);
    }

    fn add_prior(&self, states: &[f32], activations: &mut Activations, values: &mut [f32]) {
        let Some(prior) = &self.prior else { return };
        let added = self
            .network
            .mlp()
            .forward(&prior.parameters, states, activations);
        values
            .iter_mut()
            .zip(added)
            .for_each(|(value, added)| *value += prior.scale * added);
    }

    /// Learns as much as it does at one time. Nothing before the replay holds a minibatch.
    pub fn learn(&mut self, context: &LearningContext<'_>) {
        let learning = &context.composition.learning;
        if context.replay.len() < learning.minibatch.get() as usize {
            return;
        }
        match context.composition.fit {
            Fit::Td => (0..learning.minibatches.get()).for_each(|_| self.descend(context, true)),
            Fit::Lsvi { iterations } => self.iterate(context, iterations.get()),
        }
    }

    /// Least-squares value iteration: regressions one on the other, the first on rewards alone.
    fn iterate(&mut self, context: &LearningContext<'_>, iterations: u32) {
        if let Some(start) = &self.start {
            self.network.restart(start);
        }
        for iteration in 0..iterations {
            self.target.copy_from_slice(self.network.parameters());
            for _ in 0..context.composition.learning.minibatches.get() {
                self.descend(context, iteration > 0);
            }
        }
    }

    /// One gradient step on ½ mean w (r + z + γ max Q′(s′, ·) − Q(s, a))² + ½ λ ‖θ − θ̂‖² (thesis
    /// §2.4).
    fn descend(&mut self, context: &LearningContext<'_>, bootstrap: bool) {
        self.draw_minibatch(context, bootstrap);
        self.add_bonuses();
        self.compute_targets(context);
        let mut work = std::mem::take(&mut self.work);
        let Workspace {
            minibatch,
            scaled,
            now,
            targets,
            gradient,
            ..
        } = &mut work;
        now.values.clear();
        now.values.extend_from_slice(self.network.forward(scaled));
        self.add_prior(scaled, &mut now.activations, &mut now.values);
        let loss = q_learning::squared_error(
            &now.values,
            &minibatch.actions,
            targets,
            &minibatch.weights,
            gradient,
        );
        self.network
            .descend(scaled, gradient, &descent(context.composition));
        self.accumulate_stats(context, loss, &mut now.values);
        self.work = work;
        self.descents += 1;
        let iterates = self.start.is_some();
        if !iterates
            && self
                .descents
                .is_multiple_of(context.composition.learning.target_every.get().into())
        {
            self.target.copy_from_slice(self.network.parameters());
        }
    }

    fn draw_minibatch(&mut self, context: &LearningContext<'_>, bootstrap: bool) {
        let learning = &context.composition.learning;
        let Self {
            work:
                Workspace {
                    minibatch,
                    scaled,
                    scaled_next,
                    ..
                },
            perturbation,
            random,
            ..
        } = self;
        let discount = if bootstrap {
            learning.discount.get_f32()
        } else {
            0.0
        };
        minibatch.clear();
        for _ in 0..learning.minibatch.get() {
            let transition = context.replay.draw(random);
            let reward = transition.reward + perturbation.seed(transition.origin);
            let discount = remaining(discount, transition.status, learning.time_limit);
            minibatch.push(
                &transition,
                reward,
                discount,
                perturbation.weight(transition.origin),
            );
        }
        context.scaling.apply(&minibatch.states, scaled);
        context.scaling.apply(&minibatch.next, scaled_next);
    }

    /// Adds what the model's curiosity makes of the transitions now.
    fn add_bonuses(&mut self) {
        let Workspace {
            minibatch, bonuses, ..
        } = &mut self.work;
        let (Some(curiosity), Some(pairs)) = (&mut self.curiosity, minibatch.pairs()) else {
            return;
        };
        curiosity.bonuses_of_pairs(pairs, &mut self.random, bonuses);
        minibatch
            .rewards
            .iter_mut()
            .zip(bonuses)
            .for_each(|(reward, bonus)| *reward += *bonus);
    }

    /// What the values of the minibatch are to become.
    fn compute_targets(&mut self, context: &LearningContext<'_>) {
        let mut work = std::mem::take(&mut self.work);
        let Workspace {
            minibatch,
            scaled_next,
            next,
            online_next,
            targets,
            ..
        } = &mut work;
        self.values_with(&self.target, scaled_next, next);
        let chosen_by = if context.composition.double {
            self.values_with(self.network.parameters(), scaled_next, online_next);
            &online_next.values
        } else {
            &next.values
        };
        q_learning::targets(
            &minibatch.rewards,
            &minibatch.discounts,
            &next.values,
            chosen_by,
            targets,
        );
        self.work = work;
    }

    /// `values: [B × choices]`, overwritten
    fn accumulate_stats(&mut self, context: &LearningContext<'_>, loss: f32, values: &mut [f32]) {
        let choices = self.network.mlp().outputs();
        let row = &mut values[..choices];
        context
            .composition
            .exploration
            .log_probs(context.steps, row);
        self.totals.descents += 1;
        self.totals.loss += f64::from(loss);
        self.totals.entropy += f64::from(categorical::entropy(row));
    }

    /// The round is over: curiosity gives bonuses to the followers' episodes, those at the indices
    /// `own` of the fresh ones, and learns from all.
    pub fn update_curiosity(
        &mut self,
        experience: &Experience<'_>,
        own: &[usize],
        bonuses: &mut Vec<Vec<f32>>,
    ) {
        if let Some(curiosity) = &mut self.curiosity {
            curiosity.reward_own(experience, own, bonuses);
            self.totals.prediction_error = Some(curiosity.learn(experience));
        }
    }

    /// Raw gains of steps spread over an episode; none without curiosity.
    pub(super) fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<f32> {
        self.curiosity.as_mut().map_or_else(Vec::new, |curiosity| {
            curiosity.probe_bonuses(episode, round)
        })
    }

    /// What learning was like in this round.
    pub(super) fn report(&self) -> UpdateReport {
        let descents = self.totals.descents;
        let mean = |sum: f64| (descents > 0).then(|| (sum / f64::from(descents)) as f32);
        UpdateReport {
            value_loss: mean(self.totals.loss),
            entropy: mean(self.totals.entropy),
            prediction_error: self.totals.prediction_error,
            ..UpdateReport::default()
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.network.is_finite() && self.curiosity.as_ref().is_none_or(Curiosity::is_finite)
    }

    pub(super) fn tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let prior = self.prior.iter().flat_map(|prior| {
            let tensors = self.network.mlp().tensors(&prior.parameters);
            tensors.map(|(name, shape, values)| Tensor {
                name: format!("prior.{name}"),
                shape,
                values: values.into(),
            })
        });
        self.network.tensors("value").chain(prior)
    }

    pub(super) fn save(&self) -> Vec<u8> {
        let curiosity = self.curiosity.as_ref().map(Curiosity::save);
        let saved = Saved {
            learned: self.network.learned(),
            target: &self.target,
            descents: self.descents,
            curiosity,
        };
        postcard::to_stdvec(&saved).expect("plain numbers always serialise")
    }

    pub(super) fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<Learned, Vec<f32>> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        if saved.target.len() != self.target.len() {
            return Err(format!(
                "{} parameters stored for a network of {}",
                saved.target.len(),
                self.target.len()
            ));
        }
        self.network.restore(saved.learned)?;
        (self.target, self.descents) = (saved.target, saved.descents);
        match (&mut self.curiosity, saved.curiosity) {
            (Some(curiosity), Some(bytes)) => curiosity.restore(&bytes),
            (None, None) => Ok(()),
            _ => Err("stored for a run with another `bonus`".to_owned()),
        }
    }
}

fn descent(composition: &Composition) -> Descent {
    Descent {
        regularisation: composition.regularisation,
        gradient_clip: composition.learning.gradient_clip.map(Positive::get_f32),
        step_size_factor: 1.0,
    }
}
