//! When checkpoints are written. This depends on clocks; results do not depend on it.

use std::time::{Duration, Instant};

use crate::scenario::Scenario;

/// What the first checkpoint is assumed to take.
const FIRST_DURATION: Duration = Duration::from_millis(10);

/// Every `checkpoint_every` rounds, unless checkpoints would take more than their share of the time.
pub(super) struct CheckpointSchedule {
    every: u32,
    /// Largest share of the time.
    share: f64,
    latest_end: Instant,
    latest_duration: Duration,
}

impl CheckpointSchedule {
    /// The schedule of a run that begins now.
    pub(super) fn of(scenario: &Scenario) -> Self {
        Self {
            every: scenario.checkpoint_every.get(),
            share: scenario.checkpoint_share.get(),
            latest_end: Instant::now(),
            latest_duration: FIRST_DURATION,
        }
    }

    /// Whether a checkpoint should be written `now`, after this number of rounds.
    pub(super) fn is_due(&self, rounds: u32, now: Instant) -> bool {
        let between = now.duration_since(self.latest_end).as_secs_f64();
        let duration = self.latest_duration.as_secs_f64();
        rounds.is_multiple_of(self.every) && self.share * (between + duration) >= duration
    }

    /// Notes that a checkpoint that was begun at `start` is written.
    pub(super) fn written(&mut self, start: Instant) {
        self.latest_duration = start.elapsed();
        self.latest_end = Instant::now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With a share of 1 %, 50 ms of writing need 4.95 s without.
    #[test]
    fn checkpoints_take_at_most_their_share_of_the_time() {
        let latest_end = Instant::now();
        let is_due = |share, rounds, seconds| {
            let schedule = CheckpointSchedule {
                every: 25,
                share,
                latest_end,
                latest_duration: Duration::from_millis(50),
            };
            schedule.is_due(rounds, latest_end + Duration::from_secs_f64(seconds))
        };
        assert!(!is_due(0.01, 25, 4.9));
        assert!(is_due(0.01, 25, 5.0));
        assert!(!is_due(0.01, 24, 5.0));
        assert!(is_due(1.0, 50, 0.0));
    }
}
