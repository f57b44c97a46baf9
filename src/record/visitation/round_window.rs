//! Keeps one value, such as counts, for each of the latest rounds.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// One value for each of the latest rounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoundWindow<V> {
    rounds: VecDeque<(u32, V)>,
}

impl<V> Default for RoundWindow<V> {
    fn default() -> Self {
        Self {
            rounds: VecDeque::new(),
        }
    }
}

impl<V> RoundWindow<V> {
    /// Adds the value of `round`, and removes the values of rounds before the latest `window`
    /// rounds.
    pub fn add(&mut self, round: u32, value: V, window: u32) {
        self.rounds.push_back((round, value));
        while self
            .rounds
            .front()
            .is_some_and(|(oldest, _)| *oldest < first_round(round, window))
        {
            self.rounds.pop_front();
        }
    }

    /// The values, oldest first.
    pub fn values(&self) -> impl Iterator<Item = &V> {
        self.rounds.iter().map(|(_, value)| value)
    }
}

/// The first of the latest `window` rounds up to `round`; 0 if there were fewer rounds.
#[must_use]
pub fn first_round(round: u32, window: u32) -> u32 {
    (u64::from(round) + 1).saturating_sub(u64::from(window)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Round r has the value r. After each round, the window has the values of the latest three
    /// rounds.
    #[test]
    fn a_window_keeps_the_latest_rounds() {
        let mut window = RoundWindow::default();
        let mut windows = Vec::new();
        for round in 0..6 {
            window.add(round, round, 3);
            windows.push((
                first_round(round, 3),
                window.values().copied().collect::<Vec<_>>(),
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

    /// The window of 50 rounds up to round 61 begins at round 12, so that it has the values of
    /// rounds 58 and 61 only.
    #[test]
    fn rounds_without_a_value_count_in_a_window() {
        let mut window = RoundWindow::default();
        for (round, value) in [(11, 'a'), (58, 'b'), (61, 'c')] {
            window.add(round, value, 50);
        }
        assert_eq!(
            (first_round(61, 50), window.values().collect::<String>()),
            (12, "bc".to_owned())
        );
    }
}
