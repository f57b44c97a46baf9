//! The steps of agents of other ranks, for teams that learn from single transitions.
//!
//! Such a team gets the transitions of all agents in the order of steps and agents. Each rank sends
//! what its agents have played since the last time, and keeps a copy of the episodes of the others.

use serde::{Deserialize, Serialize};

use crate::run::ranks::Ranks;
use seedbed_env::Status;
use seedbed_learn::experience::Episode;
use seedbed_learn::rollout::AgentRound;
use seedbed_learn::team::Team;

/// What the agents of one rank have played since the last exchange.
#[derive(Serialize, Deserialize)]
pub(super) struct PlayedSteps {
    /// Number of steps.
    steps: u32,
    /// Whether all agents of the rank have played their episodes of the round.
    is_over: bool,
    /// New parts of episodes, in (agent, episode) order. A part has the first observation only if it
    /// begins with the first step.
    parts: Vec<Episode>,
}

impl PlayedSteps {
    pub(super) fn new(steps: u32, is_over: bool) -> Self {
        Self {
            steps,
            is_over,
            parts: Vec::new(),
        }
    }

    /// Adds what an agent has played after its latest reported transition. `playing`: its episode that
    /// has not ended
    pub(super) fn add_agent(&mut self, agent: &AgentRound, playing: Option<&Episode>) {
        let (first_episode, mut first_step) = agent.unreported;
        let episodes = agent.finished.iter().skip(first_episode).chain(playing);
        for episode in episodes {
            if episode.length() > first_step {
                self.parts.push(part_after(episode, first_step));
            }
            first_step = 0;
        }
    }
}

/// The steps of an episode from number `step` on.
fn part_after(episode: &Episode, step: usize) -> Episode {
    let length = episode.length();
    let observation_width = episode.observations.len() / (length + 1);
    let action_width = episode.actions.len() / length;
    // The observation after the step before is there already.
    let first_row = if step == 0 { 0 } else { step + 1 };
    Episode {
        agent: episode.agent,
        episode: episode.episode,
        round: episode.round,
        observations: episode.observations[first_row * observation_width..].to_vec(),
        actions: episode.actions[step * action_width..].to_vec(),
        rewards: episode.rewards[step..].to_vec(),
        log_probs: episode.log_probs[step * action_width..].to_vec(),
        outcome: episode.outcome,
    }
}

/// Copies of what the agents of another rank play in a round.
#[derive(Default)]
struct RemoteRound {
    agents: Vec<RemoteAgent>,
}

struct RemoteAgent {
    number: u32,
    round: AgentRound,
    playing: Option<Episode>,
}

impl RemoteRound {
    fn add(&mut self, parts: Vec<Episode>) {
        for part in parts {
            let index = self
                .agents
                .binary_search_by_key(&part.agent, |agent| agent.number)
                .unwrap_or_else(|index| {
                    self.agents.insert(index, RemoteAgent::new(part.agent));
                    index
                });
            self.agents[index].add(part);
        }
    }

    fn report_step(&mut self, team: &mut dyn Team) {
        for RemoteAgent { round, playing, .. } in &mut self.agents {
            round.report_step(playing.as_ref(), team);
        }
    }

    fn into_episodes(self) -> impl Iterator<Item = Episode> {
        self.agents
            .into_iter()
            .flat_map(|agent| agent.round.finished)
    }
}

impl RemoteAgent {
    fn new(number: u32) -> Self {
        Self {
            number,
            round: AgentRound::default(),
            playing: None,
        }
    }

    fn add(&mut self, part: Episode) {
        let episode = match self.playing.take() {
            None => part,
            Some(mut episode) => {
                episode.observations.extend(part.observations);
                episode.actions.extend(part.actions);
                episode.rewards.extend(part.rewards);
                episode.log_probs.extend(part.log_probs);
                episode.outcome = part.outcome;
                episode
            }
        };
        if episode.outcome == Status::Running {
            self.playing = Some(episode);
        } else {
            self.round.finished.push(episode);
        }
    }
}

/// What the agents of all other ranks play in a round.
pub(super) struct RemoteRounds {
    ranks: Ranks,
    /// Those of the ranks before this one, and those of the ranks after it.
    before: RemoteRound,
    after: RemoteRound,
}

/// The state of a round after an exchange.
pub(super) struct Exchanged {
    /// The largest number of new steps of an agent.
    pub(super) steps: u32,
    /// Whether all agents of all ranks have played their episodes.
    pub(super) is_over: bool,
}

impl RemoteRounds {
    pub(super) fn new(ranks: Ranks) -> Self {
        Self {
            ranks,
            before: RemoteRound::default(),
            after: RemoteRound::default(),
        }
    }

    /// Whether there are no other ranks.
    pub(super) fn is_empty(&self) -> bool {
        self.ranks.is_single()
    }

    /// Sends what local agents have played, and receives what others have.
    pub(super) fn exchange(&mut self, local: PlayedSteps) -> Exchanged {
        let mut exchanged = Exchanged {
            steps: 0,
            is_over: true,
        };
        let own_rank = self.ranks.rank() as usize;
        for (rank, played) in self.ranks.all_gather(local).into_iter().enumerate() {
            exchanged.steps = exchanged.steps.max(played.steps);
            exchanged.is_over &= played.is_over;
            if rank < own_rank {
                self.before.add(played.parts);
            } else if rank > own_rank {
                self.after.add(played.parts);
            }
        }
        exchanged
    }

    /// Passes the next transition of each agent before the local ones to the team.
    pub(super) fn report_step_before(&mut self, team: &mut dyn Team) {
        self.before.report_step(team);
    }

    /// Passes the next transition of each agent after the local ones to the team.
    pub(super) fn report_step_after(&mut self, team: &mut dyn Team) {
        self.after.report_step(team);
    }

    /// All episodes of the team, in (agent, episode) order.
    pub(super) fn with_local(self, local: Vec<Episode>) -> Vec<Episode> {
        let Self { before, after, .. } = self;
        before
            .into_episodes()
            .chain(local)
            .chain(after.into_episodes())
            .collect()
    }
}
