//! Searches directories for runs.

use std::fs;
use std::path::{Path, PathBuf};

use super::RunFolder;

/// Maximum number of directories between the searched directory and a run.
const MAX_DEPTH: usize = 6;

impl RunFolder {
    /// Whether the directory contains results of a run, finished or not. A table or a recording alone,
    /// beside runs in subdirectories, was exported from them.
    #[must_use]
    pub fn has_run(&self) -> bool {
        self.has_own_run() || (self.has_table_or_recording() && runs_below(self.path()).is_empty())
    }
}

/// The directory of the run at `path`: a run directory, a file in it, or a directory with a single
/// run in its subdirectories. If it has none or several, `path` itself.
#[must_use]
pub fn run_folder(path: &Path) -> RunFolder {
    if path.is_file() {
        return RunFolder::new(path.parent().unwrap_or(path));
    }
    let folder = RunFolder::new(path);
    if folder.has_run() {
        return folder;
    }
    match run_folders(path).as_slice() {
        [only] => RunFolder::new(only),
        _ => folder,
    }
}

/// Directories of all runs in `folder` and its subdirectories, sorted.
#[must_use]
pub fn run_folders(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    collect_run_folders(folder, MAX_DEPTH, &mut found);
    found.sort();
    found
}

/// Directories of all runs in the subdirectories of `folder`.
fn runs_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    collect_runs_below(folder, MAX_DEPTH, &mut found);
    found
}

fn collect_run_folders(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) {
    let run_folder = RunFolder::new(folder);
    if run_folder.has_own_run() {
        found.push(folder.to_owned());
        return;
    }
    let found_before = found.len();
    collect_runs_below(folder, depth, found);
    if found.len() == found_before && run_folder.has_table_or_recording() {
        found.push(folder.to_owned());
    }
}

fn collect_runs_below(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries {
        // Links are not followed, so that a link to a parent directory ends nowhere.
        if depth > 0 && entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            collect_run_folders(&entry.path(), depth - 1, found);
        }
    }
}
