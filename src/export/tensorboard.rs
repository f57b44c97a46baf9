//! Curves of a run as event files of TensorBoard: one directory for the team's mean return, and one
//! per agent with its returns and metrics. The step is the number of the episode or round.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::event_file::{scalar_event, version_event, write_event};
use crate::record::metrics::{METRICS, Source};
use crate::run::review::LoadedRun;

/// A value of a curve: step, name of the curve, value.
type Point = (i64, String, f64);

/// Writes the curves of a run below `folder` and returns the number of values.
///
/// # Errors
/// A file cannot be written.
pub fn export(run: &LoadedRun, folder: &Path) -> io::Result<usize> {
    let mut curves: BTreeMap<String, Vec<Point>> = BTreeMap::new();
    for (step, value) in (0..).zip(run.team_returns()) {
        let team = curves.entry("team".to_owned()).or_default();
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
    for (name, points) in &curves {
        write_events(&folder.join(name), points)?;
    }
    Ok(curves.values().map(Vec::len).sum())
}

fn agent_folder(agent: u32) -> String {
    format!("agent_{agent}")
}

/// Writes an event file to a directory.
fn write_events(folder: &Path, points: &[Point]) -> io::Result<()> {
    fs::create_dir_all(folder)?;
    let file = File::create(folder.join("events.out.tfevents.0.seedbed"))?;
    let mut file = BufWriter::new(file);
    write_event(&mut file, &version_event())?;
    for (step, tag, value) in points {
        write_event(&mut file, &scalar_event(*step, tag, *value as f32))?;
    }
    file.flush()
}
