//! What was counted over the latest rounds only.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::WINDOW;

/// A copy is kept every so many rounds, so that there are few however long a run is and however often it is pictured.
const SPACING: u32 = WINDOW / 5;

/// Earlier states of something that only grows. What it gained over the latest rounds is what it is, less what it was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Latest<T> {
    /// Copies from the end of a round, the oldest first: at most one from before the window, and those within.
    copies: VecDeque<(u32, T)>,
}

impl<T> Default for Latest<T> {
    fn default() -> Self {
        Self { copies: VecDeque::new() }
    }
}

impl<T: Clone> Latest<T> {
    /// What `now`, at the end of `round`, was just before the window of rounds that ends with `round`, and the window's first round.
    /// A window has 50 rounds, or as many more as pictures are apart; at a run's start it has all.
    pub fn before(&mut self, round: u32, now: &T) -> (Option<&T>, u32) {
        while self.copies.get(1).is_some_and(|(copied, _)| copied + WINDOW <= round) {
            self.copies.pop_front();
        }
        if self.copies.back().is_none_or(|(copied, _)| copied + SPACING <= round) {
            self.copies.push_back((round, now.clone()));
        }
        let (copied, before) = &self.copies[0];
        if copied + WINDOW <= round { (Some(before), copied + 1) } else { (None, 0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something that grows by 1 in round 0, by 2 in round 1, and so on; pictured every `every` rounds until round 200.
    fn windows(every: u32) -> Vec<(u32, u32, u32, usize)> {
        let mut latest = Latest::default();
        let total = |round: u32| (round + 1) * (round + 2) / 2;
        let picture = |round| {
            let now = total(round);
            let (before, first) = latest.before(round, &now);
            let gained = now - before.copied().unwrap_or(0);
            (round, first, gained, latest.copies.len())
        };
        (0..=200).step_by(every as usize).map(picture).collect()
    }

    #[test]
    fn a_window_holds_what_its_rounds_brought() {
        for every in [1, 3, 7, 10, 25, 50, 90] {
            for (round, first, gained, copies) in windows(every) {
                let brought: u32 = (first..=round).map(|round| round + 1).sum();
                assert_eq!(gained, brought, "rounds {first} to {round}");
                assert!(copies <= 7, "{copies} copies");
            }
        }
    }

    /// Pictures of rounds 0, 10, …: the window that ends with round 60 begins after round 10.
    #[test]
    fn a_window_has_fifty_rounds() {
        let first_of =
            |every, wanted| windows(every).into_iter().find(|(round, ..)| *round == wanted).map(|(_, first, ..)| first);
        assert_eq!([0, 40, 50, 60, 200].map(|round| first_of(10, round)), [0, 0, 1, 11, 151].map(Some));
        assert_eq!(first_of(50, 100), Some(51));
        assert!(
            windows(1)
                .into_iter()
                .filter(|(round, ..)| *round >= 60)
                .all(|(round, first, ..)| (50..60).contains(&(round - first + 1)))
        );
        assert!(windows(90).into_iter().skip(1).all(|(round, first, ..)| round - first + 1 == 90));
    }
}
