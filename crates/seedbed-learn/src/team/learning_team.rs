//! A team with the buffer of its episodes, from one round to the next.

use std::ops::Range;

use super::{AgentUpdate, Learner, LearningRequest, SavedTeam, Team, Workers, agreement};
use crate::experience::{Episode, SharedBuffer, StoredBuffer};

/// A team that learns from the episodes in its shared buffer.
pub struct LearningTeam {
    team: Box<dyn Team>,
    buffer: SharedBuffer,
    /// Number of the team's newest transitions that the buffer keeps after all agents have learned
    /// from them.
    transitions_kept: u64,
    /// Number of the team's episodes before the newest round.
    episodes_before_round: u64,
}

impl LearningTeam {
    /// A team without episodes. `transitions_kept`: see
    /// [`Algorithm::transitions_kept`](crate::algorithms::Algorithm::transitions_kept)
    #[must_use]
    pub fn new(team: Box<dyn Team>, transitions_kept: u64) -> Self {
        Self {
            team,
            buffer: SharedBuffer::default(),
            transitions_kept,
            episodes_before_round: 0,
        }
    }

    /// The team.
    #[must_use]
    pub fn team(&self) -> &dyn Team {
        &*self.team
    }

    /// The team, to play and to restore its replay buffer.
    pub fn team_mut(&mut self) -> &mut dyn Team {
        &mut *self.team
    }

    /// Number of the team's episodes so far.
    #[must_use]
    pub fn episodes_added(&self) -> u64 {
        self.buffer.episodes_added()
    }

    /// Number of the team's episodes before the newest round.
    #[must_use]
    pub fn episodes_before_round(&self) -> u64 {
        self.episodes_before_round
    }

    /// The newest round's episodes, in (agent, episode) order.
    #[must_use]
    pub fn newest_episodes(&self) -> Vec<&Episode> {
        let newest = self.buffer.episodes_after(self.episodes_before_round);
        let mut episodes: Vec<&Episode> = newest.iter().collect();
        episodes.sort_by_key(|episode| (episode.agent, episode.episode));
        episodes
    }

    /// Number of the team's first episodes that are not needed any more: all agents have learned
    /// from them, and they have none of the transitions to keep. `learned_by_all`: number of the
    /// first episodes that all agents have learned from
    #[must_use]
    pub fn count_old_episodes(&self, learned_by_all: u64) -> u64 {
        let before_kept = self.buffer.count_before_newest(self.transitions_kept);
        learned_by_all.min(before_kept)
    }

    /// Removes the episodes that are not needed any more, before a round.
    pub fn forget_old_episodes(&mut self, learned_by_all: u64) {
        self.buffer
            .remove_first(self.count_old_episodes(learned_by_all));
        self.episodes_before_round = self.buffer.episodes_added();
    }

    /// Adds episodes that ended at the same time, in a round with this number. Some may have no
    /// steps here; `lengths` are those with all their steps.
    ///
    /// # Panics
    /// If the episodes are not in agent order, or if there are not as many lengths.
    pub fn add_episodes(&mut self, mut episodes: Vec<Episode>, lengths: Vec<u32>, round: u32) {
        for episode in &mut episodes {
            episode.round = round;
        }
        self.buffer.add_episodes_of_lengths(episodes, lengths);
    }

    /// Some agents learn at the same time. `learners`: (agent, number of the team's episodes that
    /// it has learned from before, number of its earlier updates), in agent order
    pub fn learn(
        &mut self,
        learners: &[(u32, u64, u32)],
        workers: Workers<'_>,
    ) -> Vec<AgentUpdate> {
        let episodes = self.buffer.episodes_after(0);
        let removed = self.buffer.episodes_added() - episodes.len() as u64;
        let learners: Vec<Learner> = learners
            .iter()
            .map(|&(agent, learned_before, earlier_updates)| Learner {
                agent,
                first_new_episode: learned_before.saturating_sub(removed) as usize,
                earlier_updates,
            })
            .collect();
        let request = LearningRequest {
            episodes,
            lengths: self.buffer.lengths_after(0),
            learners: &learners,
        };
        self.team.learn(&request, workers)
    }

    /// All of these agents learn from the team's episodes after the first `learned_before`, at the
    /// end of a round with this number.
    pub fn learn_together(
        &mut self,
        agents: Range<u32>,
        learned_before: u64,
        round: u32,
        workers: Workers<'_>,
    ) -> Vec<AgentUpdate> {
        let learners: Vec<_> = agents.map(|agent| (agent, learned_before, round)).collect();
        self.learn(&learners, workers)
    }

    /// Agreement of the agents' intrinsic rewards for the steps of the first episode of the round:
    /// whether the same steps have high intrinsic rewards for all agents, as the mean of Spearman's
    /// rank correlation over pairs of agents. `None` for fewer than two agents, or if all rewards of an
    /// agent are equal.
    pub fn bonus_agreement(&mut self, round: u32) -> Option<f64> {
        let newest = self.buffer.episodes_after(self.episodes_before_round);
        let bonuses = self.team.probe_bonuses(newest.first()?, round);
        agreement::mean_rank_correlation(&bonuses)
    }

    /// What [`restore`](Self::restore) needs: the team, its buffer without old episodes (see
    /// [`count_old_episodes`](Self::count_old_episodes)), and the number of episodes before the
    /// newest round.
    #[must_use]
    pub fn save(&self, learned_by_all: u64) -> (SavedTeam, StoredBuffer<'_>, u64) {
        let buffer = self
            .buffer
            .without_first(self.count_old_episodes(learned_by_all));
        (self.team.save(), buffer, self.episodes_before_round)
    }

    /// Continues from what [`save`](Self::save) returned.
    ///
    /// # Errors
    /// What is wrong if the bytes are not of such a team.
    pub fn restore(
        &mut self,
        team: &SavedTeam,
        buffer: SharedBuffer,
        episodes_before_round: u64,
    ) -> Result<(), String> {
        self.team.restore(team)?;
        (self.buffer, self.episodes_before_round) = (buffer, episodes_before_round);
        Ok(())
    }
}
