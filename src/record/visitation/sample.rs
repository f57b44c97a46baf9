//! Which states become lines and points.

use rand::RngExt;

use crate::random::Stream;

/// How many states become lines, such that never more than the wanted number is visible at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineQuota {
    /// Rounds and episodes whose lines are visible together.
    pub window: u32,
    /// Lines of an agent in one round.
    pub per_round: u32,
}

impl LineQuota {
    /// For `lines` visible lines an agent, of the latest `window` episodes or, where there are fewer lines, of as many.
    #[must_use]
    pub fn of(lines: u32, window: u32) -> Self {
        let window = lines.clamp(1, window);
        Self {
            window,
            per_round: lines / window,
        }
    }

    /// Lines of the `index`-th of an agent's `episodes` in a round.
    #[must_use]
    pub fn of_episode(self, index: usize, episodes: usize) -> usize {
        let until = |episode: usize| self.per_round as usize * episode / episodes;
        until(index + 1) - until(index)
    }
}

/// Picks `count` of `states` states, in order: one at random from each of `count` parts of the episode. All, if there are fewer.
pub fn pick_states(states: usize, count: usize, random: &mut Stream) -> Vec<usize> {
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
    use crate::random::{Purpose, stream};

    #[test]
    fn the_quota_never_exceeds_the_wanted_lines() {
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
            .map(|index| LineQuota::of(1000, 50).of_episode(index, 3))
            .collect();
        assert_eq!(shares, [6, 7, 7]);
    }

    #[test]
    fn picked_states_are_spread_over_the_episode() {
        let mut random = stream(1, Purpose::Recording, 0, 0);
        let picked = pick_states(200, 20, &mut random);
        assert!(
            picked
                .iter()
                .enumerate()
                .all(|(part, &state)| state / 10 == part),
            "{picked:?}"
        );
        assert_eq!(pick_states(3, 20, &mut random), [0, 1, 2]);
        assert_eq!(pick_states(3, 0, &mut random), [0_usize; 0]);
    }
}
