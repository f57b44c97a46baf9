//! Merging: copies the stored runs of a study from other folders, such as those of other clusters.
//! Every file is verified before the first is copied.

use std::collections::{BTreeMap, HashSet};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use xxhash_rust::xxh64::xxh64;

use super::StudyFolder;
use super::result_file::StoredRun;
use crate::provenance::BuildId;
use crate::study::FileError;
use crate::study::design::cell::PlannedRun;
use crate::study::design::plan::StudyPlan;
use crate::study::file_error::replace_file;
use crate::text::pluralize;
use seedbed_input::limits::{MAX_LARGE_FILE_BYTES, read_bytes};

/// What a merge has done.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Merged {
    /// Number of runs that were copied.
    pub new: usize,
    /// Number of runs that were there already or are in several folders, with the same bits.
    pub equal: usize,
    /// Number of files that are no runs of the study as it is now: it was changed after them.
    pub other: usize,
    /// Version and build of the merged runs, each with its number of files.
    pub builds: BTreeMap<(String, Option<BuildId>), usize>,
}

/// Why nothing was merged.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MergeError {
    /// A result file is damaged, or has another run than its name says.
    #[error("{0} is damaged, was changed, or is of another version of seedbed; nothing was copied")]
    Damaged(PathBuf),
    /// A file was replaced while files were copied.
    #[error("{0} changed while runs were copied; merge again when no process writes there")]
    Changed(PathBuf),
    /// The same runs have different results.
    #[error("{}", conflict_message(.0))]
    Conflicts(Vec<Conflict>),
    /// A result file cannot be read, or is none.
    #[error("{0}; nothing was copied")]
    Unreadable(FileError),
    /// A file cannot be copied.
    #[error("cannot copy {0}")]
    Store(#[from] FileError),
}

/// Two files with different results of the same run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Conflict {
    /// The run, such as `σ 0.1, run seed 1000`.
    pub run: String,
    /// The two files.
    pub files: [PathBuf; 2],
    /// Whether one of the two failed.
    pub has_failure: bool,
}

fn conflict_message(conflicts: &[Conflict]) -> String {
    const MAX_SHOWN: usize = 10;
    let mut text = format!(
        "{} refused, and nothing was copied: the same run has different results, which come from other code \
         or another kind of machine",
        pluralize(conflicts.len(), "run")
    );
    for Conflict { run, files, .. } in conflicts.iter().take(MAX_SHOWN) {
        let [first, second] = files;
        text += &format!("\n  {run}: {} and {}", first.display(), second.display());
    }
    if conflicts.len() > MAX_SHOWN {
        text += &format!("\n  and {} more", conflicts.len() - MAX_SHOWN);
    }
    if conflicts.iter().any(|conflict| conflict.has_failure) {
        text += "\nrepeat failed runs in their own directory first, with --retry";
    }
    text
}

/// Copies the runs of `plan` that `target` lacks from `sources`, which are folders of the same study.
/// Nothing is copied if any file is damaged, or if results conflict.
///
/// # Errors
/// See [`MergeError`].
pub fn merge(
    plan: &StudyPlan,
    target: &StudyFolder,
    sources: &[StudyFolder],
) -> Result<Merged, MergeError> {
    let runs: Vec<PlannedRun<'_>> = plan
        .distinct_runs()
        .into_iter()
        .filter(|run| run.name.is_none())
        .collect();
    let mut merged = Merged {
        other: sources
            .iter()
            .map(|source| other_files(source, &runs))
            .sum(),
        ..Merged::default()
    };
    let mut conflicts = Vec::new();
    let mut copies = Vec::new();
    for run in &runs {
        let own = StoredFile::read(target, run)?;
        let mut files: Vec<StoredFile> = own.into_iter().collect();
        for source in sources {
            files.extend(StoredFile::read(source, run)?);
        }
        conflicts.extend(conflict(run, &files));
        copies.extend(merged.add(run, target, &files));
    }
    if !conflicts.is_empty() {
        return Err(MergeError::Conflicts(conflicts));
    }
    target.write_manifest_with(plan, sources)?;
    for copy in copies {
        copy.perform()?;
    }
    Ok(merged)
}

/// Number of result files that are not those of `runs`.
fn other_files(folder: &StudyFolder, runs: &[PlannedRun<'_>]) -> usize {
    let path = |run: &PlannedRun<'_>| folder.result_file(run.cell.digest(), run.run_seed);
    let planned: HashSet<PathBuf> = runs.iter().map(path).collect();
    let names = folder.result_file_names();
    let paths = names.iter().map(|name| folder.runs_folder().join(name));
    paths.filter(|path| !planned.contains(path)).count()
}

/// A verified result file.
struct StoredFile {
    path: PathBuf,
    stored: StoredRun,
    /// Hash of its bytes.
    hash: u64,
    /// Whether it has all visited states that the study needs.
    is_complete: bool,
}

impl StoredFile {
    /// Reads and verifies the file of a run; `None` if there is none.
    fn read(folder: &StudyFolder, run: &PlannedRun<'_>) -> Result<Option<Self>, MergeError> {
        let (digest, run_seed) = (run.cell.digest(), run.run_seed);
        let path = folder.result_file(digest, run_seed);
        let bytes = read_if_exists(&path).map_err(MergeError::Unreadable)?;
        let Some(bytes) = bytes else {
            return Ok(None);
        };
        let stored = StoredRun::from_bytes(&bytes)
            .filter(|stored| (stored.digest.as_str(), stored.run_seed) == (digest, run_seed));
        let Some(stored) = stored else {
            return Err(MergeError::Damaged(path));
        };
        Ok(Some(Self {
            is_complete: stored.has_windows(run.windows()),
            hash: xxh64(&bytes, 0),
            path,
            stored,
        }))
    }
}

fn read_if_exists(path: &Path) -> Result<Option<Vec<u8>>, FileError> {
    match read_bytes(path, MAX_LARGE_FILE_BYTES) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(FileError {
            path: path.to_owned(),
            reason: error.to_string(),
        }),
    }
}

/// The first two files of a run whose results differ.
fn conflict(run: &PlannedRun<'_>, files: &[StoredFile]) -> Option<Conflict> {
    let (first, others) = files.split_first()?;
    let other = others
        .iter()
        .find(|other| !first.stored.agrees_with(&other.stored))?;
    let has_failed = |file: &StoredFile| file.stored.outcome.is_err();
    Some(Conflict {
        run: format!("{}, {}", run.cell.name, run.label()),
        files: [first.path.clone(), other.path.clone()],
        has_failure: has_failed(first) || has_failed(other),
    })
}

impl Merged {
    /// Counts the files of a run. Returns the copy that is to be made, if any.
    fn add(
        &mut self,
        run: &PlannedRun<'_>,
        target: &StudyFolder,
        files: &[StoredFile],
    ) -> Option<FileCopy> {
        for StoredFile { stored, .. } in files {
            let build = (stored.version.clone(), stored.build);
            *self.builds.entry(build).or_default() += 1;
        }
        let to = target.result_file(run.cell.digest(), run.run_seed);
        let complete: Vec<&StoredFile> = files.iter().filter(|file| file.is_complete).collect();
        let from = *complete.first()?;
        self.equal += complete.len() - 1;
        if from.path == to {
            return None;
        }
        self.new += 1;
        Some(FileCopy {
            from: from.path.clone(),
            to,
            hash: from.hash,
        })
    }
}

/// A file that is to be copied.
struct FileCopy {
    from: PathBuf,
    to: PathBuf,
    /// Hash of its bytes when it was compared.
    hash: u64,
}

impl FileCopy {
    fn perform(self) -> Result<(), MergeError> {
        let bytes = read_if_exists(&self.from)?.filter(|bytes| xxh64(bytes, 0) == self.hash);
        let bytes = bytes.ok_or(MergeError::Changed(self.from))?;
        Ok(replace_file(self.to, &bytes)?)
    }
}
