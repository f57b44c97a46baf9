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
        let (index, step) = self.unreported;
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
