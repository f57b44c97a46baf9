//! `seedbed check`.

use std::path::Path;

use crate::util::{REPOSITORY, command, files_below, seedbed, stderr, stdout};

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

#[test]
fn check_suggests_an_environment_if_a_name_is_unknown() {
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
            && printed.contains(" names, such as `acrobot`, "),
        "{printed}"
    );
    assert!(
        printed.ends_with("\n  = help: did you mean `cartpole`?\n"),
        "{printed}"
    );
}

/// A file of each kind from a pipe, which can be read only once: as `-`, by the path of the standard
/// input, and by the name of a pipe, as a shell gives it for `<(command)`.
#[cfg(unix)]
#[test]
fn check_and_run_read_pipes() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let pipe = pipe.to_str().unwrap();
    for (file, kind) in [
        ("envs/cartpole.ron", "environment"),
        ("scenarios/cartpole.ron", "scenario with 4 agents"),
        ("scenarios/tabular/deep_sea.ron", "tabular scenario"),
    ] {
        let text = std::fs::read(Path::new(REPOSITORY).join(file)).unwrap();
        for argument in ["-", "/dev/stdin", pipe] {
            let output = output_with_input(&["check", argument], argument, &text);
            let expected = format!("ok: {argument}: {kind}");
            let printed = stdout(&output) + &stderr(&output);
            assert!(
                printed.starts_with(&expected),
                "{file} {argument}: {printed}"
            );
        }
    }
    let study =
        std::fs::read_to_string(Path::new(REPOSITORY).join("scenarios/thesis/fig_6_4a.ron"));
    // Relative paths begin in the working directory.
    let study = study
        .unwrap()
        .replace("../cartpole.ron", "scenarios/cartpole.ron");
    let output = output_with_input(&["check", "-"], "-", study.as_bytes());
    assert!(
        stdout(&output).starts_with("ok: -: study with"),
        "{}",
        stderr(&output)
    );
    let out = folder.path().join("run");
    let arguments = [
        "run",
        "-",
        "--quiet",
        "--no-recording",
        "--set",
        "stop=Episodes(2)",
        "--out",
    ];
    let arguments = [&arguments[..], &[out.to_str().unwrap()]].concat();
    let text = std::fs::read(Path::new(REPOSITORY).join("scenarios/cartpole.ron")).unwrap();
    let output = output_with_input(&arguments, "-", &text);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(out.join("summary.json").is_file());
    let output = output_with_input(&["check", "-"], "-", b"Scenario(\n  agents: 3 4)");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).starts_with("error: /dev/stdin:2:"),
        "{}",
        stderr(&output)
    );
}

/// A run names the fields that have former names, with their lines in the file, also of a file that can be read only
/// once.
#[cfg(unix)]
#[test]
fn fields_with_former_names_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let text = b"Scenario(environment: \"cartpole\", stop: Episodes(2),\n  algorithm: SeedPg(policy_optimiser: ()))";
    let set = ["--set", "algorithm.value_optimiser.step_size=0.1"];
    let first = ["run", "-", "--quiet", "--no-recording"];
    let arguments = [&first[..], &set, &["--out", out.to_str().unwrap()]].concat();
    let output = output_with_input(&arguments, "-", text);
    assert!(output.status.success(), "{}", stderr(&output));
    let printed = stderr(&output);
    let warnings: Vec<&str> = printed.lines().collect();
    assert_eq!(
        warnings,
        [
            "warning: /dev/stdin: line 2: `policy_optimiser` is now called `policy_optimizer`; the former name is read for \
             one more version",
            "warning: --set algorithm.value_optimiser.step_size: its name is now `algorithm.value_optimizer.step_size`; the \
             former one is read for one more version",
        ]
    );
}

/// Output of a command whose argument `path`, the standard input unless it is a pipe, has `text`.
#[cfg(unix)]
fn output_with_input(arguments: &[&str], path: &str, text: &[u8]) -> std::process::Output {
    use std::io::Write;
    use std::process::Stdio;
    let mut child = command(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    if matches!(path, "-" | "/dev/stdin") {
        input.write_all(text).unwrap();
    } else {
        std::fs::write(path, text).unwrap();
    }
    drop(input);
    child.wait_with_output().unwrap()
}
