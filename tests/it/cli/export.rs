//! `seedbed export`. That NumPy, PyArrow and TensorBoard read the files is checked by
//! `tests/interop/run`.

use std::path::Path;

use crate::util::{names_in, run_refused, run_successful, small_run};

fn export(run: &Path, arguments: &[&str]) -> String {
    run_successful(&[&["export", run.to_str().unwrap()], arguments].concat())
}

/// States are those of the recording: their number follows from `episodes.csv`, and the last state
/// of an episode has neither action nor reward.
#[test]
fn states_are_written_with_the_names_of_the_task() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let path = folder.path().join("states.csv");
    let printed = export(&run, &["--to", path.to_str().unwrap()]);
    let text = std::fs::read_to_string(&path).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(
        rows[0].join(","),
        "agent,episode,round,step,x,x_dot,theta,theta_dot,force,reward,outcome"
    );
    let episodes = std::fs::read_to_string(run.join("episodes.csv")).unwrap();
    let lengths = episodes
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(5).unwrap());
    let states: usize = lengths
        .map(|length| length.parse::<usize>().unwrap() + 1)
        .sum();
    assert_eq!(rows.len() - 1, states);
    assert!(printed.ends_with(&format!("{states} rows\n")), "{printed}");
    let without_reward = rows.iter().filter(|row| row[8..10] == ["", ""]).count();
    assert_eq!(without_reward, 12, "one state of each episode");
    assert!(
        rows[1..]
            .iter()
            .all(|row| matches!(row[8], "" | "10" | "-10"))
    );
}

/// The same run gives the same bytes, and a failed export leaves an older file as it was.
#[test]
fn exports_are_reproducible() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    for name in ["states.parquet", "states.npz"] {
        let path = folder.path().join(name);
        let bytes = || {
            export(&run, &["--to", path.to_str().unwrap()]);
            std::fs::read(&path).unwrap()
        };
        assert_eq!(bytes(), bytes(), "{name}");
    }
    let logs = folder.path().join("logs");
    export(&run, &["--tensorboard", logs.to_str().unwrap()]);
    assert_eq!(names_in(&logs), ["agent_0", "agent_1", "team"]);
    let older = folder.path().join("older.csv");
    std::fs::write(&older, "mine").unwrap();
    std::fs::remove_file(run.join("run.rrd")).unwrap();
    let arguments = [
        "export",
        run.to_str().unwrap(),
        "--to",
        older.to_str().unwrap(),
    ];
    let message = run_refused(&arguments);
    assert!(
        message.contains("has no recording, from which states are exported"),
        "{message}"
    );
    assert_eq!(std::fs::read_to_string(&older).unwrap(), "mine");
    assert_eq!(
        names_in(folder.path()),
        ["logs", "older.csv", "run", "states.npz", "states.parquet"]
    );
}

#[test]
fn unknown_formats_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let message = run_refused(&["export", run.to_str().unwrap(), "--to", "states.xlsx"]);
    assert_eq!(
        message,
        "error: --to states.xlsx: expected a file that ends in .csv, .parquet, .npz or .rrd\n"
    );
    run_refused(&["export", run.to_str().unwrap()]);
}
