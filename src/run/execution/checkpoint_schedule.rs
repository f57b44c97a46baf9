//! When checkpoints are written. This depends on clocks; results do not depend on it.

use std::time::{Duration, Instant};

use crate::scenario::Scenario;

/// What the first checkpoint is assumed to take.
const FIRST_DURATION: Duration = Duration::from_millis(10);

/// Every `checkpoint_every` rounds, unless checkpoints would take more than their share of the time.
pub(crate) struct CheckpointSchedule {
    every: u32,
    min_distance: Duration,
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
            ..Self::with_share(1.0, Duration::ZERO)
        }
    }

    /// The schedule of a run that begins now, after any round whose distance from the latest checkpoint
    /// is at least `min_distance`.
    pub(crate) fn with_share(share: f64, min_distance: Duration) -> Self {
        Self {
            every: 1,
            min_distance,
            share,
            latest_end: Instant::now(),
            latest_duration: FIRST_DURATION,
        }
    }

    /// Whether a checkpoint should be written `now`, after this number of rounds.
    pub(crate) fn is_due(&self, rounds: u32, now: Instant) -> bool {
        let distance = self.distance(now);
        let (between, duration) = (distance.as_secs_f64(), self.latest_duration.as_secs_f64());
        rounds.is_multiple_of(self.every)
            && distance >= self.min_distance
            && self.share * (between + duration) >= duration
    }

    /// Time since the latest checkpoint or, before the first, since the run began or was resumed.
    pub(crate) fn distance(&self, now: Instant) -> Duration {
        now.duration_since(self.latest_end)
    }

    /// Notes that a checkpoint that was begun at `start` is written.
    pub(crate) fn written(&mut self, start: Instant) {
        self.latest_duration = start.elapsed();
        self.latest_end = Instant::now();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a checkpoint is due this long after the latest, which took 50 ms.
    fn is_due(every: u32, min_distance: u64, share: f64, rounds: u32, seconds: f64) -> bool {
        let latest_end = Instant::now();
        let schedule = CheckpointSchedule {
            every,
            min_distance: Duration::from_secs(min_distance),
            share,
            latest_end,
            latest_duration: Duration::from_millis(50),
        };
        schedule.is_due(rounds, latest_end + Duration::from_secs_f64(seconds))
    }

    /// With a share of 1 %, 50 ms of writing need 4.95 s without.
    #[test]
    fn checkpoints_take_at_most_their_share_of_the_time() {
        let is_due = |share, rounds, seconds| is_due(25, 0, share, rounds, seconds);
        assert!(!is_due(0.01, 25, 4.9));
        assert!(is_due(0.01, 25, 5.0));
        assert!(!is_due(0.01, 24, 5.0));
        assert!(is_due(1.0, 50, 0.0));
    }

    #[test]
    fn checkpoints_have_their_min_distance() {
        assert!(!is_due(1, 30, 0.01, 7, 29.9));
        assert!(is_due(1, 30, 0.01, 7, 30.0));
        assert!(
            !is_due(1, 1, 0.01, 7, 4.9),
            "its share of the time is larger"
        );
    }
}
