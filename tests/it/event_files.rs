//! Event files of TensorBoard as results of a study: restarts from checkpoints.

use std::fs::{self, File};
use std::path::Path;

use base64::Engine;
use seedbed::experiment::run_result::RunResult;
use seedbed::export::event_file::{Event, SessionLog, scalar_event, version_event, write_event};
use seedbed::study::external::source::{ResultsSource, Values};
use seedbed::study::external::{ExternalRuns, ExternalSpec, Problem};
use serde::Deserialize;

use super::util::REPOSITORY;

const TAG: &str = "charts/episodic_return";

/// Reads the run in `folder/run`: its result and warnings.
fn read(folder: &Path) -> Result<(RunResult, Vec<String>), String> {
    let source = ResultsSource::TensorBoard {
        runs: "run".to_owned().into(),
        tag: TAG.to_owned().into(),
        values: Values::Returns,
    };
    let spec = ExternalSpec {
        source,
        place: "cell".to_owned().into(),
        solved: None,
        agents: None,
        max_episodes: None,
        max_steps: None,
        repeats: None,
    };
    let runs = ExternalRuns::load(folder, spec).map_err(|problem| match problem {
        Problem::Study(error) => format!("{error:?}"),
        Problem::Data(error) => error
            .to_string()
            .replace(&folder.display().to_string(), "F"),
    })?;
    let id = runs.runs().next().unwrap().id;
    Ok((runs.result(id).unwrap().clone(), runs.warnings()))
}

/// Files of one run, which are removed afterwards.
struct Run(tempfile::TempDir);

/// Steps of a tag, all with the same value.
type Steps<'a> = (&'a str, &'a [i64], f32);

impl Run {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("run")).unwrap();
        Self(folder)
    }

    /// Writes a file of a process that began at a time in seconds and wrote an event per second.
    fn write(self, name: &str, begin: f64, start: Option<i64>, steps: &[Steps<'_>]) -> Self {
        let mut events = vec![version_event()];
        events.extend(start.map(|step| Event {
            step,
            session_log: Some(SessionLog {
                status: SessionLog::START,
            }),
            ..Event::default()
        }));
        for (tag, steps, value) in steps {
            events.extend(steps.iter().map(|&step| scalar_event(step, tag, *value)));
        }
        let path = self.0.path().join("run").join(format!("tfevents.{name}"));
        let mut file = File::create(path).unwrap();
        for (number, mut event) in events.into_iter().enumerate() {
            event.wall_time = begin + number as f64;
            write_event(&mut file, &event).unwrap();
        }
        self
    }

    /// Steps, mean of the returns, and warnings.
    fn read(&self) -> (usize, f64, Vec<String>) {
        let (run, warnings) = read(self.0.path()).unwrap();
        let returns = &run.returns[0];
        let mean = returns.iter().sum::<f64>() / returns.len() as f64;
        (returns.len(), mean, warnings)
    }

    fn error(&self) -> String {
        read(self.0.path()).unwrap_err()
    }
}

fn every_tenth(first: i64, last: i64) -> Vec<i64> {
    (first..=last).step_by(10).collect()
}

/// A generated run, and what `EventAccumulator` of TensorBoard keeps of it.
#[derive(Deserialize)]
struct History {
    name: String,
    files: std::collections::BTreeMap<String, String>,
    steps: Vec<u64>,
    values: Vec<f32>,
}

/// Runs with restarts, of which `tests/external/event_files/generate.py` wrote what TensorBoard keeps.
#[test]
fn restarts_are_those_of_tensorboard() {
    let path = Path::new(REPOSITORY).join("tests/external/event_files/histories.json");
    let histories: Vec<History> = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    assert!(histories.len() >= 20);
    for history in histories {
        let run = Run::new();
        for (name, bytes) in &history.files {
            let bytes = base64::engine::general_purpose::STANDARD.decode(bytes);
            fs::write(run.0.path().join("run").join(name), bytes.unwrap()).unwrap();
        }
        let (result, _) = read(run.0.path()).unwrap();
        let values: Vec<f32> = result.returns[0]
            .iter()
            .map(|value| *value as f32)
            .collect();
        assert_eq!(values, history.values, "{}", history.name);
        let last = history.steps.last().copied().unwrap_or(0);
        assert_eq!(result.env_steps, last, "{}", history.name);
    }
}

/// The third process continued an older checkpoint: 1 at 10, 20, 30, then 9 at 40, …, 150. The mean of
/// 15 values is (3 · 1 + 12 · 9) / 15.
#[test]
fn the_newest_file_replaces_older_ones() {
    let run = Run::new()
        .write("1", 1000.0, None, &[(TAG, &every_tenth(10, 100), 1.0)])
        .write("2", 2000.0, None, &[(TAG, &every_tenth(80, 200), 5.0)])
        .write("3", 3000.0, None, &[(TAG, &every_tenth(40, 150), 9.0)]);
    let (values, mean, warnings) = run.read();
    assert_eq!((values, mean), (15, 7.4));
    assert_eq!(
        warnings,
        [
            "run/tfevents.2: restarts the run at step 80, which replaces 3 earlier values",
            "run/tfevents.3: restarts the run at step 40, which replaces 17 earlier values",
        ]
    );
}

/// `SummaryWriter(purge_step=50)` whose first return is at step 80: 4 values of 1 and 3 of 5, as
/// `EventAccumulator` has; without `START`, a loss at step 50 shows the same.
#[test]
fn a_restart_counts_from_the_step_at_which_the_run_continues() {
    let first = every_tenth(10, 100);
    let next = every_tenth(80, 100);
    let losses = every_tenth(10, 100);
    let with_start = Run::new()
        .write("1", 1000.0, None, &[(TAG, &first, 1.0)])
        .write("2", 2000.0, Some(50), &[(TAG, &next, 5.0)]);
    let with_loss = Run::new()
        .write(
            "1",
            1000.0,
            None,
            &[(TAG, &first, 1.0), ("loss", &[100, 100], 0.0)],
        )
        .write(
            "2",
            2000.0,
            None,
            &[("loss", &[50], 0.0), (TAG, &next, 5.0)],
        );
    // The run ended before the next return.
    let with_loss_only = Run::new()
        .write(
            "1",
            1000.0,
            None,
            &[(TAG, &first, 1.0), ("loss", &[100, 100], 0.0)],
        )
        .write("2", 2000.0, None, &[("loss", &losses[4..6], 0.0)])
        .write(
            "3",
            3000.0,
            None,
            &[("loss", &[60], 0.0), (TAG, &next, 5.0)],
        );
    for run in [with_start, with_loss, with_loss_only] {
        let (values, mean, warnings) = run.read();
        assert_eq!((values, mean), (7, 19.0 / 7.0));
        assert_eq!(
            warnings,
            ["run/tfevents.2: restarts the run at step 50, which replaces 6 earlier values"]
        );
    }
}

/// Each process writes its number once before its returns, which says nothing of their steps: 20 values
/// of 1 and 20 of 5, as `EventAccumulator` has.
#[test]
fn a_scalar_that_is_written_once_is_no_restart() {
    let (first, next) = (every_tenth(0, 190), every_tenth(200, 390));
    for numbers in [[&[0][..], &[1]], [&[0, 1], &[2, 3]]] {
        let number = |process: usize| ("process/number", numbers[process], 0.0);
        let run = Run::new()
            .write("1", 1000.0, None, &[number(0), (TAG, &first, 1.0)])
            .write("2", 2000.0, None, &[number(1), (TAG, &next, 5.0)]);
        assert_eq!(run.read(), (40, 3.0, Vec::new()));
    }
}

/// Losses that count updates, a constant without a step, and values that another program writes into
/// the same directory say nothing of restarts.
#[test]
fn other_tags_may_count_something_else() {
    let (first, next) = (every_tenth(10, 100), every_tenth(80, 120));
    let updates = |steps: &'static [i64]| ("update", steps, 0.0);
    let run = Run::new()
        .write(
            "1",
            1000.0,
            None,
            &[("lr", &[0], 0.1), (TAG, &first, 1.0), updates(&[1, 2, 3])],
        )
        .write(
            "2",
            2000.0,
            None,
            &[("lr", &[0], 0.1), (TAG, &next, 5.0), updates(&[3, 4])],
        )
        .write("3", 2001.0, None, &[("evaluation", &[0, 1, 2], 7.0)])
        .write("4", 4000.0, None, &[("evaluation", &[0, 1, 2], 7.0)]);
    let (values, mean, warnings) = run.read();
    assert_eq!((values, mean), (12, 32.0 / 12.0));
    assert_eq!(
        warnings,
        ["run/tfevents.2: restarts the run at step 80, which replaces 3 earlier values"]
    );
}

/// The process that began first has the name that comes last, as process 1000 after process 999 in
/// the same second.
#[test]
fn files_are_read_in_the_order_of_their_times() {
    let run = Run::new()
        .write("1.1000", 1999.0, None, &[(TAG, &[20, 30], 5.0)])
        .write("1.999", 1000.0, None, &[(TAG, &[10, 20, 30, 40], 1.0)]);
    let (values, mean, warnings) = run.read();
    assert_eq!((values, mean), (3, 11.0 / 3.0));
    assert_eq!(
        warnings,
        [
            "the times in the event files differ from the order of their names: they are read in the order \
             `run/tfevents.1.999`, `run/tfevents.1.1000`",
            "run/tfevents.1.1000: restarts the run at step 20, which replaces 3 earlier values",
        ]
    );
}

#[test]
fn several_runs_in_a_directory_are_refused() {
    let parallel = Run::new()
        .write("1", 1000.0, None, &[(TAG, &[10, 20, 30], 1.0)])
        .write("2", 1001.0, None, &[(TAG, &[15, 25, 35], 5.0)]);
    assert_eq!(
        parallel.error(),
        "F/run: `run/tfevents.1` and `run/tfevents.2` were written at the same time; expected one run per directory"
    );
    let again = Run::new()
        .write("1", 1000.0, None, &[(TAG, &[10, 20, 30], 1.0)])
        .write("2", 2000.0, None, &[(TAG, &[10, 20], 5.0)]);
    assert_eq!(
        again.error(),
        "F/run: `run/tfevents.2` begins at step 10, which is not after the first value of `run/tfevents.1`; expected one run \
         per directory, whose restarts continue it: move the files of other runs away (`SummaryWriter(purge_step=…)` marks a \
         restart from the beginning)"
    );
    let purged = Run::new()
        .write("1", 1000.0, None, &[(TAG, &[10, 20, 30], 1.0)])
        .write("2", 2000.0, Some(0), &[(TAG, &[10, 20], 5.0)]);
    assert_eq!(purged.read().1, 5.0);
}

/// Values that a restart replaces may be NaN: a run that diverged and was continued from before.
#[test]
fn values_are_finite_and_steps_do_not_decrease() {
    let continued = Run::new()
        .write(
            "1",
            1000.0,
            None,
            &[(TAG, &[10, 20], 1.0), (TAG, &[30], f32::NAN)],
        )
        .write("2", 2000.0, None, &[(TAG, &[30, 40], 1.0)]);
    assert_eq!(continued.read().0, 4);
    for (steps, value, error) in [
        (
            &[10, 5][..],
            1.0,
            "record 3: expected steps that do not decrease, found step 5 after step 10",
        ),
        (
            &[-1],
            1.0,
            "record 2: expected a step of at least 0, found -1",
        ),
        (
            &[7],
            f32::INFINITY,
            "record 2: expected a finite number, found inf at step 7",
        ),
    ] {
        let run = Run::new().write("1", 1000.0, None, &[(TAG, steps, value)]);
        assert_eq!(run.error(), format!("F/run/tfevents.1: {error}"));
    }
}

/// TensorBoard shows files in subdirectories as other runs, and ignores those of the profiler.
#[test]
fn files_of_a_run_are_in_one_directory() {
    let run = Run::new().write("1", 1000.0, None, &[(TAG, &[10], 1.0)]);
    let folder = run.0.path().join("run");
    fs::create_dir(folder.join("nested")).unwrap();
    fs::copy(folder.join("tfevents.1"), folder.join("nested/tfevents.2")).unwrap();
    fs::write(folder.join("tfevents.3.profile-empty"), "no records").unwrap();
    assert_eq!(run.read().0, 1);
    fs::remove_file(folder.join("tfevents.1")).unwrap();
    fs::remove_file(folder.join("tfevents.3.profile-empty")).unwrap();
    assert_eq!(
        run.error(),
        "F/run: expected event files of TensorBoard (`*tfevents*`) in this directory, found none; its directory `nested` has \
         some: expected a pattern of the directories that contain the files"
    );
}
