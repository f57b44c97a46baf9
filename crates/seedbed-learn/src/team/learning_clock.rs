//! When a team learns that gets single transitions.

use serde::{Deserialize, Serialize};

use super::LearningTiming;
use crate::nn::Standardizer;
use crate::scaling::Scaling;

/// Counts the steps and transitions of a team.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LearningClock {
    timing: LearningTiming,
    /// Number of agents K.
    agents: u32,
    /// Number of steps of each agent so far.
    pub(crate) steps: u64,
    /// Number of steps of each agent in this round so far.
    pub(crate) steps_of_round: u32,
    /// Number of the team's transitions since it learned, with
    /// [`LearningTiming::EveryTransitions`].
    pub(crate) new_transitions: u32,
}

/// What a checkpoint holds of a team that gets single transitions, beside its learners. `S` is borrowed when it is
/// written.
#[derive(Serialize, Deserialize)]
pub(crate) struct SavedProgress<S> {
    observations: Option<S>,
    steps: u64,
    new_transitions: u32,
}

impl<'a> SavedProgress<&'a Standardizer> {
    pub(crate) fn of(scaling: &'a Scaling, clock: &LearningClock) -> Self {
        Self {
            observations: scaling.learned(),
            steps: clock.steps,
            new_transitions: clock.new_transitions,
        }
    }
}

impl SavedProgress<Standardizer> {
    /// # Errors
    /// It is of a team that scales its observations in another way.
    pub(crate) fn restore(
        self,
        scaling: &mut Scaling,
        clock: &mut LearningClock,
    ) -> Result<(), String> {
        clock.steps = self.steps;
        clock.new_transitions = self.new_transitions;
        scaling.restore(self.observations)
    }
}

impl LearningClock {
    /// A clock of a team that has not acted.
    pub(crate) fn new(timing: LearningTiming, agents: usize) -> Self {
        Self {
            timing,
            agents: agents as u32,
            steps: 0,
            steps_of_round: 0,
            new_transitions: 0,
        }
    }

    pub(crate) fn begin_round(&mut self) {
        self.steps_of_round = 0;
    }

    /// Number of steps that may be played before the team learns.
    pub(crate) fn transition_interval(&self) -> u32 {
        match self.timing {
            LearningTiming::EverySteps(count) => count - self.steps_of_round % count,
            LearningTiming::EveryTransitions(count) => {
                (count - self.new_transitions).div_ceil(self.agents)
            }
            LearningTiming::AfterEpisodes => u32::MAX,
        }
    }

    pub(crate) fn add_transition(&mut self) {
        if matches!(self.timing, LearningTiming::EveryTransitions(_)) {
            self.new_transitions += 1;
        }
    }

    /// Counts a step of all agents; returns how many times the team learns after it.
    pub(crate) fn end_step(&mut self) -> u32 {
        self.steps += 1;
        self.steps_of_round += 1;
        match self.timing {
            LearningTiming::EverySteps(count) => {
                u32::from(self.steps_of_round.is_multiple_of(count))
            }
            LearningTiming::EveryTransitions(count) => {
                let due = self.new_transitions / count;
                self.new_transitions %= count;
                due
            }
            LearningTiming::AfterEpisodes => 0,
        }
    }

    /// Whether the team learns when episodes have ended, and not during them.
    pub(crate) fn learns_after_episodes(&self) -> bool {
        self.timing == LearningTiming::AfterEpisodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With an update per 3 transitions, a team of two learns after its second step (4 transitions),
    /// its third (6), and twice after 7 more transitions.
    #[test]
    fn updates_per_transition_of_the_team_carry_over() {
        let mut clock = LearningClock::new(LearningTiming::EveryTransitions(3), 2);
        let mut due_after = |transitions: u32| {
            (0..transitions).for_each(|_| clock.add_transition());
            (clock.end_step(), clock.transition_interval())
        };
        assert_eq!(due_after(2), (0, 1));
        assert_eq!(due_after(2), (1, 1));
        assert_eq!(due_after(2), (1, 2));
        assert_eq!(due_after(7), (2, 1));
    }

    /// With an update per 3 steps, a team learns after steps 3 and 6 of every round.
    #[test]
    fn steps_are_counted_from_the_beginning_of_a_round() {
        let mut clock = LearningClock::new(LearningTiming::EverySteps(3), 2);
        for _ in 0..2 {
            clock.begin_round();
            let due: Vec<u32> = (0..7).map(|_| clock.end_step()).collect();
            assert_eq!(due, [0, 0, 1, 0, 0, 1, 0]);
            assert_eq!(clock.transition_interval(), 2);
        }
        assert_eq!(clock.steps, 14);
    }
}
