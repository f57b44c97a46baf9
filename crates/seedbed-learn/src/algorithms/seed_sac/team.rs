//! A team of agents that act by the learners of Seed-SAC, and their replay buffer.

use std::ops::Range;

use super::config::SeedSac;
use super::{LearningContext, SoftLearner};
use crate::agent::action_selection::ActionSelection;
use crate::agent::bonus::{Bonus, BonusModel, SHARED_OWNER};
use crate::agent::squashed_policy::ActionRanges;
use crate::agent::{ActScratch, Update, UpdateReport};
use crate::experience::replay::Replay;
use crate::experience::{Episode, Experience, StepData};
use crate::nn::{Standardizer, Tensor};
use crate::rl::correlated_noise::CorrelatedNoise;
use crate::scaling::Scaling;
use crate::team::{
    ActionRequest, AgentUpdate, LearningClock, LearningRequest, LocalModels, SavedProgress,
    SavedTeam, Team, TeamContext, Workers, mean_bonus, update_bonus_models,
};

/// K agents that act by learners, with the transitions that all learn from.
pub struct SoftTeam {
    config: SeedSac,
    ranges: ActionRanges,
    /// The noise of `ActionSelection::Correlated`.
    noise: Option<CorrelatedNoise>,
    scaling: Scaling,
    learners: Vec<SoftLearner>,
    local: LocalModels,
    /// Index of the learner that each agent acts by: `[K]`.
    learner_of_agent: Vec<usize>,
    replay: Replay,
    clock: LearningClock,
    /// Bonuses of each agent's own steps in the latest round, by episode: `[K]`.
    own_bonuses: Vec<Vec<StepData>>,
}

impl SoftTeam {
    /// A team that has not learned yet.
    pub(super) fn new(config: &SeedSac, context: &TeamContext<'_>) -> Self {
        let agents = context.config.count.get() as usize;
        let learners = config.learner_count(agents);
        let all_learn = *config.bonus != Bonus::None;
        let capacity = config.replay.get() as usize;
        Self {
            ranges: ActionRanges::of_task(context.spec),
            noise: config.actions.noise(context.spec),
            scaling: Scaling::new(config.observations, context.spec),
            learners: (0..learners as u32)
                .map(|number| SoftLearner::new(config, &context.agent_context(number)))
                .collect(),
            local: LocalModels::new(learners, all_learn, context),
            learner_of_agent: (0..agents).map(|agent| agent % learners).collect(),
            replay: Replay::new(capacity, context.spec.into()),
            clock: LearningClock::new(context.timing, agents),
            own_bonuses: vec![Vec::new(); agents],
            config: config.clone(),
        }
    }

    /// Whether the team has made its random steps, if `unreported` steps were made since the last one
    /// that it counted.
    fn has_made_random_steps(&self, unreported: u32) -> bool {
        let steps = self.clock.steps + u64::from(unreported);
        steps * self.learner_of_agent.len() as u64 >= u64::from(self.config.random_steps.get())
    }

    /// The agents of some rows of a group act. All act by the same learner.
    fn act_by_one_learner(
        &self,
        request: &mut ActionRequest<'_>,
        rows: Range<usize>,
        scratch: &mut ActScratch,
    ) {
        let count = request.playing.len();
        let [observation_width, action_width] = [
            request.observations.len() / count,
            request.actions.len() / count,
        ];
        let learner = &self.learners[self.learner_of_agent[request.first_agent + rows.start]];
        let network = learner.policy.network();
        let observations = rows.start * observation_width..rows.end * observation_width;
        self.scaling
            .apply(&request.observations[observations], &mut scratch.state);
        let outputs = network.mlp().forward(
            network.parameters(),
            &scratch.state,
            &mut scratch.activations,
        );
        for (row, outputs) in rows.zip(outputs.chunks_exact(2 * action_width)) {
            if request.playing[row] {
                let action = row * action_width..(row + 1) * action_width;
                let chosen = (
                    &mut request.actions[action.clone()],
                    &mut request.log_probs[action],
                );
                let random = &mut request.random[row];
                let mut draw = random.begin_action(self.noise.as_ref(), action_width);
                self.ranges
                    .choose(outputs, self.config.actions, &mut draw, chosen);
            }
        }
    }

    /// The agents of a group that play choose actions uniformly from their ranges.
    fn act_randomly(&self, request: &mut ActionRequest<'_>) {
        let width = request.actions.len() / request.playing.len();
        for (row, random) in request.random.iter_mut().enumerate() {
            if request.playing[row] {
                let action = row * width..(row + 1) * width;
                let log_prob = &mut request.log_probs[action.clone()];
                let action = &mut request.actions[action];
                self.ranges
                    .choose_uniformly(&mut random.stream, action, log_prob);
            }
        }
    }

    /// Every learner takes gradient steps, `times` the number that the configuration says.
    fn learn_from_replay(&mut self, times: u32, workers: Workers<'_>) {
        let minibatch = self.config.minibatch.get() as usize;
        if self.replay.len() < minibatch || !self.has_made_random_steps(0) {
            return;
        }
        let context = LearningContext {
            config: &self.config,
            replay: &self.replay,
            scaling: &self.scaling,
        };
        let updates = times.saturating_mul(self.config.updates.get());
        let local = &self.local;
        workers.for_each(&mut self.learners, |learner| {
            if local.learns(learner.number as usize) {
                (0..updates).for_each(|_| learner.update(&context));
            }
        });
    }

    /// Bonuses of the new episodes; then bonus models learn.
    fn update_bonus_models(&mut self, experience: &Experience<'_>, workers: Workers<'_>) {
        let (learners, learner_of_agent) = (&mut self.learners, &self.learner_of_agent);
        let update = update_bonus_models(learners, learner_of_agent, experience, workers);
        for (learner, error) in learners.iter_mut().zip(update.prediction_errors) {
            learner.totals.prediction_error = error;
        }
        self.own_bonuses = update.own_bonuses;
    }

    /// The result of the round for one agent. The steps of a shared learner are those of agent 0.
    fn agent_update(&self, agent: usize) -> AgentUpdate {
        let learner = &self.learners[self.learner_of_agent[agent]];
        let report = learner.totals.report();
        let has_own_learner = agent < self.learners.len();
        let step_data = self.own_bonuses[agent].clone();
        let report = UpdateReport {
            gradient_steps: Some(if has_own_learner {
                learner.totals.updates
            } else {
                0
            }),
            intrinsic_reward: mean_bonus(&step_data),
            ..report
        };
        AgentUpdate {
            agent: agent as u32,
            update: Update { report, step_data },
            is_finite: learner.is_finite(),
        }
    }

    /// The learners whose state this process passes on.
    fn own_learners(&self) -> &[SoftLearner] {
        &self.learners[self.local.own.clone()]
    }
}

impl Team for SoftTeam {
    fn agent_count(&self) -> usize {
        self.learner_of_agent.len()
    }

    fn begin_round(&mut self, round: u32) {
        for learner in &mut self.learners {
            learner.begin_round(round);
        }
        self.clock.begin_round();
    }

    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch) {
        let is_greedy = self.config.actions == ActionSelection::Greedy;
        if !is_greedy && !self.has_made_random_steps(request.unreported_steps) {
            self.act_randomly(request);
            return;
        }
        let count = request.playing.len();
        let batch = if self.learners.len() == 1 { count } else { 1 };
        for row in (0..count).step_by(batch) {
            if batch > 1 || request.playing[row] {
                self.act_by_one_learner(request, row..row + batch, scratch);
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
            self.learn_from_replay(1, workers);
        }
    }

    fn learn(&mut self, request: &LearningRequest<'_>, workers: Workers<'_>) -> Vec<AgentUpdate> {
        let Some(first) = request.learners.first() else {
            return Vec::new();
        };
        let experience = first.experience(request);
        if self.clock.learns_after_episodes() {
            self.learn_from_replay(self.clock.steps_of_round, workers);
        }
        if *self.config.bonus != Bonus::None {
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
        let own = &mut self.learners[self.local.own.clone()];
        let bonus_models = own.iter_mut().map(|learner| learner.bonus_model.as_mut());
        bonus_models
            .map(|model| model.map_or_else(Vec::new, |model| model.probe_bonuses(episode, round)))
            .collect()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = Vec::new();
        for learner in self.own_learners() {
            let prefix = format!("model_{}.", learner.number);
            tensors.extend(
                learner
                    .tensors()
                    .into_iter()
                    .map(|tensor| tensor.prefixed(&prefix)),
            );
        }
        if self.local.has_agent_0 {
            let bonus_model = self.learners[0].bonus_model.iter();
            let shared_tensors = bonus_model.flat_map(BonusModel::shared_tensors);
            tensors.extend(shared_tensors.map(|tensor| tensor.prefixed(SHARED_OWNER)));
            tensors.extend(self.scaling.tensors());
        }
        tensors
    }

    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = Vec::new();
        for learner in self.own_learners() {
            let prefix = format!("model_{}.", learner.number);
            let initial = learner.initial_tensors().into_iter();
            tensors.extend(initial.map(|tensor| tensor.prefixed(&prefix)));
        }
        tensors
    }

    fn replay(&self) -> Option<&Replay> {
        Some(&self.replay)
    }

    fn replay_mut(&mut self) -> Option<&mut Replay> {
        Some(&mut self.replay)
    }

    fn save(&self) -> SavedTeam {
        let saved = SavedProgress::of(&self.scaling, &self.clock);
        SavedTeam {
            parts: self.own_learners().iter().map(SoftLearner::save).collect(),
            shared: postcard::to_stdvec(&saved).expect("plain data always serializes"),
        }
    }

    fn restore(&mut self, saved: &SavedTeam) -> Result<(), String> {
        let shared: SavedProgress<Standardizer> =
            postcard::from_bytes(&saved.shared).map_err(|error| error.to_string())?;
        if saved.parts.len() != self.learners.len() {
            return Err("the checkpoint is of a team with other learners".to_owned());
        }
        for (learner, bytes) in self.learners.iter_mut().zip(&saved.parts) {
            learner.restore(bytes)?;
        }
        shared.restore(&mut self.scaling, &mut self.clock)
    }
}
