//! Value-based learners: Q-learning, Seed TD, seed LSVI, seed ensembles, bootstrapped DQN and
//! HyperAgent.
//!
//! Models of Q(s, a) learn from the replay buffer, which has the newest transitions of all agents.
//! Each agent acts by one of the models; the followers of a model are the agents that act by it.
//! Seed TD (thesis §2.4; Dimakopoulou, Osband & Van Roy 2018) perturbs the reward of every
//! transition by the model's own fixed z and starts each model at its own θ̂; randomized priors
//! (Osband, Aslanides & Cassirer 2018) add a fixed random network. With HyperAgent ([`hyper_agent`],
//! [`mod@index`]) all agents act by one model, each by its own index. [`config`] has the parameters,
//! [`model`] a model, and [`ValueTeam`] the models with the agents that act by them. Formulas are
//! in [`rl`](crate::rl).

pub mod config;
pub mod exploration;
pub mod hyper_agent;
pub mod index;
#[cfg(test)]
mod index_tests;
pub(super) mod minibatch;
pub mod model;
pub(super) mod perturbation;
#[cfg(test)]
mod tests;

use rand::RngExt;

use self::config::{Composition, Learning, ModelAssignment};
use self::exploration::Chooser;
use self::model::{LearningContext, ValueModel};
use crate::agent::bonus::{Bonus, SHARED_OWNER};
use crate::agent::{ActScratch, Update, UpdateReport, ValueScratch};
use crate::experience::replay::Replay;
use crate::experience::{Episode, Experience, StepData};
use crate::nn::{Mlp, Standardizer, Tensor};
use crate::rl::index_conditioned;
use crate::scaling::Scaling;
use crate::team::{
    ActionRequest, AgentUpdate, LearningClock, LearningRequest, LocalModels, SavedProgress,
    SavedTeam, Team, TeamContext, Workers, mean_bonus, update_bonus_models,
};
use seedbed_env::{Choice, TaskSpec};
use seedbed_random::{Purpose, stream};

/// K agents that act by value models. Several agents may act by the same model.
pub struct ValueTeam {
    run_seed: u64,
    composition: Composition,
    /// Number of choices of an action.
    choices: usize,
    /// Shape of a network that values the choices for one index.
    folded_shape: Mlp,
    scaling: Scaling,
    /// All models of the team.
    models: Vec<ValueModel>,
    local: LocalModels,
    /// Indices that the agents act by in this round: `[K × M]`; empty if values depend on none.
    agent_indices: Vec<f32>,
    /// Number of this round.
    round: u32,
    /// Index of the model that each agent acts by in this round: `[K]`.
    model_of_agent: Vec<usize>,
    /// Agents that act by each model in this round, in agent order: `[models]`.
    followers: Vec<Vec<usize>>,
    replay: Replay,
    clock: LearningClock,
    /// Bonuses of each agent's own steps in the latest round, by episode: `[K]`; empty if the team
    /// has no bonus.
    own_bonuses: Vec<Vec<StepData>>,
}

/// Shape of the network of a model.
fn network_shape(learning: &Learning, spec: &TaskSpec, outputs: usize) -> Mlp {
    let mut sizes = vec![spec.observation_width()];
    sizes.extend(learning.hidden.iter().map(|units| units.get() as usize));
    sizes.push(outputs);
    if learning.skip_connection {
        Mlp::with_skip_connection(&sizes)
    } else {
        Mlp::new(&sizes)
    }
}

impl ValueTeam {
    /// A team that has not learned yet.
    ///
    /// # Panics
    /// If the task does not have one discrete action: see [`choice_count`].
    fn new(composition: Composition, context: &TeamContext<'_>) -> Self {
        let spec = context.spec;
        let choices = choice_count(spec).expect("checked: the task has one discrete action");
        let learning = &composition.learning;
        let mlp = network_shape(learning, spec, composition.outputs(choices));
        let model = |index| {
            let first_follower = context.agent_context(index);
            ValueModel::new(index, &composition, mlp.clone(), &first_follower)
        };
        let agents = context.config.count.get() as usize;
        let has_bonus = composition.bonus != Bonus::None;
        // Models may be drawn for agents of other processes, and the bonus model of one may be copied.
        let all_learn = has_bonus || composition.assignment != ModelAssignment::Fixed;
        let mut team = Self {
            run_seed: context.run_seed,
            choices,
            folded_shape: network_shape(learning, spec, choices),
            agent_indices: Vec::new(),
            round: 0,
            scaling: Scaling::new(learning.observations, spec),
            models: (0..composition.models as u32).map(model).collect(),
            local: LocalModels::new(composition.models, all_learn, context),
            model_of_agent: (0..agents)
                .map(|agent| agent % composition.models)
                .collect(),
            followers: vec![Vec::new(); composition.models],
            replay: Replay::new(learning.replay.get() as usize, spec.into()),
            clock: LearningClock::new(context.timing, agents),
            own_bonuses: vec![Vec::new(); if has_bonus { agents } else { 0 }],
            composition,
        };
        team.draw_indices(0);
        team
    }

    /// Draws the indices of the agents, if values depend on one.
    fn draw_indices(&mut self, round: u32) {
        self.round = round;
        if let Some(index) = &self.composition.index {
            let agents = self.model_of_agent.len();
            self.agent_indices = index.draw_for_agents(self.run_seed, agents, round);
        }
    }

    /// Draws the indices of the round whose number a checkpoint has, if values depend on one.
    fn restore_indices(&mut self, saved_round: &[u8]) -> Result<(), String> {
        match (self.composition.index, saved_round.try_into()) {
            (Some(_), Ok(round)) => self.draw_indices(u32::from_le_bytes(round)),
            (None, _) if saved_round.is_empty() => {}
            _ => return Err("the checkpoint is of a team with other models".to_owned()),
        }
        Ok(())
    }

    /// The index that an agent acts by; empty if values depend on none.
    fn index_of(&self, agent: usize) -> &[f32] {
        let dimension = self.agent_indices.len() / self.model_of_agent.len();
        &self.agent_indices[agent * dimension..][..dimension]
    }

    /// Draws models for agents, if models are drawn for every round.
    fn draw_models(&mut self, round: u32) {
        let count = self.models.len();
        let draw = |agent| {
            let mut random = stream(self.run_seed, Purpose::ModelChoice, agent, round);
            random.random_range(0..count)
        };
        match self.composition.assignment {
            ModelAssignment::Fixed => {}
            ModelAssignment::DrawnForTeam => self.model_of_agent.fill(draw(0)),
            ModelAssignment::DrawnForAgent => {
                for (model, agent) in self.model_of_agent.iter_mut().zip(0..) {
                    *model = draw(agent);
                }
            }
        }
    }

    /// Lists the agents of each model.
    fn list_followers(&mut self) {
        self.followers.iter_mut().for_each(Vec::clear);
        for (agent, &model) in self.model_of_agent.iter().enumerate() {
            self.followers[model].push(agent);
        }
    }

    /// Computes the values of all choices for the agents of a group that play, in one batch per
    /// model. `observations: [agents × width]`, `playing: [agents]`
    fn evaluate(
        &self,
        first_agent: usize,
        observations: &[f32],
        playing: &[bool],
        buffers: &mut ValueScratch,
    ) {
        let count = playing.len();
        let width = observations.len() / count;
        buffers.values.resize(count * self.choices, 0.0);
        for (model, followers) in self.models.iter().zip(&self.followers) {
            let playing_rows = || {
                let rows = followers
                    .iter()
                    .filter_map(|agent| agent.checked_sub(first_agent));
                rows.filter(|&row| row < count && playing[row])
            };
            buffers.observations.clear();
            for row in playing_rows() {
                let observation = &observations[row * width..(row + 1) * width];
                buffers.observations.extend_from_slice(observation);
            }
            if buffers.observations.is_empty() {
                continue;
            }
            self.scaling
                .apply(&buffers.observations, &mut buffers.scaled);
            let heads = model
                .values(&buffers.scaled, &mut buffers.model)
                .chunks_exact(self.composition.outputs(self.choices));
            for (row, heads) in playing_rows().zip(heads) {
                let range = row * self.choices..(row + 1) * self.choices;
                buffers.row.clear();
                let index = self.index_of(first_agent + row);
                index_conditioned::append_values(heads, index, &mut buffers.row);
                buffers.values[range].copy_from_slice(&buffers.row);
            }
        }
    }

    /// Every model learns from the replay buffer.
    fn learn_from_replay(&mut self, workers: Workers<'_>) {
        let context = LearningContext {
            composition: &self.composition,
            replay: &self.replay,
            scaling: &self.scaling,
            agents: self.model_of_agent.len(),
            choices: self.choices,
            steps: self.clock.steps,
        };
        let local = &self.local;
        workers.for_each(&mut self.models, |model| {
            if local.learns(model.number()) {
                model.learn(&context);
            }
        });
    }

    /// The models whose state this process passes on, with their numbers.
    fn own_models(&self) -> impl Iterator<Item = (usize, &ValueModel)> {
        let own = &self.local.own;
        own.clone().zip(&self.models[own.clone()])
    }

    /// Bonuses of the new episodes; then bonus models learn.
    fn update_bonus_models(&mut self, experience: &Experience<'_>, workers: Workers<'_>) {
        let (models, model_of_agent) = (&mut self.models, &self.model_of_agent);
        let update = update_bonus_models(models, model_of_agent, experience, workers);
        for (model, error) in models.iter_mut().zip(update.prediction_errors) {
            model.set_prediction_error(error);
        }
        self.own_bonuses = update.own_bonuses;
    }

    /// The indices of the local agents, and the networks that they act by; none if values depend on
    /// none.
    fn tensors_of_indices(&self) -> Vec<Tensor<'_>> {
        let mut tensors = Vec::new();
        if self.composition.index.is_none() {
            return tensors;
        }
        for agent in self.local.agents.clone() {
            let (index, prefix) = (self.index_of(agent), format!("agent_{agent}."));
            let networks = self.models[0].tensors_for_index(index, &self.folded_shape);
            let index = Tensor::list("index", index);
            let own = std::iter::once(index).chain(networks);
            tensors.extend(own.map(|tensor| tensor.prefixed(&prefix)));
        }
        tensors
    }

    /// The result of the round for one agent.
    fn agent_update(&self, agent: usize) -> AgentUpdate {
        let model = &self.models[self.model_of_agent[agent]];
        let step_data = self.own_bonuses.get(agent).cloned().unwrap_or_default();
        // All models take the same number of steps, here or in another process.
        let steps_of_model = model.report().gradient_steps.unwrap_or(0);
        let gradient_steps = if agent == 0 {
            steps_of_model * self.models.len() as u32
        } else {
            0
        };
        let report = UpdateReport {
            gradient_steps: Some(gradient_steps),
            intrinsic_reward: mean_bonus(&step_data),
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
        self.model_of_agent.len()
    }

    fn begin_round(&mut self, round: u32) {
        self.models
            .iter_mut()
            .for_each(|model| model.begin_round(round));
        self.draw_models(round);
        self.draw_indices(round);
        self.list_followers();
        self.clock.begin_round();
    }

    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch) {
        let buffers = &mut scratch.values;
        let (observations, playing) = (request.observations, request.playing);
        self.evaluate(request.first_agent, observations, playing, buffers);
        let exploration = &self.composition.exploration;
        let steps = self.clock.steps + u64::from(request.unreported_steps);
        let rows = buffers.values.chunks_exact_mut(self.choices);
        for (row, values) in rows.enumerate() {
            if request.playing[row] {
                let chooser = Chooser {
                    agent: request.first_agent + row,
                    agents: self.model_of_agent.len(),
                    steps,
                };
                let random = &mut request.random[row];
                let (choice, log_prob) = exploration.choose(chooser, values, random);
                request.actions[row] = choice as f32;
                request.log_probs[row] = log_prob;
            }
        }
    }

    fn transition_interval(&self) -> Option<u32> {
        Some(self.clock.transition_interval())
    }

    fn add_transition(&mut self, episode: &Episode, step: usize) {
        self.replay.push(episode, step);
        self.clock.add_transition();
    }

    fn end_step(&mut self, workers: Workers<'_>) {
        for _ in 0..self.clock.end_step() {
            self.learn_from_replay(workers);
        }
    }

    fn learn(&mut self, request: &LearningRequest<'_>, workers: Workers<'_>) -> Vec<AgentUpdate> {
        let Some(first) = request.learners.first() else {
            return Vec::new();
        };
        let experience = first.experience(request);
        if self.clock.learns_after_episodes() {
            self.learn_from_replay(workers);
        }
        if !self.own_bonuses.is_empty() {
            self.update_bonus_models(&experience, workers);
        }
        for episode in experience.new_episodes {
            self.scaling.update(episode.states());
        }
        let agents = request.learners.iter();
        agents
            .map(|learner| self.agent_update(learner.agent as usize))
            .collect()
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<Vec<f32>> {
        self.models[self.local.own.clone()]
            .iter_mut()
            .map(|model| model.probe_bonuses(episode, round))
            .collect()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = Vec::new();
        for (number, model) in self.own_models() {
            let prefix = format!("model_{number}.");
            tensors.extend(model.tensors().map(|tensor| tensor.prefixed(&prefix)));
        }
        tensors.extend(self.tensors_of_indices());
        if self.local.has_agent_0 {
            let shared_tensors = self.models.iter().take(1);
            let shared_tensors = shared_tensors.flat_map(ValueModel::shared_tensors);
            tensors.extend(shared_tensors.map(|tensor| tensor.prefixed(SHARED_OWNER)));
            tensors.extend(self.scaling.tensors());
        }
        tensors
    }

    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        let tensors = self.own_models().flat_map(|(number, model)| {
            let prefix = format!("model_{number}.");
            model
                .initial_tensors()
                .map(move |tensor| tensor.prefixed(&prefix))
        });
        tensors.collect()
    }

    fn replay(&self) -> Option<&Replay> {
        Some(&self.replay)
    }

    fn replay_mut(&mut self) -> Option<&mut Replay> {
        Some(&mut self.replay)
    }

    fn save(&self) -> SavedTeam {
        let saved = SavedProgress::of(&self.scaling, &self.clock);
        let mut shared = postcard::to_stdvec(&saved).expect("plain data always serializes");
        if self.composition.index.is_some() {
            // Indices are drawn again from the number of the round.
            shared.extend(self.round.to_le_bytes());
        }
        SavedTeam {
            parts: self.own_models().map(|(_, model)| model.save()).collect(),
            shared,
        }
    }

    fn restore(&mut self, saved: &SavedTeam) -> Result<(), String> {
        let models = &saved.parts;
        let (saved, rest) = postcard::take_from_bytes::<SavedProgress<Standardizer>>(&saved.shared)
            .map_err(|error| error.to_string())?;
        if models.len() != self.models.len() {
            return Err("the checkpoint is of a team with other models".to_owned());
        }
        for (model, bytes) in self.models.iter_mut().zip(models) {
            model.restore(bytes)?;
        }
        saved.restore(&mut self.scaling, &mut self.clock)?;
        self.restore_indices(rest)
    }
}

/// Number of choices of the task's discrete action.
///
/// # Errors
/// If the task does not have exactly one action, or if it is continuous. The message says what it
/// has instead.
pub fn choice_count(spec: &TaskSpec) -> Result<usize, String> {
    match spec.actions.as_slice() {
        [action] => match &action.choice {
            Choice::Discrete(values) => Ok(values.len()),
            Choice::Continuous => Err(format!(
                "the action `{}` of `{}` is continuous",
                action.quantity.name, spec.name
            )),
        },
        actions => Err(format!(
            "`{}` has {} actions per step",
            spec.name,
            actions.len()
        )),
    }
}
