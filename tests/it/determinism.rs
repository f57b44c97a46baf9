//! The same scenario and seed give the same bits: whatever the threads, recorded or not, crashed and
//! resumed or not.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::util::{RESULT_FILES, assert_same_results, crash, differing_results, run_command};

/// The command `seedbed run scenarios/cartpole.ron`, which prints nothing.
fn silent(folder: &Path, more: &[&str]) -> Command {
    let mut command = run_command(folder, &[&["--quiet"], more].concat());
    command.stderr(Stdio::null());
    command
}

/// Runs to the end.
fn finish(folder: &Path, more: &[&str]) {
    let status = silent(folder, more).status().expect("the binary runs");
    assert!(status.success(), "{more:?}: {status}");
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
    finish(&one, &[&SHORT[..], &["--threads", "1"]].concat());
    finish(&three, &[&SHORT[..], &["--threads", "3"]].concat());
    assert_same_results(&one, &three);
}

#[test]
fn recording_changes_nothing() {
    let (_guard, with, without) = folders();
    finish(&with, &SHORT);
    finish(&without, &[&SHORT[..], &["--no-recording"]].concat());
    assert_same_results(&with, &without);
}

#[test]
fn advantages_on_record_change_nothing() {
    for schedule in ["schedule=Synchronous(episodes: 2)", ASYNCHRONOUS] {
        let (_guard, with, without) = folders();
        let common = [
            &SHORT[..],
            &[
                "--set",
                "algorithm.standardise=PerTrajectory",
                "--set",
                schedule,
            ],
        ]
        .concat();
        finish(
            &with,
            &[
                &common[..],
                &["--set", "recording.axes=[Observations, Advantage()]"],
            ]
            .concat(),
        );
        finish(&without, &common);
        assert_same_results(&with, &without);
    }
}

#[test]
fn another_seed_gives_another_run() {
    let (_guard, zero, one) = folders();
    finish(&zero, &[&SHORT[..], &["--no-recording"]].concat());
    finish(
        &one,
        &[&SHORT[..], &["--no-recording", "--seed", "1"]].concat(),
    );
    assert_eq!(differing_results(&zero, &one), RESULT_FILES);
}

#[test]
fn asynchronous_agents_do_not_wait_for_threads_either() {
    let (_guard, one, three) = folders();
    let asynchronous = [&SHORT[..], &["--set", ASYNCHRONOUS]].concat();
    finish(&one, &[&asynchronous[..], &["--threads", "1"]].concat());
    finish(&three, &[&asynchronous[..], &["--threads", "3"]].concat());
    assert_same_results(&one, &three);
}

#[test]
fn curiosity_does_not_depend_on_threads() {
    let (_guard, one, three) = folders();
    let curious = [&SHORT[..], &["--set", "algorithm.bonus=Vime(seeds: Shift)"]].concat();
    finish(&one, &[&curious[..], &["--threads", "1"]].concat());
    finish(&three, &[&curious[..], &["--threads", "3"]].concat());
    assert_same_results(&one, &three);
}

/// A single agent has nobody to wait for, so both schedules are the same.
#[test]
fn alone_an_asynchronous_agent_is_a_synchronous_one() {
    let (_guard, waiting, hurried) = folders();
    let alone = ["--set", "stop=Episodes(30)", "--set", "agents.count=1"];
    finish(&waiting, &alone);
    finish(&hurried, &[&alone[..], &["--set", ASYNCHRONOUS]].concat());
    assert_same_results(&waiting, &hurried);
}

/// Models of several agents each that learn in the middle of episodes.
#[test]
fn an_ensemble_in_lockstep_does_not_depend_on_threads_or_recordings() {
    let (_guard, one, three) = folders();
    finish(
        &one,
        &[&SHORT[..], &ENSEMBLE, &["--threads", "1", "--no-recording"]].concat(),
    );
    finish(
        &three,
        &[&SHORT[..], &ENSEMBLE, &["--threads", "3"]].concat(),
    );
    assert_same_results(&one, &three);
}

/// There the checkpoint holds the team's transitions, target networks and curiosity.
#[test]
fn a_crashed_ensemble_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&ENSEMBLE);
}

/// There models are drawn again in each round.
#[test]
fn a_crashed_bootstrapped_dqn_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&[
        "--set",
        "algorithm=BootstrappedDqn(models: 3, learning: (observations: Running, replay: 3000))",
        "--set",
        "schedule=Lockstep(learn_every: 2)",
    ]);
}

const ENSEMBLE: [&str; 4] = [
    "--set",
    "algorithm=SeedTd(models: Ensemble(most: 2), bonus: Rnd(minibatches: 5))",
    "--set",
    "schedule=Lockstep(learn_every: 4)",
];

const ASYNCHRONOUS: &str = "schedule=Asynchronous(training: (env_steps: 15))";

#[test]
fn a_crashed_run_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&[]);
}

/// There the checkpoint finds episodes half played and updates half done.
#[test]
fn a_crashed_asynchronous_run_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&[
        "--set",
        ASYNCHRONOUS,
        "--set",
        "algorithm.observations=Running",
    ]);
}

/// There the checkpoint holds a model of the dynamics and the transitions that it is trained on.
#[test]
fn a_crashed_curious_run_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&[
        "--set",
        "algorithm.bonus=Vime(seeds: Scale, buffer: Kept(transitions: 5000))",
    ]);
}

/// Crashes a run ten rounds after a checkpoint, and resumes it.
fn is_resumed_to_the_same_bits(more: &[&str]) {
    let (_guard, whole, crashed) = folders();
    let long = [
        &[
            "--set",
            "stop=Episodes(120)",
            "--set",
            "checkpoint_every=20",
        ],
        more,
    ]
    .concat();
    finish(&whole, &long);

    crash(silent(
        &crashed,
        &[&long[..], &["--abort-after-rounds", "50"]].concat(),
    ));
    assert!(crashed.join("checkpoint/state.bin").exists());
    assert!(!crashed.join("summary.json").exists());
    finish(&crashed, &[&long[..], &["--resume"]].concat());

    assert_same_results(&whole, &crashed);
    assert!(crashed.join("run.rrd").exists() && !crashed.join("run.rrd.part").exists());
}

/// Resuming as another run is refused, resuming to a later end is not.
#[test]
fn only_the_same_run_resumes() {
    let (_guard, folder, _) = folders();
    let setting = ["--no-recording", "--set", "checkpoint_every=5"];
    let aborted = ["--set", "stop=Episodes(30)", "--abort-after-rounds", "12"];
    crash(silent(&folder, &[&setting[..], &aborted].concat()));

    let resume = |more: &[&str]| {
        silent(&folder, &[&setting[..], &["--resume"], more].concat())
            .status()
            .unwrap()
    };
    let other = resume(&["--set", "algorithm.discount=0.9"]);
    assert_eq!(other.code(), Some(2), "another run");
    let passed = resume(&["--set", "stop=Episodes(9)"]);
    assert_eq!(passed.code(), Some(2), "the checkpoint has 10 episodes");
    assert!(resume(&["--set", "stop=Episodes(40)"]).success());
    let stored = std::fs::read_to_string(folder.join("scenario.ron")).unwrap();
    assert!(
        stored.contains("stop: Episodes(40)"),
        "the stored scenario is that of the resumed run: {stored}"
    );
}

/// Before its first checkpoint a run cannot be resumed, and a new one may take its folder.
#[test]
fn a_run_that_crashed_at_once_begins_again() {
    let (_guard, folder, _) = folders();
    let short = [&SHORT[..], &["--no-recording"]].concat();
    crash(silent(
        &folder,
        &[&short[..], &["--abort-after-rounds", "3"]].concat(),
    ));
    let resumed = silent(&folder, &[&short[..], &["--resume"]].concat());
    assert_eq!({ resumed }.status().unwrap().code(), Some(2));
    finish(&folder, &short);
}
