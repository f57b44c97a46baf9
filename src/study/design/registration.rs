//! Registration of a study: its lock is written beside its file, and compared with it before its runs are used.

use std::sync::Arc;

use super::FormerDigests;
use super::cell::{Cell, CellDescription};
use super::file::Study;
use super::lock::{Lock, Registered, RegistrationError, SeenFile};
use super::plan::StudyPlan;
use crate::study::external::{ExternalRuns, SeenFiles};
use crate::study::file_error::{replace_file, to_json};

impl Lock {
    /// Registers a study: writes its lock beside the study file. If there is a lock already, the
    /// new one has it as an ancestor; if nothing differs from it, it is kept. `count_runs`: the number of runs of a cell
    /// that were made before.
    ///
    /// # Errors
    /// If the study has no confirmatory claim, if an existing lock was changed after it was made, or
    /// if a file cannot be read or written.
    ///
    /// # Panics
    /// Never: plain data always serializes.
    pub fn register(
        plan: &StudyPlan,
        count_runs: impl Fn(&Cell) -> usize,
    ) -> Result<Self, RegistrationError> {
        if !plan.study().claims.iter().any(|claim| claim.confirmatory) {
            return Err(RegistrationError::NothingToConfirm(plan.path.clone()));
        }
        let path = Self::path(&plan.path);
        let earlier = match Self::read(&path) {
            Ok(lock) => Some(lock),
            Err(RegistrationError::NotRegistered(_)) => None,
            Err(error) => return Err(error),
        };
        let registered = Registered {
            seen_before: seen_before(plan, count_runs),
            seen_files: seen_files(plan, earlier.as_ref()),
            ancestors: earlier
                .as_ref()
                .map(Self::with_ancestors)
                .unwrap_or_default(),
            ..Registered::of_plan(plan)
        };
        if let Some(lock) = earlier
            && lock.registered.differences_of_plan(plan)?.is_empty()
        {
            return Ok(lock);
        }
        let lock = Self::new(registered);
        replace_file(path, to_json(&lock).as_bytes())?;
        Ok(lock)
    }

    /// Reads the lock of a study, and checks that the study does not differ from it.
    ///
    /// # Errors
    /// As [`read`](Self::read), and if the study differs from its lock.
    pub fn check(plan: &StudyPlan) -> Result<Self, RegistrationError> {
        let path = Self::path(&plan.path);
        let lock = Self::read(&path)?;
        let differences = lock.registered.differences_of_plan(plan)?;
        if differences.is_empty() {
            Ok(lock)
        } else {
            Err(RegistrationError::Differs { path, differences })
        }
    }
}

impl Registered {
    fn of_plan(plan: &StudyPlan) -> Self {
        let cells = descriptions(plan);
        Self::of(&plan.name, study_of(plan), &cells)
    }

    /// What differs between this and a study, as sentences without a full stop.
    fn differences_of_plan(&self, plan: &StudyPlan) -> Result<Vec<String>, RegistrationError> {
        let mut cells = descriptions(plan);
        if self.settings_version == 0 {
            let former = FormerDigests::beside(&plan.path);
            cells = former
                .map_err(RegistrationError::Unreadable)?
                .of_cells(cells);
        }
        let planned = Self::of(&plan.name, study_of(plan), &cells);
        Ok(self.differences(&planned))
    }
}

fn descriptions(plan: &StudyPlan) -> Vec<CellDescription> {
    plan.cells.iter().map(Cell::description).collect()
}

/// The study of a plan, and the text from which it was read.
fn study_of(plan: &StudyPlan) -> (&Study, &str) {
    (plan.study(), &plan.document.text)
}

/// Files of results of others that exist now, and those that existed at an earlier registration.
fn seen_files(plan: &StudyPlan, earlier: Option<&Lock>) -> Vec<SeenFile> {
    let mut seen = earlier.map_or(Vec::new(), |lock| lock.registered.seen_files.clone());
    for cell in &plan.cells {
        for file in cell
            .source
            .found()
            .into_iter()
            .flat_map(ExternalRuns::files)
        {
            let new = SeenFile {
                cell: cell.name.clone(),
                file: file.clone(),
            };
            if !seen.contains(&new) {
                seen.push(new);
            }
        }
    }
    seen
}

/// Cells that have runs with other run seeds, and the numbers of these runs.
fn seen_before(plan: &StudyPlan, count_runs: impl Fn(&Cell) -> usize) -> Vec<(String, usize)> {
    let mut seen = Vec::new();
    let own_cells = plan
        .cells
        .iter()
        .filter(|cell| cell.source.found().is_none());
    for cell in own_cells {
        let runs = count_runs(cell);
        if runs > 0 {
            seen.push((cell.name.clone(), runs));
        }
    }
    seen
}

impl StudyPlan {
    /// The same study with the run seeds of its lock.
    ///
    /// # Errors
    /// If the study is not registered, or if it differs from its lock.
    pub fn registered(mut self) -> Result<Self, RegistrationError> {
        let lock = Lock::check(&self)?;
        let seen = SeenFiles::new(lock.registered.seen_files.iter().map(|seen| &seen.file));
        let repeats = self.repeats();
        for cell in &mut self.cells {
            let Some(runs) = cell.source.found() else {
                continue;
            };
            let new = runs.without(&seen)?;
            let expected = new.repeats().unwrap_or(repeats);
            // Runs may be missing, but not too many.
            if new.runs().count() as u64 > expected {
                new.check_number(Some(expected))
                    .map_err(|error| self.document.locate(error))?;
            }
            cell.source = Arc::new(new);
        }
        self.lock = Some(lock);
        Ok(self)
    }
}
