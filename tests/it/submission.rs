//! Submissions: what `seedbed submit` packs can be checked without anything else.

use std::fs;
use std::io::Cursor;
use std::path::PathBuf;
use std::process::Output;

use zip::ZipArchive;

use super::util::{command, stderr, stdout};

/// A project with a task that extends another one, a scenario that names it, and a study.
struct Project {
    folder: tempfile::TempDir,
}

/// Path of the study in the project.
const STUDY: &str = "scenarios/papers/small.ron";

impl Project {
    fn new() -> Self {
        let project = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let cartpole = include_str!("../../envs/cartpole.ron");
        project.write("lab/envs/base.ron", cartpole);
        project.write(
            "lab/envs/short.ron",
            r#"Environment(extends: "base", time_limit: 20)"#,
        );
        project.write(
            "lab/scenarios/short.ron",
            r#"Scenario(environment: "short", algorithm: Random, agents: (count: 2), stop: Episodes(2))"#,
        );
        project.write(
            "lab/scenarios/papers/small.ron",
            r#"Study(
                title: "Teams of random agents",
                scenario: "../short.ron",
                cells: [(name: "short"), (name: "built in", scenario: "cartpole", set: ["algorithm=Random", "stop=Episodes(2)"])],
                repeats: 3,
                measures: [FinalReturn(window: 2)],
                claims: [(text: "They fall soon.", compare: ("short", "built in"), direction: Same, smallest: 500,
                    because: "it is above all returns", confirmatory: true)],
            )"#,
        );
        project
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::create_dir_all(self.path(name).parent().unwrap()).unwrap();
        fs::write(self.path(name), text).unwrap();
    }

    /// Runs `seedbed ARGUMENTS` in a directory of the project.
    fn seedbed(&self, folder: &str, arguments: &[&str]) -> Output {
        let mut command = command(arguments);
        command.current_dir(self.path(folder)).output().unwrap()
    }

    fn succeed(&self, folder: &str, arguments: &[&str]) -> String {
        let output = self.seedbed(folder, arguments);
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        stdout(&output)
    }

    /// The error of a command that must refuse its input.
    fn refusal(&self, arguments: &[&str]) -> String {
        let output = self.seedbed("lab", arguments);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        stderr(&output)
    }

    /// Registers, runs and packs the study. Returns the bytes of the submission.
    fn submit(&self) -> Vec<u8> {
        self.succeed("lab", &["study", STUDY, "--register"]);
        self.succeed("lab", &["study", STUDY, "--confirm"]);
        let printed = self.succeed("lab", &["submit", STUDY, "--out", "small.zip"]);
        assert!(
            printed.contains("packed     small.zip (10 files, "),
            "{printed}"
        );
        fs::read(self.path("lab/small.zip")).unwrap()
    }

    /// Unpacks a submission into the directory `elsewhere`, and removes the project that it is from.
    /// Returns the directory of the submission.
    fn unpack_elsewhere(&self, archive: &[u8]) -> String {
        let mut archive = ZipArchive::new(Cursor::new(archive)).unwrap();
        archive.extract(self.path("elsewhere")).unwrap();
        fs::remove_dir_all(self.path("lab")).unwrap();
        let mut unpacked = fs::read_dir(self.path("elsewhere")).unwrap();
        let folder = unpacked.next().unwrap().unwrap().file_name();
        assert!(unpacked.next().is_none(), "there is one directory in it");
        format!("elsewhere/{}", folder.to_str().unwrap())
    }
}

#[test]
fn a_submission_is_verified_without_the_project_that_it_is_from() {
    let project = Project::new();
    let archive = project.submit();
    let folder = project.unpack_elsewhere(&archive);
    let read_me = fs::read_to_string(project.path(&folder).join("README.md")).unwrap();
    let commands: Vec<Vec<&str>> = read_me
        .lines()
        .filter_map(|line| line.strip_prefix("    seedbed "))
        .map(|line| line.split('#').next().unwrap().split_whitespace().collect())
        .collect();
    assert_eq!(commands.len(), 3, "{read_me}");
    let printed: Vec<String> = commands
        .iter()
        .map(|arguments| project.succeed(&folder, arguments))
        .collect();
    assert!(
        printed[0].contains("open             They fall soon."),
        "{printed:?}"
    );
    assert!(
        printed[1].contains("1 of 1 repeated runs are bit-identical (6 runs published)"),
        "{printed:?}"
    );
    assert!(printed[2].contains("6 finished"), "{printed:?}");
}

#[test]
fn a_submission_says_what_made_it_and_does_not_depend_on_the_time() {
    let project = Project::new();
    let archive = project.submit();
    assert_eq!(archive, {
        project.succeed("lab", &["submit", STUDY, "--out", "again.zip"]);
        fs::read(project.path("lab/again.zip")).unwrap()
    });
    let folder = project.unpack_elsewhere(&archive);
    let text = fs::read_to_string(project.path(&folder).join("submission.json")).unwrap();
    let description: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(description["study"], STUDY);
    assert_eq!(description["runs"]["finished"], 6);
    assert_eq!(
        description["builds"]["versions"][0],
        env!("CARGO_PKG_VERSION")
    );
    let packer = &description["packed_by"];
    assert_eq!(
        packer["executable"],
        description["builds"]["executables"][0]
    );
    assert!(!packer["cpu_level"].as_str().unwrap().is_empty());
    let names: Vec<&String> = description["sha256"].as_object().unwrap().keys().collect();
    assert_eq!(
        names,
        [
            "README.md",
            "envs/base.ron",
            "envs/short.ron",
            "scenarios/papers/results/small/builds.json",
            "scenarios/papers/results/small/results.csv.gz",
            "scenarios/papers/results/small/study.json",
            "scenarios/papers/small.ron",
            "scenarios/papers/small.ron.lock",
            "scenarios/short.ron",
        ]
    );
}

#[test]
fn changed_results_and_changed_tasks_of_a_submission_are_noticed() {
    let project = Project::new();
    let archive = project.submit();
    let folder = project.unpack_elsewhere(&archive);
    let verify = ["study", STUDY, "--confirm", "--verify=100%"];
    project.succeed(&folder, &verify);
    let task = project.path(&folder).join("envs/short.ron");
    let text = fs::read_to_string(&task).unwrap();
    fs::write(&task, text.replace("time_limit: 20", "time_limit: 21")).unwrap();
    let output = project.seedbed(&folder, &verify);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    fs::write(&task, text).unwrap();
    let table = project
        .path(&folder)
        .join("scenarios/papers/results/small/results.csv.gz");
    let mut bytes = fs::read(&table).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&table, bytes).unwrap();
    let output = project.seedbed(&folder, &verify);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
}

#[test]
fn studies_without_a_lock_or_without_all_results_are_not_packed() {
    let project = Project::new();
    let error = project.refusal(&["submit", STUDY]);
    assert!(
        error.contains("register the study with --register"),
        "{error}"
    );
    project.succeed("lab", &["study", STUDY, "--register"]);
    let error = project.refusal(&["submit", STUDY]);
    assert!(error.contains("recordings/studies/small-"), "{error}");
    project.succeed("lab", &["study", STUDY, "--confirm", "--index", "0"]);
    let error = project.refusal(&["submit", STUDY]);
    assert!(
        error.contains("5 of 6 runs are missing; expected the results of all runs"),
        "{error}"
    );
    assert!(
        !project
            .path("lab/recordings/submissions")
            .join("small.zip")
            .exists()
    );
}
