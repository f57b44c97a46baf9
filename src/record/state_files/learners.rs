//! Learners of a recorded run: agents that are copies of an environment in which one learner acts
//! count as one.

use crate::run::facts::EpisodeRow;

/// An episode that has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EndedEpisode {
    /// Number of the agent.
    pub agent: u32,
    /// Number of steps.
    pub length: u64,
    /// Sum of the rewards.
    pub r#return: f64,
    /// Number of steps of the agent's environment up to the end of the episode; `None` if it is that
    /// of the recorded steps.
    pub end_step: Option<u64>,
}

/// The learners of a recorded run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Learners {
    /// The learner of each agent: `[K]`.
    of_agents: Vec<u32>,
    /// Of each agent, the number of steps of its environment up to the end of each episode:
    /// `[K][episodes]`; empty if they are not known.
    end_steps: Vec<Vec<u64>>,
}

impl Learners {
    /// Learners with these numbers, one per agent.
    #[must_use]
    pub fn new(of_agents: Vec<u32>) -> Self {
        Self {
            of_agents,
            end_steps: Vec::new(),
        }
    }

    /// The same learners, with the number of steps of each agent's environment up to the end of each of
    /// its episodes: `[K][episodes]`.
    #[must_use]
    pub fn with_end_steps(self, end_steps: Vec<Vec<u64>>) -> Self {
        Self { end_steps, ..self }
    }

    /// `agents` agents that each learn on their own.
    #[must_use]
    pub fn of_own(agents: u32) -> Self {
        Self::new((0..agents).collect())
    }

    /// Numbers of the learners, in ascending order.
    #[must_use]
    pub fn numbers(&self) -> Vec<u32> {
        let mut numbers = self.of_agents.clone();
        numbers.sort_unstable();
        numbers.dedup();
        numbers
    }

    /// Number of learners.
    #[must_use]
    pub fn count(&self) -> usize {
        self.numbers().len()
    }

    /// Number of agents, of which several may have one learner.
    #[must_use]
    pub fn agents(&self) -> usize {
        self.of_agents.len()
    }

    /// Whether several agents have one learner.
    #[must_use]
    pub fn have_copies(&self) -> bool {
        self.count() < self.agents()
    }

    /// The episodes of each learner in the order in which they ended, in steps of their environments:
    /// copies step together. With each episode, the number of these steps. `episodes` has those of each
    /// agent in their order.
    ///
    /// # Panics
    /// If an episode has another agent.
    #[must_use]
    pub fn episodes(
        &self,
        episodes: impl Iterator<Item = EndedEpisode>,
    ) -> Vec<Vec<(u64, EndedEpisode)>> {
        let mut steps = vec![0_u64; self.agents()];
        let mut ended: Vec<(u64, EndedEpisode)> = Vec::new();
        for episode in episodes {
            let steps = &mut steps[episode.agent as usize];
            let recorded = steps.saturating_add(episode.length);
            *steps = episode.end_step.unwrap_or(recorded);
            ended.push((*steps, episode));
        }
        ended.sort_by_key(|(steps, episode)| (*steps, episode.agent));
        let numbers = self.numbers();
        let mut of_learners = vec![Vec::new(); numbers.len()];
        for (steps, episode) in ended {
            let learner = self.of_agents[episode.agent as usize];
            let index = numbers.partition_point(|&number| number < learner);
            of_learners[index].push((steps, episode));
        }
        of_learners
    }

    /// Returns of the episodes of each learner, in the order of [`episodes`](Self::episodes).
    ///
    /// # Panics
    /// If a row has another agent.
    #[must_use]
    pub fn returns(&self, rows: &[EpisodeRow]) -> Vec<Vec<f64>> {
        let episodes = self.ended_episodes(rows);
        let returns = |episodes: Vec<(u64, EndedEpisode)>| {
            let episodes = episodes.into_iter();
            episodes.map(|(_, episode)| episode.r#return).collect()
        };
        episodes.into_iter().map(returns).collect()
    }

    /// Number of steps of their environments after which the episodes of each learner ended, in the same order.
    ///
    /// # Panics
    /// If a row has another agent.
    #[must_use]
    pub fn end_steps(&self, rows: &[EpisodeRow]) -> Vec<Vec<u64>> {
        let episodes = self.ended_episodes(rows);
        let steps = |episodes: Vec<(u64, EndedEpisode)>| {
            let episodes = episodes.into_iter();
            episodes.map(|(steps, _)| steps).collect()
        };
        episodes.into_iter().map(steps).collect()
    }

    fn ended_episodes(&self, rows: &[EpisodeRow]) -> Vec<Vec<(u64, EndedEpisode)>> {
        self.episodes(rows.iter().map(|row| self.ended(row)))
    }

    fn ended(&self, row: &EpisodeRow) -> EndedEpisode {
        let of_agent = self.end_steps.get(row.agent as usize);
        EndedEpisode {
            agent: row.agent,
            length: row.length.into(),
            r#return: row.r#return,
            end_step: of_agent.and_then(|ends| ends.get(row.episode as usize).copied()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::Status;

    fn row(agent: u32, episode: u32, length: u32) -> EpisodeRow {
        EpisodeRow {
            agent,
            episode,
            round: episode,
            env_steps: 0,
            r#return: f64::from(length),
            length,
            outcome: Status::Terminated,
            coverage: f64::NAN,
            visitation_entropy: f64::NAN,
            team_overlap: f64::NAN,
            effective_agents: f64::NAN,
        }
    }

    /// The copies 0 and 2 of one learner end episodes after 5, 7 and 4, 9 steps.
    #[test]
    fn episodes_of_copies_are_in_the_order_of_their_ends() {
        let rows = [
            row(0, 0, 5),
            row(1, 0, 1),
            row(2, 0, 4),
            row(0, 1, 2),
            row(2, 1, 5),
        ];
        let learners = Learners::new(vec![0, 1, 0]);
        assert_eq!(
            learners.returns(&rows),
            [vec![4.0, 5.0, 2.0, 5.0], vec![1.0]]
        );
        // Copy 0 was reset, without a recorded step, for five steps before its second episode.
        let reset = learners
            .clone()
            .with_end_steps(vec![vec![5, 12], vec![1], vec![4, 9]]);
        assert_eq!(reset.returns(&rows)[0], [4.0, 5.0, 5.0, 2.0]);
        assert!(learners.have_copies() && !Learners::of_own(3).have_copies());
        assert_eq!(Learners::of_own(3).returns(&rows)[0], [5.0, 2.0]);
    }
}
