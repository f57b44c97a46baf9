//! `seedbed runs`.

use std::path::Path;

use crate::util::{run_refused, run_successful, small_run};

/// Runs of two and six episodes, one tabular run, one that was interrupted and one that is damaged.
fn runs_in(folder: &Path) {
    assert!(small_run(&folder.join("six"), &[]).status.success());
    let two = ["--set", "stop=Episodes(2)", "--set", "agents.count=3"];
    assert!(
        small_run(&folder.join("deep/er/two"), &two)
            .status
            .success()
    );
    let tabular = folder.join("tabular");
    let arguments = ["run", "tabular/deep_sea", "-q", "--out"];
    run_successful(&[&arguments[..], &[tabular.to_str().unwrap()]].concat());
    let unfinished = folder.join("unfinished");
    assert!(small_run(&unfinished, &[]).status.success());
    std::fs::remove_file(unfinished.join("summary.json")).unwrap();
    let damaged = folder.join("damaged");
    assert!(small_run(&damaged, &[]).status.success());
    std::fs::write(damaged.join("summary.json"), "{").unwrap();
}

/// Tables and recordings that were exported into a folder of runs.
#[test]
fn files_beside_runs_do_not_hide_them() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().to_str().unwrap();
    let first = folder.path().join("s0");
    assert!(small_run(&first, &[]).status.success());
    let list = || {
        let printed = run_successful(&["runs", root, "--json"]);
        let rows: serde_json::Value = serde_json::from_str(&printed).unwrap();
        let rows = rows.as_array().unwrap().clone();
        rows.iter()
            .map(|row| row["path"].as_str().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    let one = list();
    for name in ["episodes.csv", "rounds.csv", "run.rrd"] {
        std::fs::copy(first.join(name), folder.path().join(name)).unwrap();
    }
    assert_eq!(list(), one);
    assert!(run_successful(&["inspect", root]).contains(first.to_str().unwrap()));
    assert!(small_run(&folder.path().join("s1"), &[]).status.success());
    assert_eq!(list().len(), 2);
    let error = run_refused(&["inspect", root]);
    assert!(error.contains("contains 2 runs"), "{error}");
    // Without runs below, a recording alone is listed.
    for name in ["s0", "s1"] {
        std::fs::remove_dir_all(folder.path().join(name)).unwrap();
    }
    assert_eq!(list(), [root]);
}

/// Agents of an asynchronous run have different numbers of episodes: the last 25 of each count.
#[test]
fn the_final_return_is_that_of_the_last_episodes_of_each_agent() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let asynchronous = [
        "--set",
        "agents.count=3",
        "--set",
        "schedule=Asynchronous()",
        "--set",
        "stop=Steps(team: 3000, at_most: 500)",
    ];
    assert!(small_run(&run, &asynchronous).status.success());
    let mut returns: Vec<Vec<f64>> = vec![Vec::new(); 3];
    for line in std::fs::read_to_string(run.join("episodes.csv"))
        .unwrap()
        .lines()
        .skip(1)
    {
        let cells: Vec<&str> = line.split(',').collect();
        returns[cells[0].parse::<usize>().unwrap()].push(cells[4].parse().unwrap());
    }
    let counts: Vec<usize> = returns.iter().map(Vec::len).collect();
    let (least, most) = (*counts.iter().min().unwrap(), *counts.iter().max().unwrap());
    assert!(25 < least && least < most, "{counts:?}");
    let last_mean = |returns: &Vec<f64>| returns[returns.len() - 25..].iter().sum::<f64>() / 25.0;
    let expected = returns.iter().map(last_mean).sum::<f64>() / 3.0;
    let path = run.to_str().unwrap();
    let json = |arguments: &[&str]| -> serde_json::Value {
        serde_json::from_str(&run_successful(arguments)).unwrap()
    };
    let inspected = json(&["inspect", path, "--json"]);
    let summary = std::fs::read_to_string(run.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    for file in ["summary.json", "SHA256SUMS"] {
        std::fs::remove_file(run.join(file)).unwrap();
    }
    let unfinished = json(&["runs", path, "--json"]);
    for found in [&inspected, &summary, &unfinished[0]] {
        let found = found["final_return"].as_f64().unwrap();
        assert!(
            (found - expected).abs() < 1e-9,
            "{found}, expected {expected}"
        );
    }
    let text = run_successful(&["inspect", path]);
    assert!(
        text.contains(&format!("{least} to {most} episodes each")),
        "{text}"
    );
    assert!(
        text.contains("mean of each agent's last 25 episodes"),
        "{text}"
    );
}

#[test]
fn runs_are_listed_filtered_and_sorted() {
    let folder = tempfile::tempdir().unwrap();
    runs_in(folder.path());
    let root = folder.path().to_str().unwrap();
    let listed = |arguments: &[&str]| -> Vec<(String, String, String)> {
        let printed = run_successful(&[&["runs", root], arguments].concat());
        printed
            .lines()
            .skip(1)
            .map(|line| {
                let mut cells = line
                    .split("  ")
                    .map(str::trim)
                    .filter(|cell| !cell.is_empty());
                let path = cells.next().unwrap().strip_prefix(root).unwrap().to_owned();
                assert!(
                    matches!(cells.next(), Some("cartpole" | "DeepSea" | "–")),
                    "{line}"
                );
                assert!(matches!(cells.next(), Some("0" | "–")), "seed of {line}");
                let agents = cells.next().unwrap().to_owned();
                (path, agents, cells.next().unwrap().to_owned())
            })
            .collect()
    };
    let row = |path: &str, agents: &str, episodes: &str| {
        (path.to_owned(), agents.to_owned(), episodes.to_owned())
    };
    assert_eq!(
        listed(&["--sort", "path"]),
        [
            row("/damaged", "–", "–"),
            row("/deep/er/two", "3", "2"),
            row("/six", "2", "6"),
            row("/tabular", "10", "50"),
            row("/unfinished", "2", "6"),
        ]
    );
    assert_eq!(
        listed(&["--state", "unfinished"]),
        [row("/unfinished", "2", "6")]
    );
    assert_eq!(
        listed(&["--sort", "agents", "--filter", "/er/"]),
        [row("/deep/er/two", "3", "2")]
    );
    let by_agents = listed(&["--sort", "agents", "--reverse", "--state", "finished"]);
    assert_eq!(
        by_agents
            .iter()
            .map(|row| row.0.as_str())
            .collect::<Vec<_>>(),
        ["/tabular", "/deep/er/two", "/six"]
    );
}

/// A damaged summary gives no number and is reported.
#[test]
fn a_damaged_run_has_no_numbers() {
    let folder = tempfile::tempdir().unwrap();
    runs_in(folder.path());
    let root = folder.path().to_str().unwrap();
    let text = run_successful(&["runs", root, "--json"]);
    let runs: Vec<serde_json::Value> = serde_json::from_str(&text).unwrap();
    let find = |name: &str| {
        let has_name = |run: &&serde_json::Value| run["path"].as_str().unwrap().ends_with(name);
        runs.iter().find(has_name).unwrap()
    };
    let damaged = find("damaged");
    assert_eq!(damaged["state"], "unreadable");
    assert!(damaged["final_return"].is_null() && damaged["seed"].is_null());
    assert!(damaged["error"].as_str().unwrap().contains("summary.json"));
    let (six, unfinished) = (find("six"), find("unfinished"));
    assert_eq!(unfinished["state"], "unfinished");
    for key in [
        "final_return",
        "env_steps",
        "effective_agents",
        "environment",
    ] {
        assert_eq!(six[key], unfinished[key], "{key}");
    }
    assert!(six["written"].as_str().unwrap().ends_with('Z'));
}

#[test]
fn a_directory_without_runs_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().to_str().unwrap();
    assert_eq!(
        run_successful(&["runs", root]),
        format!("no runs in {root}\n")
    );
    let missing = folder.path().join("nothing");
    let message = run_refused(&["runs", missing.to_str().unwrap()]);
    assert!(message.starts_with("error: no directory "), "{message}");
}

/// A directory with one run in it stands for this run; one with several is refused.
#[test]
fn the_directory_of_a_scenario_names_its_only_run() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().to_str().unwrap();
    assert!(
        small_run(&folder.path().join("seed-0"), &[])
            .status
            .success()
    );
    let text = run_successful(&["inspect", root, "--json"]);
    let inspected: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(inspected["agents"].as_array().unwrap().len(), 2);
    assert_eq!(
        inspected["final_return"],
        inspected["summary"]["final_return"]
    );
    assert_eq!(inspected["observations"][2]["name"], "theta");
    run_successful(&["evaluate", root, "--episodes", "1"]);
    assert!(
        small_run(&folder.path().join("seed-1"), &[])
            .status
            .success()
    );
    let message = run_refused(&["inspect", root]);
    assert!(
        message.contains("contains 2 runs: name one of them, for example "),
        "{message}"
    );
}
