//! Agents that each have networks of their own.

use super::{ActionRequest, AgentUpdate, Learner, Lesson, Team, TeamContext, Workers};
use crate::agent::{ActScratch, Agent, AgentContext, Tensor};
use crate::experience::{Episode, Experience};

/// A team of agents that each learn for themselves, from the team's shared episodes.
pub struct IndependentLearners {
    agents: Vec<Box<dyn Agent>>,
    scratch: ActScratch,
}

impl IndependentLearners {
    /// A team of these agents, agent k being the k-th.
    #[must_use]
    pub fn new(agents: Vec<Box<dyn Agent>>) -> Self {
        Self {
            agents,
            scratch: ActScratch::default(),
        }
    }

    /// A team of as many agents as `context` says, each made by `build`.
    pub fn build<A: Agent + 'static>(
        context: &TeamContext<'_>,
        build: impl Fn(&AgentContext<'_>) -> A,
    ) -> Box<dyn Team> {
        let agents = context
            .agents()
            .map(|agent| Box::new(build(&context.agent(agent))) as Box<dyn Agent>);
        Box::new(Self::new(agents.collect()))
    }
}

impl Team for IndependentLearners {
    fn agent_count(&self) -> usize {
        self.agents.len()
    }

    fn act(&mut self, request: &mut ActionRequest<'_>) {
        let count = self.agents.len();
        let observed = request.observations.len() / count;
        let acted = request.actions.len() / count;
        for (index, agent) in self.agents.iter().enumerate() {
            if !request.playing[index] {
                continue;
            }
            agent.act(
                &request.observations[index * observed..(index + 1) * observed],
                &mut request.random[index],
                &mut self.scratch,
                &mut request.actions[index * acted..(index + 1) * acted],
                &mut request.log_probs[index * acted..(index + 1) * acted],
            );
        }
    }

    fn learn(&mut self, lesson: &Lesson<'_>, workers: Workers<'_>) -> Vec<AgentUpdate> {
        let mut remaining = lesson.learners.iter().peekable();
        let mut learning: Vec<(&mut Box<dyn Agent>, &Learner)> = Vec::new();
        for (agent, number) in self.agents.iter_mut().zip(0..) {
            if let Some(learner) = remaining.next_if(|learner| learner.agent == number) {
                learning.push((agent, learner));
            }
        }
        workers.map(learning, |(agent, learner)| AgentUpdate {
            agent: learner.agent,
            update: agent.update(&Experience {
                fresh: &lesson.kept[learner.first_fresh..],
                kept: lesson.kept,
                round: learner.round,
            }),
            is_finite: agent.is_finite(),
        })
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<Vec<f32>> {
        self.agents
            .iter_mut()
            .map(|agent| agent.probe_bonuses(episode, round))
            .collect()
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        let mut all = Vec::new();
        for (number, agent) in self.agents.iter().enumerate() {
            all.extend(agent.tensors().into_iter().map(|tensor| Tensor {
                name: format!("agent_{number}.{}", tensor.name),
                ..tensor
            }));
        }
        all
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
                "stored for {} agents, not for {count}",
                saved.len()
            ));
        }
        self.agents
            .iter_mut()
            .zip(&saved)
            .try_for_each(|(agent, bytes)| agent.restore(bytes))
    }
}
