//! Scalars of TensorBoard as results of a run.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::data_file::{DataFile, file_error};
use super::event_log::{self, EventLog};
use super::read_run::ReadRun;
use super::run_data::{self, AgentEpisodes};
use super::{Problem, Settings};
use crate::export::event_file::read_events;
use crate::scenario::Rounding;
use seedbed_input::{InputError, Located};

/// Reads the run whose event files are in the directory `path`, or which is the event file `path`.
pub(super) fn read(
    folder: &Path,
    path: &Path,
    tag: &Located<String>,
    settings: Settings,
) -> Result<ReadRun, Problem> {
    let (mut files, mut logs, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    for path in event_files(path)? {
        let file = DataFile::read(folder, &path)?;
        let mut log = EventLog::new(&file);
        let is_incomplete = read_events(&file.bytes, |record, event| log.add(record, &event, tag));
        if is_incomplete.map_err(|error| file.error(error.to_string()))? {
            warnings.push(format!(
                "{}: the last record is incomplete and is ignored",
                file.hash.path
            ));
        }
        logs.push(log);
        files.push(file.hash);
    }
    if logs.iter().all(|log| log.values.is_empty()) {
        let what = format!("scalar in {}", path.display());
        let tags: BTreeSet<&str> = logs.iter().flat_map(EventLog::other_tags).collect();
        return Err(tag.unknown_name(&what, tags.iter().copied()).into());
    }
    let (mut agent, mut rounding) = (AgentEpisodes::default(), Rounding::Double);
    for value in event_log::joined(path, logs, &mut warnings)? {
        agent.env_steps.push(value.step.cast_unsigned());
        agent.returns.push(value.value);
        if !value.is_double {
            rounding = Rounding::SingleReturns;
        }
    }
    let result = run_data::result(vec![agent], settings.solved, settings.limits, rounding);
    Ok(ReadRun::new(folder, path, files, result).with_warnings(warnings))
}

/// The event files of a run, in the order of their names.
fn event_files(path: &Path) -> Result<Vec<PathBuf>, InputError> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let files = event_files_in(path)?;
    if !files.is_empty() {
        return Ok(files);
    }
    let expected =
        "expected event files of TensorBoard (`*tfevents*`) in this directory, found none";
    let mut folders = paths_in(path)?;
    folders.retain(|folder| event_files_in(folder).is_ok_and(|files| !files.is_empty()));
    Err(match folders.first() {
        None => file_error(path, expected),
        Some(folder) => file_error(
            path,
            format!(
                "{expected}; its directory `{}` has some: expected a pattern of the directories that contain the files",
                super::data_file::name_of(path, folder)
            ),
        ),
    })
}

/// The event files in a directory, but not in its subdirectories, which TensorBoard shows as other
/// runs.
fn event_files_in(folder: &Path) -> Result<Vec<PathBuf>, InputError> {
    let mut paths = paths_in(folder)?;
    paths.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.contains("tfevents") && !name.ends_with(".profile-empty") && path.is_file()
    });
    Ok(paths)
}

/// The paths in a directory, sorted.
fn paths_in(folder: &Path) -> Result<Vec<PathBuf>, InputError> {
    let entries =
        std::fs::read_dir(folder).map_err(|error| file_error(folder, error.to_string()))?;
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    Ok(paths)
}
