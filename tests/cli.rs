//! The command line as a user meets it: messages, exit codes, and what is left on disk.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn seedbed(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_seedbed"));
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().expect("the binary runs")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A run small enough for a test: 2 agents, 6 episodes.
fn small_run(folder: &Path, more: &[&str]) -> Output {
    let folder = folder.to_str().unwrap();
    let base = ["run", "scenarios/cartpole.ron", "--set", "agents.count=2", "--set", "stop=Episodes(6)", "--out", folder];
    seedbed(&[&base, more].concat())
}

fn ron_files(folder: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "ron"));
    files.sort();
    files
}

/// Every `NAME.ron` in the folder has its exact message in `NAME.stderr`.
fn check_messages(folder: &str) {
    let files = ron_files(folder);
    assert!(files.len() >= 10, "{} broken files in {folder}", files.len());
    for path in files {
        let output = seedbed(&["check", path.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2), "{}", path.display());
        let expected_path = path.with_extension("stderr");
        if std::env::var_os("SEEDBED_BLESS").is_some() {
            std::fs::write(&expected_path, &output.stderr).unwrap();
        }
        let expected = std::fs::read_to_string(&expected_path).unwrap_or_default();
        assert_eq!(stderr(&output), expected, "{}", path.display());
    }
}

#[test]
fn broken_scenarios_are_explained() {
    check_messages("tests/broken_scenarios");
}

#[test]
fn good_files_pass() {
    let output = seedbed(&["check", "scenarios/cartpole.ron", "envs/cartpole.ron"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(
        stdout(&output),
        "ok: scenarios/cartpole.ron: scenario of 4 agents in `cartpole`, observations x, x_dot, theta, theta_dot; actions force (-10 or 10 N)\n\
         ok: envs/cartpole.ron: environment with observations x, x_dot, theta, theta_dot; actions force (-10 or 10 N)\n"
    );
}

#[test]
fn every_scenario_and_environment_passes() {
    let paths: Vec<PathBuf> = ["scenarios", "envs"].into_iter().flat_map(ron_files).collect();
    let names: Vec<&str> = paths.iter().map(|path| path.to_str().unwrap()).collect();
    let output = seedbed(&[&["check"], names.as_slice()].concat());
    assert!(output.status.success() && paths.len() >= 4, "{}", stderr(&output));
}

#[test]
fn a_run_leaves_what_is_promised() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let output = small_run(&path, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    let mut names: Vec<String> =
        std::fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    let promised = [
        "checkpoint",
        "environment.ron",
        "episodes.csv",
        "policies.safetensors",
        "rounds.csv",
        "run.rrd",
        "scenario.ron",
        "summary.json",
    ];
    assert_eq!(names, promised);

    let episodes = std::fs::read_to_string(path.join("episodes.csv")).unwrap();
    assert_eq!(episodes.lines().next(), Some("agent,episode,round,env_steps,return,length,outcome,coverage"));
    assert_eq!(episodes.lines().count(), 1 + 2 * 6);
    let rounds = std::fs::read_to_string(path.join("rounds.csv")).unwrap();
    let header = "agent,round,value_loss,policy_loss,ratio_deviation,clipped_fraction,entropy,coverage";
    assert_eq!(rounds.lines().next(), Some(header));
    assert_eq!(rounds.lines().count(), 1 + 2 * 6);

    let weights = std::fs::read(path.join("policies.safetensors")).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&weights).unwrap();
    assert_eq!(tensors.tensor("agent_1.policy.layer_0.weight").unwrap().shape(), [4, 32]);
    assert_eq!(tensors.names().len(), 2 * 2 * 3 * 2, "agents × networks × layers × (weight, bias)");

    let said = stdout(&output);
    for word in ["finished", "solved", "return", "coverage", "results", "recording"] {
        assert!(said.contains(word), "{word} in {said}");
    }
}

/// The resolved scenario, run again, gives the same episodes.
#[test]
fn the_resolved_scenario_repeats_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("first"), folder.path().join("second"));
    assert!(small_run(&first, &["--no-recording"]).status.success());
    let resolved = first.join("scenario.ron");
    let output = seedbed(&["run", resolved.to_str().unwrap(), "--no-recording", "--out", second.to_str().unwrap()]);
    assert!(output.status.success(), "{}", stderr(&output));
    let read = |folder: &Path| std::fs::read_to_string(folder.join("episodes.csv")).unwrap();
    assert_eq!(read(&first), read(&second));
}

#[test]
fn nothing_is_overwritten_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(small_run(&path, &["--no-recording", "--quiet"]).status.success());
    let before = std::fs::read(path.join("episodes.csv")).unwrap();

    let refused = small_run(&path, &["--no-recording", "--seed", "1"]);
    assert_eq!(refused.status.code(), Some(2));
    let expected = format!(
        "error: {} holds a finished run; keep both with --seed N or --out DIR, replace it with --overwrite\n",
        path.display()
    );
    assert_eq!(stderr(&refused), expected);
    assert_eq!(std::fs::read(path.join("episodes.csv")).unwrap(), before);

    let resumed = small_run(&path, &["--resume"]);
    assert_eq!(resumed.status.code(), Some(2));
    assert!(stderr(&resumed).contains("is finished; there is nothing to resume"), "{}", stderr(&resumed));

    assert!(small_run(&path, &["--no-recording", "--seed", "1", "--overwrite"]).status.success());
    assert_ne!(std::fs::read(path.join("episodes.csv")).unwrap(), before);
}

#[test]
fn a_folder_of_other_files_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("thesis.tex"), "precious").unwrap();
    let refused = small_run(folder.path(), &[]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("is not empty"), "{}", stderr(&refused));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn overrides_are_explained() {
    let output = seedbed(&["run", "scenarios/cartpole.ron", "--set", "algorithm.dicount=0.9"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output)
            .starts_with("error: --set algorithm.dicount=0.9: in `algorithm.dicount`: there is no field `dicount` here")
    );
    assert!(stderr(&output).ends_with("  = help: did you mean `discount`?\n"), "{}", stderr(&output));
}

#[test]
fn a_folder_that_cannot_be_written_is_one_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let output = small_run(&file.join("run"), &[]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert_eq!(stderr(&output).matches("error:").count(), 1, "{}", stderr(&output));
}

#[test]
fn list_shows_what_there_is() {
    let output = seedbed(&["list"]);
    assert!(output.status.success());
    let said = stdout(&output);
    for word in ["cartpole", "theta_dot", "scenarios/cartpole.ron", "SeedPg", "ratio_product_cap", "0.99", "Random"] {
        assert!(said.contains(word), "{word} in {said}");
    }
}
