//! Searches for parameters on the command line: budgets, choices, files, interruptions.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use super::util::{REPOSITORY, command, crash, run_successful, seedbed, stderr, stdout};
use crate::study::stored_results;

/// A step size that learns nothing in twenty episodes, and one that learns.
const STEP_SIZES: [&str; 2] = ["0.000000001", "0.002"];

/// Values that all methods replace in the scenario, before their step size.
const SET: &str = r#""agents.count=2", "stop=Episodes(20)", "algorithm.exploration=EpsilonGreedy(from: 1, to: 0.02, steps: 500)""#;

/// Q-learning of two agents in CartPole. Without tuning, its step size is the first of `STEP_SIZES`.
fn tuning_text(fields: &str) -> String {
    let scenario = Path::new(REPOSITORY).join("scenarios/cartpole_q.ron");
    format!(
        r#"Tuning(
            title: "Step sizes",
            scenario: "{}",
            set: [{SET}, "algorithm.learning.optimizer.step_size={}"],
            {fields}
        )"#,
        scenario.display(),
        STEP_SIZES[0]
    )
}

/// One method with two configurations, the first of which is also the default.
fn toy_text(goal: &str) -> String {
    let [idle, working] = STEP_SIZES;
    tuning_text(&format!(
        r#"methods: [(name: "q")],
        space: [(name: "step size", set: ["algorithm.learning.optimizer.step_size={{}}"], draw: Choice(["{idle}", "{working}"]))],
        measure: FinalReturn(window: 5),
        goal: {goal}"#
    ))
}

/// Two methods: one with any number of configurations, one with three.
fn two_methods_text() -> String {
    tuning_text(
        r#"methods: [
            (name: "many", space: [(set: ["algorithm.learning.optimizer.step_size={}"], draw: LogUniform(1e-4, 1e-2))]),
            (name: "few, \"three\"", set: ["agents.count=1"], space: [(name: "double", set: ["algorithm.double={}"], draw: Choice(["true", "false"])),
                (name: "one", set: ["algorithm.learning.minibatch={}"], draw: Choice(["64", "64"]))]),
        ],
        measure: FinalReturn(window: 5),
        goal: Maximize,
        runs: 1"#,
    )
}

/// Writes a tuning file in a temporary directory. Returns the directory, the path of the file, and a
/// path for results.
fn write_tuning(text: &str) -> (tempfile::TempDir, String, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("toy.ron");
    fs::write(&file, text).unwrap();
    let (file, out) = (file.to_str().unwrap().to_owned(), folder.path().join("out"));
    (folder, file, out)
}

fn tune(file: &str, budget: &str, out: &Path, extra_arguments: &[&str]) -> Output {
    let arguments = [
        "tune",
        file,
        "--budget",
        budget,
        "--out",
        out.to_str().unwrap(),
    ];
    seedbed(&[&arguments[..], extra_arguments].concat())
}

/// The rows of `tuning.csv`, by the names of their columns.
fn rows(out: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(out.join("tuning.csv")).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
}

fn file(out: &Path, name: &str) -> String {
    fs::read_to_string(out.join(name)).unwrap()
}

/// Everything that a search writes.
fn all_files(out: &Path) -> (String, String, String, BTreeMap<String, Vec<u8>>) {
    (
        file(out, "tuning.csv"),
        file(out, "best.ron"),
        file(out, "study.json"),
        stored_results(out),
    )
}

/// The default and the first choice are equal, so that there are two configurations: an idle one,
/// which is the first, and one that learns. The goal decides which is best, not the order.
#[test]
fn the_search_chooses_the_step_size_that_learns() {
    for (goal, expected) in [("Maximize", Some(STEP_SIZES[1])), ("Minimize", None)] {
        let (_folder, path, out) = write_tuning(&toy_text(goal));
        let output = tune(&path, "8", &out, &[]);
        assert!(output.status.success(), "{output:?}");
        let chosen = expected.map_or(String::new(), |value| {
            format!(r#", "algorithm.learning.optimizer.step_size={value}""#)
        });
        let cell = format!(
            r#"set: [{SET}, "algorithm.learning.optimizer.step_size={}"{chosen}]),"#,
            STEP_SIZES[0]
        );
        let best = file(&out, "best.ron");
        assert!(best.contains(&cell), "{goal}: {best}");
        // Two configurations with η = 3 are one rung; each has half of the budget.
        let rows = rows(&out);
        let of = |configuration: &str| {
            let own = rows
                .iter()
                .filter(|row| row["configuration"] == configuration);
            own.map(|row| row["value"].parse().unwrap())
                .collect::<Vec<f64>>()
        };
        assert_eq!([of("0").len(), of("1").len()], [4, 4]);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        assert!(mean(&of("1")) > 2.0 * mean(&of("0")), "{rows:?}");
        assert!(rows.iter().all(|row| row["rung"] == "0"));
    }
}

/// The largest of three step sizes is the only one that learns: larger ones may be better.
#[test]
fn a_best_value_at_the_edge_of_its_range_is_a_warning() {
    let [idle, working] = STEP_SIZES;
    let three = format!(r#"draw: Choice(["{idle}", "0.000000002", "{working}"])"#);
    let two = format!(r#"draw: Choice(["{idle}", "{working}"])"#);
    let text = toy_text("Maximize");
    assert!(text.contains(&two));
    for (text, is_at_edge) in [(text.replace(&two, &three), true), (text, false)] {
        let (_folder, path, out) = write_tuning(&text);
        let output = tune(&path, "27", &out, &[]);
        assert!(output.status.success(), "{output:?}");
        let warning = format!(
            "warning: the best configuration of `q` is at the edge of a range: step size {working}; a wider one may have a \
             better value"
        );
        assert_eq!(stderr(&output).contains(&warning), is_at_edge, "{output:?}");
    }
}

/// Whatever the number of configurations of a method, it gets all runs of the budget and not one more,
/// with run seeds from 0 on, and a configuration of a later rung keeps its runs.
#[test]
fn every_method_gets_exactly_its_budget() {
    let (_folder, path, out) = write_tuning(&two_methods_text());
    for budget in ["2", "7", "12"] {
        let output = tune(&path, budget, &out, &[]);
        assert!(output.status.success(), "{output:?}");
        let rows = rows(&out);
        for method in ["many", "few, \"three\""] {
            let own: Vec<_> = rows.iter().filter(|row| row["method"] == method).collect();
            assert_eq!(own.len().to_string(), budget, "{method}");
            let mut run_seeds: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
            for row in &own {
                let seeds = run_seeds.entry(&row["configuration"]).or_default();
                seeds.push(row["run_seed"].parse().unwrap());
            }
            assert!(
                run_seeds.contains_key("0"),
                "the default is a configuration"
            );
            for seeds in run_seeds.values() {
                assert_eq!(*seeds, (0..seeds.len() as u64).collect::<Vec<_>>());
            }
        }
    }
    // The scenario's `double` is one of the two choices.
    let few = rows(&out).into_iter().filter(|row| row["method"] != "many");
    let configurations: std::collections::BTreeSet<String> =
        few.map(|row| row["configuration"].clone()).collect();
    assert_eq!(configurations.len(), 2, "{configurations:?}");
}

#[test]
fn files_depend_neither_on_jobs_nor_on_crashes_nor_on_repetitions() {
    let (_folder, path, out) = write_tuning(&two_methods_text());
    assert!(tune(&path, "12", &out, &["--jobs", "2"]).status.success());
    let expected = all_files(&out);
    let repeated = tune(&path, "12", &out, &["--jobs", "1"]);
    let lines = stdout(&repeated);
    assert!(
        lines.contains("\nrung 0     20 runs, 0 to run\n") && !lines.contains("finished"),
        "{lines}"
    );
    assert_eq!(all_files(&out), expected);

    let (_folder, _, crashed) = write_tuning("");
    let arguments = [
        "tune",
        &path,
        "--budget",
        "12",
        "--out",
        crashed.to_str().unwrap(),
    ];
    // Rung 0 has 20 runs and rung 1 has 4: the first crash is in rung 0, the second in rung 1.
    for (after, stored) in [("18", 18), ("3", 23)] {
        let options = ["--jobs", "1", "--abort-after-runs", after];
        crash(command(&[&arguments[..], &options].concat()));
        assert_eq!(stored_results(&crashed).len(), stored);
        assert!(!crashed.join("best.ron").exists());
    }
    let resumed = tune(&path, "12", &crashed, &[]);
    assert!(resumed.status.success(), "{resumed:?}");
    assert_eq!(all_files(&crashed), expected);
}

/// The search seed decides which configurations are drawn; runs of other searches are kept.
#[test]
fn another_search_seed_draws_other_configurations() {
    let (_folder, path, out) = write_tuning(&two_methods_text());
    assert!(tune(&path, "7", &out, &[]).status.success());
    let (table, runs) = (file(&out, "tuning.csv"), stored_results(&out));
    assert!(tune(&path, "7", &out, &["--seed", "1"]).status.success());
    assert_ne!(file(&out, "tuning.csv"), table);
    let kept = stored_results(&out);
    assert!(kept.len() > runs.len() && runs.iter().all(|(name, bytes)| kept[name] == *bytes));
}

#[test]
fn the_best_configurations_are_cells_of_a_study() {
    let (folder, path, out) = write_tuning(&two_methods_text());
    assert!(tune(&path, "7", &out, &[]).status.success());
    let study = folder.path().join("study.ron");
    let cells = file(&out, "best.ron");
    let text =
        format!("Study(title: \"x\", measures: [FinalReturn()], repeats: 1, cells: {cells})");
    fs::write(&study, text).unwrap();
    let checked = run_successful(&["check", study.to_str().unwrap()]);
    assert!(
        checked.ends_with("study with 2 cells, 1 run each, and 0 claims\n"),
        "{checked}"
    );
}

/// A step size of 1e37 makes networks infinite. Such runs are the worst, even if small values are
/// best.
#[test]
fn failed_runs_count_as_the_worst() {
    let text = toy_text("Minimize").replace(STEP_SIZES[1], "1e37");
    let (_folder, path, out) = write_tuning(&text);
    let output = tune(&path, "6", &out, &[]);
    assert!(output.status.success(), "{output:?}");
    let rows = rows(&out);
    let failed: Vec<_> = rows.iter().filter(|row| row["state"] == "failed").collect();
    assert_eq!(failed.len(), 3, "{rows:?}");
    for row in failed {
        assert_eq!(
            (row["step size"].as_str(), row["value"].as_str()),
            ("1e37", "")
        );
        assert!(row["reason"].contains("non-finite"), "{row:?}");
    }
    assert!(file(&out, "best.ron").contains("// default: 3 runs"));
    assert!(stderr(&output).contains("failed     q, configuration 1, run seed 0: non-finite"));

    let all_fail = text.replace(STEP_SIZES[0], "1e36");
    let (_folder, path, out) = write_tuning(&all_fail);
    let output = tune(&path, "6", &out, &[]);
    assert_eq!(output.status.code(), Some(1));
    let expected = "error: all runs of the best configuration of `q` failed\n";
    assert!(stderr(&output).ends_with(expected), "{output:?}");
}

/// Two agents that do not solve the task in their 20 episodes count as 20, or as the horizon.
#[test]
fn times_that_are_not_reached_count_as_the_horizon() {
    let text = toy_text("Minimize").replace("FinalReturn(window: 5)", "EpisodesToSolve");
    let text = text.replace(
        "stop=Episodes(20)",
        "stop=Solved(return: 1000, window: 5, at_most: 20)",
    );
    for (horizon, value) in [("", "20"), ("horizon: 300,", "300")] {
        let (_folder, path, out) =
            write_tuning(&text.replace("methods", &format!("{horizon} methods")));
        assert!(tune(&path, "4", &out, &[]).status.success());
        for row in rows(&out) {
            assert_eq!(
                (row["state"].as_str(), row["value"].as_str()),
                ("not reached", value)
            );
        }
    }
}

#[test]
fn budgets_that_cannot_be_spent_are_refused() {
    let (_folder, path, out) = write_tuning(&toy_text("Maximize"));
    let refused = |budget: &str| {
        let output = tune(&path, budget, &out, &[]);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(!out.exists());
        stderr(&output)
    };
    assert_eq!(
        refused("3"),
        "error: --budget 3: a search needs at least 4 runs: the default and another configuration, 2 runs each (`runs` \
         in the file)\n"
    );
    assert_eq!(
        refused("2001"),
        "error: --budget 2001: method `q` has 2 configurations, so that one of them would need 1001 run seeds; there \
         are 1000 for tuning. Choose a smaller budget\n"
    );
    let error = refused("0");
    assert!(error.contains("0 is not in 1..=100000"), "{error}");
}

#[test]
fn a_list_runs_nothing() {
    let (_folder, path, out) = write_tuning(&toy_text("Maximize"));
    let output = tune(&path, "9", &out, &["--list"]);
    assert_eq!(
        stdout(&output),
        "q: 9 runs\n  rung 0: 2 configurations, 4 runs each, one more for the best 1\n  default\n  \
         configuration 1  step size 0.002\n"
    );
    assert!(!out.exists());
}

#[test]
fn other_commands_name_the_right_one() {
    let (_folder, path, _) = write_tuning(&toy_text("Maximize"));
    let output = seedbed(&["run", &path]);
    assert_eq!(
        (output.status.code(), stderr(&output)),
        (
            Some(2),
            format!(
                "error: {path}: expected a scenario, found a search for parameters\n  = help: use `seedbed tune {path}`\n"
            )
        )
    );
    let checked = run_successful(&["check", &path]);
    assert_eq!(
        checked,
        format!("ok: {path}: search for 1 parameter of 1 method\n")
    );
}
