//! Value-based learners: Q-learning, Seed TD, seed LSVI, seed ensembles and bootstrapped DQN.
//!
//! Models of Q(s, a) learn from the team's newest transitions, shared by all; each agent follows one of the models. Seed TD (thesis §2.4;
//! Dimakopoulou, Osband & Van Roy 2018) perturbs the reward of every transition by the model's own fixed z and starts each model at its
//! own θ̂; randomised priors (Osband, Aslanides & Cassirer 2018) add a fixed random network. [`config`] says what can be chosen, a
//! [`model`] learns, and a [`ValueTeam`] is the models with those who follow them. Formulas may not enter.

pub mod config;
pub mod exploration;
pub(in crate::agent) mod meanings;
mod minibatch;
pub mod model;
mod perturbation;
#[cfg(test)]
mod tests;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use self::config::{Composition, Following};
use self::model::{Evaluation, Lesson, ValueModel};
use super::curiosity::Bonus;
use super::scaling::Scaling;
use super::{Membership, Team, Tensor, UpdateReport};
use crate::env::{Choice, Spec};
use crate::experience::replay::Replay;
use crate::experience::{Episode, Experience};
use crate::nn::{Mlp, Standardiser};
use crate::random::{Purpose, Stream, stream};

/// K agents that act by models of which several may share one, and that learn step by step.
pub struct ValueTeam {
    run_seed: u64,
    composition: Composition,
    choices: usize,
    scaling: Scaling,
    models: Vec<ValueModel>,
    /// The model of each agent in this round: `[K]`.
    following: Vec<usize>,
    /// The agents of each model in this round, in order.
    followers: Vec<Vec<usize>>,
    replay: Replay,
    /// Steps of each agent so far.
    steps: u64,
    /// Of the latest round, the bonuses of each agent's own steps: `[K]`; empty without curiosity.
    own_bonuses: Vec<Vec<f32>>,
}

/// Room for the decisions of a whole team, reused from step to step.
#[derive(Debug, Default)]
pub struct DecisionRoom {
    rows: Vec<f32>,
    scaled: Vec<f32>,
    evaluation: Evaluation,
    /// `[K × choices]`
    values: Vec<f32>,
}

/// What a checkpoint holds of a team. The rest derives from the scenario.
#[derive(Serialize, Deserialize)]
struct Saved<R, S> {
    models: Vec<Vec<u8>>,
    replay: R,
    observations: Option<S>,
    steps: u64,
}

impl ValueTeam {
    /// A team at its seed.
    ///
    /// # Panics
    /// If an action of the task is not one discrete choice: see [`one_choice`].
    pub(super) fn new(composition: Composition, run_seed: u64, team: &Team, spec: &Spec) -> Self {
        let choices = one_choice(spec).expect("checked: an action is one discrete choice");
        let learning = &composition.learning;
        let hidden = learning.hidden.iter().map(|units| units.get() as usize);
        let sizes: Vec<usize> = [spec.observation_width()]
            .into_iter()
            .chain(hidden)
            .chain([choices])
            .collect();
        let model = |index| {
            let leader = Membership {
                run_seed,
                agent: index,
                team,
                spec,
                notes_advantages: false,
            };
            ValueModel::new(index, &composition, Mlp::new(&sizes), &leader)
        };
        let agents = team.count.get() as usize;
        Self {
            run_seed,
            choices,
            scaling: Scaling::new(learning.observations, spec),
            models: (0..composition.models as u32).map(model).collect(),
            following: (0..agents)
                .map(|agent| agent % composition.models)
                .collect(),
            followers: vec![Vec::new(); composition.models],
            replay: Replay::new(learning.replay.get() as usize, spec.observation_width()),
            steps: 0,
            own_bonuses: if composition.bonus == Bonus::None {
                Vec::new()
            } else {
                vec![Vec::new(); agents]
            },
            composition,
        }
    }

    /// A round begins: agents that do not stay with their model draw one.
    pub fn begin_round(&mut self, round: u32) {
        self.models
            .iter_mut()
            .for_each(|model| model.begin_round(round));
        if self.composition.following == Following::Drawn {
            for (following, agent) in self.following.iter_mut().zip(0..) {
                *following = stream(self.run_seed, Purpose::ModelChoice, agent, round)
                    .random_range(0..self.models.len());
            }
        }
        self.followers.iter_mut().for_each(Vec::clear);
        self.following
            .iter()
            .enumerate()
            .for_each(|(agent, &model)| self.followers[model].push(agent));
    }

    /// Values of all choices for all agents that play, model by model.   `observations: [K × width]`, `playing: [K]`
    pub fn evaluate(&self, observations: &[f32], playing: &[bool], room: &mut DecisionRoom) {
        let width = observations.len() / playing.len();
        room.values.resize(playing.len() * self.choices, 0.0);
        for (model, followers) in self.models.iter().zip(&self.followers) {
            let players = || followers.iter().copied().filter(|&agent| playing[agent]);
            room.rows.clear();
            for agent in players() {
                room.rows
                    .extend_from_slice(&observations[agent * width..(agent + 1) * width]);
            }
            if room.rows.is_empty() {
                continue;
            }
            self.scaling.apply(&room.rows, &mut room.scaled);
            let rows = model
                .values(&room.scaled, &mut room.evaluation)
                .chunks_exact(self.choices);
            for (agent, row) in players().zip(rows) {
                room.values[agent * self.choices..(agent + 1) * self.choices].copy_from_slice(row);
            }
        }
    }

    /// Chooses by the values that were just [evaluated](Self::evaluate); returns the action and its log-probability.
    pub fn choose(&self, agent: usize, random: &mut Stream, room: &mut DecisionRoom) -> (f32, f32) {
        let values = &mut room.values[agent * self.choices..(agent + 1) * self.choices];
        let (choice, log_prob) = self
            .composition
            .exploration
            .choose(self.steps, values, random);
        (choice as f32, log_prob)
    }

    /// Shares the newest step of an agent's episode with all.
    pub fn take_in(&mut self, episode: &Episode) {
        self.replay.push_newest(episode);
    }

    /// Every agent that plays has made a step.
    pub fn count_step(&mut self) {
        self.steps += 1;
    }

    /// The models, which may learn at once, and what they learn from.
    pub fn lesson(&mut self) -> (&mut [ValueModel], Lesson<'_>) {
        let Self {
            composition,
            replay,
            scaling,
            steps,
            models,
            ..
        } = self;
        (
            models,
            Lesson {
                composition,
                replay,
                scaling,
                steps: *steps,
            },
        )
    }

    /// Takes in what curiosity made of a finished round, once the models have [reflected](ValueModel::reflect) on it.
    pub fn end_round(&mut self, experience: &Experience<'_>, bonuses: &[Vec<Vec<f32>>]) {
        experience
            .fresh
            .iter()
            .for_each(|episode| self.scaling.update(episode.states()));
        self.own_bonuses.iter_mut().for_each(Vec::clear);
        for (place, episode) in experience.fresh.iter().enumerate() {
            let agent = episode.agent as usize;
            if let (Some(own), Some(of_model)) = (
                self.own_bonuses.get_mut(agent),
                bonuses.get(self.following[agent]),
            ) {
                own.extend(of_model.get(place).into_iter().flatten());
            }
        }
    }

    /// Whether models judge whole episodes at the end of a round.
    #[must_use]
    pub fn is_curious(&self) -> bool {
        !self.own_bonuses.is_empty()
    }

    /// Of the latest round, the bonuses of an agent's own steps; none without curiosity.
    #[must_use]
    pub fn intrinsic_rewards(&self, agent: usize) -> &[f32] {
        self.own_bonuses.get(agent).map_or(&[], Vec::as_slice)
    }

    /// Raw gains of steps of an episode as each model's curiosity has them now: one list a model.
    pub fn judge(&mut self, episode: &Episode, round: u32) -> Vec<Vec<f32>> {
        self.models
            .iter_mut()
            .map(|model| model.judge(episode, round))
            .collect()
    }

    /// For each agent, what learning was like for its model: `[K]`.
    #[must_use]
    pub fn reports(&self) -> Vec<(u32, UpdateReport)> {
        let report = |(agent, &model): (u32, &usize)| {
            let own = self.intrinsic_rewards(agent as usize);
            let intrinsic_reward = own.iter().sum::<f32>() / own.len().max(1) as f32;
            (
                agent,
                UpdateReport {
                    intrinsic_reward,
                    ..self.models[model].report()
                },
            )
        };
        (0..).zip(&self.following).map(report).collect()
    }

    /// The agents that follow a model in this round, in order.
    #[must_use]
    pub fn followers(&self, model: usize) -> &[usize] {
        &self.followers[model]
    }

    /// The first agent whose model has numbers that are not finite.
    #[must_use]
    pub fn diverged(&self) -> Option<u32> {
        let lost = self.models.iter().position(|model| !model.is_finite())?;
        Some(
            self.followers[lost]
                .first()
                .map_or(0, |&agent| agent as u32),
        )
    }

    /// How many models there are.
    #[must_use]
    pub fn model_count(&self) -> usize {
        self.models.len()
    }

    /// The parameters of all models, named `model_3.value.layer_0.weight` and the like, and the running moments of observations.
    pub fn tensors(&self) -> impl Iterator<Item = Tensor<'_>> {
        let mut models = Vec::new();
        for (number, model) in self.models.iter().enumerate() {
            models.extend(model.tensors().map(|tensor| Tensor {
                name: format!("model_{number}.{}", tensor.name),
                ..tensor
            }));
        }
        models.into_iter().chain(self.scaling.tensors())
    }

    /// Everything that learning changed, as bytes.
    ///
    /// # Panics
    /// Never: plain data always serialises.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        let models = self.models.iter().map(ValueModel::save).collect();
        let saved = Saved {
            models,
            replay: &self.replay,
            observations: self.scaling.learned(),
            steps: self.steps,
        };
        postcard::to_stdvec(&saved).expect("plain data always serialises")
    }

    /// Takes up what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// Says what is wrong where the bytes are not of such a team.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<Replay, Standardiser> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        if saved.models.len() != self.models.len() || !saved.replay.is_like(&self.replay) {
            return Err("stored for another team".to_owned());
        }
        self.models
            .iter_mut()
            .zip(&saved.models)
            .try_for_each(|(model, bytes)| model.restore(bytes))?;
        self.scaling.restore(saved.observations)?;
        (self.replay, self.steps) = (saved.replay, saved.steps);
        Ok(())
    }
}

/// How many choices an action of the task has.
///
/// # Errors
/// Says what an action is instead of one discrete choice.
pub fn one_choice(spec: &Spec) -> Result<usize, String> {
    match spec.actions.as_slice() {
        [only] => match &only.choice {
            Choice::Discrete(values) => Ok(values.len()),
            Choice::Continuous => Err(format!(
                "`{}` of `{}` is continuous",
                only.quantity.name, spec.name
            )),
        },
        several => Err(format!(
            "an action of `{}` has {} components",
            spec.name,
            several.len()
        )),
    }
}
