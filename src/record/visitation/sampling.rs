//! Chooses the states that are drawn as lines and points.
//!
//! The viewer shows the lines of a window of episodes on top of each other, and beyond about 1,000
//! lines they are a solid block. So each round gets an equal share of the wanted number, and each of
//! its episodes an equal share of that. Within an episode, one state is drawn at random from each of
//! equally long parts: every part of the episode is shown, yet no fixed stride that a periodic
//! motion could fall in step with. The random stream is that of recordings, so that learning does
//! not depend on what is drawn.

use rand::RngExt;

use seedbed_env::random::Stream;

/// How many states become lines, so that no more than the wanted number are visible at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineQuota {
    /// Number of rounds and episodes whose lines are visible together.
    pub window: u32,
    /// Lines per agent and round.
    pub per_round: u32,
}

impl LineQuota {
    /// For `lines` visible lines per agent from the latest `window` episodes, or from as many
    /// episodes as there are lines if those are fewer.
    #[must_use]
    pub fn of(lines: u32, window: u32) -> Self {
        let window = lines.clamp(1, window);
        Self {
            window,
            per_round: lines / window,
        }
    }

    /// Lines of the episode at `index` of the `episodes` that an agent finished in a round.
    #[must_use]
    pub fn of_episode(self, index: usize, episodes: usize) -> usize {
        let until = |episode: usize| self.per_round as usize * episode / episodes;
        until(index + 1) - until(index)
    }
}

/// Picks `count` of `states` states in ascending order: one at random from each of `count` parts of
/// the episode; all of them if there are no more than `count`.
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
    use seedbed_env::random::{Purpose, stream};

    #[test]
    fn the_quota_never_exceeds_the_wanted_number() {
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
