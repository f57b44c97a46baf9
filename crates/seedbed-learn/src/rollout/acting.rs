//! Choosing the actions of a group of agents.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::agent::{ActScratch, ActionRandom};
use crate::experience::Episode;
use crate::team::{ActionRequest, Team};
use seedbed_random::{Purpose, stream};

/// An agent that may be playing an episode.
pub trait Player {
    /// The episode that the agent is playing, if any.
    fn playing(&mut self) -> Option<&mut Episode>;
}

/// Consecutive agents of a team that choose their actions together.
#[derive(Debug, Serialize, Deserialize)]
pub struct ActingAgents {
    /// What each agent draws its actions from: `[agents]`.
    random: Vec<ActionRandom>,
    #[serde(skip)]
    buffers: StepBuffers,
}

/// What a group of agents acts on.
#[derive(Clone, Copy, Debug)]
pub struct GroupStep<'a> {
    /// Number of the group's first agent.
    pub first_agent: u32,
    /// Number of components of an action.
    pub action_width: usize,
    /// Number of steps that have been played since the last [`Team::end_step`].
    pub unreported_steps: u32,
    /// Observations of the group; rows of agents that do not play have no meaning: `[agents ×
    /// observation width]`.
    pub observations: &'a [f32],
}

/// Memory for one step of all agents, reused from step to step.
#[derive(Debug, Default)]
struct StepBuffers {
    playing: Vec<bool>,
    steps: Vec<u32>,
    actions: Vec<f32>,
    log_probs: Vec<f32>,
    scratch: ActScratch,
}

impl ActingAgents {
    /// Agents that draw their actions from the random streams of (run seed, agent, `round`).
    #[must_use]
    pub fn new(run_seed: u64, agents: Range<u32>, round: u32) -> Self {
        Self {
            random: agents
                .map(|agent| stream(run_seed, Purpose::Action, agent, round).into())
                .collect(),
            buffers: StepBuffers::default(),
        }
    }

    /// Gives each agent the stream of `round`. `first_agent`: number of the group's first agent
    pub fn begin_round(&mut self, run_seed: u64, first_agent: u32, round: u32) {
        for (index, agent) in (0..self.random.len()).zip(first_agent..) {
            self.renew(index, run_seed, agent, round);
        }
    }

    /// Gives one agent the stream of `round`. `index`: that of the agent in the group
    pub fn renew(&mut self, index: usize, run_seed: u64, agent: u32, round: u32) {
        self.random[index].stream = stream(run_seed, Purpose::Action, agent, round);
    }

    /// All playing agents choose their next actions, which are added to their episodes: `[agents ×
    /// action width]`, one row per agent. Rows of other agents have no meaning.
    pub fn act(
        &mut self,
        team: &dyn Team,
        step: &GroupStep<'_>,
        agents: &mut [impl Player],
    ) -> &[f32] {
        let buffers = &mut self.buffers;
        buffers.begin_step(step.action_width, agents);
        for (random, &steps) in self.random.iter_mut().zip(&buffers.steps) {
            if steps == 0 {
                random.begin_episode();
            }
        }
        let mut request = ActionRequest {
            first_agent: step.first_agent as usize,
            unreported_steps: step.unreported_steps,
            steps: &buffers.steps,
            observations: step.observations,
            playing: &buffers.playing,
            random: &mut self.random,
            actions: &mut buffers.actions,
            log_probs: &mut buffers.log_probs,
        };
        team.act(&mut request, &mut buffers.scratch);
        buffers.add_to_episodes(step.action_width, agents);
        &self.buffers.actions
    }
}

impl StepBuffers {
    /// Notes who plays, and makes room for the actions.
    fn begin_step(&mut self, action_width: usize, agents: &mut [impl Player]) {
        self.playing.clear();
        self.steps.clear();
        for agent in &mut *agents {
            let playing = agent.playing();
            self.playing.push(playing.is_some());
            let steps = playing.map_or(0, |episode| episode.length() as u32);
            self.steps.push(steps);
        }
        self.actions.resize(agents.len() * action_width, 0.0);
        self.log_probs.resize(agents.len() * action_width, 0.0);
    }

    fn add_to_episodes(&self, action_width: usize, agents: &mut [impl Player]) {
        let rows = self.actions.chunks_exact(action_width);
        let rows = rows.zip(self.log_probs.chunks_exact(action_width));
        for (agent, (action, log_prob)) in agents.iter_mut().zip(rows) {
            if let Some(episode) = agent.playing() {
                episode.actions.extend_from_slice(action);
                episode.log_probs.extend_from_slice(log_prob);
            }
        }
    }
}
