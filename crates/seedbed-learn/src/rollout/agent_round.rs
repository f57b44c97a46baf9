//! The episodes of an agent in a round, and which of its transitions the team has.

use serde::{Deserialize, Serialize};

use crate::experience::Episode;
use crate::team::Team;

/// The round of one agent.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct AgentRound {
    /// The episodes that have ended.
    pub finished: Vec<Episode>,
    /// The next transition for the team: index of its episode in this round, and its step.
    pub unreported: (usize, usize),
}

impl AgentRound {
    /// Passes the next transition to the team, if there is one. `playing`: the episode that has not
    /// ended
    pub fn report_step(&mut self, playing: Option<&Episode>, team: &mut dyn Team) {
        let (mut index, mut step) = self.unreported;
        let is_complete = |episode: &Episode| step == episode.length();
        if self.finished.get(index).is_some_and(is_complete) {
            // It was cut off after the team had got its last step.
            (index, step) = (index + 1, 0);
        }
        let finished = self.finished.get(index);
        let Some(episode) = finished.or(playing) else {
            return;
        };
        if step == episode.length() {
            return;
        }
        team.add_transition(episode, step);
        let is_complete = finished.is_some() && step + 1 == episode.length();
        self.unreported = if is_complete {
            (index + 1, 0)
        } else {
            (index, step + 1)
        };
    }

    /// Ends the round, and returns its episodes. The team has all transitions, or needs none; an
    /// episode that has not ended belongs to the next round.
    pub fn end(&mut self) -> Vec<Episode> {
        let (index, step) = self.unreported;
        let is_in_playing = index == self.finished.len();
        self.unreported = (0, if is_in_playing { step } else { 0 });
        std::mem::take(&mut self.finished)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::agent::ActScratch;
    use crate::nn::Tensor;
    use crate::team::{ActionRequest, AgentUpdate, LearningRequest, SavedTeam, Workers};
    use seedbed_env::{Status, TaskSpec};

    /// A team that only notes the rewards of the transitions that it gets.
    #[derive(Default)]
    struct Listening(Vec<f32>);

    impl Team for Listening {
        fn agent_count(&self) -> usize {
            1
        }

        fn act(&self, _: &mut ActionRequest<'_>, _: &mut ActScratch) {}

        fn add_transition(&mut self, episode: &Episode, step: usize) {
            self.0.push(episode.rewards[step]);
        }

        fn learn(&mut self, _: &LearningRequest<'_>, _: Workers<'_>) -> Vec<AgentUpdate> {
            Vec::new()
        }

        fn tensors(&self) -> Vec<Tensor<'_>> {
            Vec::new()
        }

        fn save(&self) -> SavedTeam {
            SavedTeam::default()
        }

        fn restore(&mut self, _: &SavedTeam) -> Result<(), String> {
            Ok(())
        }
    }

    fn episode(rewards: &[f32]) -> Episode {
        let spec = TaskSpec::new("test", Vec::new(), Vec::new());
        let mut episode = Episode::start(0, 0, 0, &spec);
        for &reward in rewards {
            episode.add_result(reward, &[], Status::Running);
        }
        episode
    }

    /// A round with episodes of two and of one step; two steps of a third episode, of which the team
    /// gets one before the end of the round and one after it.
    #[test]
    fn each_transition_is_reported_once_also_across_rounds() {
        let (mut round, mut team) = (AgentRound::default(), Listening::default());
        round.finished = vec![episode(&[1.0, 2.0]), episode(&[3.0])];
        let mut playing = episode(&[4.0]);
        (0..5).for_each(|_| round.report_step(Some(&playing), &mut team));
        assert_eq!(team.0, [1.0, 2.0, 3.0, 4.0]);
        assert_eq!((round.end().len(), round.finished.len()), (2, 0));
        playing.add_result(5.0, &[], Status::Terminated);
        round.report_step(Some(&playing), &mut team);
        round.report_step(Some(&playing), &mut team);
        assert_eq!(team.0, [1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    /// An episode is cut off between two steps, after the first of which the team has got it.
    #[test]
    fn steps_after_an_episode_that_was_cut_off_are_reported() {
        let (mut round, mut team) = (AgentRound::default(), Listening::default());
        round.report_step(Some(&episode(&[1.0])), &mut team);
        round.finished = vec![episode(&[1.0])];
        let next = episode(&[2.0]);
        (0..2).for_each(|_| round.report_step(Some(&next), &mut team));
        assert_eq!(team.0, [1.0, 2.0]);
    }

    /// The last step of an episode is reported after the round in which it was played has begun.
    #[test]
    fn an_episode_that_ends_in_the_next_round_is_reported_to_its_end() {
        let (mut round, mut team) = (AgentRound::default(), Listening::default());
        round.finished = vec![episode(&[1.0])];
        let playing = episode(&[2.0]);
        (0..2).for_each(|_| round.report_step(Some(&playing), &mut team));
        round.end();
        round.finished = vec![episode(&[2.0, 3.0])];
        let next = episode(&[4.0]);
        (0..2).for_each(|_| round.report_step(Some(&next), &mut team));
        assert_eq!(team.0, [1.0, 2.0, 3.0, 4.0]);
    }
}
