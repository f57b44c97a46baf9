//! `seedbed run`.

use std::path::Path;
use std::process::Command;

use crate::util::{REPOSITORY, names_in, seedbed, small_run, stderr, stdout, wait_until};

#[test]
fn a_run_writes_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let output = small_run(&path, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    let expected = [
        "SHA256SUMS",
        "checkpoint",
        "envs",
        "episodes.csv",
        "policies.safetensors",
        "rounds.csv",
        "run.rrd",
        "scenario.ron",
        "summary.json",
    ];
    assert_eq!(names_in(&path), expected);
    assert_tables_of_small_run(&path);
    assert_policies_of_small_run(&path);
    let printed = stdout(&output);
    for word in [
        "finished",
        "solved",
        "return",
        "coverage",
        "results",
        "recording",
    ] {
        assert!(printed.contains(word), "{word} in {printed}");
    }
}

/// The limit is that of `ulimit -v`: 600,000 kB. The estimate for the large team is 64 bytes for each
/// parameter of 1000 agents, which have 2 × (4 · 4096 + 4096 + 4096² + 4096) + 4096 · 3 + 3 parameters,
/// and 0.4 MB per agent.
#[cfg(target_os = "linux")]
#[test]
fn a_run_that_does_not_fit_in_memory_is_refused_before_it_starts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = |arguments: &str| {
        let program = env!("CARGO_BIN_EXE_seedbed");
        let command = format!(
            "ulimit -v 600000; {program} run cartpole --quiet --no-recording --threads 1 --out {} \
             --set 'stop=Episodes(1)' {arguments}",
            path.display()
        );
        let mut shell = Command::new("sh");
        shell
            .args(["-c", &command])
            .current_dir(REPOSITORY)
            .output()
            .unwrap()
    };
    let refused = run("--set agents.count=1000 --set 'algorithm.hidden=[4096, 4096]'");
    assert_eq!(refused.status.code(), Some(2));
    assert_eq!(
        stderr(&refused),
        "error: this run would need about 2151.8 GB, and `ulimit -v` allows 0.6 GB; reduce the number of \
         agents, `hidden` or `replay`, or start anyway with --ignore-memory\n"
    );
    assert!(!path.exists());
    // 10⁸ transitions of 45 bytes, with room for a fourth more.
    let refused = run(
        "--set agents.count=1 --set 'environment=\"pendulum\"' --set 'stop=Episodes(1000000)' \
                       --set 'algorithm=SeedSac(hidden: [8], replay: 100000000)'",
    );
    assert_eq!(refused.status.code(), Some(2));
    let message = stderr(&refused);
    let expected =
        "in `algorithm.SeedSac.replay`: this run would need about 5.6 GB, and `ulimit -v` allows";
    assert!(message.contains(expected), "{message}");
    // The estimate is rough: agents without networks need less than agents with networks.
    let team = "--set agents.count=1600 --set algorithm=Random";
    assert_eq!(run(team).status.code(), Some(2));
    let insisted = run(&format!("{team} --ignore-memory"));
    assert!(insisted.status.success(), "{}", stderr(&insisted));
}

/// The tables have one header and one row per agent and episode: 2 agents have 6 episodes each.
fn assert_tables_of_small_run(folder: &Path) {
    let episodes = std::fs::read_to_string(folder.join("episodes.csv")).unwrap();
    assert_eq!(
        episodes.lines().next(),
        Some(
            "agent,episode,round,env_steps,return,length,outcome,coverage,visitation_entropy,team_overlap,effective_agents"
        )
    );
    assert_eq!(episodes.lines().count(), 1 + 2 * 6);
    let rounds = std::fs::read_to_string(folder.join("rounds.csv")).unwrap();
    let header = "agent,round,gradient_steps,value_loss,policy_loss,ratio_deviation,largest_ratio,clipped_fraction,entropy,intrinsic_reward,prediction_error,bonus_agreement,coverage,\
                  visitation_entropy,visitation_evenness,team_coverage,team_overlap,effective_agents,recent_overlap,recent_effective_agents,first_coverage,new_coverage,\
                  new_coverage_rate";
    assert_eq!(rounds.lines().next(), Some(header));
    assert_eq!(rounds.lines().count(), 1 + 2 * 6);
    // Each agent learns from the trajectories of both, one after the other, with both networks.
    let gradient_steps = |row: &str| row.split(',').nth(2).unwrap().to_owned();
    assert!(
        rounds
            .lines()
            .skip(1)
            .all(|row| gradient_steps(row) == "4.0"),
        "{rounds}"
    );
}

fn assert_policies_of_small_run(folder: &Path) {
    let bytes = std::fs::read(folder.join("policies.safetensors")).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    assert_eq!(
        tensors
            .tensor("agent_1.policy.layer_0.weight")
            .unwrap()
            .shape(),
        [4, 32]
    );
    assert_eq!(
        tensors.names().len(),
        2 * (2 * 3 * 2 + 2),
        "agents × (networks × layers × (weight, bias) + moments)"
    );
    let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    assert_eq!(header.metadata().as_ref().unwrap()["task"], "cartpole");
}

/// The printed speed must include the first round, because this run has no other.
#[test]
fn a_run_of_one_round_prints_its_speed() {
    let folder = tempfile::tempdir().unwrap();
    let one_round = [
        "--no-recording",
        "--set",
        "schedule=Synchronous(episodes: 6)",
    ];
    let printed = stderr(&small_run(&folder.path().join("run"), &one_round));
    let line = printed
        .lines()
        .find(|line| line.starts_with("6/6 episodes"))
        .unwrap_or_else(|| panic!("{printed}"));
    let steps_per_second: u64 = line
        .rsplit(" · ")
        .next()
        .unwrap()
        .replace(" env steps/s", "")
        .replace(',', "")
        .parse()
        .unwrap();
    assert!(steps_per_second > 0, "{line}");
}

/// A run of the stored scenario has the same episodes, even if the task file has been changed since
/// the first run.
#[test]
fn the_stored_scenario_repeats_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (project, first, second) = (
        folder.path().join("project"),
        folder.path().join("first"),
        folder.path().join("second"),
    );
    std::fs::create_dir_all(project.join("envs")).unwrap();
    let task_text = std::fs::read_to_string("envs/cartpole.ron").unwrap();
    std::fs::write(project.join("envs/cartpole.ron"), &task_text).unwrap();
    let scenario = project.join("short.ron");
    std::fs::write(
        &scenario,
        r#"Scenario(environment: "cartpole", stop: Episodes(6))"#,
    )
    .unwrap();

    let run = |scenario: &Path, out: &Path| {
        let output = seedbed(&[
            "run",
            scenario.to_str().unwrap(),
            "--no-recording",
            "--out",
            out.to_str().unwrap(),
        ]);
        assert!(output.status.success(), "{}", stderr(&output));
    };
    run(&scenario, &first);
    std::fs::write(
        project.join("envs/cartpole.ron"),
        task_text.replace("mass: 0.1", "mass: 0.3"),
    )
    .unwrap();
    run(&first.join("scenario.ron"), &second);
    let read_episodes =
        |folder: &Path| std::fs::read_to_string(folder.join("episodes.csv")).unwrap();
    assert_eq!(read_episodes(&first), read_episodes(&second));
    run(&scenario, &folder.path().join("third"));
    assert_ne!(
        read_episodes(&first),
        read_episodes(&folder.path().join("third")),
        "the original scenario must use the changed task file"
    );
}

#[test]
fn a_finished_run_is_replaced_only_with_overwrite() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(
        small_run(&path, &["--no-recording", "--quiet"])
            .status
            .success()
    );
    let before = std::fs::read(path.join("episodes.csv")).unwrap();

    let refused = small_run(&path, &["--no-recording", "--seed", "1"]);
    assert_eq!(refused.status.code(), Some(2));
    let expected = format!(
        "error: {} contains a finished run; choose another --out to keep both, or --overwrite to replace it\n",
        path.display()
    );
    assert_eq!(stderr(&refused), expected);
    assert_eq!(std::fs::read(path.join("episodes.csv")).unwrap(), before);

    let resumed = small_run(&path, &["--resume"]);
    assert_eq!(resumed.status.code(), Some(2));
    assert!(
        stderr(&resumed).contains("is finished; there is nothing to resume"),
        "{}",
        stderr(&resumed)
    );

    assert!(
        small_run(&path, &["--no-recording", "--seed", "1", "--overwrite"])
            .status
            .success()
    );
    assert_ne!(std::fs::read(path.join("episodes.csv")).unwrap(), before);
}

#[test]
fn a_directory_with_other_files_is_not_touched() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("thesis.tex"), "precious").unwrap();
    for extra_arguments in [&[][..], &["--overwrite"], &["--resume"]] {
        let refused = small_run(folder.path(), extra_arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(
            stderr(&refused).contains("is not empty"),
            "{}",
            stderr(&refused)
        );
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn an_override_of_an_unknown_field_is_explained() {
    let output = seedbed(&[
        "run",
        "scenarios/cartpole.ron",
        "--set",
        "algorithm.dicount=0.9",
    ]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output)
            .starts_with("error: --set algorithm.dicount=0.9: in `algorithm.dicount`: there is no field `dicount` here")
    );
    assert!(
        stderr(&output).ends_with("  = help: did you mean `discount`?\n"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn a_file_in_place_of_the_parent_directory_is_one_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "not a directory").unwrap();
    let output = small_run(&file.join("run"), &[]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert_eq!(
        stderr(&output).matches("error:").count(),
        1,
        "{}",
        stderr(&output)
    );
}

#[test]
fn non_finite_parameters_end_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let exploding = [
        "--set",
        "agents.seeds=Normal(sigma: 1e30)",
        "--no-recording",
    ];
    let output = small_run(&path, &exploding);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("non-finite network parameters (agent"),
        "{}",
        stderr(&output)
    );
    assert!(!path.join("summary.json").exists());
}

#[test]
fn a_non_finite_reward_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("envs")).unwrap();
    let task_text = std::fs::read_to_string("envs/cartpole.ron")
        .unwrap()
        .replace("reward: \"1\"", "reward: \"1 / (x - x)\"");
    std::fs::write(folder.path().join("envs/absurd.ron"), task_text).unwrap();
    let scenario = folder.path().join("absurd.ron");
    std::fs::write(&scenario, r#"Scenario(environment: "absurd")"#).unwrap();
    let out = folder.path().join("run");
    let output = seedbed(&[
        "run",
        scenario.to_str().unwrap(),
        "--no-recording",
        "--out",
        out.to_str().unwrap(),
    ]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stderr(&output).contains(
            "non-finite reward (agent 0, episode 0, step 0): inf, after the observation "
        ),
        "{}",
        stderr(&output)
    );
}

/// `log` of a number below 0 is not a number: the reward is finite until agents have learned to play so
/// long that the cart leaves the middle.
/// The state before is kept, although no checkpoint was due, with the bits of a run that ends there.
#[test]
fn the_round_before_a_number_that_is_not_finite_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let task = std::fs::read_to_string("envs/cartpole.ron").unwrap();
    let task = task.replace("reward: \"1\"", "reward: \"1 + 0.001 * log(1 - abs(x))\"");
    std::fs::write(folder.path().join("absurd.ron"), &task).unwrap();
    std::fs::write(
        folder.path().join("scenario_of_it.ron"),
        r#"Scenario(environment: "absurd.ron", agents: (count: 2), checkpoint_every: 100000)"#,
    )
    .unwrap();
    let run = |extra: &[&str]| {
        let scenario = path("scenario_of_it.ron");
        seedbed(
            &[
                &["run", &scenario, "--no-recording", "--threads", "1"],
                extra,
            ]
            .concat(),
        )
    };
    let output = run(&["--out", &path("failed")]);
    let errors = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    let line = task
        .lines()
        .position(|line| line.contains("reward:"))
        .unwrap()
        + 1;
    let place = format!(
        "check `reward` in {}/envs/absurd.ron:{line}:13: \"1 + 0.001 * log(1 - abs(x))\"\n",
        path("failed")
    );
    assert!(
        errors.contains("error: non-finite reward (agent "),
        "{errors}"
    );
    assert!(
        errors.contains("): NaN, after the observation x = "),
        "{errors}"
    );
    assert!(errors.contains(&place), "{errors}");
    assert!(errors.contains("seedbed replay "), "{errors}");
    let episodes = std::fs::read_to_string(folder.path().join("failed/episodes.csv")).unwrap();
    let rounds = (episodes.lines().count() - 1) / 2;
    assert!(rounds > 0, "{errors}");
    let stop = format!("stop=Episodes({rounds})");
    let output = run(&["--out", &path("short"), "--set", &stop]);
    assert!(output.status.success(), "{}", stderr(&output));
    let evaluations = ["failed", "short"].map(|name| seedbed(&["evaluate", &path(name)]));
    let [of_failed, of_short] = evaluations.each_ref().map(crate::util::stdout);
    assert!(of_failed.contains("mean"), "{}", stderr(&evaluations[0]));
    assert_eq!(of_failed, of_short);
}

/// Agents have nothing to learn from if all returns are the same.
#[test]
fn a_run_without_a_signal_says_what_to_read() {
    let folder = tempfile::tempdir().unwrap();
    let task = std::fs::read_to_string("envs/cartpole.ron").unwrap();
    for (reward, hint) in [
        (
            "0",
            "note       all 12 returns are 0: agents had nothing to learn from, except bonuses if they have any; the page docs/learning_problems.md says what to change, such as a bonus for exploration\n",
        ),
        ("1", ""),
    ] {
        let text = task.replace("reward: \"1\"", &format!("reward: \"{reward}\""));
        let (path, out) = (folder.path().join("mine.ron"), folder.path().join(reward));
        std::fs::write(&path, text).unwrap();
        let environment = format!("environment={}", path.display());
        let output = small_run(&out, &["--no-recording", "--set", &environment]);
        let printed = crate::util::stdout(&output);
        assert_eq!(printed.contains("note "), !hint.is_empty(), "{printed}");
        assert!(printed.contains(hint), "{printed}");
    }
}

/// What killed processes left is removed when the folder is locked again.
#[test]
fn files_of_killed_processes_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(small_run(&path, &["--no-recording"]).status.success());
    std::fs::remove_file(path.join("summary.json")).unwrap();
    let abandoned = [
        "checkpoint/state.bin.a1B2c3.part",
        "checkpoint/previous.bin.a1B2c3.part",
        "summary.json.xxxxxx.part",
        "SHA256SUMS.123456.part",
        "policies.safetensors.abcdef.part",
        "envs/cartpole.ron.abcdef.part",
    ];
    let kept = ["notes.txt.abcdef.part", "thesis.part"];
    for name in abandoned.iter().chain(&kept) {
        std::fs::write(path.join(name), "").unwrap();
    }
    let output = small_run(
        &path,
        &["--no-recording", "--resume", "--set", "stop=Episodes(8)"],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    for name in abandoned {
        assert!(!path.join(name).exists(), "{name}");
    }
    for name in kept {
        assert!(path.join(name).exists(), "{name}");
    }
}

#[test]
fn only_one_run_at_a_time_writes_to_a_directory() {
    let folder = tempfile::tempdir().unwrap();
    let lock = seedbed::run::folder::RunFolder::new(folder.path().join("run"))
        .lock()
        .unwrap();
    let output = small_run(&folder.path().join("run"), &["--overwrite"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("another seedbed process is writing to"),
        "{}",
        stderr(&output)
    );
    drop(lock);
    // A process that another test is starting at this moment may have inherited the lock.
    wait_until("a run starts after the lock is released", || {
        small_run(&folder.path().join("run"), &["--no-recording"])
            .status
            .success()
    });
}

#[test]
fn invalid_settings_are_refused() {
    for (setting, expected) in [
        (
            "algorithm.policy_loss=SimplePg",
            "`SimplePg` is correct only with",
        ),
        ("algorithm.hidden=[]", "has no layer"),
        (
            "stop=Solved(return: 195, window: 25, at_most: 10)",
            "expected a window of at most the 10 episodes",
        ),
        (
            "recording.scene.agents=[0, 9]",
            "expected an agent from 0 to 3",
        ),
        ("recording.scene.agents=[1, 1]", "duplicate agent 1"),
        ("recording.scene.agents=[]", "expected at least one agent"),
        (
            "recording.scene.every=0",
            "expected a whole number from 1 to",
        ),
        (
            "agents.count=4000000000",
            "expected a whole number from 1 to 10000",
        ),
        (
            "algorithm.discount=1e-300",
            "does not fit into a number of single precision",
        ),
    ] {
        let output = seedbed(&["run", "scenarios/cartpole.ron", "--set", setting]);
        assert_eq!(
            output.status.code(),
            Some(2),
            "{setting}: {}",
            stderr(&output)
        );
        assert!(
            stderr(&output).contains(expected),
            "{setting}: {}",
            stderr(&output)
        );
    }
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    let command = format!("{} list | head -1", env!("CARGO_BIN_EXE_seedbed"));
    let output = Command::new("sh")
        .args(["-c", &command])
        .current_dir(REPOSITORY)
        .output()
        .unwrap();
    assert_eq!(stderr(&output), "");
    assert!(stdout(&output).starts_with("Environments ("), "{output:?}");
}

/// A wheel whose moment of inertia is far too small for its motor: 1 N m / 1e-9 kg m² × 0.02 s are 2e7
/// rad/s, and one turn per substep of 5 ms is 1257 rad/s.
const SPINNING: &str = r#"Environment(
    description: "A wheel.", gravity: (0.0, 0.0), control_step: 0.02, time_limit: 20,
    bodies: [(name: "wheel", mass: 1.0, inertia: 1e-9)],
    joints: [(name: "axle", parent: "world", child: "wheel", type: Hinge())],
    actuators: [(name: "torque", type: JointForce("axle"), control: Discrete([-1.0, 1.0]))],
    sensors: [(name: "angle", type: JointPosition("axle"))],
    observations: [(name: "side", value: "cos(angle)", range: (-1.0, 1.0))],
    reward: "side",
)"#;

#[test]
fn physics_beyond_its_range_is_reported_once_and_kept_in_the_summary() {
    let folder = tempfile::tempdir().unwrap();
    let task = folder.path().join("wheel.ron");
    std::fs::write(&task, SPINNING).unwrap();
    let scenario = folder.path().join("spin.ron");
    let text = r#"Scenario(environment: "wheel.ron", agents: (count: 2), algorithm: Random, stop: Episodes(3))"#;
    std::fs::write(&scenario, text).unwrap();
    let out = folder.path().join("run");
    let [task, scenario, out] = [&task, &scenario, &out].map(|path| path.to_str().unwrap());
    let run = seedbed(&["run", scenario, "--out", out, "--no-recording", "--quiet"]);
    assert!(run.status.success(), "{}", stderr(&run));
    let begin = "agent 0, episode 0, step 1: the velocity of `axle` is ";
    let end = "2.0e7 rad/s, more than 1256.6371 rad/s: the physics cannot compute it; check masses, inertias, \
               stiffness, gears and `control_step`, or raise `solver.iterations`";
    let printed = stderr(&run);
    assert!(
        printed.starts_with(&format!("warning: {begin}")) && printed.contains(end),
        "{printed}"
    );
    assert_eq!(printed.matches("warning").count(), 1, "{printed}");
    let summary = std::fs::read_to_string(Path::new(out).join("summary.json")).unwrap();
    assert!(
        summary.contains(&format!("\"physics_warning\": \"{begin}")),
        "{summary}"
    );
    let inspected = seedbed(&["inspect", out]);
    assert!(
        stderr(&inspected).starts_with(&format!("warning: {begin}")),
        "{}",
        stderr(&inspected)
    );
    for arguments in [vec!["check", task], vec!["check", scenario]] {
        let printed = stdout(&seedbed(&arguments));
        let found =
            "with all actions at their minimum, in step 1, the velocity of `axle` is -2.0e7 rad/s";
        assert!(printed.contains(found), "{printed}");
    }
}

/// Pictures of the former run go; files with names of users stay, and are named.
#[test]
fn a_run_that_is_overwritten_takes_its_pictures_along() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(small_run(&path, &[]).status.success());
    let files = names_in(&path);
    let pictures = [
        "plot.svg",
        "film.gif",
        "explore.html",
        "run.svg",
        "run.html",
        "replay.svg",
    ];
    for name in pictures.iter().chain(&["mine.png", "notes.txt"]) {
        std::fs::write(path.join(name), "of the former run").unwrap();
    }
    let output = small_run(&path, &["--overwrite", "--quiet"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(
        stderr(&output),
        format!(
            "warning: kept in {}, and not of this run: mine.png, notes.txt\n",
            path.display()
        )
    );
    let mut expected = [files, vec!["mine.png".to_owned(), "notes.txt".to_owned()]].concat();
    expected.sort();
    assert_eq!(names_in(&path), expected);
}
