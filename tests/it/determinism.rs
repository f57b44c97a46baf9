//! The same scenario and run seed give the same bits for any number of threads, with and without
//! recording, and after a crash.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::util::{
    RESULT_FILES, assert_same_results, crash, differing_results, run_command, stderr,
};

/// The command `seedbed run scenarios/cartpole.ron --quiet`, with standard error discarded.
fn quiet_run_command(folder: &Path, extra_arguments: &[&str]) -> Command {
    let mut command = run_command(folder, &[&["--quiet"], extra_arguments].concat());
    command.stderr(Stdio::null());
    command
}

/// Runs `scenarios/cartpole.ron` until it is finished.
fn run_to_end(folder: &Path, extra_arguments: &[&str]) {
    let status = quiet_run_command(folder, extra_arguments)
        .status()
        .expect("the binary runs");
    assert!(status.success(), "{extra_arguments:?}: {status}");
}

fn two_run_folders() -> (tempfile::TempDir, PathBuf, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    (folder, a, b)
}

const SHORT_RUN: [&str; 4] = ["--set", "stop=Episodes(30)", "--set", "agents.count=5"];

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let (_temporary, one, three) = two_run_folders();
    run_to_end(&one, &[&SHORT_RUN[..], &["--threads", "1"]].concat());
    run_to_end(&three, &[&SHORT_RUN[..], &["--threads", "3"]].concat());
    assert_same_results(&one, &three);
}

#[test]
fn results_do_not_depend_on_recording() {
    let (_temporary, with, without) = two_run_folders();
    run_to_end(&with, &SHORT_RUN);
    run_to_end(&without, &[&SHORT_RUN[..], &["--no-recording"]].concat());
    assert_same_results(&with, &without);
}

#[test]
fn results_do_not_depend_on_recording_advantages() {
    for schedule in ["schedule=Synchronous(episodes: 2)", ASYNCHRONOUS_OVERRIDE] {
        let (_temporary, with, without) = two_run_folders();
        let common = [
            &SHORT_RUN[..],
            &[
                "--set",
                "algorithm.standardize=PerTrajectory",
                "--set",
                schedule,
            ],
        ]
        .concat();
        run_to_end(
            &with,
            &[
                &common[..],
                &["--set", "recording.axes=[Observations, Advantage()]"],
            ]
            .concat(),
        );
        run_to_end(&without, &common);
        assert_same_results(&with, &without);
    }
}

#[test]
fn another_run_seed_gives_other_results() {
    let (_temporary, zero, one) = two_run_folders();
    run_to_end(&zero, &[&SHORT_RUN[..], &["--no-recording"]].concat());
    run_to_end(
        &one,
        &[&SHORT_RUN[..], &["--no-recording", "--seed", "1"]].concat(),
    );
    assert_eq!(differing_results(&zero, &one), RESULT_FILES);
}

#[test]
fn asynchronous_results_do_not_depend_on_the_number_of_threads() {
    let (_temporary, one, three) = two_run_folders();
    let asynchronous = [&SHORT_RUN[..], &["--set", ASYNCHRONOUS_OVERRIDE]].concat();
    run_to_end(&one, &[&asynchronous[..], &["--threads", "1"]].concat());
    run_to_end(&three, &[&asynchronous[..], &["--threads", "3"]].concat());
    assert_same_results(&one, &three);
}

#[test]
fn results_with_bonuses_do_not_depend_on_the_number_of_threads() {
    let (_temporary, one, three) = two_run_folders();
    let with_bonus = [
        &SHORT_RUN[..],
        &["--set", "algorithm.bonus=Vime(seeds: Shift)"],
    ]
    .concat();
    run_to_end(&one, &[&with_bonus[..], &["--threads", "1"]].concat());
    run_to_end(&three, &[&with_bonus[..], &["--threads", "3"]].concat());
    assert_same_results(&one, &three);
}

/// A single agent never waits for others, so the synchronous and the asynchronous schedule are the
/// same.
#[test]
fn one_agent_learns_the_same_with_both_schedules() {
    let (_temporary, synchronous, asynchronous) = two_run_folders();
    let one_agent = ["--set", "stop=Episodes(30)", "--set", "agents.count=1"];
    run_to_end(&synchronous, &one_agent);
    run_to_end(
        &asynchronous,
        &[&one_agent[..], &["--set", ASYNCHRONOUS_OVERRIDE]].concat(),
    );
    assert_same_results(&synchronous, &asynchronous);
}

/// Two models, each shared by several agents, that learn during episodes.
#[test]
fn ensemble_results_depend_on_neither_threads_nor_recording() {
    let (_temporary, one, three) = two_run_folders();
    run_to_end(
        &one,
        &[
            &SHORT_RUN[..],
            &ENSEMBLE_OVERRIDES,
            &["--threads", "1", "--no-recording"],
        ]
        .concat(),
    );
    run_to_end(
        &three,
        &[&SHORT_RUN[..], &ENSEMBLE_OVERRIDES, &["--threads", "3"]].concat(),
    );
    assert_same_results(&one, &three);
}

/// The checkpoint includes the replay buffer, the target networks and the bonus networks.
#[test]
fn a_crashed_ensemble_resumes_to_the_same_bits() {
    assert_resumed_run_gives_the_same_bits(&ENSEMBLE_OVERRIDES);
}

/// Agents draw a model at random in each round.
#[test]
fn a_crashed_bootstrapped_dqn_resumes_to_the_same_bits() {
    assert_resumed_run_gives_the_same_bits(&[
        "--set",
        "algorithm=BootstrappedDqn(models: 3, learning: (observations: Running, replay: 3000))",
        "--set",
        "schedule=Lockstep(learn_every: 2)",
    ]);
}

/// Agents draw an index in each round, and the network draws indices to learn with.
#[test]
fn a_crashed_hyper_agent_resumes_to_the_same_bits() {
    assert_resumed_run_gives_the_same_bits(&[
        "--set",
        "algorithm=HyperAgent(draw: EveryRound, learning: (observations: Running, replay: 3000))",
        "--set",
        "schedule=Lockstep(learn_every: 2)",
    ]);
}

/// Agents draw a model in each episode, and plan in it.
#[test]
fn a_crashed_team_of_planners_resumes_to_the_same_bits() {
    assert_resumed_run_gives_the_same_bits(&["--set", PLANNERS]);
}

#[test]
fn planners_give_the_same_bits_on_any_number_of_threads() {
    let (_temporary, one, three) = two_run_folders();
    for (out, threads) in [(&one, "1"), (&three, "3")] {
        let arguments = ["--set", PLANNERS, "--threads", threads, "--no-recording"];
        run_to_end(out, &[&SHORT_RUN[..], &arguments].concat());
    }
    assert_same_results(&one, &three);
}

/// Three learners whose draws depend on rounds, on their own steps and on the transitions of all agents.
#[test]
fn soft_actor_critics_depend_neither_on_threads_nor_on_a_crash() {
    let (_temporary, one, three) = two_run_folders();
    let short = ["--set", "stop=Episodes(8)", "--set", "agents.count=3"];
    for (out, threads) in [(&one, "1"), (&three, "3")] {
        let arguments = ["--threads", threads, "--no-recording"];
        run_to_end(out, &[&short[..], &SOFT_OVERRIDES, &arguments].concat());
    }
    assert_same_results(&one, &three);
    assert_resumed_run_gives_the_same_bits(&SOFT_OVERRIDES);
}

const SOFT_OVERRIDES: [&str; 6] = [
    "--set",
    "environment=\"pendulum\"",
    "--set",
    "algorithm=SeedSac(hidden: [8], minibatch: 8, critics: 3, n_step: 2, policy_every: 2, own_share: 0.5, prior_scale: 1, \
     layer_normalization: true, observations: Running, random_steps: 100, replay: 5000, bonus: Rnd(minibatches: 5))",
    "--set",
    "schedule=Lockstep(learn_every: 3)",
];

const PLANNERS: &str =
    "algorithm=SeedPsrl(draw: Fresh, horizon: 4, candidates: 16, elites: 4, minibatches: 20)";

const ENSEMBLE_OVERRIDES: [&str; 4] = [
    "--set",
    "algorithm=SeedTd(models: Ensemble(most: 2), bonus: Rnd(minibatches: 5))",
    "--set",
    "schedule=Lockstep(learn_every: 4)",
];

const ASYNCHRONOUS_OVERRIDE: &str = "schedule=Asynchronous(training: (env_steps: 15))";

#[test]
fn a_crashed_run_resumes_to_the_same_bits() {
    assert_resumed_run_gives_the_same_bits(&[]);
}

/// The checkpoint includes unfinished episodes and unfinished updates.
#[test]
fn a_crashed_asynchronous_run_resumes_to_the_same_bits() {
    assert_resumed_run_gives_the_same_bits(&[
        "--set",
        ASYNCHRONOUS_OVERRIDE,
        "--set",
        "algorithm.observations=Running",
    ]);
}

/// The checkpoint includes the state of noise in the middle of episodes.
#[test]
fn crashed_runs_with_correlated_noise_resume_to_the_same_bits() {
    for actions in ["Pink", "OrnsteinUhlenbeck(time: 0.3)"] {
        let actions = format!("algorithm.actions=Correlated(noise: {actions})");
        assert_resumed_run_gives_the_same_bits(&[
            "--set",
            ASYNCHRONOUS_OVERRIDE,
            "--set",
            &actions,
        ]);
    }
    let open_loop = "algorithm=OpenLoopNoise(noise: Pink)";
    assert_resumed_run_gives_the_same_bits(&["--set", ASYNCHRONOUS_OVERRIDE, "--set", open_loop]);
    let repeated = "algorithm=QLearning(exploration: EpsilonZGreedy(from: 1, to: 0.3, steps: 500))";
    let lockstep = "schedule=Lockstep(learn_every: 2)";
    assert_resumed_run_gives_the_same_bits(&["--set", repeated, "--set", lockstep]);
}

/// The checkpoint includes the dynamics model and the transitions on which it is trained.
#[test]
fn a_crashed_run_with_a_vime_bonus_resumes_to_the_same_bits() {
    assert_resumed_run_gives_the_same_bits(&[
        "--set",
        "algorithm.bonus=Vime(seeds: Scale, buffer: Kept(transitions: 5000))",
    ]);
}

/// The checkpoint includes the states that bonuses compare states with.
#[test]
fn a_crashed_run_with_an_entropy_bonus_resumes_to_the_same_bits() {
    for model in ["Shared", "Independent"] {
        let bonus = format!("algorithm.bonus=TeamEntropy(model: {model}, references: 100)");
        assert_resumed_run_gives_the_same_bits(&["--set", &bonus]);
    }
    assert_resumed_run_gives_the_same_bits(&[
        "--set",
        "algorithm=SeedTd(models: Ensemble(most: 2), bonus: TeamEntropy(references: 100))",
        "--set",
        "schedule=Lockstep(learn_every: 4)",
    ]);
}

/// The checkpoint includes the regions and their owners.
#[test]
fn a_crashed_run_that_divides_the_states_resumes_to_the_same_bits() {
    for model in ["Shared", "Independent"] {
        let bonus = format!("algorithm.bonus=Regions(model: {model}, regions: 20)");
        assert_resumed_run_gives_the_same_bits(&["--set", &bonus]);
    }
}

#[test]
fn a_crashed_run_of_a_leader_resumes_to_the_same_bits() {
    assert_resumed_run_gives_the_same_bits(&[
        "--set",
        "algorithm=LeaderFollowers(observations: Running)",
    ]);
    assert_resumed_run_gives_the_same_bits(&[
        "--set",
        "algorithm=LeaderFollowers(networks: Shared, bonus: Rnd())",
    ]);
}

/// Crashes a run ten rounds after a checkpoint, resumes it, and asserts that its results equal
/// those of an uninterrupted run.
fn assert_resumed_run_gives_the_same_bits(extra_arguments: &[&str]) {
    let (_temporary, uninterrupted, crashed) = two_run_folders();
    let long_run = [
        &[
            "--set",
            "stop=Episodes(120)",
            "--set",
            "checkpoint_every=20",
            "--set",
            "checkpoint_share=1",
        ],
        extra_arguments,
    ]
    .concat();
    run_to_end(&uninterrupted, &long_run);

    crash(quiet_run_command(
        &crashed,
        &[&long_run[..], &["--abort-after-rounds", "50"]].concat(),
    ));
    assert!(crashed.join("checkpoint/state.bin").exists());
    assert!(!crashed.join("summary.json").exists());
    run_to_end(&crashed, &[&long_run[..], &["--resume"]].concat());

    assert_same_results(&uninterrupted, &crashed);
    assert!(crashed.join("run.rrd").exists() && !crashed.join("run.rrd.part").exists());
}

/// A replay file that lacks a byte or has another one is refused. With the original file, the run
/// can be resumed.
#[test]
fn a_damaged_replay_file_is_refused() {
    let (_temporary, folder, _) = two_run_folders();
    let arguments = [
        &SHORT_RUN[..],
        &ENSEMBLE_OVERRIDES,
        &[
            "--no-recording",
            "--set",
            "checkpoint_every=5",
            "--set",
            "checkpoint_share=1",
        ],
    ]
    .concat();
    crash(quiet_run_command(
        &folder,
        &[&arguments[..], &["--abort-after-rounds", "12"]].concat(),
    ));
    let file = folder.join("checkpoint/replay-1.bin");
    let original = std::fs::read(&file).unwrap();
    let resume = [&["--quiet", "--resume"], &arguments[..]].concat();
    let refused_with = |bytes: &[u8], reason: &str| {
        std::fs::write(&file, bytes).unwrap();
        let output = run_command(&folder, &resume).output().unwrap();
        let expected = format!("checkpoint {}: {reason}", file.display());
        let printed = stderr(&output);
        assert!(
            !output.status.success() && printed.contains(&expected),
            "{printed}"
        );
    };
    refused_with(&original[1..], "is too short: it has ");
    let mut changed = original.clone();
    changed[original.len() / 2] ^= 1;
    refused_with(&changed, "is damaged: it has another checksum");
    std::fs::write(&file, &original).unwrap();
    run_to_end(&folder, &[&arguments[..], &["--resume"]].concat());
}

/// A run cannot be resumed with another discount or an end before its checkpoint. It can be resumed
/// with a later end.
#[test]
fn resume_refuses_another_scenario_and_an_earlier_end() {
    let (_temporary, folder, _) = two_run_folders();
    let common = [
        "--no-recording",
        "--set",
        "checkpoint_every=5",
        "--set",
        "checkpoint_share=1",
    ];
    let aborted = ["--set", "stop=Episodes(30)", "--abort-after-rounds", "12"];
    crash(quiet_run_command(
        &folder,
        &[&common[..], &aborted].concat(),
    ));

    let resume = |extra_arguments: &[&str]| {
        quiet_run_command(
            &folder,
            &[&common[..], &["--resume"], extra_arguments].concat(),
        )
        .status()
        .unwrap()
    };
    let other_scenario = resume(&["--set", "algorithm.discount=0.9"]);
    assert_eq!(other_scenario.code(), Some(2), "another discount");
    let shorter = resume(&["--set", "stop=Episodes(9)"]);
    assert_eq!(shorter.code(), Some(2), "the checkpoint has 10 episodes");
    assert!(resume(&["--set", "stop=Episodes(40)"]).success());
    let stored = std::fs::read_to_string(folder.join("scenario.ron")).unwrap();
    assert!(
        stored.contains("stop: Episodes(40)"),
        "resuming must store the new scenario: {stored}"
    );
}

/// A run that crashed before its first checkpoint cannot be resumed; a new run may use its folder.
#[test]
fn a_run_without_a_checkpoint_starts_again() {
    let (_temporary, folder, _) = two_run_folders();
    let short = [&SHORT_RUN[..], &["--no-recording"]].concat();
    crash(quiet_run_command(
        &folder,
        &[&short[..], &["--abort-after-rounds", "3"]].concat(),
    ));
    let resumed = quiet_run_command(&folder, &[&short[..], &["--resume"]].concat());
    assert_eq!({ resumed }.status().unwrap().code(), Some(2));
    run_to_end(&folder, &short);
}
