//! Returns that equal a threshold reach it, whatever was added up and wherever the numbers are from.

use std::fs;
use std::path::Path;

use seedbed::experiment::run_result::RunResult;
use seedbed::study::external::source::{Columns, ResultsSource, SolvedAt, Values};
use seedbed::study::external::{ExternalRuns, ExternalSpec};
use seedbed_input::numbers::{ranged_count, ranged_number};

use super::util::{REPOSITORY, run_successful};

/// The run in `folder/run`, which counts as solved at this mean return over 25 episodes.
fn read(folder: &Path, source: ResultsSource, threshold: f64) -> RunResult {
    let spec = ExternalSpec {
        source,
        place: "cell".to_owned().into(),
        solved: Some(SolvedAt {
            r#return: ranged_number(threshold),
            window: ranged_count(25),
        }),
        agents: None,
        max_episodes: None,
        max_steps: None,
        repeats: None,
    };
    let runs = ExternalRuns::load(folder, spec).unwrap();
    let id = runs.runs().next().unwrap().id;
    runs.result(id).unwrap().clone()
}

/// Number of episodes until a run with these returns is solved, from a CSV file and from a monitor
/// file that begins with a byte order mark.
fn solved_at(returns: &[&str], threshold: f64) -> Option<u32> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let pattern = || "run".to_owned().into();
    fs::write(&path, format!("return\n{}\n", returns.join("\n"))).unwrap();
    let csv = ResultsSource::Csv {
        files: pattern(),
        columns: Columns::default(),
        values: Values::Returns,
    };
    let csv = read(folder.path(), csv, threshold);
    let rows: Vec<String> = returns.iter().map(|r| format!("{r},10,0.5\n")).collect();
    let rows = rows.concat();
    fs::write(
        &path,
        format!("\u{feff}#{{\"t_start\": 1.0}}\r\nr,l,t\r\n{rows}"),
    )
    .unwrap();
    let monitor = read(folder.path(), ResultsSource::Monitor(pattern()), threshold);
    assert_eq!(csv.returns, monitor.returns);
    assert_eq!(csv.returns[0][0], returns[0].parse::<f64>().unwrap());
    let episodes = [csv, monitor].map(|run| {
        // Single episodes reach the threshold, too.
        assert_eq!(run.first_goals()[0].is_some(), run.solved.is_some());
        run.solved.map(|solved| solved.episodes)
    });
    assert_eq!(episodes[0], episodes[1]);
    episodes[0]
}

/// A mean of 25 times 0.7 is 0.6999999999999998 in NumPy: equal up to rounding. In single precision,
/// 0.7 would be 0.699999988, and 1e39 infinite.
#[test]
fn returns_of_others_that_equal_a_threshold_reach_it() {
    assert_eq!(solved_at(&["0.7"; 30], 0.7), Some(25));
    assert_eq!(solved_at(&["-0.7"; 30], -0.7), Some(25));
    assert_eq!(solved_at(&["1000000.1"; 30], 1_000_000.1), Some(25));
    assert_eq!(solved_at(&["1000000.09"; 30], 1_000_000.1), None);
    assert_eq!(solved_at(&["0.69999998"; 30], 0.7), None);
    assert_eq!(solved_at(&["1e39"; 30], 1e38), Some(25));
    assert_eq!(solved_at(&["-1e39"; 30], -1e38), None);
    // 0.1 added up ten times.
    assert_eq!(solved_at(&["0.9999999999999999"; 30], 1.0), Some(25));
}

/// The scalar 0.7 of an event file is in single precision.
#[test]
fn returns_in_event_files_reach_a_threshold_that_they_round() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("run")).unwrap();
    let mut file = fs::File::create(folder.path().join("run/tfevents")).unwrap();
    for step in 1..=30 {
        let event = seedbed::export::event_file::scalar_event(step, "return", 0.7);
        seedbed::export::event_file::write_event(&mut file, &event).unwrap();
    }
    let solved = |threshold| {
        let source = ResultsSource::TensorBoard {
            runs: "run".to_owned().into(),
            tag: "return".to_owned().into(),
            values: Values::Returns,
        };
        let run = read(folder.path(), source, threshold);
        assert_eq!(run.returns[0][0], f64::from(0.7_f32));
        run.solved.map(|solved| solved.episodes)
    };
    assert_eq!(solved(0.7), Some(25));
    assert_eq!(solved(0.700_000_1), None);
}

/// 100 rewards of 0.01, which are 0.0099999998 in single precision: a return of 0.99999998.
#[test]
fn rewards_of_a_run_add_up_to_its_threshold() {
    let folder = tempfile::tempdir().unwrap();
    let task = fs::read_to_string(Path::new(REPOSITORY).join("envs/cartpole.ron")).unwrap();
    let task = task
        .replace("reward: \"1\"", "reward: \"0.01\"")
        .replace("time_limit: 200", "time_limit: 100")
        .replace(
            "abs(x) > 2.4 || abs(theta) > 12 * degree",
            "abs(x) > 1000000",
        );
    let environment = folder.path().join("hundredths.ron");
    fs::write(&environment, task).unwrap();
    let scenario = folder.path().join("scenario.ron");
    let text = format!(
        "Scenario(environment: \"{}\", algorithm: Random, stop: Solved(return: 1, window: 3, at_most: 9))",
        environment.display()
    );
    fs::write(&scenario, text).unwrap();
    let out = folder.path().join("out");
    let paths = [&scenario, &out].map(|path| path.to_str().unwrap());
    run_successful(&[
        "run",
        paths[0],
        "--out",
        paths[1],
        "--no-recording",
        "--quiet",
    ]);
    let summary = fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(summary["episodes_until_solved"], 3);
    assert_eq!(summary["episodes_per_agent"], 3);
    assert!(summary["final_return"].as_f64().unwrap() < 1.0);
}
