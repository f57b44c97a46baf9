//! Curves of a run as event files of TensorBoard: one directory for the team's mean return, and one
//! per agent with its returns and metrics. The step is the number of the episode or round. A value that is
//! NaN is written as NaN, which TensorBoard marks.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::event_file::{scalar_event, version_event, write_event};
use crate::review::LoadedRun;
use crate::run::facts::metrics::{METRICS, Source};
use crate::storage::files::{self, Replacement};

/// A value of a curve: step, name of the curve, value.
type Point = (i64, String, f64);

/// Names of the directories.
pub(super) const TEAM: &str = "team";
const AGENT: &str = "agent_";

/// Name of the exported event file in each directory.
const FILE: &str = "events.out.tfevents.0.seedbed";

/// Beginning and end of the names of all event files of seedbed, around a number.
const FILE_NAME: [&str; 2] = ["events.out.tfevents.", ".seedbed"];

/// Writes the curves of a run below `folder` and returns the number of values. Curves that were exported
/// to `folder` before, such as those of another run with more agents, are removed first.
///
/// # Errors
/// A file cannot be removed or written; then no curves are left. Or a directory has event files of other programs, which
/// TensorBoard would show as parts of the same curves.
pub fn export(run: &LoadedRun, folder: &Path) -> io::Result<usize> {
    let mut curves: BTreeMap<String, Vec<Point>> = BTreeMap::new();
    for (step, value) in (0..).zip(run.team_returns()) {
        let team = curves.entry(TEAM.to_owned()).or_default();
        team.push((step, "return".to_owned(), value));
    }
    for row in &run.episodes {
        let agent = curves.entry(agent_folder(row.agent)).or_default();
        agent.push((i64::from(row.episode), "return".to_owned(), row.r#return));
    }
    for row in &run.rounds {
        let agent = curves.entry(agent_folder(row.agent)).or_default();
        for metric in METRICS {
            if let Source::Round(value) = metric.source
                && let Some(value) = value(row)
            {
                agent.push((i64::from(row.round), metric.key.to_owned(), value));
            }
        }
    }
    remove_earlier(folder)?;
    for (name, points) in &curves {
        let subfolder = folder.join(name);
        if let Err(error) = write_events(&subfolder, points) {
            // A part of the curves could be taken for the whole.
            remove_earlier(folder)?;
            let _ = fs::remove_dir(subfolder);
            return Err(error);
        }
    }
    Ok(curves.values().map(Vec::len).sum())
}

/// Name of the directory of an agent.
pub(super) fn agent_folder(agent: u32) -> String {
    format!("{AGENT}{agent}")
}

/// Name of the event file that the process with this number, from 1, writes during training. TensorBoard reads files
/// in the order of their names.
pub(super) fn live_file_name(number: u32) -> String {
    let [begin, end] = FILE_NAME;
    format!("{begin}{number:06}{end}")
}

/// Number of an event file of seedbed; `None` if the file is another one.
fn number_of(name: &str) -> Option<u32> {
    let [begin, end] = FILE_NAME;
    name.strip_prefix(begin)?.strip_suffix(end)?.parse().ok()
}

/// The largest number of the event files in the directories of the team and of agents; 0 if there are none.
pub(super) fn largest_number(folder: &Path) -> io::Result<u32> {
    let mut largest = 0;
    for subfolder in subfolders(folder)? {
        let numbers = names_in(&subfolder)?.into_iter();
        let numbers = numbers.filter_map(|name| number_of(&name));
        largest = numbers.fold(largest, u32::max);
    }
    Ok(largest)
}

/// Removes the event files of an earlier export or run, and the directories that are empty then.
///
/// # Errors
/// A file cannot be removed, or a directory has event files of other programs; then nothing is removed.
pub(super) fn remove_earlier(folder: &Path) -> io::Result<()> {
    let subfolders: Vec<PathBuf> = subfolders(folder)?;
    for subfolder in &subfolders {
        files::remove_abandoned_of(&subfolder.join(FILE));
        if let Some(file) = event_file_of_others(subfolder)? {
            return Err(io::Error::other(format!(
                "{} is of another program, and TensorBoard would show its values in the same curves; name another \
                 directory",
                file.display()
            )));
        }
    }
    for subfolder in subfolders {
        let names = names_in(&subfolder)?.into_iter();
        let own: Vec<String> = names.filter(|name| number_of(name).is_some()).collect();
        for name in &own {
            fs::remove_file(subfolder.join(name))?;
        }
        if !own.is_empty() {
            // A directory with other files stays.
            let _ = fs::remove_dir(subfolder);
        }
    }
    Ok(())
}

/// The directories of the team and of agents in `folder`.
fn subfolders(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut subfolders = Vec::new();
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let is_agent = |number: &str| number.parse::<u32>().is_ok();
        if name == TEAM || name.strip_prefix(AGENT).is_some_and(is_agent) {
            subfolders.push(entry.path());
        }
    }
    subfolders.sort();
    Ok(subfolders)
}

/// An event file that another program wrote to a directory.
fn event_file_of_others(folder: &Path) -> io::Result<Option<PathBuf>> {
    let mut names = names_in(folder)?.into_iter();
    let other = names.find(|name| name.contains("tfevents") && number_of(name).is_none());
    Ok(other.map(|name| folder.join(name)))
}

/// Names of the files in a directory.
fn names_in(folder: &Path) -> io::Result<Vec<String>> {
    let name = |entry: io::Result<fs::DirEntry>| {
        entry.map(|entry| entry.file_name().to_string_lossy().into_owned())
    };
    fs::read_dir(folder)?.map(name).collect()
}

/// Writes an event file to a directory.
fn write_events(folder: &Path, points: &[Point]) -> io::Result<()> {
    let replacement = Replacement::begin(&folder.join(FILE))?;
    let mut file = BufWriter::new(replacement.file()?);
    write_event(&mut file, &version_event())?;
    for (step, tag, value) in points {
        write_event(&mut file, &scalar_event(*step, tag, *value as f32))?;
    }
    file.flush()?;
    replacement.commit()
}
