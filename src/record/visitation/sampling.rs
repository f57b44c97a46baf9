//! Chooses the states that are drawn as lines and points.
//!
//! The viewer shows the lines of a window of episodes on top of each other. More than about 1,000
//! lines would cover the whole image, so their number is limited. Each round gets an equal share of
//! the lines, and each episode of a round gets an equal share of the lines of the round; short
//! episodes get fewer lines, so that a line stands for at least a few states. The states
//! of an episode are divided into parts of equal length, and one state is sampled at random from
//! each part. So every part of the episode is shown, without a fixed interval, which could be equal
//! to the period of a motion. Samples use the random stream of recordings, so that learning does
//! not depend on them.

use rand::RngExt;

use seedbed_random::Stream;

/// Number of states of an episode from which on it gets its whole share of the lines. Shorter
/// episodes get proportionally fewer.
const STATES_FOR_ALL_LINES: usize = 200;

/// How many states of each round are drawn as lines, so that at most a given number is visible at
/// once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineQuota {
    /// Number of latest rounds and episodes whose lines are visible at once.
    pub window: u32,
    /// Number of lines per agent in one round.
    pub per_round: u32,
}

impl LineQuota {
    /// The quota for at most `lines` visible lines per agent, from the latest `window` episodes. If
    /// `lines` is smaller than `window`, only the latest `lines` episodes have lines.
    #[must_use]
    pub fn of(lines: u32, window: u32) -> Self {
        let window = lines.clamp(1, window);
        Self {
            window,
            per_round: lines / window,
        }
    }

    /// Number of lines of episode `index` of the `episodes` that an agent finished in a round. The
    /// episode has `length` steps.
    #[must_use]
    pub fn lines_of_episode(self, index: usize, episodes: usize, length: usize) -> usize {
        let lines_before = |episode: usize| self.per_round as usize * episode / episodes;
        let lines = lines_before(index + 1) - lines_before(index);
        let states = (length + 1).min(STATES_FOR_ALL_LINES);
        let share = lines * states + STATES_FOR_ALL_LINES / 2;
        (share / STATES_FOR_ALL_LINES).max(lines.min(1))
    }
}

/// Samples indices of `count` out of `states` states, in ascending order: one index from each of
/// `count` equal parts of the episode. Returns all indices if there are at most `count` states.
pub fn sample_states(states: usize, count: usize, random: &mut Stream) -> Vec<usize> {
    if count >= states {
        return (0..states).collect();
    }
    let start = |part: usize| part * states / count;
    (0..count)
        .map(|part| random.random_range(start(part) as u64..start(part + 1) as u64) as usize)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_random::{Purpose, stream};

    #[test]
    fn the_quota_does_not_exceed_the_requested_number() {
        assert_eq!(
            LineQuota::of(1000, 50),
            LineQuota {
                window: 50,
                per_round: 20
            }
        );
        assert_eq!(
            LineQuota::of(1000, 200),
            LineQuota {
                window: 200,
                per_round: 5
            }
        );
        assert_eq!(
            LineQuota::of(7, 50),
            LineQuota {
                window: 7,
                per_round: 1
            }
        );
        assert_eq!(
            LineQuota::of(0, 50),
            LineQuota {
                window: 1,
                per_round: 0
            }
        );
        let shares: Vec<_> = (0..3)
            .map(|index| LineQuota::of(1000, 50).lines_of_episode(index, 3, 200))
            .collect();
        assert_eq!(shares, [6, 7, 7]);
        let lines_of_length = |length| LineQuota::of(1000, 50).lines_of_episode(0, 1, length);
        assert_eq!([0, 7, 20, 159, 500].map(lines_of_length), [1, 1, 2, 16, 20]);
        assert_eq!(LineQuota::of(0, 50).lines_of_episode(0, 1, 20), 0);
    }

    #[test]
    fn sampled_states_are_spread_over_the_episode() {
        let mut random = stream(1, Purpose::Recording, 0, 0);
        let sampled = sample_states(200, 20, &mut random);
        assert!(
            sampled
                .iter()
                .enumerate()
                .all(|(part, &state)| state / 10 == part),
            "{sampled:?}"
        );
        assert_eq!(sample_states(3, 20, &mut random), [0, 1, 2]);
        assert_eq!(sample_states(3, 0, &mut random), [0_usize; 0]);
    }
}
