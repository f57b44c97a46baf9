//! Submissions: a registered study with all that others need to check it, in one ZIP file.
//!
//! A submission has the study, its lock, the scenarios and tasks that it reads and that are not built
//! in, in the same directories relative to each other, its results as they are
//! [published], and `submission.json`, which says what made the results and the
//! file. Unpacked, `seedbed study verify … --registered --runs 2%` repeats some of the runs and compares their
//! bits. Equal results of equal files give the same bytes.

use std::collections::BTreeMap;
use std::io::{self, Cursor, Write};
use std::path::{Component, Path, PathBuf};

use crate::storage::hashes::sha256;
use serde::Serialize;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::publish;
use crate::experiment;
use crate::input_files::{self, Directory};
use crate::provenance;
use crate::storage::files;
use crate::study::design::FormerDigests;
use crate::study::design::lock::Lock;
use crate::study::design::plan::StudyPlan;
use crate::study::evaluate::published::{self, Builds};
use crate::study::evaluate::results::Results;
use crate::study::file_error::to_json;
use seedbed_input::InputError;
use seedbed_input::limits::{MAX_LARGE_FILE_BYTES, read_bytes};

/// Why a study cannot be submitted.
#[derive(Debug, thiserror::Error)]
pub enum SubmissionError {
    /// The study has no lock.
    #[error(
        "{0} is not registered; only registered studies can be submitted, see `seedbed study register`"
    )]
    NotRegistered(PathBuf),
    /// Results do not confirm what was registered.
    #[error("the results do not confirm what was registered: {0}")]
    Broken(String),
    /// Runs are missing.
    #[error("{missing} of {total} runs are missing; expected the results of all runs")]
    Incomplete {
        /// Number of runs without a result.
        missing: usize,
        /// Number of runs of the study.
        total: usize,
    },
    /// A cell has results of others.
    #[error("cell `{0}` has results of others, which cannot be repeated from a submission")]
    External(String),
    /// There is no directory that all files are in.
    #[error("{0} and the study are in no common directory; expected both in one project")]
    NoCommonFolder(PathBuf),
    /// A file of the study has an error.
    #[error("{0}")]
    Input(InputError),
    /// A file cannot be read or written.
    #[error("{}: {error}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// What the operating system reported.
        error: io::Error,
    },
}

/// A submission that was written.
#[derive(Clone, Debug)]
pub struct Packed {
    /// Number of files in it.
    pub files: usize,
    /// Its size in bytes.
    pub bytes: usize,
    /// The command that repeats some of its runs, in its directory.
    pub verify: String,
    /// Name of the directory that all its files are in.
    pub folder: String,
}

/// Contents of a submission: bytes by path, sorted.
type Files = BTreeMap<PathBuf, Vec<u8>>;

/// `submission.json`: what is in a submission, and what made it.
#[derive(Serialize)]
struct Description<'a> {
    study: &'a Path,
    title: &'a str,
    /// Id of the registration.
    lock: &'a str,
    runs: Runs,
    /// What made the runs.
    builds: Builds,
    packed_by: Packer,
    verify: &'a str,
    /// SHA-256 of all files but this one.
    sha256: BTreeMap<&'a Path, String>,
}

#[derive(Serialize)]
struct Runs {
    finished: usize,
    failed: usize,
}

/// The program and the machine that packed a submission.
#[derive(Serialize)]
struct Packer {
    version: &'static str,
    commit: Option<&'static str>,
    executable: String,
    libraries: Vec<&'static str>,
    operating_system: &'static str,
    cpu_level: &'static str,
}

/// Name of a submission without its extension, such as `fig_6_1-3f00a91c5e7d`.
///
/// # Errors
/// If the study is not registered.
pub fn name(plan: &StudyPlan) -> Result<String, SubmissionError> {
    Ok(format!("{}-{}", plan.name, lock(plan)?.short_id()))
}

/// Packs a registered study with its results, and writes the ZIP file at `path`.
///
/// # Errors
/// If the study is not registered, if its results are incomplete or do not confirm what was
/// registered, or if a file cannot be read or written.
pub fn write(plan: &StudyPlan, results: &Results, path: &Path) -> Result<Packed, SubmissionError> {
    let lock = lock(plan)?;
    check_results(results)?;
    let inputs = input_files(plan)?;
    let root = common_folder(&inputs)?;
    let study = within(&root, &canonical(&plan.path)?);
    let mut files = read_all(&root, &inputs)?;
    add_results(&mut files, &study, results)?;
    let verify = format!(
        "seedbed study verify {} --registered --runs 2%",
        study.display()
    );
    files.insert("README.md".into(), read_me(plan, &study, &verify));
    let [finished, failed, _] = results.run_counts();
    let description = Description {
        study: &study,
        title: &plan.study().title,
        lock: &lock.id,
        runs: Runs { finished, failed },
        builds: Builds::of(results),
        packed_by: Packer::this_program(),
        verify: &verify,
        sha256: hashes(&files),
    };
    let description = to_json(&description).into_bytes();
    files.insert(published::SUBMISSION.into(), description);
    let folder = name(plan)?;
    let archive = zip(&folder, &files).map_err(|error| file_error(path, error))?;
    files::write_to(path, &archive).map_err(|error| file_error(path, error))?;
    Ok(Packed {
        files: files.len(),
        bytes: archive.len(),
        verify,
        folder,
    })
}

fn lock(plan: &StudyPlan) -> Result<&Lock, SubmissionError> {
    let lock = plan.lock.as_ref();
    lock.ok_or_else(|| SubmissionError::NotRegistered(plan.path.clone()))
}

fn check_results(results: &Results) -> Result<(), SubmissionError> {
    let broken = results.audit.iter().flat_map(|audit| &audit.broken).next();
    if let Some(sentence) = broken {
        return Err(SubmissionError::Broken(sentence.clone()));
    }
    let [finished, failed, missing] = results.run_counts();
    if missing > 0 {
        let total = finished + failed + missing;
        return Err(SubmissionError::Incomplete { missing, total });
    }
    Ok(())
}

/// The study, its lock with the digests of today, and the scenarios and tasks that are not built in, sorted.
fn input_files(plan: &StudyPlan) -> Result<Vec<PathBuf>, SubmissionError> {
    let mut paths = vec![canonical(&plan.path)?, canonical(&Lock::path(&plan.path))?];
    let digests = FormerDigests::path(&plan.path);
    if digests.exists() {
        paths.push(canonical(&digests)?);
    }
    for cell in &plan.cells {
        if cell.source.found().is_some() {
            return Err(SubmissionError::External(cell.name.clone()));
        }
        let scenario = Path::new(&cell.scenario);
        let read = experiment::files_read(scenario, &cell.overrides)
            .map_err(|error| SubmissionError::Input(error.error))?;
        for path in read.iter().filter(|path| !input_files::is_builtin(path)) {
            paths.push(canonical(path)?);
        }
    }
    paths.sort();
    paths.dedup();
    Ok(paths)
}

fn canonical(path: &Path) -> Result<PathBuf, SubmissionError> {
    path.canonicalize().map_err(|error| file_error(path, error))
}

/// The innermost directory that all files are in, and in which those below `envs` and `scenarios` are
/// found by their names.
fn common_folder(paths: &[PathBuf]) -> Result<PathBuf, SubmissionError> {
    let mut folder: &Path = paths[0].parent().unwrap_or(&paths[0]);
    for path in paths {
        while !path.starts_with(folder) {
            folder = folder.parent().unwrap_or(Path::new("/"));
        }
        if folder.parent().is_none() {
            return Err(SubmissionError::NoCommonFolder(path.clone()));
        }
    }
    let is_searched = |name: &Component<'_>| {
        let directories = [Directory::Environments, Directory::Scenarios];
        directories
            .map(|directory| Component::Normal(directory.name().as_ref()))
            .contains(name)
    };
    Ok(folder
        .components()
        .take_while(|name| !is_searched(name))
        .collect())
}

fn within(root: &Path, path: &Path) -> PathBuf {
    path.strip_prefix(root).unwrap_or(path).to_owned()
}

fn read_all(root: &Path, paths: &[PathBuf]) -> Result<Files, SubmissionError> {
    let read = |path: &PathBuf| {
        let bytes =
            read_bytes(path, MAX_LARGE_FILE_BYTES).map_err(|error| file_error(path, error))?;
        Ok((within(root, path), bytes))
    };
    paths.iter().map(read).collect()
}

/// Adds the results where `seedbed study verify` looks for them: in `results` beside the study.
fn add_results(files: &mut Files, study: &Path, results: &Results) -> Result<(), SubmissionError> {
    let folder = published::folder_beside(study);
    let published = publish::files(results).map_err(|error| file_error(&folder, error))?;
    let published = published.into_iter();
    files.extend(published.map(|(name, bytes)| (folder.join(name), bytes)));
    Ok(())
}

fn read_me(plan: &StudyPlan, study: &Path, verify: &str) -> Vec<u8> {
    let title = crate::text::markdown_cell(&plan.study().title);
    let results = published::folder_beside(study);
    format!(
        "# {title}\n\n\
         A registered study with its results. In this directory:\n\n    \
         seedbed report {}   # tables and verdicts, computed from the results\n    \
         {verify}   # repeats 2 % of the runs, and compares their bits\n    \
         seedbed study confirm {}   # repeats all runs\n\n\
         `submission.json` says which builds made the runs, and on which kind of CPU the file was packed.\n",
        results.display(),
        study.display(),
    )
    .into_bytes()
}

fn hashes(files: &Files) -> BTreeMap<&Path, String> {
    files
        .iter()
        .map(|(path, bytes)| (path.as_path(), sha256(bytes)))
        .collect()
}

impl Packer {
    fn this_program() -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            commit: provenance::commit(),
            executable: provenance::format_build_id(provenance::build_id()),
            libraries: provenance::dependency_versions(),
            operating_system: std::env::consts::OS,
            cpu_level: provenance::cpu_level(),
        }
    }
}

/// A ZIP file with these files in `folder`. Times are constant, so that equal files give the same
/// bytes.
fn zip(folder: &str, files: &Files) -> io::Result<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default());
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (path, bytes) in files {
        let path = Path::new(folder).join(path);
        archive.start_file_from_path(path, options)?;
        archive.write_all(bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}

fn file_error(path: &Path, error: io::Error) -> SubmissionError {
    SubmissionError::File {
        path: path.to_owned(),
        error,
    }
}
