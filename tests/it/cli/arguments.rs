//! Options and words of other libraries on the command line: what is meant, to be pasted.

use crate::util::{run_refused, seedbed};

/// The options in the tip of an error, as a shell splits them.
fn pasted(error: &str) -> Vec<String> {
    let (_, rest) = error
        .split_once("write `")
        .unwrap_or_else(|| panic!("no example in {error}"));
    let text = rest.split_once('`').unwrap().0;
    let mut options = vec![String::new()];
    let mut is_quoted = false;
    for character in text.chars() {
        match character {
            '\'' => is_quoted = !is_quoted,
            ' ' if !is_quoted => options.push(String::new()),
            _ => options.last_mut().unwrap().push(character),
        }
    }
    options
}

/// Each example runs when it is pasted; the file of the run has what was meant.
#[test]
fn options_of_other_libraries_are_answered_with_examples_that_run() {
    let folder = tempfile::tempdir().unwrap();
    for (number, (scenario, arguments, expected)) in [
        ("cartpole", &["--lr", "0.25"][..], "step_size: 0.25,"),
        ("cartpole_q", &["--learning-rate=0.25"], "step_size: 0.25,"),
        ("cartpole", &["--gamma", "0.5"], "discount: 0.5,"),
        ("cartpole", &["--n-envs", "3"], "episodes: 3,"),
        ("cartpole", &["--num_envs=3"], "episodes: 3,"),
        ("cartpole", &["agents.count=3"], "count: 3,"),
        ("cartpole", &["--agents", "3"], "count: 3,"),
        (
            "cartpole",
            &["--env", "cart_pole"],
            "environment: \"cartpole\",",
        ),
        ("cartpole", &["--algo", "ppo"], "policy_data: Own,"),
        ("cartpole", &["--batch-size", "32"], "Steps(32)"),
        ("cartpole", &["--set", "lr=0.25"], "step_size: 0.25,"),
        (
            "cartpole",
            &["--set", "algorithm=DQN"],
            "algorithm: QLearning(",
        ),
    ]
    .into_iter()
    .enumerate()
    {
        let error = run_refused(&[&["run", scenario], arguments].concat());
        let mut options = pasted(&error);
        if arguments[0] == "--set" {
            // Help for `--set` and `set` in studies has the assignment alone.
            options = vec!["--set".to_owned(), pasted(&error).concat()];
        }
        let out = folder.path().join(number.to_string());
        let out = out.to_str().unwrap();
        let mut run = vec![
            "run",
            scenario,
            "--set",
            "stop=Episodes(1)",
            "--no-recording",
        ];
        run.extend(["--quiet", "--out", out]);
        run.extend(options.iter().map(String::as_str));
        let output = seedbed(&run);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{run:?}: {errors}");
        let stored = std::fs::read_to_string(format!("{out}/scenario.ron")).unwrap();
        assert!(stored.contains(expected), "{arguments:?}: {stored}");
    }
}

/// What has no field is explained; other unknown options are refused as before.
#[test]
fn what_has_no_field_is_explained() {
    // Running it would need Gymnasium.
    let error = run_refused(&["run", "cartpole", "--env", "CartPole-v1"]);
    let expected = r#"--set 'environment=Gymnasium(id: "CartPole-v1")'"#;
    assert!(error.contains(expected), "{error}");
    let error = run_refused(&["run", "cartpole", "--device", "cuda"]);
    assert!(
        error.starts_with(
            "error: unexpected argument '--device' found\n\n  \
             tip: `device`: runs use the processor only; `--threads N` sets the number of threads\n\n"
        ),
        "{error}"
    );
    let error = run_refused(&["run", "cartpole", "--seed", "1", "--seed", "2"]);
    assert!(
        error.contains("tip: `seedbed bench SCENARIO --seeds 10`"),
        "{error}"
    );
    let error = run_refused(&["study", "scenarios/thesis/fig_6_1.ron", "--gamma=0.9"]);
    assert!(
        error.contains("in the study file, `gamma`: discount factor; write `set: ["),
        "{error}"
    );
    let error = run_refused(&["run", "cartpole", "--frobnicate", "3"]);
    assert!(!error.contains("write `"), "{error}");
}

/// Values of options that also work without one need a `=`.
#[test]
fn values_without_an_equals_sign_are_answered_with_one() {
    let address = "rerun+http://127.0.0.1:9876/proxy";
    for (arguments, wrong, written) in [
        (
            ["run", "cartpole", "--serve", "9876"],
            "9876",
            "--serve=9876",
        ),
        (
            ["run", "--serve", "9876", "cartpole"],
            "cartpole",
            "--serve=9876",
        ),
        (
            ["run", "cartpole", "--live", address],
            address,
            &format!("--live={address}"),
        ),
    ] {
        let error = run_refused(&arguments);
        let expected =
            format!("error: unexpected argument '{wrong}' found\n\n  tip: write `{written}`\n\n");
        assert!(error.starts_with(&expected), "{error}");
    }
}

/// Sizes that no machine has are refused before anything is allocated.
#[test]
fn absurd_sizes_are_refused() {
    let layers = vec!["1"; 1001].join(",");
    let layers = format!("algorithm.learning.hidden=[{layers}]");
    let start = |text: &str| text.chars().take(40).collect::<String>();
    let count = |path: &str, max: u32, found: &str| {
        format!("in `{path}`: expected a whole number from 1 to {max}, found {found}")
    };
    for (scenario, set, expected) in [
        (
            "tabular/parallel_chains",
            "task.ParallelChains.chains=1000000000",
            count("task.ParallelChains.chains", 250, "1000000000"),
        ),
        (
            "tabular/parallel_chains",
            "task.ParallelChains.edges=1e9",
            count("task.ParallelChains.edges", 1000, "`1e9`"),
        ),
        (
            "cartpole_q",
            "algorithm.learning.hidden=[1000000000, 1000000000]",
            count("algorithm.QLearning.learning.hidden[0]", 4096, "1000000000"),
        ),
        (
            "cartpole_q",
            "algorithm.learning.replay=999999999999",
            count("algorithm.learning.replay", 100_000_000, "999999999999"),
        ),
        (
            "cartpole",
            "agents.count=4294967296",
            count("agents.count", 100_000, "4294967296"),
        ),
        (
            "cartpole_q",
            &layers,
            "in `algorithm.learning.hidden`: expected a list of at most 1000 entries, found more"
                .to_owned(),
        ),
    ] {
        let error = run_refused(&["run", scenario, "--set", set]);
        let first = error.lines().next().unwrap();
        assert!(
            first.starts_with(&format!("error: --set {}", start(set))),
            "{error}"
        );
        assert!(first.ends_with(&expected), "{first}");
    }
}

/// The same for options and for numbers of runs.
#[test]
fn absurd_numbers_are_refused() {
    for (arguments, expected) in [
        (
            ["run", "cartpole", "--threads", "1000000000"],
            "error: invalid value '1000000000' for '--threads <N>': 1000000000 is not in 1..=1024\n",
        ),
        (
            ["bench", "cartpole", "--jobs", "1000000000"],
            "error: invalid value '1000000000' for '--jobs <N>': 1000000000 is not in 1..=1024\n",
        ),
        (
            ["plot", "recordings/sample", "--size", "99999999x99999999"],
            "error: invalid value '99999999x99999999' for '--size <WxH>': expected WIDTHxHEIGHT, e.g. 760x900, each from 100 to 10000\n",
        ),
        (
            ["film", "recordings/sample", "--width", "1000000000"],
            "error: invalid value '1000000000' for '--width <N>': 1000000000 is not in 300..=4000\n",
        ),
        (
            ["run", "cartpole", "--seed", "abc"],
            "error: invalid value 'abc' for '--seed <N>': expected a whole number\n",
        ),
        (
            ["run", "cartpole", "--seed", "99999999999999999999"],
            "error: invalid value '99999999999999999999' for '--seed <N>': expected a smaller number\n",
        ),
    ] {
        let error = run_refused(&arguments);
        assert!(error.starts_with(expected), "{error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("many.ron");
    let text =
        r#"Study(title: "Many", repeats: 99999999999, cells: [(name: "a", scenario: "cartpole")])"#;
    std::fs::write(&study, text).unwrap();
    let error = run_refused(&["study", "list", study.to_str().unwrap()]);
    let place = format!("error: {}:1:31: in `repeats`: ", study.display());
    assert!(error.starts_with(&place), "{error}");
    let expected = "expected a whole number from 1 to 100000, found 99999999999\n";
    assert!(error[place.len()..].starts_with(expected), "{error}");
}
