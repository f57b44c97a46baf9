//! Teams of agents that each have their own networks.

use super::{
    ActionRequest, AgentUpdate, HasBonusModel, Learner, LearningRequest, SavedTeam, Team,
    TeamContext, Workers, copy_shared_bonus_model,
};
use crate::agent::bonus::{BonusModel, SHARED_OWNER};
use crate::agent::{ActScratch, Agent, AgentContext};
use crate::cancellation::cancellation_point;
use crate::experience::{Episode, EpisodeInfo};
use crate::nn::Tensor;

/// A team of independent [`Agent`]s, which all learn from the team's shared episodes.
pub struct IndependentLearners {
    /// Number of agents of the team, in all processes together.
    agent_count: usize,
    /// Number of the first of `agents`.
    first_agent: usize,
    /// The local agents.
    agents: Vec<Box<dyn Agent>>,
}

impl IndependentLearners {
    /// A team of these agents, in the order of their numbers.
    #[must_use]
    pub fn new(agents: Vec<Box<dyn Agent>>) -> Self {
        Self {
            agent_count: agents.len(),
            first_agent: 0,
            agents,
        }
    }

    /// A team with the number of agents in `context`, whose local agents are built by `build`.
    pub fn build<A: Agent + 'static>(
        context: &TeamContext<'_>,
        build: impl Fn(&AgentContext<'_>) -> A,
    ) -> Box<dyn Team> {
        let local_agents = context.local_agents();
        Box::new(Self {
            agent_count: context.config.count.get() as usize,
            first_agent: local_agents.start as usize,
            agents: local_agents
                .map(|agent| {
                    cancellation_point();
                    Box::new(build(&context.agent_context(agent))) as Box<dyn Agent>
                })
                .collect(),
        })
    }

    fn local_agents(&self) -> impl Iterator<Item = &dyn Agent> {
        self.agents.iter().map(|agent| &**agent)
    }

    /// Agent 0, if it is local.
    fn agent_0(&self) -> Option<&dyn Agent> {
        self.agents
            .first()
            .filter(|_| self.first_agent == 0)
            .map(|agent| &**agent)
    }
}

/// The bonus model, if the team shares it.
impl HasBonusModel for Box<dyn Agent> {
    fn bonus_model(&self) -> Option<&BonusModel> {
        self.shared_bonus_model()
    }

    fn bonus_model_mut(&mut self) -> Option<&mut BonusModel> {
        self.shared_bonus_model_mut()
    }
}

/// The agents of a group, which come first among `agents`, choose their actions.
pub(crate) fn act_one_by_one<'a, A: Agent + ?Sized + 'a>(
    agents: impl Iterator<Item = &'a A>,
    request: &mut ActionRequest<'_>,
    scratch: &mut ActScratch,
) {
    let count = request.playing.len();
    let observation_width = request.observations.len() / count;
    let action_width = request.actions.len() / count;
    for (index, agent) in agents.take(count).enumerate() {
        if !request.playing[index] {
            continue;
        }
        let observation = index * observation_width..(index + 1) * observation_width;
        let action = index * action_width..(index + 1) * action_width;
        agent.act(
            &request.observations[observation],
            &mut request.random[index],
            scratch,
            &mut request.actions[action.clone()],
            &mut request.log_probs[action],
        );
    }
}

/// Tensors of agents that begin with this number, whose names then begin with e.g. `agent_3.`.
pub(crate) fn tensors_of_agents<'a, A: ?Sized + 'a>(
    agents: impl Iterator<Item = &'a A>,
    first: usize,
    tensors_of: impl Fn(&'a A) -> Vec<Tensor<'a>>,
) -> Vec<Tensor<'a>> {
    let mut tensors = Vec::new();
    for (agent, number) in agents.zip(first..) {
        let prefix = format!("agent_{number}.");
        let own_tensors = tensors_of(agent).into_iter();
        tensors.extend(own_tensors.map(|tensor| tensor.prefixed(&prefix)));
    }
    tensors
}

impl Team for IndependentLearners {
    fn agent_count(&self) -> usize {
        self.agent_count
    }

    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch) {
        let group = &self.agents[request.first_agent - self.first_agent..];
        act_one_by_one(group.iter().map(|agent| &**agent), request, scratch);
    }

    fn learn(&mut self, request: &LearningRequest<'_>, workers: Workers<'_>) -> Vec<AgentUpdate> {
        // Learners are in agent order, so one pass over the agents finds all of them.
        let mut remaining = request.learners.iter().peekable();
        let mut learning_agents: Vec<(&mut Box<dyn Agent>, &Learner)> = Vec::new();
        for (agent, number) in self.agents.iter_mut().zip(self.first_agent as u32..) {
            if let Some(learner) = remaining.next_if(|learner| learner.agent == number) {
                learning_agents.push((agent, learner));
            }
        }
        let mut updates = workers.map(learning_agents, |(agent, learner)| AgentUpdate {
            agent: learner.agent,
            update: agent.update(&learner.experience(request)),
            is_finite: agent.is_finite(),
        });
        if self.first_agent == 0 && copy_shared_bonus_model(&mut self.agents, workers) {
            let trained = updates[0].update.report.prediction_error;
            for update in &mut updates {
                update.update.report.prediction_error = trained;
            }
        }
        updates
    }

    fn choose_episodes(
        &self,
        new_episodes: &[EpisodeInfo],
        earlier_updates: u32,
    ) -> Option<Vec<usize>> {
        let mut is_chosen = vec![false; new_episodes.len()];
        for agent in &self.agents {
            for index in agent.choose_episodes(new_episodes, earlier_updates)? {
                is_chosen[index] = true;
            }
        }
        let indices = 0..new_episodes.len();
        Some(indices.filter(|&index| is_chosen[index]).collect())
    }

    fn shared_model(&self) -> Option<Vec<u8>> {
        let model = self.agent_0()?.shared_bonus_model()?;
        Some(model.save_model())
    }

    fn set_shared_model(&mut self, bytes: &[u8], workers: Workers<'_>) -> Result<(), String> {
        let model = self.agents.first_mut();
        let model = model.and_then(|agent| agent.shared_bonus_model_mut());
        model.map_or(Ok(()), |model| BonusModel::restore_model(model, bytes))?;
        copy_shared_bonus_model(&mut self.agents, workers);
        Ok(())
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<Vec<f32>> {
        self.agents
            .iter_mut()
            .map(|agent| agent.probe_bonuses(episode, round))
            .collect()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = tensors_of_agents(self.local_agents(), self.first_agent, |agent| {
            agent.tensors()
        });
        if let Some(agent) = self.agent_0() {
            let shared_tensors = agent.shared_tensors().into_iter();
            tensors.extend(shared_tensors.map(|tensor| tensor.prefixed(SHARED_OWNER)));
        }
        tensors
    }

    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        tensors_of_agents(self.local_agents(), self.first_agent, |agent| {
            agent.initial_tensors()
        })
    }

    fn save(&self) -> SavedTeam {
        SavedTeam {
            parts: self.agents.iter().map(|agent| agent.save()).collect(),
            shared: Vec::new(),
        }
    }

    fn restore(&mut self, saved: &SavedTeam) -> Result<(), String> {
        let (stored, expected) = (saved.parts.len(), self.agent_count);
        if stored != expected {
            return Err(format!(
                "the checkpoint has {stored} agents; expected {expected}"
            ));
        }
        let states = &saved.parts[self.first_agent..];
        let mut agents = self.agents.iter_mut().zip(states);
        agents.try_for_each(|(agent, bytes)| agent.restore(bytes))
    }
}
