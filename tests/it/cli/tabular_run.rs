//! `seedbed run` with tabular scenarios.

use std::path::Path;
use std::process::Output;

#[cfg(unix)]
use crate::util::interrupt;
use crate::util::{command, names_in, seedbed, stderr, stdout, wait_until};

/// Runs `scenarios/tabular/bipolar_chain.ron` with one episode per agent.
fn run_bipolar_chain(folder: &Path, agents: u32, extra_arguments: &[&str]) -> Output {
    let agent_count = format!("agents.count={agents}");
    let base = [
        "run",
        "scenarios/tabular/bipolar_chain.ron",
        "--set",
        &agent_count,
        "--out",
        folder.to_str().unwrap(),
    ];
    seedbed(&[&base, extra_arguments].concat())
}

/// A second run into the same directory is refused. With `--overwrite`, it writes the same bytes
/// again.
#[test]
fn a_tabular_run_writes_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let output = run_bipolar_chain(&path, 20, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(
        stdout(&output).contains("regret     "),
        "{}",
        stdout(&output)
    );
    assert_eq!(
        names_in(&path),
        [
            "SHA256SUMS",
            "regret.csv",
            "run.rrd",
            "scenario.ron",
            "summary.json",
            "visits.csv"
        ]
    );
    let read_table = || std::fs::read_to_string(path.join("regret.csv")).unwrap();
    let table = read_table();
    assert_eq!(
        table.lines().next(),
        Some("agent,episode,begun,ended,length,return,regret")
    );
    assert_eq!(table.lines().count(), 1 + 20);
    let second = run_bipolar_chain(&path, 20, &[]);
    assert_eq!(second.status.code(), Some(2));
    let overwrite = run_bipolar_chain(&path, 20, &["--overwrite", "--threads", "1"]);
    assert!(overwrite.status.success());
    assert_eq!(read_table(), table);
}

/// Progress is printed whenever a tenth of all episodes is finished: here 20 agents have one
/// episode each.
#[test]
fn a_tabular_run_prints_progress_and_results() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let output = run_bipolar_chain(&path, 20, &[]);
    let progress = stderr(&output);
    assert_eq!(progress.lines().count(), 10, "{progress}");
    assert!(
        progress.starts_with("2/20 episodes · mean return "),
        "{progress}"
    );
    let printed = stdout(&output);
    let labels: Vec<&str> = printed.lines().map(|line| line[..10].trim()).collect();
    assert_eq!(
        labels,
        [
            "finished",
            "optimal",
            "regret",
            "no regret",
            "visited",
            "results",
            "recording",
            ""
        ]
    );
}

/// Only teams of at most 64 agents are recorded. A larger team cannot be shown in a viewer either.
#[test]
fn a_tabular_run_of_65_agents_has_no_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let served = run_bipolar_chain(&path, 65, &["--serve=0"]);
    assert_eq!(served.status.code(), Some(2));
    assert_eq!(
        stderr(&served),
        "error: cannot show scenarios/tabular/bipolar_chain.ron in a viewer: only teams of at most 64 agents are recorded\n"
    );
    let output = run_bipolar_chain(&path, 65, &[]);
    assert!(
        stdout(&output)
            .ends_with("recording  none: only teams of at most 64 agents are recorded\n"),
        "{output:?}"
    );
}

/// Tabular runs have no checkpoints. A file with the name of a checkpoint in their directory is not
/// read.
#[test]
fn a_tabular_run_cannot_be_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(run_bipolar_chain(&path, 65, &[]).status.success());
    std::fs::remove_file(path.join("summary.json")).unwrap();
    std::fs::create_dir(path.join("checkpoint")).unwrap();
    std::fs::write(path.join("checkpoint/state.bin"), "of another run").unwrap();
    let resumed = run_bipolar_chain(&path, 65, &["--resume"]);
    assert_eq!(resumed.status.code(), Some(2));
    assert!(
        stderr(&resumed).contains("tabular runs have no checkpoints"),
        "{resumed:?}"
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_interrupts_a_tabular_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let mut command = command(&[
        "run",
        "scenarios/tabular/deep_sea.ron",
        "--set",
        "agents.count=4",
        "--set",
        "episodes=100000",
        "--out",
        path.to_str().unwrap(),
    ]);
    let mut child = command
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let recording = path.join("run.rrd.part");
    wait_until("the run has begun", || {
        assert_eq!(child.try_wait().unwrap(), None, "the run ended early");
        recording.is_file()
    });
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    let errors = stderr(&output);
    assert_eq!(output.status.code(), Some(130), "{errors}");
    assert!(errors.contains("error: interrupted after "), "{errors}");
    assert!(
        errors.ends_with("this run cannot be resumed, start it again\n"),
        "{errors}"
    );
}

#[test]
fn check_accepts_the_scenario_that_a_tabular_run_stores() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(run_bipolar_chain(&path, 20, &[]).status.success());
    let checked = seedbed(&["check", path.join("scenario.ron").to_str().unwrap()]);
    assert!(
        stdout(&checked)
            .ends_with("tabular scenario with 20 agents in BipolarChain, SeedSampling\n"),
        "{}",
        stdout(&checked)
    );
}
