//! The command line: messages, exit statuses, and the files that commands write.

use std::path::Path;
use std::process::{Command, Output};

use super::recording::contents::RecordingContents;
#[cfg(unix)]
use super::util::interrupt;
use super::util::{
    REPOSITORY, command, files_below, names_in, seedbed, small_run, stderr, stdout, wait_until,
};

#[test]
fn check_accepts_valid_files() {
    let output = seedbed(&["check", "scenarios/cartpole.ron", "envs/cartpole.ron"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(
        stdout(&output),
        "ok: scenarios/cartpole.ron: scenario with 4 agents in `cartpole`; observations x, x_dot, theta, theta_dot; actions force (-10 or 10 N)\n\
         ok: envs/cartpole.ron: environment; observations x, x_dot, theta, theta_dot; actions force (-10 or 10 N)\n"
    );
}

#[test]
fn check_accepts_every_file_of_the_repository() {
    let mut files = Vec::new();
    for folder in ["envs", "scenarios"] {
        files.extend(files_below(&Path::new(REPOSITORY).join(folder), "ron"));
    }
    let mut arguments = vec!["check"];
    arguments.extend(files.iter().map(|path| path.to_str().unwrap()));
    let output = seedbed(&arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    let answers = stdout(&output);
    let verdicts = || {
        answers
            .lines()
            .filter(|line| !line.starts_with("warning: "))
    };
    assert_eq!(verdicts().count(), files.len(), "{answers}");
    for (file, answer) in files.iter().zip(verdicts()) {
        assert!(
            answer.starts_with(&format!("ok: {}: ", file.display())),
            "{answer}"
        );
    }
    // The list of files must have one file of each kind.
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

/// Without a bonus and with a value function of 0, only rewards can change a policy. Reward seeds
/// are rewards.
#[test]
fn check_warns_of_agents_that_cannot_learn_before_a_reward() {
    let folder = tempfile::tempdir().unwrap();
    let warnings_of = |seeds: &str| {
        let scenario = folder.path().join("scenario.ron");
        let environment = Path::new(REPOSITORY).join("envs/mountain_car_continuous_sparse.ron");
        let text = format!(
            r#"Scenario(environment: "{}", agents: (count: 2, seeds: {seeds}), algorithm: SeedPg(value_scale: 0))"#,
            environment.display()
        );
        std::fs::write(&scenario, text).unwrap();
        let output = seedbed(&["check", scenario.to_str().unwrap()]);
        assert!(output.status.success(), "{output:?}");
        stdout(&output)
            .matches("policies do not change before an agent receives a reward")
            .count()
    };
    assert_eq!(warnings_of("Normal(sigma: 0)"), 1);
    assert_eq!(warnings_of("Normal(sigma: 0.1)"), 0);
}

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
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("error: interrupted after "), "{errors}");
    assert!(
        errors.ends_with("this run cannot be resumed, start it again\n"),
        "{errors}"
    );
}

#[test]
fn bench_compares_tabular_scenarios_by_regret() {
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
    let printed = stdout(&output);
    assert!(
        printed.contains("| parallel_chains      |     10 |")
            && printed.contains("Compared with parallel_chains, paired by run seed"),
        "{printed}"
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
                  visitation_entropy,visitation_evenness,team_coverage,team_overlap,effective_agents";
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

/// Prints `seedbed list WHAT` in a folder.
fn list_in(folder: &Path, what: &str) -> String {
    let output = command(&["list", what])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output)
}

#[test]
fn list_explains_missing_directories() {
    let folder = tempfile::tempdir().unwrap();
    let subfolder = folder.path().join("notes/today");
    std::fs::create_dir_all(&subfolder).unwrap();
    let printed = list_in(&subfolder, "environments");
    assert!(
        printed.contains("no directory `envs` in ") && printed.contains("notes/today"),
        "{printed}"
    );
    assert!(list_in(&subfolder, "scenarios").contains("no directory `scenarios` in "));
}

/// `list` searches the same directories as the lookup of environments and scenarios by name: the
/// working directory and its parents.
#[test]
fn list_searches_parent_directories() {
    let folder = tempfile::tempdir().unwrap();
    let project = folder.path().canonicalize().unwrap();
    let subfolder = project.join("notes/today");
    for name in ["envs", "scenarios", "notes/today"] {
        std::fs::create_dir_all(project.join(name)).unwrap();
    }
    std::fs::copy("envs/cartpole.ron", project.join("envs/broom.ron")).unwrap();
    let one_agent = r#"Scenario(environment: "broom", agents: (count: 1), stop: Episodes(1))"#;
    for name in ["alone", "lonely"] {
        let path = project.join("scenarios").join(name).with_extension("ron");
        std::fs::write(path, one_agent).unwrap();
    }
    let environments = list_in(&subfolder, "environments");
    assert!(
        environments.starts_with(&format!(
            "Environments ({})\n  broom\n",
            project.join("envs/").display()
        )),
        "{environments}"
    );
    let scenarios = project.join("scenarios/").display().to_string();
    let description = "1 agent in broom, at most 1 episode each";
    let expected = format!(
        "Scenarios ({scenarios})\n  {scenarios}alone.ron  {description}\n  {scenarios}lonely.ron {description}\n\n"
    );
    assert_eq!(
        list_in(&subfolder, "scenarios"),
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
        stderr(&output).contains("non-finite reward (agent 0, episode 0)"),
        "{}",
        stderr(&output)
    );
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

/// Mean return of the team as printed by `seedbed evaluate RUN --episodes 5`.
fn evaluated_return(run: &str, extra_arguments: &[&str]) -> f64 {
    let output = seedbed(&[&["evaluate", run, "--episodes", "5"], extra_arguments].concat());
    let rows = table_rows(&output);
    assert_eq!(rows.len(), 1 + 1 + 16 + 1, "{rows:?}");
    let team = rows.iter().find(|row| row.starts_with("| team")).unwrap();
    team.split('|').nth(2).unwrap().trim().parse().unwrap()
}

/// The lines of the table that a successful command printed.
fn table_rows(output: &Output) -> Vec<String> {
    assert!(output.status.success(), "{}", stderr(output));
    stdout(output)
        .lines()
        .filter(|line| line.starts_with('|'))
        .map(str::to_owned)
        .collect()
}

/// A trained policy keeps the pole up longer with greedy than with nearly random actions; the same
/// run seed plays the same episodes.
#[test]
fn a_run_is_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = path.to_str().unwrap();
    let train = [
        "run",
        "scenarios/cartpole_16.ron",
        "--quiet",
        "--no-recording",
        "--out",
        run,
        "--set",
        "stop=Episodes(40)",
    ];
    assert!(seedbed(&train).status.success());
    let (greedy, nearly_random) = (
        evaluated_return(run, &["--actions", "greedy"]),
        evaluated_return(run, &["--temperature", "100"]),
    );
    assert!(
        greedy > 100.0 && nearly_random < 50.0,
        "{greedy} {nearly_random}"
    );
    let default = evaluated_return(run, &[]);
    assert_eq!(default, evaluated_return(run, &["--actions", "sampled"]));
    assert_ne!(default, evaluated_return(run, &["--seed", "1"]));
}

#[test]
fn evaluate_explains_invalid_arguments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    assert!(
        small_run(&path, &["--quiet", "--no-recording"])
            .status
            .success()
    );
    let evaluate = ["evaluate", path.to_str().unwrap(), "--temperature", "-1"];
    let negative_temperature = seedbed(&evaluate);
    assert_eq!(
        (
            negative_temperature.status.code(),
            stderr(&negative_temperature)
        ),
        (
            Some(2),
            "error: --temperature: expected a number above 0, found -1.0\n".to_owned()
        )
    );
    let missing_path = folder.path().join("nowhere");
    let missing_run = seedbed(&["evaluate", missing_path.to_str().unwrap()]);
    assert_eq!(missing_run.status.code(), Some(2));
    assert!(
        stderr(&missing_run).contains("scenario.ron: no such file"),
        "{}",
        stderr(&missing_run)
    );
}

/// A replay plays the episodes of an evaluation with the same run seed. It records the raw data of
/// all agents, and the bodies of the selected agents.
#[test]
fn a_run_is_replayed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = path.to_str().unwrap();
    assert!(small_run(&path, &["--quiet"]).status.success());
    let three_episodes = ["--episodes", "3", "--seed", "4"];
    let evaluated = seedbed(&[&["evaluate", run], &three_episodes[..]].concat());
    let replayed = seedbed(&[&["replay", run, "--agents", "1"], &three_episodes[..]].concat());
    assert_eq!(table_rows(&replayed), table_rows(&evaluated));
    let recording = path.join("replay.rrd");
    assert!(
        stdout(&replayed).ends_with(&format!(
            "open the recording with\n  rerun {}\n",
            recording.display()
        )),
        "{}",
        stdout(&replayed)
    );
    let contents = RecordingContents::read(&recording);
    assert!(contents.has_entity("/raw/agent_0"));
    assert!(contents.has_entity("/scene/agent_1") && !contents.has_entity("/scene/agent_0"));
}

#[test]
fn replay_explains_invalid_arguments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let run = path.to_str().unwrap();
    assert!(small_run(&path, &["--quiet"]).status.success());
    for (extra_arguments, expected) in [
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
        let refused = seedbed(&[&["replay", run], extra_arguments].concat());
        assert_eq!(
            (refused.status.code(), stderr(&refused)),
            (Some(2), expected)
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

#[test]
fn check_lists_the_known_environments_if_a_name_is_unknown() {
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

/// The lines that `bench` prints for two scenarios, without speeds, which differ from run to run.
/// The threshold is low, so that the runs are short: random actions keep the pole up for about 20
/// steps.
fn bench_lines_without_speeds(run_seeds: &str) -> Vec<String> {
    let short_runs = [
        "--set",
        "stop=Solved(return: 25, window: 1, at_most: 40)",
        "--seeds",
        run_seeds,
    ];
    let output = seedbed(
        &[
            &[
                "bench",
                "scenarios/cartpole_1.ron",
                "scenarios/cartpole.ron",
            ],
            short_runs.as_slice(),
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
    let lines = bench_lines_without_speeds("6");
    assert_eq!(lines, bench_lines_without_speeds("6"));
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
fn a_benchmark_of_four_run_seeds_has_no_intervals() {
    let lines = bench_lines_without_speeds("4");
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
