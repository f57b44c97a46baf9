//! The same scenario and seed give the same bits: whatever the threads, recorded or not, killed and resumed or not.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn seedbed(folder: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_seedbed"));
    command
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["run", "scenarios/cartpole.ron", "--quiet", "--out"])
        .arg(folder);
    command.args(more).stderr(Stdio::null());
    command
}

fn finish(mut command: Command) {
    assert!(command.status().expect("the binary runs").success());
}

/// Everything that must not depend on how a run was run.
fn results(folder: &Path) -> Vec<Vec<u8>> {
    let names = [
        "episodes.csv",
        "rounds.csv",
        "policies.safetensors",
        "summary.json",
    ];
    names
        .map(|name| {
            std::fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
        })
        .to_vec()
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
    finish(seedbed(
        &without,
        &[&SHORT[..], &["--no-recording"]].concat(),
    ));
    assert_eq!(results(&with), results(&without));
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
        finish(seedbed(
            &with,
            &[
                &common[..],
                &["--set", "recording.axes=[Observations, Advantage()]"],
            ]
            .concat(),
        ));
        finish(seedbed(&without, &common));
        assert_eq!(results(&with), results(&without));
    }
}

#[test]
fn another_seed_gives_another_run() {
    let (_guard, zero, one) = folders();
    finish(seedbed(&zero, &[&SHORT[..], &["--no-recording"]].concat()));
    finish(seedbed(
        &one,
        &[&SHORT[..], &["--no-recording", "--seed", "1"]].concat(),
    ));
    assert_ne!(results(&zero), results(&one));
}

#[test]
fn asynchronous_agents_do_not_wait_for_threads_either() {
    let (_guard, one, three) = folders();
    let asynchronous = [&SHORT[..], &["--set", ASYNCHRONOUS]].concat();
    finish(seedbed(
        &one,
        &[&asynchronous[..], &["--threads", "1"]].concat(),
    ));
    finish(seedbed(
        &three,
        &[&asynchronous[..], &["--threads", "3"]].concat(),
    ));
    assert_eq!(results(&one), results(&three));
}

#[test]
fn curiosity_does_not_depend_on_threads() {
    let (_guard, one, three) = folders();
    let curious = [&SHORT[..], &["--set", "algorithm.bonus=Vime(seeds: Shift)"]].concat();
    finish(seedbed(&one, &[&curious[..], &["--threads", "1"]].concat()));
    finish(seedbed(
        &three,
        &[&curious[..], &["--threads", "3"]].concat(),
    ));
    assert_eq!(results(&one), results(&three));
}

/// A single agent has nobody to wait for, so both schedules are the same.
#[test]
fn alone_an_asynchronous_agent_is_a_synchronous_one() {
    let (_guard, waiting, hurried) = folders();
    let alone = ["--set", "stop=Episodes(30)", "--set", "agents.count=1"];
    finish(seedbed(&waiting, &alone));
    finish(seedbed(
        &hurried,
        &[&alone[..], &["--set", ASYNCHRONOUS]].concat(),
    ));
    assert_eq!(results(&waiting), results(&hurried));
}

/// Models of several agents each that learn in the middle of episodes.
#[test]
fn an_ensemble_in_lockstep_does_not_depend_on_threads_or_recordings() {
    let (_guard, one, three) = folders();
    finish(seedbed(
        &one,
        &[&SHORT[..], &ENSEMBLE, &["--threads", "1", "--no-recording"]].concat(),
    ));
    finish(seedbed(
        &three,
        &[&SHORT[..], &ENSEMBLE, &["--threads", "3"]].concat(),
    ));
    assert_eq!(results(&one), results(&three));
}

/// There the checkpoint holds the team's transitions, target networks and curiosity.
#[test]
fn a_killed_ensemble_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&ENSEMBLE);
}

/// There models are drawn anew in each round.
#[test]
fn a_killed_bootstrapped_dqn_resumes_to_the_same_bits() {
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
fn a_killed_run_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&[]);
}

/// There the checkpoint finds episodes half played and updates half done.
#[test]
fn a_killed_asynchronous_run_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&[
        "--set",
        ASYNCHRONOUS,
        "--set",
        "algorithm.observations=Running",
    ]);
}

/// There the checkpoint holds a model of the dynamics and the transitions that it is trained on.
#[test]
fn a_killed_curious_run_resumes_to_the_same_bits() {
    is_resumed_to_the_same_bits(&[
        "--set",
        "algorithm.bonus=Vime(seeds: Scale, buffer: Kept(transitions: 5000))",
    ]);
}

/// Kills a run between checkpoints, as often as it takes to have some rounds behind the newest one.
fn is_resumed_to_the_same_bits(more: &[&str]) {
    let (_guard, whole, killed) = folders();
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
    finish(seedbed(&whole, &long));

    let mut child = seedbed(&killed, &long).spawn().unwrap();
    wait_for(&mut child, &killed.join("checkpoint/state.bin"));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(
        !killed.join("summary.json").exists(),
        "killed before its end"
    );
    finish(seedbed(&killed, &[&long[..], &["--resume"]].concat()));

    assert_eq!(results(&whole), results(&killed));
    assert!(killed.join("run.rrd").exists() && !killed.join("run.rrd.part").exists());
}

/// Resuming as another run is refused, resuming to a later end is not.
#[test]
fn only_the_same_run_resumes() {
    let (_guard, folder, _) = folders();
    let long = [
        "--set",
        "stop=Episodes(100000)",
        "--set",
        "checkpoint_every=5",
        "--no-recording",
    ];
    let mut child = seedbed(&folder, &long).spawn().unwrap();
    wait_for(&mut child, &folder.join("checkpoint/state.bin"));
    child.kill().unwrap();
    child.wait().unwrap();

    let other = seedbed(
        &folder,
        &[
            "--no-recording",
            "--resume",
            "--set",
            "algorithm.discount=0.9",
        ],
    )
    .status()
    .unwrap();
    assert_eq!(other.code(), Some(2));
    let before = std::fs::read_to_string(folder.join("rounds.csv"))
        .unwrap()
        .lines()
        .count()
        / 4;
    let resume = |episodes: usize| {
        let stop = format!("stop=Episodes({episodes})");
        seedbed(
            &folder,
            &[
                "--no-recording",
                "--resume",
                "--set",
                "checkpoint_every=5",
                "--set",
                &stop,
            ],
        )
        .status()
        .unwrap()
    };
    assert_eq!(resume(1).code(), Some(2), "an end that has passed");
    assert!(resume(before + 50).success());
    let stop = format!("stop: Episodes({})", before + 50);
    assert!(
        std::fs::read_to_string(folder.join("scenario.ron"))
            .unwrap()
            .contains(&stop),
        "the stored scenario tells the truth"
    );
}

fn wait_for(child: &mut Child, file: &Path) {
    let patience = Instant::now() + Duration::from_mins(1);
    while !file.exists() {
        assert!(
            child.try_wait().unwrap().is_none(),
            "the run ended before its first checkpoint"
        );
        assert!(Instant::now() < patience, "no checkpoint within a minute");
        std::thread::sleep(Duration::from_millis(1));
    }
}
