//! `seedbed init` and `seedbed new`, and files by name in a folder that has nothing but them.

use std::path::Path;
use std::process::Output;

use crate::util::{command, files_below, names_in, stderr, stdout};

/// Runs `seedbed ARGUMENTS` in a folder.
fn seedbed_in(folder: &Path, arguments: &[&str]) -> Output {
    command(arguments).current_dir(folder).output().unwrap()
}

/// Runs `seedbed ARGUMENTS` in a folder, which must succeed.
fn successful_in(folder: &Path, arguments: &[&str]) -> String {
    let output = seedbed_in(folder, arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        stderr(&output)
    );
    stdout(&output)
}

/// From an empty folder to a solved task and a figure of the states that agents visited.
#[test]
fn a_new_workspace_leads_to_a_figure() {
    let folder = tempfile::tempdir().unwrap();
    let printed = successful_in(folder.path(), &["init", "lab"]);
    assert!(printed.contains("\nNext:\n  cd lab\n"), "{printed}");
    let lab = folder.path().join("lab");
    assert_eq!(names_in(&lab), ["README.md", "envs", "scenarios"]);
    let files = files_below(&lab, "ron");
    assert_eq!(files.len(), 3);
    let mut check = vec!["check"];
    check.extend(files.iter().map(|path| path.to_str().unwrap()));
    assert_eq!(successful_in(&lab, &check).matches("ok: ").count(), 3);
    for line in printed
        .lines()
        .filter_map(|line| line.strip_prefix("  seedbed "))
    {
        successful_in(&lab, &line.split(' ').collect::<Vec<_>>());
    }
    let run = lab.join("recordings/short_pole/seed-0");
    let summary = std::fs::read_to_string(run.join("summary.json")).unwrap();
    assert!(
        !summary.contains("\"solved_at_episode\": null"),
        "{summary}"
    );
    assert!(std::fs::metadata(lab.join("run.png")).unwrap().len() > 10_000);
}

/// All commands of the README of a workspace succeed.
#[test]
fn the_readme_of_a_workspace_has_commands_that_work() {
    let folder = tempfile::tempdir().unwrap();
    successful_in(folder.path(), &["init"]);
    let readme = std::fs::read_to_string(folder.path().join("README.md")).unwrap();
    let commands: Vec<&str> = readme
        .lines()
        .filter_map(|line| line.strip_prefix("    seedbed "))
        .map(|line| line.split('#').next().unwrap().trim_end())
        .collect();
    assert_eq!(commands.len(), 6);
    for line in commands {
        let quick = line.starts_with("study").then_some("--quick");
        let arguments: Vec<&str> = line.split(' ').chain(quick).collect();
        successful_in(folder.path(), &arguments);
    }
}

/// Without the time limit that Python would tell, the scenario may be wrong.
#[test]
fn a_scenario_of_an_environment_that_cannot_be_tried_comes_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["new", "scenario", "mine", "--env", "gymnasium:Mine-v0"];
    let mut command = command(&arguments);
    command.env("SEEDBED_PYTHON", "/missing/python");
    let output = command.current_dir(folder.path()).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let warning = "warning    the environment could not be tried, so the scenario may lack what it needs, such as `time_limit`: ";
    let said = stderr(&output);
    assert!(said.starts_with(warning), "{said}");
    assert!(said.contains("SEEDBED_PYTHON"), "{said}");
}

/// A typo leaves no file that would stand in the way of the right name.
#[test]
fn a_python_file_that_does_not_exist_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["task", "scenario"] {
        let arguments = ["new", kind, "mine", "--env", "gymnasium:nofile.py:Maze"];
        let output = seedbed_in(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(
            stderr(&output),
            "error: gymnasium:nofile.py:Maze: there is no file nofile.py\n"
        );
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn existing_files_are_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("README.md"), "mine").unwrap();
    let output = seedbed_in(folder.path(), &["init"]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(
        stderr(&output),
        "error: README.md exists already; nothing was overwritten\n"
    );
    assert_eq!(names_in(folder.path()), ["README.md"]);
    successful_in(folder.path(), &["new", "task", "ball"]);
    let again = seedbed_in(folder.path(), &["new", "task", "ball"]);
    assert_eq!(again.status.code(), Some(2));
    assert_eq!(
        stderr(&again),
        "error: envs/ball.ron exists already; nothing was overwritten\n"
    );
}

#[test]
fn new_files_name_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    for arguments in [
        ["new", "task", "ball", "", ""].as_slice(),
        &["new", "scenario", "balls", "--env", "ball"],
        &["new", "study", "sizes", "--scenario", "balls"],
    ] {
        let arguments: Vec<&str> = arguments
            .iter()
            .copied()
            .filter(|word| !word.is_empty())
            .collect();
        successful_in(path, &arguments);
    }
    let printed = successful_in(path, &["check", "scenarios/sizes.ron", "balls", "ball"]);
    assert!(printed.contains("4 agents in `ball`"), "{printed}");
    for (arguments, message) in [
        (
            ["new", "task", "a/b"].as_slice(),
            "cannot use `a/b` as a name",
        ),
        (
            &["new", "scenario", "x", "--env", "bal"],
            "did you mean `ball`?",
        ),
    ] {
        let output = seedbed_in(path, arguments);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(message), "{}", stderr(&output));
    }
}

/// The study of a task without a threshold is about returns, and valid as it is written.
#[test]
fn a_new_study_of_a_task_without_a_threshold_is_about_returns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    successful_in(path, &["new", "scenario", "mine", "--env", "pendulum"]);
    successful_in(path, &["new", "study", "sizes", "--scenario", "mine"]);
    let printed = successful_in(path, &["check", "scenarios/sizes.ron"]);
    assert!(printed.contains("study with 2 cells"), "{printed}");
    let text = std::fs::read_to_string(path.join("scenarios/sizes.ron")).unwrap();
    assert!(text.contains("measures: [FinalReturn(), ") && !text.contains("EpisodesToSolve"));
    assert!(text.contains("have larger returns") && !text.contains("fewer episodes"));
}

/// A scenario that is built in runs by name in any folder, and its stored settings repeat it.
#[test]
fn built_in_scenarios_run_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    successful_in(
        path,
        &[
            "run",
            "cartpole",
            "--set",
            "stop=Episodes(2)",
            "--no-recording",
        ],
    );
    let stored = path.join("recordings/cartpole/seed-0/scenario.ron");
    successful_in(
        path,
        &[
            "run",
            stored.to_str().unwrap(),
            "--out",
            "again",
            "--no-recording",
        ],
    );
    let episodes = |run: &str| std::fs::read(path.join(run).join("episodes.csv")).unwrap();
    assert_eq!(episodes("recordings/cartpole/seed-0"), episodes("again"));
    successful_in(
        path,
        &[
            "preview",
            "lander",
            "--episodes",
            "1",
            "--out",
            "lander.rrd",
        ],
    );
    let bench = [
        "bench",
        "cartpole_1",
        "cartpole",
        "--seeds",
        "1",
        "--set",
        "stop=Episodes(2)",
    ];
    successful_in(path, &bench);
}

/// A file of the user precedes a built-in one of the same name.
#[test]
fn a_file_in_the_folder_precedes_a_built_in_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::create_dir(path.join("envs")).unwrap();
    std::fs::write(path.join("envs/cartpole.ron"), "Environment(").unwrap();
    let output = seedbed_in(path, &["preview", "cartpole"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).starts_with("error: envs/cartpole.ron:1:13:"),
        "{}",
        stderr(&output)
    );
    // Scenarios that are built in use the tasks that are.
    let printed = successful_in(path, &["check", "cartpole"]);
    assert!(
        printed.starts_with("ok: cartpole: scenario with 4 agents"),
        "{printed}"
    );
}

#[test]
fn errors_in_built_in_files_name_them() {
    let folder = tempfile::tempdir().unwrap();
    let output = seedbed_in(
        folder.path(),
        &["run", "cartpole", "--set", "agents.count=0"],
    );
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("expected a whole number from 1"),
        "{}",
        stderr(&output)
    );
    let output = seedbed_in(folder.path(), &["run", "builtin:scenarios/nothing.ron"]);
    assert_eq!(
        stderr(&output).lines().next(),
        Some("error: builtin:scenarios/nothing.ron: no such file")
    );
}

/// A study is found by its name, with and without `.ron`. A file name that is not here is never taken for a built-in file.
#[test]
fn studies_are_found_by_name() {
    let folder = tempfile::tempdir().unwrap();
    successful_in(folder.path(), &["init", "lab"]);
    let lab = folder.path().join("lab");
    let by_path = successful_in(&lab, &["study", "list", "scenarios/team_size.ron"]);
    for name in ["team_size", "team_size.ron"] {
        assert_eq!(successful_in(&lab, &["study", "list", name]), by_path);
    }
    for arguments in [["run", "cartpole.ron"], ["check", "cartpole.ron"]] {
        let output = seedbed_in(&lab, &arguments);
        assert_eq!(output.status.code(), Some(2));
        let error = stderr(&output);
        assert!(
            error.starts_with("error: cartpole.ron: no such file"),
            "{error}"
        );
    }
}
