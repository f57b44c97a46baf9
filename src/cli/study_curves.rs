//! Curves of the runs of a study for TensorBoard, written while they train.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use seedbed::experiment::MeasuredRound;
use seedbed::export::live_curves::LiveCurves;
use seedbed::run::Observer;
use seedbed::study::design::cell::PlannedRun;

/// Digest of the experiment and run seed.
type Key = (String, u64);

/// The curves of all runs that are made at the moment.
pub(super) struct StudyCurves {
    folder: PathBuf,
    /// Name of the cell by the digest of its experiment.
    cells: HashMap<String, String>,
    /// `None` for a run whose curves cannot be written.
    runs: Mutex<HashMap<Key, Option<LiveCurves>>>,
}

impl StudyCurves {
    pub(super) fn new(folder: &Path, runs: &[PlannedRun<'_>]) -> Self {
        let cell = |run: &PlannedRun<'_>| (run.cell.digest().to_owned(), run.cell.name.clone());
        Self {
            folder: folder.to_owned(),
            cells: runs.iter().map(cell).collect(),
            runs: Mutex::default(),
        }
    }

    /// Adds a round of a run.
    pub(super) fn add(&self, round: &MeasuredRound<'_>) {
        let key = (round.digest.to_owned(), round.run_seed);
        let mut runs = self.runs_of_now();
        let curves = runs.entry(key).or_insert_with(|| self.begin(round));
        if let Some(curves) = curves {
            curves.round_finished(round.progress, round.rows);
        }
    }

    fn runs_of_now(&self) -> MutexGuard<'_, HashMap<Key, Option<LiveCurves>>> {
        self.runs.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what waits of a run that has ended.
    pub(super) fn end(&self, run: &PlannedRun<'_>) {
        let key = (run.cell.digest().to_owned(), run.run_seed);
        self.runs_of_now().remove(&key);
    }

    /// Begins the curves of a run with its first round of this process, or continues them. `None` if that
    /// fails.
    fn begin(&self, round: &MeasuredRound<'_>) -> Option<LiveCurves> {
        let warn = |reason: &str| note!("warning: {reason}");
        let cell = self.cells.get(round.digest).map_or("", String::as_str);
        let name = cell.replace(['/', '\\', ':'], "-");
        let folder = self
            .folder
            .join(name)
            .join(format!("seed-{}", round.run_seed));
        let mut before = *round.progress;
        before.env_steps -= round
            .rows
            .episodes
            .iter()
            .map(|row| u64::from(row.length))
            .sum::<u64>();
        match LiveCurves::begin(&folder, before.env_steps > 0, warn) {
            Ok(mut curves) => {
                curves.begun(&before);
                Some(curves)
            }
            Err(error) => {
                warn(&format!("cannot write to {}: {error}", folder.display()));
                None
            }
        }
    }
}
