//! `seedbed evaluate` and `seedbed replay`.

use std::fs;
use std::process::Output;

use crate::recording::contents::RecordingContents;
use crate::util::{seedbed, small_run, stderr, stdout};

/// Trains sixteen agents that keep the pole up for more than a hundred steps, with its files in the folder `run`.
fn train(run: &str) {
    let train = [
        "run",
        "scenarios/cartpole_16.ron",
        "--quiet",
        "--no-recording",
        "--out",
        run,
        "--set",
        "stop=Episodes(40)",
    ];
    assert!(seedbed(&train).status.success());
}

/// Mean return of the team as printed by `seedbed evaluate RUN --episodes 5`.
fn evaluated_return(run: &str, extra_arguments: &[&str]) -> f64 {
    let output = seedbed(&[&["evaluate", run, "--episodes", "5"], extra_arguments].concat());
    let rows = table_rows(&output);
    assert_eq!(rows.len(), 1 + 1 + 16 + 1, "{rows:?}");
    let team = rows.iter().find(|row| row.starts_with("| team")).unwrap();
    team.split('|').nth(2).unwrap().trim().parse().unwrap()
}

/// The lines of the table that a successful command printed.
fn table_rows(output: &Output) -> Vec<String> {
    assert!(output.status.success(), "{}", stderr(output));
    stdout(output)
        .lines()
        .filter(|line| line.starts_with('|'))
        .map(str::to_owned)
        .collect()
}

/// A trained policy keeps the pole up longer with greedy than with nearly random actions; the same
/// run seed plays the same episodes.
#[test]
fn a_run_is_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = path.to_str().unwrap();
    train(run);
    let (greedy, nearly_random) = (
        evaluated_return(run, &["--actions", "greedy"]),
        evaluated_return(run, &["--temperature", "100"]),
    );
    assert!(
        greedy > 100.0 && nearly_random < 50.0,
        "{greedy} {nearly_random}"
    );
    let default = evaluated_return(run, &[]);
    assert_eq!(default, evaluated_return(run, &["--actions", "sampled"]));
    assert_ne!(default, evaluated_return(run, &["--seed", "1"]));
}

/// A policy that keeps the pole up for longer than 30 steps gets all 30 rewards of a shorter task.
#[test]
fn a_policy_acts_in_another_task_with_the_same_interface() {
    let folder = tempfile::tempdir().unwrap();
    let (path, short) = (folder.path().join("run"), folder.path().join("short.ron"));
    let (run, short) = (path.to_str().unwrap(), short.to_str().unwrap());
    fs::copy("envs/cartpole.ron", folder.path().join("cartpole.ron")).unwrap();
    fs::write(short, r#"Environment(extends: "cartpole", time_limit: 30)"#).unwrap();
    train(run);
    assert_eq!(
        evaluated_return(run, &["--actions", "greedy", "--environment", short]),
        30.0
    );

    let film = path.join("short.gif");
    let filmed = seedbed(&[
        "film",
        run,
        "--policy",
        "1",
        "--environment",
        short,
        "--out",
        film.to_str().unwrap(),
    ]);
    assert!(
        filmed.status.success() && film.is_file(),
        "{}",
        stderr(&filmed)
    );

    for (environment, expected) in [
        (
            "pendulum",
            "error: --environment: policies that were trained in `cartpole` cannot act in `pendulum`, since it has other observations or actions\n  \
             = help: expected observations `x`, `x_dot`, `theta`, `theta_dot` and actions `force` (2 choices); found",
        ),
        ("cartpol", "error: --environment"),
        ("mistakes/cartpole_nothing", "error: --environment"),
    ] {
        let refused = seedbed(&["evaluate", run, "--environment", environment]);
        assert_eq!(refused.status.code(), Some(2));
        assert!(
            stderr(&refused).starts_with(expected),
            "{}",
            stderr(&refused)
        );
    }
}

#[test]
fn evaluate_explains_invalid_arguments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(
        small_run(&path, &["--quiet", "--no-recording"])
            .status
            .success()
    );
    let evaluate = ["evaluate", path.to_str().unwrap(), "--temperature", "-1"];
    let negative_temperature = seedbed(&evaluate);
    assert_eq!(
        (
            negative_temperature.status.code(),
            stderr(&negative_temperature)
        ),
        (
            Some(2),
            "error: --temperature: expected a number above 0, found -1.0\n".to_owned()
        )
    );
    let missing_path = folder.path().join("nowhere");
    let missing_run = seedbed(&["evaluate", missing_path.to_str().unwrap()]);
    assert_eq!(missing_run.status.code(), Some(2));
    assert!(
        stderr(&missing_run).contains("scenario.ron: no such file"),
        "{}",
        stderr(&missing_run)
    );
}

/// A replay plays the episodes of an evaluation with the same run seed. It records the raw data of
/// all agents, and the bodies of the selected agents.
#[test]
fn a_run_is_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = path.to_str().unwrap();
    assert!(small_run(&path, &["--quiet"]).status.success());
    let three_episodes = ["--episodes", "3", "--seed", "4"];
    let evaluated = seedbed(&[&["evaluate", run], &three_episodes[..]].concat());
    let replayed = seedbed(&[&["replay", run, "--agents", "1"], &three_episodes[..]].concat());
    assert_eq!(table_rows(&replayed), table_rows(&evaluated));
    let recording = path.join("replay.rrd");
    assert!(
        stdout(&replayed).ends_with(&format!(
            "open the recording with\n  rerun {}\n",
            recording.display()
        )),
        "{}",
        stdout(&replayed)
    );
    let contents = RecordingContents::read(&recording);
    assert!(contents.has_entity("/raw/agent_0"));
    assert!(contents.has_entity("/scene/agent_1") && !contents.has_entity("/scene/agent_0"));
}

#[test]
fn replay_explains_invalid_arguments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = path.to_str().unwrap();
    assert!(small_run(&path, &["--quiet"]).status.success());
    for (extra_arguments, expected) in [
        (
            &["--agents", "0,2"][..],
            "error: --agents: there is no agent 2; the team of `cartpole` has agents 0 to 1\n"
                .to_owned(),
        ),
        (
            &["--out", &format!("{run}/run.rrd")],
            format!(
                "error: --out {run}/run.rrd would overwrite the recording of the run; choose another file\n"
            ),
        ),
        (
            &["--temperature", "0"],
            "error: --temperature: expected a number above 0, found 0.0\n".to_owned(),
        ),
    ] {
        let refused = seedbed(&[&["replay", run], extra_arguments].concat());
        assert_eq!(
            (refused.status.code(), stderr(&refused)),
            (Some(2), expected)
        );
    }
}
