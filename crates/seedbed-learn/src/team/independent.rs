//! Teams of agents that each have their own networks.

use super::{ActionRequest, AgentUpdate, Learner, LearningRequest, Team, TeamContext, Workers};
use crate::agent::bonus::SHARED_OWNER;
use crate::agent::{ActScratch, Agent, AgentContext, Tensor};
use crate::experience::{Episode, Experience};

/// A team of independent [`Agent`]s, which all learn from the team's shared episodes.
pub struct IndependentLearners {
    agents: Vec<Box<dyn Agent>>,
}

impl IndependentLearners {
    /// A team of these agents, in the order of their numbers.
    #[must_use]
    pub fn new(agents: Vec<Box<dyn Agent>>) -> Self {
        Self { agents }
    }

    /// A team with the number of agents in `context`, each built by `build`.
    pub fn build<A: Agent + 'static>(
        context: &TeamContext<'_>,
        build: impl Fn(&AgentContext<'_>) -> A,
    ) -> Box<dyn Team> {
        let agents = context
            .agent_numbers()
            .map(|agent| Box::new(build(&context.agent_context(agent))) as Box<dyn Agent>);
        Box::new(Self::new(agents.collect()))
    }

    /// Tensors of all agents, whose names begin with e.g. `agent_3.`.
    fn tensors_of_agents<'a>(
        &'a self,
        tensors_of: impl Fn(&'a dyn Agent) -> Vec<Tensor<'a>>,
    ) -> Vec<Tensor<'a>> {
        let mut tensors = Vec::new();
        for (number, agent) in self.agents.iter().enumerate() {
            let prefix = format!("agent_{number}.");
            let own_tensors = tensors_of(&**agent).into_iter();
            tensors.extend(own_tensors.map(|tensor| tensor.prefixed(&prefix)));
        }
        tensors
    }

    /// Copies the bonus model that agent 0 has trained to the other agents; returns whether there is
    /// such a model.
    fn copy_shared_bonus_model(&mut self, workers: Workers<'_>) -> bool {
        let Some((first, others)) = self.agents.split_first_mut() else {
            return false;
        };
        let Some(trained) = first.shared_bonus_model() else {
            return false;
        };
        let trained = &*trained;
        workers.for_each(others, |agent| {
            if let Some(model) = agent.shared_bonus_model() {
                model.copy_learned(trained);
            }
        });
        true
    }
}

impl Team for IndependentLearners {
    fn agent_count(&self) -> usize {
        self.agents.len()
    }

    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch) {
        let count = request.playing.len();
        let observation_width = request.observations.len() / count;
        let action_width = request.actions.len() / count;
        let group = &self.agents[request.first_agent..][..count];
        for (index, agent) in group.iter().enumerate() {
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

    fn learn(&mut self, request: &LearningRequest<'_>, workers: Workers<'_>) -> Vec<AgentUpdate> {
        // Learners are in agent order, so one pass over the agents finds all of them.
        let mut remaining = request.learners.iter().peekable();
        let mut learning_agents: Vec<(&mut Box<dyn Agent>, &Learner)> = Vec::new();
        for (agent, number) in self.agents.iter_mut().zip(0..) {
            if let Some(learner) = remaining.next_if(|learner| learner.agent == number) {
                learning_agents.push((agent, learner));
            }
        }
        let mut updates = workers.map(learning_agents, |(agent, learner)| AgentUpdate {
            agent: learner.agent,
            update: agent.update(&Experience {
                new_episodes: &request.episodes[learner.first_new_episode..],
                all_episodes: request.episodes,
                earlier_updates: learner.earlier_updates,
            }),
            is_finite: agent.is_finite(),
        });
        if self.copy_shared_bonus_model(workers) {
            let trained = updates[0].update.report.prediction_error;
            for update in &mut updates {
                update.update.report.prediction_error = trained;
            }
        }
        updates
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<Vec<f32>> {
        self.agents
            .iter_mut()
            .map(|agent| agent.probe_bonuses(episode, round))
            .collect()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut tensors = self.tensors_of_agents(Agent::tensors);
        if let Some(agent) = self.agents.first() {
            let shared_tensors = agent.shared_tensors().into_iter();
            tensors.extend(shared_tensors.map(|tensor| tensor.prefixed(SHARED_OWNER)));
        }
        tensors
    }

    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        self.tensors_of_agents(Agent::initial_tensors)
    }

    fn save(&self) -> Vec<u8> {
        let agents: Vec<Vec<u8>> = self.agents.iter().map(|agent| agent.save()).collect();
        postcard::to_stdvec(&agents).expect("plain data always serializes")
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), String> {
        let saved: Vec<Vec<u8>> = postcard::from_bytes(bytes).map_err(|error| error.to_string())?;
        let count = self.agents.len();
        if saved.len() != count {
            return Err(format!(
                "the checkpoint has {} agents; expected {count}",
                saved.len()
            ));
        }
        self.agents
            .iter_mut()
            .zip(&saved)
            .try_for_each(|(agent, bytes)| agent.restore(bytes))
    }
}
