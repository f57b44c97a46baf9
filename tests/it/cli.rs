//! The command line: messages, exit statuses, and files that are written.

use std::path::Path;
use std::process::{Command, Output};

use super::util::{
    REPOSITORY, command, files_below, names_in, seedbed, small_run, stderr, stdout, wait_until,
};

#[test]
fn valid_files_pass() {
    let output = seedbed(&["check", "scenarios/cartpole.ron", "envs/cartpole.ron"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(
        stdout(&output),
        "ok: scenarios/cartpole.ron: scenario with 4 agents in `cartpole`; observations x, x_dot, theta, theta_dot; actions force (-10 or 10 N)\n\
         ok: envs/cartpole.ron: environment; observations x, x_dot, theta, theta_dot; actions force (-10 or 10 N)\n"
    );
}

#[test]
fn every_file_of_the_repository_passes() {
    let mut files = Vec::new();
    for folder in ["envs", "scenarios"] {
        files.extend(files_below(&Path::new(REPOSITORY).join(folder), "ron"));
    }
    let mut arguments = vec!["check"];
    arguments.extend(files.iter().map(|path| path.to_str().unwrap()));
    let output = seedbed(&arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let answers = stdout(&output);
    assert_eq!(answers.lines().count(), files.len(), "{answers}");
    for (file, answer) in files.iter().zip(answers.lines()) {
        assert!(
            answer.starts_with(&format!("ok: {}: ", file.display())),
            "{answer}"
        );
    }
    // One file of each kind, in case the files of a kind are no longer found.
    for known in [
        "/envs/cartpole.ron: environment",
        "/envs/deep_sea.ron: environment",
        "/scenarios/cartpole.ron: scenario",
        "/scenarios/tabular/deep_sea.ron: tabular scenario",
        "/scenarios/thesis/fig_6_4a.ron: study",
        "/scenarios/benchmark/deep_sea.ron: study",
    ] {
        assert!(answers.contains(known), "{known} in {answers}");
    }
}

/// Regrets are in `regret.csv` and `summary.json`; a second run into the same directory is refused,
/// and `--overwrite` repeats it to the bit.
#[test]
fn a_tabular_run_writes_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = |more: &[&str]| {
        let base = [
            "run",
            "scenarios/tabular/bipolar_chain.ron",
            "--set",
            "agents.count=20",
            "--out",
            path.to_str().unwrap(),
        ];
        seedbed(&[&base, more].concat())
    };
    let output = run(&[]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(
        stdout(&output).contains("regret     "),
        "{}",
        stdout(&output)
    );
    assert_eq!(
        names_in(&path),
        [
            "regret.csv",
            "run.rrd",
            "scenario.ron",
            "summary.json",
            "visits.csv"
        ]
    );
    let regret = std::fs::read_to_string(path.join("regret.csv")).unwrap();
    assert_eq!(
        regret.lines().next(),
        Some("agent,episode,begun,ended,length,return,regret")
    );
    assert_eq!(regret.lines().count(), 1 + 20);
    assert_eq!(run(&[]).status.code(), Some(2));
    assert!(run(&["--overwrite", "--threads", "1"]).status.success());
    assert_eq!(
        std::fs::read_to_string(path.join("regret.csv")).unwrap(),
        regret
    );
    let resolved = path.join("scenario.ron");
    let checked = seedbed(&["check", resolved.to_str().unwrap()]);
    assert!(
        stdout(&checked)
            .ends_with("tabular scenario with 20 agents in BipolarChain, SeedSampling\n"),
        "{}",
        stdout(&checked)
    );
}

/// Of 20 agents with one episode each: progress is printed per tenth of all episodes.
#[test]
fn a_tabular_run_prints_progress_and_results() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let output = seedbed(&[
        "run",
        "scenarios/tabular/bipolar_chain.ron",
        "--set",
        "agents.count=20",
        "--out",
        path.to_str().unwrap(),
    ]);
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

/// A team that is too large for a recording cannot be shown in a viewer, and a tabular run has no
/// checkpoint from which it could be resumed, not even that of another run.
#[test]
fn tabular_runs_without_recording_or_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = |more: &[&str]| {
        let base = [
            "run",
            "scenarios/tabular/bipolar_chain.ron",
            "--set",
            "agents.count=65",
            "--out",
            path.to_str().unwrap(),
        ];
        seedbed(&[&base, more].concat())
    };
    let served = run(&["--serve=0"]);
    assert_eq!(served.status.code(), Some(2));
    assert_eq!(
        stderr(&served),
        "error: cannot show scenarios/tabular/bipolar_chain.ron in a viewer: only teams of at most 64 agents are recorded\n"
    );
    let output = run(&[]);
    assert!(
        stdout(&output)
            .ends_with("recording  none: only teams of at most 64 agents are recorded\n"),
        "{output:?}"
    );
    std::fs::remove_file(path.join("summary.json")).unwrap();
    std::fs::create_dir(path.join("checkpoint")).unwrap();
    std::fs::write(path.join("checkpoint/state.bin"), "of another run").unwrap();
    let resumed = run(&["--resume"]);
    assert_eq!(resumed.status.code(), Some(2));
    assert!(
        stderr(&resumed).contains("tabular runs have no checkpoints"),
        "{resumed:?}"
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_tabular_run() {
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
    let interrupted = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(interrupted.unwrap().success());
    let output = child.wait_with_output().unwrap();
    let errors = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("error: interrupted after "), "{errors}");
    assert!(
        errors.ends_with("this run cannot be resumed, start it again\n"),
        "{errors}"
    );
}

#[test]
fn tabular_scenarios_are_compared_by_regret() {
    let files = [
        "scenarios/tabular/parallel_chains.ron",
        "scenarios/tabular/parallel_chains_ucrl.ron",
    ];
    let output = seedbed(
        &[
            &["bench"],
            files.as_slice(),
            &["--seeds", "5", "--set", "agents.count=10"],
        ]
        .concat(),
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(
        text.contains("| parallel_chains      |     10 |")
            && text.contains("Compared with parallel_chains, paired by run seed"),
        "{text}"
    );
    let mixed = seedbed(&["bench", files[0], "scenarios/cartpole.ron"]);
    assert_eq!(mixed.status.code(), Some(2));
    assert_eq!(
        stderr(&mixed),
        "error: cannot compare scenarios/tabular/parallel_chains.ron, which is measured by regret, with \
         scenarios/cartpole.ron, which is measured by episodes until solved\n"
    );
}

#[test]
fn a_run_writes_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let output = small_run(&path, &[]);
    assert!(output.status.success(), "{}", stderr(&output));
    let expected = [
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

    let episodes = std::fs::read_to_string(path.join("episodes.csv")).unwrap();
    assert_eq!(
        episodes.lines().next(),
        Some(
            "agent,episode,round,env_steps,return,length,outcome,coverage,visitation_entropy,team_overlap,effective_agents"
        )
    );
    assert_eq!(episodes.lines().count(), 1 + 2 * 6);
    let rounds = std::fs::read_to_string(path.join("rounds.csv")).unwrap();
    let header = "agent,round,value_loss,policy_loss,ratio_deviation,largest_ratio,clipped_fraction,entropy,intrinsic_reward,prediction_error,bonus_agreement,coverage,\
                  visitation_entropy,visitation_evenness,team_coverage,team_overlap,effective_agents";
    assert_eq!(rounds.lines().next(), Some(header));
    assert_eq!(rounds.lines().count(), 1 + 2 * 6);

    let weights = std::fs::read(path.join("policies.safetensors")).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&weights).unwrap();
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

/// The speed includes the first round, which here is the only one.
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
    let rate: u64 = line
        .rsplit(" · ")
        .next()
        .unwrap()
        .replace(" env steps/s", "")
        .replace(',', "")
        .parse()
        .unwrap();
    assert!(rate > 0, "{line}");
}

/// A run of the resolved scenario has the same episodes, even if the task's file was changed since.
#[test]
fn the_resolved_scenario_repeats_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (lab, first, second) = (
        folder.path().join("lab"),
        folder.path().join("first"),
        folder.path().join("second"),
    );
    std::fs::create_dir_all(lab.join("envs")).unwrap();
    let task = std::fs::read_to_string("envs/cartpole.ron").unwrap();
    std::fs::write(lab.join("envs/cartpole.ron"), &task).unwrap();
    let scenario = lab.join("short.ron");
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
        lab.join("envs/cartpole.ron"),
        task.replace("mass: 0.1", "mass: 0.3"),
    )
    .unwrap();
    run(&first.join("scenario.ron"), &second);
    let read = |folder: &Path| std::fs::read_to_string(folder.join("episodes.csv")).unwrap();
    assert_eq!(read(&first), read(&second));
    run(&scenario, &folder.path().join("third"));
    assert_ne!(
        read(&first),
        read(&folder.path().join("third")),
        "the other task does make a difference"
    );
}

#[test]
fn nothing_is_overwritten_without_overwrite() {
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
    for more in [&[][..], &["--overwrite"], &["--resume"]] {
        let refused = small_run(folder.path(), more);
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
fn overrides_are_explained() {
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
fn a_directory_that_cannot_be_written_is_one_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
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
fn list_prints_environments_scenarios_and_algorithms() {
    let output = seedbed(&["list"]);
    assert!(output.status.success());
    let printed = stdout(&output);
    for word in [
        "cartpole",
        "theta_dot",
        "scenarios/cartpole.ron",
        "SeedPg",
        "ratio_product_cap",
        "0.99",
        "Random",
    ] {
        assert!(printed.contains(word), "{word} in {printed}");
    }
}

/// Files are listed from where names are looked up: the working directory and its parents.
#[test]
fn list_searches_parent_directories() {
    let lab = tempfile::tempdir().unwrap();
    let (deep, lab) = (
        lab.path().join("notes/today"),
        lab.path().canonicalize().unwrap(),
    );
    std::fs::create_dir_all(&deep).unwrap();
    let list = |what| {
        let output = command(&["list", what])
            .current_dir(&deep)
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let nothing = list("environments");
    assert!(
        nothing.contains("no directory `envs` in ") && nothing.contains("notes/today"),
        "{nothing}"
    );
    assert!(list("scenarios").contains("no directory `scenarios` in "));

    std::fs::create_dir(lab.join("envs")).unwrap();
    std::fs::create_dir(lab.join("scenarios")).unwrap();
    std::fs::copy("envs/cartpole.ron", lab.join("envs/broom.ron")).unwrap();
    let lonely = r#"Scenario(environment: "broom", agents: (count: 1), stop: Episodes(1))"#;
    std::fs::write(lab.join("scenarios/lonely.ron"), lonely).unwrap();
    let found = list("environments");
    assert!(
        found.starts_with(&format!(
            "Environments ({})\n  broom\n",
            lab.join("envs/").display()
        )),
        "{found}"
    );
    std::fs::copy(
        lab.join("scenarios/lonely.ron"),
        lab.join("scenarios/alone.ron"),
    )
    .unwrap();
    let folder = lab.join("scenarios/").display().to_string();
    let words = "1 agent in broom, at most 1 episode each";
    let expected = format!(
        "Scenarios ({folder})\n  {folder}alone.ron  {words}\n  {folder}lonely.ron {words}\n\n"
    );
    assert_eq!(
        list("scenarios"),
        expected,
        "descriptions begin after the longest path"
    );
}

#[test]
fn preview_records_a_task_without_training() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new").join("look.rrd");
    let output = seedbed(&[
        "preview",
        "cartpole",
        "--episodes",
        "2",
        "--out",
        path.to_str().unwrap(),
    ]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(
        stdout(&output)
            .lines()
            .filter(|line| line.starts_with("episode "))
            .count(),
        2
    );
    assert!(path.metadata().unwrap().len() > 10_000);

    let mistyped = seedbed(&["preview", "cartpol"]);
    assert_eq!(mistyped.status.code(), Some(2));
    assert!(
        stderr(&mistyped).ends_with("  = help: did you mean `cartpole`?\n"),
        "{}",
        stderr(&mistyped)
    );
}

#[test]
fn non_finite_numbers_end_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let exploding = [
        "--set",
        "agents.seeds=Normal(sigma: 1e30)",
        "--no-recording",
    ];
    let output = small_run(&folder.path().join("learning"), &exploding);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("non-finite network parameters (agent"),
        "{}",
        stderr(&output)
    );
    assert!(!folder.path().join("learning/summary.json").exists());

    std::fs::create_dir(folder.path().join("envs")).unwrap();
    let task = std::fs::read_to_string("envs/cartpole.ron")
        .unwrap()
        .replace("reward: \"1\"", "reward: \"1 / (x - x)\"");
    std::fs::write(folder.path().join("envs/absurd.ron"), task).unwrap();
    let scenario = folder.path().join("absurd.ron");
    std::fs::write(&scenario, r#"Scenario(environment: "absurd")"#).unwrap();
    let out = folder.path().join("simulation");
    let output = seedbed(&[
        "run",
        scenario.to_str().unwrap(),
        "--no-recording",
        "--out",
        out.to_str().unwrap(),
    ]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("non-finite reward (agent 0, episode 0)"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn one_run_at_a_time_writes_to_a_directory() {
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
    // A process that another test is starting may have a copy of the lock for a moment.
    wait_until("a run that was broken off does not prevent another", || {
        small_run(&folder.path().join("run"), &["--no-recording"])
            .status
            .success()
    });
}

#[test]
fn contradicting_settings_are_refused() {
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

/// A trained policy keeps the pole up longer with greedy than with nearly random actions; the same run
/// seed plays the same episodes.
#[test]
fn a_run_is_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = path.to_str().unwrap();
    let trained = [
        "run",
        "scenarios/cartpole_16.ron",
        "--quiet",
        "--no-recording",
        "--out",
        run,
        "--set",
        "stop=Episodes(40)",
    ];
    assert!(seedbed(&trained).status.success());
    let team_mean = |more: &[&str]| -> f64 {
        let output = seedbed(&[&["evaluate", run, "--episodes", "5"], more].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        let printed = String::from_utf8(output.stdout).unwrap();
        assert_eq!(
            printed
                .lines()
                .filter(|line| line.starts_with("| "))
                .count(),
            1 + 16 + 1,
            "{printed}"
        );
        let team = printed
            .lines()
            .find(|line| line.starts_with("| team"))
            .unwrap();
        team.split('|').nth(2).unwrap().trim().parse().unwrap()
    };
    let (greedy, random) = (
        team_mean(&["--actions", "greedy"]),
        team_mean(&["--temperature", "100"]),
    );
    assert!(greedy > 100.0 && random < 50.0, "{greedy} {random}");
    assert_eq!(team_mean(&[]), team_mean(&["--actions", "sampled"]));
    assert_ne!(team_mean(&[]), team_mean(&["--seed", "1"]));

    let wrong = seedbed(&["evaluate", run, "--temperature", "-1"]);
    assert_eq!(
        (wrong.status.code(), stderr(&wrong)),
        (
            Some(2),
            "error: --temperature: expected a number above 0, found -1.0\n".to_owned()
        )
    );
    let nowhere = folder.path().join("nowhere");
    let nothing = seedbed(&["evaluate", nowhere.to_str().unwrap()]);
    assert_eq!(nothing.status.code(), Some(2));
    assert!(
        stderr(&nothing).contains("scenario.ron: no such file"),
        "{}",
        stderr(&nothing)
    );
}

/// A replay plays the episodes of an evaluation, and records the bodies of the selected agents.
#[test]
fn a_run_is_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = path.to_str().unwrap();
    assert!(small_run(&path, &["--quiet"]).status.success());
    let table = |output: &Output| -> Vec<String> {
        assert!(output.status.success(), "{}", stderr(output));
        stdout(output)
            .lines()
            .filter(|line| line.starts_with('|'))
            .map(str::to_owned)
            .collect()
    };
    let replayed = seedbed(&[
        "replay",
        run,
        "--episodes",
        "3",
        "--agents",
        "1",
        "--seed",
        "4",
    ]);
    assert_eq!(
        table(&replayed),
        table(&seedbed(&[
            "evaluate",
            run,
            "--episodes",
            "3",
            "--seed",
            "4"
        ]))
    );
    let recording = path.join("replay.rrd");
    assert!(
        stdout(&replayed).ends_with(&format!("open it with\n  rerun {}\n", recording.display())),
        "{}",
        stdout(&replayed)
    );
    let bytes = std::fs::read(&recording).unwrap();
    let holds = |name: &str| {
        bytes
            .windows(name.len())
            .any(|window| window == name.as_bytes())
    };
    assert!(holds("/scene/agent_1") && !holds("/scene/agent_0") && holds("/raw/agent_0"));

    for (more, expected) in [
        (
            &["--agents", "0,2"][..],
            "error: --agents: there is no agent 2; the team of `cartpole` has agents 0 to 1\n"
                .to_owned(),
        ),
        (
            &["--out", &format!("{run}/run.rrd")],
            format!(
                "error: --out {run}/run.rrd would overwrite the recording of the run; choose another file\n"
            ),
        ),
        (
            &["--temperature", "0"],
            "error: --temperature: expected a number above 0, found 0.0\n".to_owned(),
        ),
    ] {
        let refused = seedbed(&[&["replay", run], more].concat());
        assert_eq!(
            (refused.status.code(), stderr(&refused)),
            (Some(2), expected)
        );
    }
}

#[test]
fn a_closed_pipe_is_no_error() {
    let command = format!("{} list | head -1", env!("CARGO_BIN_EXE_seedbed"));
    let output = Command::new("sh")
        .args(["-c", &command])
        .current_dir(REPOSITORY)
        .output()
        .unwrap();
    assert_eq!(stderr(&output), "");
    assert!(stdout(&output).starts_with("Environments ("), "{output:?}");
}

#[test]
fn an_unknown_environment_is_reported_with_known_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wrong.ron");
    std::fs::write(&path, "Scenario(\n    environment: \"cartpol\",\n)").unwrap();
    let output = seedbed(&["check", path.to_str().unwrap()]);
    let printed = stderr(&output);
    let place = format!(
        "error: {}:2:19: in `environment`: no environment is named `cartpol`, expected one of ",
        path.display()
    );
    assert!(
        output.status.code() == Some(2)
            && printed.starts_with(&place)
            && printed.contains("`cartpole`, "),
        "{printed}"
    );
    assert!(
        printed.ends_with("\n  = help: did you mean `cartpole`?\n"),
        "{printed}"
    );
}

/// Lines of a benchmark without speeds, which differ between machines. Random actions keep the pole up
/// for about 20 steps.
fn bench_of_two(seeds: &str) -> Vec<String> {
    let easy = [
        "--set",
        "stop=Solved(return: 25, window: 1, at_most: 40)",
        "--seeds",
        seeds,
    ];
    let output = seedbed(
        &[
            &[
                "bench",
                "scenarios/cartpole_1.ron",
                "scenarios/cartpole.ron",
            ],
            easy.as_slice(),
        ]
        .concat(),
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let without_speed = |line: &str| {
        if line.matches('|').count() == 10 {
            line[..line.trim_end_matches('|').rfind('|').unwrap()].to_owned()
        } else {
            line.to_owned()
        }
    };
    stdout(&output).lines().map(without_speed).collect()
}

#[test]
fn a_benchmark_is_reproducible() {
    let lines = bench_of_two("6");
    assert_eq!(lines, bench_of_two("6"));
    let rows: Vec<&String> = lines
        .iter()
        .filter(|line| line.starts_with("| cartpole"))
        .collect();
    assert_eq!(
        rows.len(),
        2 + 1,
        "one row per scenario, and one comparison: {lines:#?}"
    );
    assert!(
        rows[0].contains("/6 |") && rows[2].starts_with("| cartpole   |"),
        "{lines:#?}"
    );
    assert!(
        lines
            .iter()
            .all(|line| line.chars().count() <= 110 && !line.contains("No intervals")),
        "{lines:#?}"
    );
}

#[test]
fn a_benchmark_of_few_seeds_has_no_intervals() {
    let lines = bench_of_two("4");
    assert_eq!(
        lines.last().map(String::as_str),
        Some("No intervals: 5 run seeds are needed, found 4.")
    );
    assert_eq!(
        lines
            .iter()
            .map(|line| line.matches("none (n = 4)").count())
            .sum::<usize>(),
        2 + 2,
        "{lines:#?}"
    );
    assert!(
        !lines
            .iter()
            .any(|line| line.contains(" to ") && line.starts_with('|')),
        "{lines:#?}"
    );
}
