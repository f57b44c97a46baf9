//! How long the remaining runs of a study take, from the times that finished runs took.

use std::collections::BTreeMap;

use seedbed::study::design::cell::PlannedRun;

/// The runs of each cell, with the time that finished ones took.
pub(super) struct Forecast {
    threads: usize,
    cells: BTreeMap<String, CellTime>,
}

/// The runs of a cell.
struct CellTime {
    /// Estimated cost of a run, in any unit.
    cost: f64,
    left: usize,
    finished: usize,
    /// Seconds that a thread had for the finished runs.
    seconds: f64,
}

impl Forecast {
    pub(super) fn new(runs: &[PlannedRun<'_>], threads: usize) -> Self {
        let mut forecast = Self {
            threads: threads.max(1),
            cells: BTreeMap::new(),
        };
        for run in runs {
            forecast.add(run.cell.digest(), run.cell.source.cost());
        }
        forecast
    }

    fn add(&mut self, cell: &str, cost: f64) {
        let cell = self.cells.entry(cell.to_owned()).or_insert(CellTime {
            cost,
            left: 0,
            finished: 0,
            seconds: 0.0,
        });
        cell.left += 1;
    }

    /// `seconds`: for which a thread worked on the run
    pub(super) fn run_finished(&mut self, cell: &str, seconds: f64) {
        if let Some(cell) = self.cells.get_mut(cell) {
            cell.left = cell.left.saturating_sub(1);
            cell.finished += 1;
            cell.seconds += seconds;
        }
    }

    /// Whether a run of each cell has finished, so that nothing rests on estimated costs.
    pub(super) fn is_measured(&self) -> bool {
        self.cells.values().all(|cell| cell.finished > 0)
    }

    /// Seconds that the remaining runs take on all threads; `None` before a run has finished.
    pub(super) fn seconds_left(&self) -> Option<f64> {
        let finished = || self.cells.values().filter(|cell| cell.finished > 0);
        let seconds: f64 = finished().map(|cell| cell.seconds).sum();
        let cost: f64 = finished()
            .map(|cell| cell.cost * cell.finished as f64)
            .sum();
        let of_run = |cell: &CellTime| match cell.finished {
            0 => cell.cost * seconds / cost,
            finished => cell.seconds / finished as f64,
        };
        let left = self
            .cells
            .values()
            .map(|cell| cell.left as f64 * of_run(cell));
        (cost > 0.0).then(|| left.sum::<f64>() / self.threads as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two runs of a cell take 10 s each, and four of another, whose cost is twice as large, would take 20 s; in fact
    /// they take 5 s: 10 + 4 · 20 s and 10 + 3 · 5 s are left, for two threads.
    #[test]
    fn times_of_cells_are_estimated_until_they_are_measured() {
        let mut forecast = Forecast {
            threads: 2,
            cells: BTreeMap::new(),
        };
        (0..2).for_each(|_| forecast.add("cheap", 1.0));
        (0..4).for_each(|_| forecast.add("expensive", 2.0));
        assert_eq!(forecast.seconds_left(), None);
        forecast.run_finished("cheap", 10.0);
        assert_eq!(forecast.seconds_left(), Some(45.0));
        assert!(!forecast.is_measured());
        forecast.run_finished("expensive", 5.0);
        assert_eq!(forecast.seconds_left(), Some(12.5));
        assert!(forecast.is_measured());
    }
}
