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
