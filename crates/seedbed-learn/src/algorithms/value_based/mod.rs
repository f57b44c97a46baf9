//! Value-based learners: Q-learning, Seed TD, seed LSVI, seed ensembles and bootstrapped DQN.
//!
//! Models of Q(s, a) learn from the team's newest transitions, shared by all; each agent follows
//! one of the models. Seed TD (thesis §2.4; Dimakopoulou, Osband & Van Roy 2018) perturbs the
//! reward of every transition by the model's own fixed z and starts each model at its own θ̂;
//! randomized priors (Osband, Aslanides & Cassirer 2018) add a fixed random network. [`config`]
//! is what can be chosen, a [`model`] learns, and a [`ValueTeam`] is the models with the agents
//! that follow them. Formulas are in [`rl`](crate::rl).

pub mod config;
pub mod exploration;
mod minibatch;
pub mod model;
mod perturbation;
#[cfg(test)]
mod tests;

use rand::RngExt;
use serde::{Deserialize, Serialize};

use self::config::{Composition, Following};
use self::model::{Evaluation, LearningContext, ValueModel};
use crate::agent::curiosity::Bonus;
use crate::agent::scaling::Scaling;
use crate::agent::{Tensor, Update, UpdateReport};
use crate::experience::replay::Replay;
use crate::experience::{Episode, Experience, StepData};
use crate::nn::{Mlp, Standardizer};
use crate::team::{ActionRequest, AgentUpdate, LearningTiming, Lesson, Team, TeamContext, Workers};
use seedbed_env::random::{Purpose, stream};
use seedbed_env::{Choice, Spec};

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
    /// Steps of this round so far.
    steps_of_round: u32,
    timing: LearningTiming,
    buffers: ActionBuffers,
    /// Bonuses of each agent's own steps in the latest round, by episode: `[K]`; empty if the team
    /// has no bonus.
    own_bonuses: Vec<Vec<StepData>>,
}

/// Memory for the actions of a whole team, reused from step to step.
#[derive(Debug, Default)]
struct ActionBuffers {
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
    /// A team at its seeds.
    ///
    /// # Panics
    /// If an action of the task is not one discrete choice: see [`one_choice`].
    fn new(composition: Composition, context: &TeamContext<'_>) -> Self {
        let spec = context.spec;
        let choices = one_choice(spec).expect("checked: an action is one discrete choice");
        let learning = &composition.learning;
        let mut sizes = vec![spec.observation_width()];
        sizes.extend(learning.hidden.iter().map(|units| units.get() as usize));
        sizes.push(choices);
        let model = |index| {
            let first_follower = context.agent(index);
            ValueModel::new(index, &composition, Mlp::new(&sizes), &first_follower)
        };
        let agents = context.config.count.get() as usize;
        let curious = composition.bonus != Bonus::None;
        Self {
            run_seed: context.run_seed,
            choices,
            scaling: Scaling::new(learning.observations, spec),
            models: (0..composition.models as u32).map(model).collect(),
            following: (0..agents)
                .map(|agent| agent % composition.models)
                .collect(),
            followers: vec![Vec::new(); composition.models],
            replay: Replay::new(learning.replay.get() as usize, spec.observation_width()),
            steps: 0,
            steps_of_round: 0,
            timing: context.timing,
            buffers: ActionBuffers::default(),
            own_bonuses: vec![Vec::new(); if curious { agents } else { 0 }],
            composition,
        }
    }

    /// Agents that do not stay with their model draw one for the round.
    fn draw_models(&mut self, round: u32) {
        if self.composition.following != Following::Drawn {
            return;
        }
        for (following, agent) in self.following.iter_mut().zip(0..) {
            let mut random = stream(self.run_seed, Purpose::ModelChoice, agent, round);
            *following = random.random_range(0..self.models.len());
        }
    }

    fn list_followers(&mut self) {
        self.followers.iter_mut().for_each(Vec::clear);
        for (agent, &model) in self.following.iter().enumerate() {
            self.followers[model].push(agent);
        }
    }

    /// Values of all choices for all agents that play, in one batch per model.
    /// `observations: [K × width]`, `playing: [K]`
    fn evaluate(&mut self, observations: &[f32], playing: &[bool]) {
        let buffers = &mut self.buffers;
        let width = observations.len() / playing.len();
        buffers.values.resize(playing.len() * self.choices, 0.0);
        for (model, followers) in self.models.iter().zip(&self.followers) {
            let players = || followers.iter().copied().filter(|&agent| playing[agent]);
            buffers.rows.clear();
            for agent in players() {
                let row = &observations[agent * width..(agent + 1) * width];
                buffers.rows.extend_from_slice(row);
            }
            if buffers.rows.is_empty() {
                continue;
            }
            self.scaling.apply(&buffers.rows, &mut buffers.scaled);
            let rows = model
                .values(&buffers.scaled, &mut buffers.evaluation)
                .chunks_exact(self.choices);
            for (agent, row) in players().zip(rows) {
                let place = agent * self.choices..(agent + 1) * self.choices;
                buffers.values[place].copy_from_slice(row);
            }
        }
    }

    /// Every model learns from the replay.
    fn learn_from_replay(&mut self, workers: Workers<'_>) {
        let context = LearningContext {
            composition: &self.composition,
            replay: &self.replay,
            scaling: &self.scaling,
            steps: self.steps,
        };
        workers.for_each(&mut self.models, |model| model.learn(&context));
    }

    /// The curiosity of every model gives bonuses to the fresh episodes of its followers, and then
    /// learns from all.
    fn update_curiosity(&mut self, experience: &Experience<'_>, workers: Workers<'_>) {
        let mut own_episodes: Vec<Vec<usize>> = vec![Vec::new(); self.models.len()];
        for (place, episode) in experience.fresh.iter().enumerate() {
            own_episodes[self.following[episode.agent as usize]].push(place);
        }
        let models: Vec<(&mut ValueModel, Vec<usize>)> =
            self.models.iter_mut().zip(own_episodes).collect();
        let bonuses = workers.map(models, |(model, own)| {
            let mut bonuses = Vec::new();
            model.update_curiosity(experience, &own, &mut bonuses);
            bonuses
        });
        self.own_bonuses.iter_mut().for_each(Vec::clear);
        for (place, episode) in experience.fresh.iter().enumerate() {
            let agent = episode.agent as usize;
            let of_model = &bonuses[self.following[agent]];
            self.own_bonuses[agent].push(StepData {
                intrinsic_rewards: of_model.get(place).cloned().unwrap_or_default(),
                ..StepData::of(episode)
            });
        }
    }

    /// The result of the round for one agent.
    fn update_of(&self, agent: usize) -> AgentUpdate {
        let model = &self.models[self.following[agent]];
        let step_data = self.own_bonuses.get(agent).cloned().unwrap_or_default();
        let bonuses = || step_data.iter().flat_map(|data| &data.intrinsic_rewards);
        let (steps, sum) = (bonuses().count(), bonuses().sum::<f32>());
        let report = UpdateReport {
            intrinsic_reward: (steps > 0).then(|| sum / steps as f32),
            ..model.report()
        };
        AgentUpdate {
            agent: agent as u32,
            update: Update { report, step_data },
            is_finite: model.is_finite(),
        }
    }
}

impl Team for ValueTeam {
    fn agent_count(&self) -> usize {
        self.following.len()
    }

    fn begin_round(&mut self, round: u32) {
        self.models
            .iter_mut()
            .for_each(|model| model.begin_round(round));
        self.draw_models(round);
        self.list_followers();
        self.steps_of_round = 0;
    }

    fn act(&mut self, request: &mut ActionRequest<'_>) {
        self.evaluate(request.observations, request.playing);
        let exploration = &self.composition.exploration;
        let rows = self.buffers.values.chunks_exact_mut(self.choices);
        for (agent, values) in rows.enumerate() {
            if request.playing[agent] {
                let random = &mut request.random[agent];
                let (choice, log_prob) = exploration.choose(self.steps, values, random);
                request.actions[agent] = choice as f32;
                request.log_probs[agent] = log_prob;
            }
        }
    }

    fn add_transition(&mut self, episode: &Episode) {
        self.replay.push_newest(episode);
    }

    fn end_step(&mut self, workers: Workers<'_>) {
        self.steps += 1;
        self.steps_of_round += 1;
        if let LearningTiming::EverySteps(count) = self.timing
            && self.steps_of_round.is_multiple_of(count)
        {
            self.learn_from_replay(workers);
        }
    }

    fn learn(&mut self, lesson: &Lesson<'_>, workers: Workers<'_>) -> Vec<AgentUpdate> {
        let Some(first) = lesson.learners.first() else {
            return Vec::new();
        };
        let experience = Experience {
            fresh: &lesson.kept[first.first_fresh..],
            kept: lesson.kept,
            round: first.round,
        };
        if self.timing == LearningTiming::AfterEpisodes {
            self.learn_from_replay(workers);
        }
        if !self.own_bonuses.is_empty() {
            self.update_curiosity(&experience, workers);
        }
        for episode in experience.fresh {
            self.scaling.update(episode.states());
        }
        let agents = lesson.learners.iter();
        agents
            .map(|learner| self.update_of(learner.agent as usize))
            .collect()
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<Vec<f32>> {
        self.models
            .iter_mut()
            .map(|model| model.probe_bonuses(episode, round))
            .collect()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut all = Vec::new();
        for (number, model) in self.models.iter().enumerate() {
            all.extend(model.tensors().map(|tensor| Tensor {
                name: format!("model_{number}.{}", tensor.name),
                ..tensor
            }));
        }
        all.extend(self.scaling.tensors());
        all
    }

    fn save(&self) -> Vec<u8> {
        let saved = Saved {
            models: self.models.iter().map(ValueModel::save).collect(),
            replay: &self.replay,
            observations: self.scaling.learned(),
            steps: self.steps,
        };
        postcard::to_stdvec(&saved).expect("plain data always serializes")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Saved<Replay, Standardizer> =
            postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        if saved.models.len() != self.models.len() || !saved.replay.is_like(&self.replay) {
            return Err("stored for another team".to_owned());
        }
        for (model, bytes) in self.models.iter_mut().zip(&saved.models) {
            model.restore(bytes)?;
        }
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
