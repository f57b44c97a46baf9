//! The episodes of an agent in a round, and which of its transitions the team has.

use seedbed_learn::experience::Episode;
use seedbed_learn::team::Team;

/// The round of one agent.
#[derive(Default)]
pub(super) struct AgentRound {
    /// The episodes that have ended.
    pub(super) finished: Vec<Episode>,
    /// The next transition for the team: index of its episode in this round, and its step.
    pub(super) unreported: (usize, usize),
}

impl AgentRound {
    /// Passes the next transition to the team, if there is one. `playing`: the episode that has not
    /// ended
    pub(super) fn report_step(&mut self, playing: Option<&Episode>, team: &mut dyn Team) {
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
}
