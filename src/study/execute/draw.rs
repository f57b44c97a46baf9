//! Which runs are repeated to verify results: a random choice that nobody who made the results can
//! foresee, and that can be repeated by its number.

use std::collections::HashSet;
use std::io;

use rand::TryRng;
#[expect(
    clippy::disallowed_types,
    reason = "which runs are repeated must not be foreseen"
)]
use rand::rngs::SysRng;
use rand::seq::SliceRandom;

use crate::study::design::cell::PlannedRun;
use seedbed_random::{Purpose, stream};

/// A random choice of runs. Equal numbers choose the same runs of the same results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Draw(u64);

/// Minimum number of runs that are repeated, if there are as many.
const MIN_RUNS: usize = 2;

impl Draw {
    /// The choice with this number.
    #[must_use]
    pub fn with_number(number: u64) -> Self {
        Self(number)
    }

    /// A new choice, from the randomness of the operating system.
    ///
    /// # Errors
    /// The operating system has none.
    pub fn fresh() -> io::Result<Self> {
        let number = SysRng.try_next_u32().map_err(io::Error::other)?;
        Ok(Self(number.into()))
    }

    /// Its number.
    #[must_use]
    pub fn number(self) -> u64 {
        self.0
    }

    /// One of the runs; `None` without runs. Different places choose independently.
    #[must_use]
    pub fn choose_one<'a>(self, runs: &[PlannedRun<'a>], place: u32) -> Option<PlannedRun<'a>> {
        let mut shuffled = runs.to_vec();
        shuffled.shuffle(&mut stream(self.0, Purpose::VerifiedRuns, place, 1));
        shuffled.first().copied()
    }

    /// `count` of the runs, at least one, of any cells; sorted by their indices.
    #[must_use]
    pub fn choose_of_any_cell<'a>(
        self,
        runs: &[PlannedRun<'a>],
        count: usize,
    ) -> Vec<PlannedRun<'a>> {
        let mut chosen = self.shuffled(runs);
        chosen.truncate(count.max(1));
        chosen.sort_by_key(|run| run.index);
        chosen
    }

    fn shuffled<'a>(self, runs: &[PlannedRun<'a>]) -> Vec<PlannedRun<'a>> {
        let mut shuffled = runs.to_vec();
        shuffled.shuffle(&mut stream(self.0, Purpose::VerifiedRuns, 0, 0));
        shuffled
    }

    /// At least `count` of the runs: one of each cell, two in all, and the others at random; sorted by
    /// their indices.
    #[must_use]
    pub fn choose<'a>(self, runs: &[PlannedRun<'a>], count: usize) -> Vec<PlannedRun<'a>> {
        let mut cells = HashSet::new();
        let is_first_of_cell = |run: &PlannedRun<'_>| cells.insert(run.cell.name.clone());
        let (mut chosen, others): (Vec<_>, Vec<_>) =
            self.shuffled(runs).into_iter().partition(is_first_of_cell);
        let more = count.max(MIN_RUNS).saturating_sub(chosen.len());
        chosen.extend(others.into_iter().take(more));
        chosen.sort_by_key(|run| run.index);
        chosen
    }
}
