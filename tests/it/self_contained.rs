//! The folder of a run has all that any command needs, however its scenario named the task, and
//! wherever the folder is moved.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

use super::util::{assert_same_results, command, names_in, stderr, stdout};

/// A way to name a task.
struct Form {
    what: &'static str,
    /// Value of `environment`; `HOME` is replaced by the folder of the scenario.
    environment: &'static str,
    /// Files below that folder.
    files: &'static [(&'static str, Text)],
    /// Arguments of `seedbed run` after the scenario.
    arguments: &'static [&'static str],
    scenario: Source,
    /// Name of the task.
    task: &'static str,
}

/// The text of a task file.
#[derive(Clone, Copy)]
enum Text {
    /// A cart-pole whose episodes have at most 7 steps.
    Task,
    /// One whose episodes have at most 5 steps, which must not be read.
    OtherTask,
    Written(&'static str),
}

/// Where the scenario comes from.
#[derive(Clone, Copy, PartialEq)]
enum Source {
    File,
    StandardInput,
    BuiltIn,
}

const FORM: Form = Form {
    what: "",
    environment: "",
    files: &[],
    arguments: &[],
    scenario: Source::File,
    task: "mine",
};

const FORMS: [Form; 17] = [
    Form {
        what: "name in `envs/`",
        environment: "mine",
        files: &[("envs/mine.ron", Text::Task)],
        ..FORM
    },
    Form {
        what: "name in `envs/` that is also built in",
        environment: "cartpole",
        files: &[("envs/cartpole.ron", Text::Task)],
        task: "cartpole",
        ..FORM
    },
    Form {
        what: "path beside the scenario",
        environment: "mine.ron",
        files: &[("mine.ron", Text::Task), ("envs/mine.ron", Text::OtherTask)],
        ..FORM
    },
    Form {
        what: "path down",
        environment: "sub/mine.ron",
        files: &[("sub/mine.ron", Text::Task)],
        ..FORM
    },
    Form {
        what: "path up",
        environment: "../up/mine.ron",
        files: &[("../up/mine.ron", Text::Task)],
        ..FORM
    },
    Form {
        what: "absolute path",
        environment: "HOME/far/mine.ron",
        files: &[("far/mine.ron", Text::Task)],
        ..FORM
    },
    Form {
        what: "built-in task",
        environment: "cartpole_gym",
        task: "cartpole_gym",
        ..FORM
    },
    Form {
        what: "built-in task in a subfolder",
        environment: "mistakes/two_poles_naive",
        task: "two_poles_naive",
        ..FORM
    },
    Form {
        what: "name in a subfolder of `envs/`",
        environment: "deep/mine",
        files: &[
            ("envs/deep/mine.ron", Text::Task),
            ("envs/mine.ron", Text::OtherTask),
        ],
        ..FORM
    },
    Form {
        what: "`extends` over two files",
        environment: "third",
        files: &[
            (
                "envs/third.ron",
                Text::Written("Environment(extends: \"second\", description: \"Third.\")"),
            ),
            (
                "envs/second.ron",
                Text::Written("Environment(extends: \"mine\", description: \"Second.\")"),
            ),
            ("envs/mine.ron", Text::Task),
        ],
        task: "third",
        ..FORM
    },
    Form {
        what: "`extends` over two files in other folders",
        environment: "a/third.ron",
        files: &[
            (
                "a/third.ron",
                Text::Written("Environment(extends: \"../b/second.ron\", description: \"Third.\")"),
            ),
            (
                "b/second.ron",
                Text::Written("Environment(extends: \"c/mine.ron\", description: \"Second.\")"),
            ),
            ("b/c/mine.ron", Text::Task),
        ],
        task: "third",
        ..FORM
    },
    Form {
        what: "scenario from the standard input",
        environment: "mine.ron",
        files: &[("mine.ron", Text::Task)],
        scenario: Source::StandardInput,
        ..FORM
    },
    Form {
        what: "override with a path",
        environment: "cartpole",
        files: &[("sub/mine.ron", Text::Task)],
        arguments: &["--set", "environment=sub/mine.ron"],
        ..FORM
    },
    Form {
        what: "override of a built-in scenario with a name",
        files: &[("envs/mine.ron", Text::Task)],
        arguments: &["--set", "environment=mine"],
        scenario: Source::BuiltIn,
        ..FORM
    },
    Form {
        what: "override of a built-in scenario with a path",
        files: &[("sub/mine.ron", Text::Task)],
        arguments: &["--set", "environment=sub/mine.ron"],
        scenario: Source::BuiltIn,
        ..FORM
    },
    Form {
        what: "spaces and letters of other languages",
        environment: "mein Stab – 杆 'x'.ron",
        files: &[("mein Stab – 杆 'x'.ron", Text::Task)],
        task: "mein Stab – 杆 'x'",
        ..FORM
    },
    Form {
        what: "a name that ends in `.ron` itself, and has dots",
        environment: "v1.2.ron.ron",
        files: &[("v1.2.ron.ron", Text::Task), ("v1.2.ron", Text::OtherTask)],
        task: "v1.2.ron",
        ..FORM
    },
];

fn text(text: Text) -> String {
    let task = fs::read_to_string("envs/cartpole.ron").unwrap();
    let with_limit = |limit: u32| {
        assert!(task.contains("time_limit: 200"), "{task}");
        task.replace("time_limit: 200", &format!("time_limit: {limit}"))
    };
    match text {
        Text::Task => with_limit(7),
        Text::OtherTask => with_limit(5),
        Text::Written(text) => text.to_owned(),
    }
}

fn write(path: &Path, text: &str) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

/// A folder in which a run was made, and the run.
struct Made {
    folder: tempfile::TempDir,
    run: PathBuf,
}

impl Form {
    /// Makes a run in a new folder.
    fn make(&self) -> Made {
        let folder = tempfile::tempdir().unwrap();
        let home = folder.path().join("home");
        fs::create_dir_all(&home).unwrap();
        for (file, contents) in self.files {
            write(&home.join(file), &text(*contents));
        }
        let environment = self.environment.replace("HOME", home.to_str().unwrap());
        let scenario = format!(
            "Scenario(environment: {environment:?}, agents: (count: 2), stop: Episodes(3))"
        );
        let run = folder.path().join("run");
        let out = run.to_str().unwrap();
        let (name, input) = match self.scenario {
            Source::File => {
                write(&home.join("of_mine.ron"), &scenario);
                ("of_mine.ron", None)
            }
            Source::StandardInput => ("-", Some(scenario)),
            Source::BuiltIn => ("cartpole", None),
        };
        let small = ["--set", "agents.count=2", "--set", "stop=Episodes(3)"];
        let arguments = [&["run", name, "--out", out], self.arguments, &small].concat();
        let output = call(&home, &arguments, input.as_deref());
        assert!(
            output.status.success(),
            "{}: {}",
            self.what,
            stderr(&output)
        );
        Made { folder, run }
    }

    fn scenario_name(&self) -> &'static str {
        match self.scenario {
            Source::File => "of_mine",
            Source::StandardInput => "stdin",
            Source::BuiltIn => "cartpole",
        }
    }

    /// Asserts that all commands read the run in `run`, with the results of `made`.
    fn assert_read_by_all_commands(&self, run: &Path, made: &BeforeMove) {
        let what = self.what;
        let (path, folder) = (run.to_str().unwrap(), run.parent().unwrap());
        let succeed = |arguments: &[&str]| {
            let output = call(folder, arguments, None);
            assert!(
                output.status.success(),
                "{what}: {arguments:?}: {}",
                stderr(&output)
            );
            stdout(&output)
        };
        assert_eq!(
            succeed(&["evaluate", path, "--episodes", "3"]),
            made.evaluation,
            "{what}"
        );
        succeed(&["export", path, "--to", "states.csv"]);
        let states = fs::read_to_string(folder.join("states.csv")).unwrap();
        assert_eq!(states, made.states, "{what}");
        succeed(&["replay", path, "--episodes", "2", "--out", "replay.rrd"]);
        succeed(&["explore", path, "--out", "explore.html"]);
        succeed(&[
            "film",
            path,
            "--out",
            "film.gif",
            "--seconds",
            "1",
            "--fps",
            "2",
            "--width",
            "300",
        ]);
        succeed(&["plot", path, "--out", "plot.png"]);
        succeed(&["inspect", path]);
        let listed: serde_json::Value =
            serde_json::from_str(&succeed(&["runs", path, "--json"])).unwrap();
        assert_eq!(listed[0]["environment"], self.task, "{what}");
        assert_eq!(listed[0]["scenario"], self.scenario_name(), "{what}");
        let scenario = format!("{path}/scenario.ron");
        succeed(&["check", &scenario]);
        succeed(&["bench", &scenario, "--seeds", "1"]);
        let again = folder.join("again");
        succeed(&[
            "run",
            &scenario,
            "--out",
            again.to_str().unwrap(),
            "--overwrite",
        ]);
        assert_same_results(run, &again);
        self.assert_resumable(run, folder);
    }

    /// Asserts that a copy of the run, without its summary, is continued to the results of a longer
    /// run.
    fn assert_resumable(&self, run: &Path, folder: &Path) {
        let (part, whole) = (folder.join("part"), folder.join("whole"));
        let _ = fs::remove_dir_all(&part);
        copy_folder(run, &part);
        fs::remove_file(part.join("summary.json")).unwrap();
        let scenario = part.join("scenario.ron");
        for (out, more) in [(&whole, "--overwrite"), (&part, "--resume")] {
            let arguments = [
                "run",
                scenario.to_str().unwrap(),
                "--out",
                out.to_str().unwrap(),
                "--set",
                "stop=Episodes(5)",
                more,
            ];
            let output = call(folder, &arguments, None);
            assert!(
                output.status.success(),
                "{}: {}",
                self.what,
                stderr(&output)
            );
        }
        assert_same_results(&whole, &part);
    }
}

/// Results of a run before its folder is moved.
struct BeforeMove {
    evaluation: String,
    states: String,
}

fn call(folder: &Path, arguments: &[&str], input: Option<&str>) -> Output {
    let mut command = command(arguments);
    command
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin
        .write_all(input.unwrap_or_default().as_bytes())
        .unwrap();
    drop(stdin);
    child.wait_with_output().unwrap()
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for name in names_in(from) {
        let (from, to) = (from.join(&name), to.join(&name));
        if from.is_dir() {
            copy_folder(&from, &to);
        } else {
            fs::copy(from, to).unwrap();
        }
    }
}

/// The run is read where it was made; then its folder is moved, all its sources are deleted, and other
/// tasks with the same names are where a command could find them.
fn assert_self_contained(form: &Form) {
    let Made { folder, run } = form.make();
    let path = run.to_str().unwrap();
    let evaluation = call(folder.path(), &["evaluate", path, "--episodes", "3"], None);
    assert!(
        evaluation.status.success(),
        "{}: {}",
        form.what,
        stderr(&evaluation)
    );
    let exported = call(folder.path(), &["export", path, "--to", "states.csv"], None);
    assert!(
        exported.status.success(),
        "{}: {}",
        form.what,
        stderr(&exported)
    );
    let before = BeforeMove {
        evaluation: stdout(&evaluation),
        states: fs::read_to_string(folder.path().join("states.csv")).unwrap(),
    };
    let elsewhere = tempfile::tempdir().unwrap();
    let moved = elsewhere.path().join("moved run");
    fs::rename(&run, &moved).unwrap();
    drop(folder);
    let decoy = text(Text::OtherTask);
    for file in [
        "envs/TASK.ron",
        "TASK.ron",
        "sub/TASK.ron",
        "envs/cartpole.ron",
        "cartpole.ron",
    ] {
        write(
            &elsewhere.path().join(file.replace("TASK", form.task)),
            &decoy,
        );
    }
    form.assert_read_by_all_commands(&moved, &before);
}

/// `part` of two parts of the forms, which are tested at the same time.
fn assert_all_self_contained(part: usize) {
    for form in FORMS.iter().skip(part).step_by(2) {
        assert_self_contained(form);
    }
}

#[test]
fn a_run_is_read_wherever_its_folder_is_however_its_task_was_named() {
    assert_all_self_contained(0);
}

#[test]
fn a_run_is_read_wherever_its_folder_is_however_its_task_was_named_2() {
    assert_all_self_contained(1);
}

/// Runs of two tasks with the same file name keep their own, and neither is resumed with the other.
#[test]
fn tasks_with_the_same_file_name_are_not_confused() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    for (name, contents) in [("a", Text::Task), ("b", Text::OtherTask)] {
        write(&home.join(name).join("mine.ron"), &text(contents));
        let scenario = format!(
            "Scenario(environment: \"{name}/mine.ron\", agents: (count: 2), stop: Episodes(2))"
        );
        write(&home.join(format!("{name}.ron")), &scenario);
        let output = call(
            home,
            &[
                "run",
                &format!("{name}.ron"),
                "--out",
                &format!("out_{name}"),
            ],
            None,
        );
        assert!(output.status.success(), "{}", stderr(&output));
    }
    for (name, steps) in [("a", "7"), ("b", "5")] {
        let tables = fs::read_to_string(home.join(format!("out_{name}/episodes.csv"))).unwrap();
        let mut reader = csv::Reader::from_reader(tables.as_bytes());
        let rows = reader.deserialize::<std::collections::BTreeMap<String, String>>();
        for row in rows {
            assert_eq!(row.unwrap()["length"], steps, "{tables}");
        }
    }
    fs::remove_file(home.join("out_a/summary.json")).unwrap();
    let resumed = [
        "run",
        "b.ron",
        "--out",
        "out_a",
        "--resume",
        "--set",
        "stop=Episodes(4)",
    ];
    let output = call(home, &resumed, None);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    let expected = "the task `mine` has changed since the run in out_a began";
    assert!(stderr(&output).contains(expected), "{}", stderr(&output));
}

/// Folders of earlier versions have the scenario as it was given.
#[test]
fn folders_of_earlier_versions_are_read_and_resumed() {
    for form in FORMS
        .iter()
        .filter(|form| Path::new(form.environment).extension().is_some())
    {
        let Made { folder, run } = form.make();
        let path = run.join("scenario.ron");
        let stored = fs::read_to_string(&path).unwrap();
        let mut lines: Vec<&str> = stored
            .lines()
            .filter(|line| !line.starts_with("    name: "))
            .collect();
        let given = format!(
            "    environment: {:?},",
            form.environment.replace("HOME", "/home/somebody")
        );
        let index = lines
            .iter()
            .position(|line| line.starts_with("    environment: "))
            .unwrap();
        lines[index] = &given;
        fs::write(&path, lines.join("\n")).unwrap();
        fs::remove_file(run.join("SHA256SUMS")).unwrap();
        fs::remove_dir_all(folder.path().join("home")).unwrap();
        let run_path = run.to_str().unwrap();
        for command in ["evaluate", "replay"] {
            let output = call(folder.path(), &[command, run_path, "--episodes", "1"], None);
            assert!(
                output.status.success(),
                "{}: {}",
                form.what,
                stderr(&output)
            );
        }
        form.assert_resumable(&run, folder.path());
    }
}

/// A run without the copy of its task is an error, not a run of another task with the same name.
#[test]
fn a_run_that_has_lost_its_task_is_refused() {
    let Made { folder, run } = FORMS[1].make();
    fs::remove_dir_all(run.join("envs")).unwrap();
    let (path, scenario) = (run.to_str().unwrap(), run.join("scenario.ron"));
    let scenario = scenario.to_str().unwrap();
    for arguments in [
        ["evaluate", path],
        ["explore", path],
        ["replay", path],
        ["check", scenario],
        ["bench", scenario],
        ["run", scenario],
    ] {
        let output = call(folder.path(), &arguments, None);
        let errors = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {errors}");
        assert!(
            errors.contains("envs/cartpole.ron: "),
            "{arguments:?}: {errors}"
        );
    }
}
