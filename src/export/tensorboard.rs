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
const TEAM: &str = "team";
const AGENT: &str = "agent_";

/// Name of the event file in each directory.
const FILE: &str = "events.out.tfevents.0.seedbed";

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
    remove_earlier_export(folder)?;
    for (name, points) in &curves {
        let subfolder = folder.join(name);
        if let Err(error) = write_events(&subfolder, points) {
            // A part of the curves could be taken for the whole.
            remove_earlier_export(folder)?;
            let _ = fs::remove_dir(subfolder);
            return Err(error);
        }
    }
    Ok(curves.values().map(Vec::len).sum())
}

fn agent_folder(agent: u32) -> String {
    format!("{AGENT}{agent}")
}

/// Removes the event files of an earlier export, and the directories that are empty then.
fn remove_earlier_export(folder: &Path) -> io::Result<()> {
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
        match fs::remove_file(subfolder.join(FILE)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            removed => removed?,
        }
        // A directory with other files stays.
        let _ = fs::remove_dir(subfolder);
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
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        if name != FILE && name.to_string_lossy().contains("tfevents") {
            return Ok(Some(entry.path()));
        }
    }
    Ok(None)
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
