//! Scalars of TensorBoard as results of a run.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::data_file::{DataFile, file_error};
use super::read_run::ReadRun;
use super::run_data::{self, AgentEpisodes};
use super::{Problem, Settings};
use crate::export::event_file::read_events;
use crate::text::pluralize;
use seedbed_env::input::{InputError, Located};

/// Values of a curve in one file.
struct Points {
    /// Path relative to the folder of the study.
    name: String,
    steps: Vec<u64>,
    values: Vec<f64>,
}

/// Reads the run whose event files are in the directory `path`, or which is the event file `path`.
pub(super) fn read(
    folder: &Path,
    path: &Path,
    tag: &Located<String>,
    settings: Settings,
) -> Result<ReadRun, Problem> {
    let (mut files, mut curves, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    let mut tags = BTreeSet::new();
    for path in event_files(path)? {
        let file = DataFile::read(folder, &path)?;
        let (points, is_incomplete) = read_points(&file, tag, &mut tags)?;
        if is_incomplete {
            warnings.push(format!(
                "{}: the last record is incomplete and is ignored",
                file.hash.path
            ));
        }
        curves.extend((!points.steps.is_empty()).then_some(points));
        files.push(file.hash);
    }
    if curves.is_empty() {
        let what = format!("scalar in {}", path.display());
        return Err(tag
            .unknown_name(&what, tags.iter().map(String::as_str))
            .into());
    }
    let agent = joined(path, curves, &mut warnings)?;
    let result = run_data::result(vec![agent], settings.solved, settings.limits);
    Ok(ReadRun::new(folder, path, files, result).with_warnings(warnings))
}

/// The event files of a run, in the order of their names.
fn event_files(path: &Path) -> Result<Vec<PathBuf>, InputError> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = std::fs::read_dir(path).map_err(|error| file_error(path, error.to_string()))?;
    let paths = entries.flatten().map(|entry| entry.path());
    let is_event_file = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.contains("tfevents") && path.is_file()
    };
    let mut files: Vec<PathBuf> = paths.filter(is_event_file).collect();
    files.sort();
    if files.is_empty() {
        return Err(file_error(
            path,
            "expected event files of TensorBoard (`*tfevents*`) in this directory, found none",
        ));
    }
    Ok(files)
}

/// The values of a tag, and whether the last record is incomplete. Adds all tags to `tags`.
fn read_points(
    file: &DataFile,
    tag: &str,
    tags: &mut BTreeSet<String>,
) -> Result<(Points, bool), InputError> {
    let mut points = Points {
        name: file.hash.path.clone(),
        steps: Vec::new(),
        values: Vec::new(),
    };
    let mut error = None;
    let is_incomplete = read_events(&file.bytes, |record, event| {
        for scalar in event.summary.iter().flat_map(|summary| &summary.value) {
            let Some(value) = scalar.number() else {
                continue;
            };
            if scalar.tag != tag {
                if !tags.contains(&scalar.tag) {
                    tags.insert(scalar.tag.clone());
                }
            } else if let Err(reason) = points.add(event.step, value) {
                error.get_or_insert_with(|| {
                    file.error(format!("record {record}, scalar `{tag}`: {reason}"))
                });
            }
        }
    });
    let is_incomplete = is_incomplete.map_err(|error| file.error(error.to_string()))?;
    error.map_or(Ok((points, is_incomplete)), Err)
}

impl Points {
    fn add(&mut self, step: i64, value: f64) -> Result<(), String> {
        let earlier = self.steps.last().copied().unwrap_or(0);
        let step = u64::try_from(step)
            .map_err(|_| format!("expected a step of at least 0, found {step}"))?;
        if step < earlier {
            return Err(format!(
                "expected steps that do not decrease, found step {step} after step {earlier}"
            ));
        }
        if !value.is_finite() {
            return Err(format!(
                "expected a finite number, found {value} at step {step}"
            ));
        }
        self.steps.push(step);
        self.values.push(value);
        Ok(())
    }
}

/// The values of all files of a run, which was restarted for each of them. A file replaces what
/// earlier ones say of steps from its first step on, as in TensorBoard.
fn joined(
    path: &Path,
    mut curves: Vec<Points>,
    warnings: &mut Vec<String>,
) -> Result<AgentEpisodes, InputError> {
    curves.sort_by_key(|curve| curve.steps[0]);
    let mut agent = AgentEpisodes::default();
    let mut earlier: Option<(String, u64)> = None;
    for curve in curves {
        let first = curve.steps[0];
        if let Some((earlier, _)) = earlier.filter(|(_, start)| *start == first) {
            return Err(file_error(
                path,
                format!(
                    "`{earlier}` and `{}` both begin at step {first}; expected one run per directory",
                    curve.name
                ),
            ));
        }
        let kept = agent.env_steps.partition_point(|&step| step < first);
        let replaced = agent.env_steps.len() - kept;
        if replaced > 0 {
            warnings.push(format!(
                "{}: begins at step {first} and replaces {} of earlier files",
                curve.name,
                pluralize(replaced, "value")
            ));
        }
        agent.env_steps.truncate(kept);
        agent.returns.truncate(kept);
        agent.env_steps.extend(curve.steps);
        agent.returns.extend(curve.values);
        earlier = Some((curve.name, first));
    }
    Ok(agent)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(name: &str, points: &[(u64, f64)]) -> Points {
        Points {
            name: name.to_owned(),
            steps: points.iter().map(|point| point.0).collect(),
            values: points.iter().map(|point| point.1).collect(),
        }
    }

    /// A run that was restarted at step 20, after it had come to step 40; then at step 70.
    #[test]
    fn a_restart_replaces_later_steps() {
        let files = vec![
            points("c", &[(70, 7.0)]),
            points("a", &[(10, 1.0), (20, 2.0), (40, 4.0)]),
            points("b", &[(20, -2.0), (60, -6.0)]),
        ];
        let mut warnings = Vec::new();
        let agent = joined(Path::new("run"), files, &mut warnings).unwrap();
        assert_eq!(agent.env_steps, [10, 20, 60, 70]);
        assert_eq!(agent.returns, [1.0, -2.0, -6.0, 7.0]);
        assert_eq!(
            warnings,
            ["b: begins at step 20 and replaces 2 values of earlier files"]
        );
    }

    #[test]
    fn two_runs_in_a_directory_are_refused() {
        let files = vec![points("a", &[(1, 1.0), (2, 2.0)]), points("b", &[(1, 1.5)])];
        let error = joined(Path::new("run"), files, &mut Vec::new()).unwrap_err();
        assert_eq!(
            error.to_string(),
            "run: `a` and `b` both begin at step 1; expected one run per directory"
        );
    }

    #[test]
    fn steps_do_not_decrease_and_values_are_finite() {
        let mut curve = points("a", &[]);
        assert_eq!(curve.add(5, 1.0).and(curve.add(5, 2.0)), Ok(()));
        assert_eq!(
            curve.add(4, 1.0).unwrap_err(),
            "expected steps that do not decrease, found step 4 after step 5"
        );
        assert!(curve.add(-1, 1.0).is_err() && curve.add(6, f64::NAN).is_err());
        assert_eq!(curve.steps.len(), 2);
    }
}
