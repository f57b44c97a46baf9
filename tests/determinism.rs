//! The same scenario and seed give the same bits: whatever the threads, recorded or not, killed and resumed or not.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn seedbed(folder: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_seedbed"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["run", "scenarios/cartpole.ron", "--quiet", "--out"]).arg(folder);
    command.args(more).stderr(Stdio::null());
    command
}

fn finish(mut command: Command) {
    assert!(command.status().expect("the binary runs").success());
}

/// Everything that must not depend on how a run was run.
fn results(folder: &Path) -> Vec<Vec<u8>> {
    let names = ["episodes.csv", "rounds.csv", "policies.safetensors", "summary.json"];
    names.map(|name| std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))).to_vec()
}

fn folders() -> (tempfile::TempDir, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    (folder, a, b)
}

const SHORT: [&str; 4] = ["--set", "stop=Episodes(30)", "--set", "agents.count=5"];

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let (_guard, one, three) = folders();
    finish(seedbed(&one, &[&SHORT[..], &["--threads", "1"]].concat()));
    finish(seedbed(&three, &[&SHORT[..], &["--threads", "3"]].concat()));
    assert_eq!(results(&one), results(&three));
}

#[test]
fn recording_changes_nothing() {
    let (_guard, with, without) = folders();
    finish(seedbed(&with, &SHORT));
    finish(seedbed(&without, &[&SHORT[..], &["--no-recording"]].concat()));
    assert_eq!(results(&with), results(&without));
}

#[test]
fn another_seed_gives_another_run() {
    let (_guard, zero, one) = folders();
    finish(seedbed(&zero, &[&SHORT[..], &["--no-recording"]].concat()));
    finish(seedbed(&one, &[&SHORT[..], &["--no-recording", "--seed", "1"]].concat()));
    assert_ne!(results(&zero), results(&one));
}

/// Kills a run between checkpoints, as often as it takes to have some rounds behind the newest one.
#[test]
fn a_killed_run_resumes_to_the_same_bits() {
    let (_guard, whole, killed) = folders();
    let long = ["--set", "stop=Episodes(120)", "--set", "checkpoint_every=20"];
    finish(seedbed(&whole, &long));

    let mut child = seedbed(&killed, &long).spawn().unwrap();
    wait_for(&mut child, &killed.join("checkpoint/state.bin"));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!killed.join("summary.json").exists(), "killed before its end");
    finish(seedbed(&killed, &[&long[..], &["--resume"]].concat()));

    assert_eq!(results(&whole), results(&killed));
    assert!(killed.join("run.rrd").exists() && !killed.join("run.rrd.part").exists());
}

/// Resuming as another run is refused, resuming to a later end is not.
#[test]
fn only_the_same_run_resumes() {
    let (_guard, folder, _) = folders();
    let long = ["--set", "stop=Episodes(100000)", "--set", "checkpoint_every=1", "--no-recording"];
    let mut child = seedbed(&folder, &long).spawn().unwrap();
    wait_for(&mut child, &folder.join("checkpoint/state.bin"));
    child.kill().unwrap();
    child.wait().unwrap();

    let other = seedbed(&folder, &["--no-recording", "--resume", "--set", "algorithm.discount=0.9"]).status().unwrap();
    assert_eq!(other.code(), Some(2));
    finish(seedbed(&folder, &["--no-recording", "--resume", "--set", "checkpoint_every=1", "--set", "stop=Episodes(1)"]));
}

fn wait_for(child: &mut Child, file: &Path) {
    let patience = Instant::now() + Duration::from_mins(1);
    while !file.exists() {
        assert!(child.try_wait().unwrap().is_none(), "the run ended before its first checkpoint");
        assert!(Instant::now() < patience, "no checkpoint within a minute");
        std::thread::sleep(Duration::from_millis(1));
    }
}
