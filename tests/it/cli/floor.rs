//! `seedbed floor`.

use std::fs;

use crate::util::{run_successful, seedbed, stderr};

/// An agent at the side of a pole cannot be told from one that pushes at random: noise rarely keeps the pole up for 30 steps,
/// and one action for a whole episode never does (it falls within 12 steps).
#[test]
fn floor_says_how_often_noise_reaches_a_goal() {
    let folder = tempfile::tempdir().unwrap();
    let table = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let call = |seed: &str, csv: &str| {
        let arguments = [
            "floor",
            "cartpole",
            "--goal",
            "30",
            "--attempts",
            "10",
            "50",
            "--episodes",
            "60",
            "--runs",
            "3",
            "--seed",
            seed,
            "--csv",
            csv,
        ];
        run_successful(&arguments)
    };
    let (first, again, other) = (table("first.csv"), table("again.csv"), table("other.csv"));
    let shown = call("0", &first);
    assert!(shown.starts_with(
        "cartpole: 3 run seeds, 60 episodes each; at the goal: a return of at least 30\n"
    ));
    assert!(
        shown.contains(
            "\nMeans over run seeds, without intervals, which need at least 5 of them; the largest return of all episodes."
        ),
        "{shown}"
    );
    let rows: Vec<Vec<&str>> = shown
        .lines()
        .filter(|line| line.starts_with("| "))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    assert_eq!(rows[0].len(), 6, "{shown}");
    let row = |noise: &str| rows.iter().find(|row| row[0] == noise).unwrap();
    let number = |cell: &str| cell.split(' ').next().unwrap().parse::<f64>().unwrap();
    assert_eq!(number(row("one action per episode")[1]), 0.0);
    assert_eq!(number(row("one action per episode")[3]), 0.0);
    let uniform: Vec<f64> = row("uniform")[1..4]
        .iter()
        .map(|cell| number(cell))
        .collect();
    assert!(
        uniform[0] > 0.05 && uniform[0] < uniform[1] && uniform[1] < uniform[2],
        "{uniform:?}"
    );

    call("0", &again);
    call("1", &other);
    let read = |path: &str| fs::read_to_string(path).unwrap();
    assert_eq!(read(&first), read(&again));
    assert_ne!(read(&first), read(&other));
    let rows = read(&first);
    assert!(rows.starts_with(
        "noise,run_seed,episodes,goals,mean_return,best_return,found_in_10,found_in_50\n"
    ));
    assert_eq!(rows.lines().count(), 1 + 8 * 3);
}

#[test]
fn floor_needs_a_goal_and_enough_episodes() {
    let error = |arguments: &[&str]| {
        let output = seedbed(&[&["floor"], arguments].concat());
        assert_eq!(output.status.code(), Some(2));
        stderr(&output)
    };
    assert_eq!(
        error(&["cartpole", "--attempts", "200", "--episodes", "100"]),
        "error: --episodes 100: expected at least as many as --attempts, 200\n"
    );
    assert_eq!(
        error(&["corridors_drawn"]),
        "error: the task `corridors_drawn` has no `reward_threshold`, which would say what reaches the goal: give a return with --goal\n"
    );
    assert_eq!(
        error(&["cartpole", "--goal", "NaN"]),
        "error: --goal: expected a number\n"
    );
}

/// A scenario stands for its task.
#[test]
fn the_task_of_a_scenario_has_a_floor() {
    let few = [
        "--goal",
        "30",
        "--runs",
        "1",
        "--attempts",
        "2",
        "--episodes",
        "2",
    ];
    let floor = |what: &str| run_successful(&[&["floor", what], &few[..]].concat());
    assert_eq!(floor("scenarios/cartpole.ron"), floor("cartpole"));
}
