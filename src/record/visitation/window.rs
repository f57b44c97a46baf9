//! What was counted over the latest rounds only.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// The latest rounds, each with what it brought.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Latest<G> {
    rounds: VecDeque<(u32, G)>,
}

impl<G> Default for Latest<G> {
    fn default() -> Self {
        Self {
            rounds: VecDeque::new(),
        }
    }
}

impl<G> Latest<G> {
    /// Adds what `round` brought, and forgets the rounds before the latest `window`.
    pub fn add(&mut self, round: u32, gains: G, window: u32) {
        self.rounds.push_back((round, gains));
        while self
            .rounds
            .front()
            .is_some_and(|(brought, _)| *brought < first_of(round, window))
        {
            self.rounds.pop_front();
        }
    }

    /// What each of the rounds brought, the oldest first.
    pub fn all(&self) -> impl Iterator<Item = &G> {
        self.rounds.iter().map(|(_, gains)| gains)
    }
}

/// The first of the latest `window` rounds up to the end of `round`; at a run's start there are fewer.
#[must_use]
pub fn first_of(round: u32, window: u32) -> u32 {
    (u64::from(round) + 1).saturating_sub(u64::from(window)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Round r brings r; a window of three ends with each of them.
    #[test]
    fn a_window_has_as_many_rounds_as_it_says() {
        let mut latest = Latest::default();
        let mut windows = Vec::new();
        for round in 0..6 {
            latest.add(round, round, 3);
            windows.push((
                first_of(round, 3),
                latest.all().copied().collect::<Vec<_>>(),
            ));
        }
        let expected = [
            (0, vec![0]),
            (0, vec![0, 1]),
            (0, vec![0, 1, 2]),
            (1, vec![1, 2, 3]),
            (2, vec![2, 3, 4]),
            (3, vec![3, 4, 5]),
        ];
        assert_eq!(windows, expected);
    }

    #[test]
    fn rounds_that_were_not_recorded_count() {
        let mut latest = Latest::default();
        for (round, gains) in [(11, 'a'), (58, 'b'), (61, 'c')] {
            latest.add(round, gains, 50);
        }
        assert_eq!(
            (first_of(61, 50), latest.all().collect::<String>()),
            (12, "bc".to_owned())
        );
    }
}
