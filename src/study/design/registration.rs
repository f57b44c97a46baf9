//! Registration of a study: its lock is written beside its file, and compared with it before its runs are used.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use super::FormerDigests;
use super::cell::{Cell, CellDescription};
use super::file::Study;
use super::lock::{
    Ancestor, Lock, Registered, RegistrationError, RelatedStudy, SeenFile, SeenInLog,
};
use super::plan::StudyPlan;
use crate::input_files::folder_of;
use crate::run_log::{LoggedRuns, RunLog};
use crate::study::external::{ExternalRuns, SeenFiles};
use crate::study::file_error::{replace_file, to_json};

impl Lock {
    /// Registers a study: writes its lock beside the study file. If there is a lock already, the
    /// new one has it as an ancestor; if nothing differs from it, it is kept. So does each related lock in `log`, the log
    /// of the project. `stored`: run seeds of the runs of a cell that are stored in the folder of the study.
    ///
    /// # Errors
    /// If the study has no confirmatory claim, if an existing lock was changed after it was made, or
    /// if a file cannot be read or written.
    ///
    /// # Panics
    /// Never: plain data always serializes.
    pub fn register(
        plan: &StudyPlan,
        log: &RunLog,
        stored: impl Fn(&Cell) -> BTreeSet<u64>,
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
        let logged = log.runs();
        let study = Registered::of_plan(plan);
        let related = related_locks(&study, &path);
        let registered = Registered {
            seen_before: seen_before(plan, &logged, stored),
            run_log: log.is_kept().then(|| seen_in_log(plan, &logged)),
            seen_files: seen_files(plan, earlier.as_ref()),
            ancestors: ancestors(&study, earlier.as_ref(), log.locks(), &related),
            related: related.iter().map(RelatedStudy::of_lock).collect(),
            ..study
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

/// Cells that have runs with other run seeds, in the folder of the study or in the log, and the numbers of these runs.
fn seen_before(
    plan: &StudyPlan,
    logged: &LoggedRuns,
    stored: impl Fn(&Cell) -> BTreeSet<u64>,
) -> Vec<(String, usize)> {
    let mut seen = Vec::new();
    for cell in own_cells(plan) {
        let mut run_seeds = stored(cell);
        run_seeds.extend(logged.run_seeds(cell.digest()));
        if !run_seeds.is_empty() {
            seen.push((cell.name.clone(), run_seeds.len()));
        }
    }
    seen
}

fn seen_in_log(plan: &StudyPlan, logged: &LoggedRuns) -> SeenInLog {
    let tasks = own_cells(plan).map(|cell| cell.source.task()).collect();
    let digests = own_cells(plan).map(Cell::digest).collect();
    SeenInLog {
        runs: logged.count(),
        others_in_tasks: logged.count_others_in(&tasks, &digests),
    }
}

/// The cells whose runs are made here.
fn own_cells(plan: &StudyPlan) -> impl Iterator<Item = &Cell> {
    let cells = plan.cells.iter();
    cells.filter(|cell| cell.source.found().is_none())
}

/// The ancestors of a new lock: the lock beside the study with its own, and the related ones in the log, of which whoever
/// renamed the study or deleted its lock says nothing; but not the `others` that stay registered, nor their ancestors.
fn ancestors(
    study: &Registered,
    beside: Option<&Lock>,
    logged: Vec<Lock>,
    others: &[Lock],
) -> Vec<Ancestor> {
    let histories = others.iter().flat_map(Lock::with_ancestors);
    let of_others: BTreeSet<String> = histories.map(|lock| lock.id).collect();
    let is_ancestor = |lock: &Lock| lock.is_unchanged() && lock.is_related(study);
    let logged: Vec<Lock> = logged.into_iter().filter(is_ancestor).collect();
    let mut ancestors: Vec<Ancestor> = Vec::new();
    for ancestor in logged.iter().chain(beside).flat_map(Lock::with_ancestors) {
        if !of_others.contains(&ancestor.id)
            && !ancestors.iter().any(|other| other.id == ancestor.id)
        {
            ancestors.push(ancestor);
        }
    }
    ancestors
}

/// The locks of other studies beside that with the lock at `path` that have a cell in common with it, by the names of their studies.
fn related_locks(study: &Registered, path: &Path) -> Vec<Lock> {
    let entries = fs::read_dir(Path::new(".").join(folder_of(path)));
    let files = entries.into_iter().flatten().flatten();
    let others = files.map(|entry| entry.path()).filter(|file| {
        let is_lock = file
            .extension()
            .is_some_and(|extension| extension == "lock");
        is_lock && file.file_name() != path.file_name() && file.with_extension("").is_file()
    });
    let locks = others.filter_map(|file| Lock::read(&file).ok());
    let mut related: Vec<Lock> = locks.filter(|lock| lock.is_related(study)).collect();
    related.sort_by(|one, other| one.registered.study.cmp(&other.registered.study));
    related
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
