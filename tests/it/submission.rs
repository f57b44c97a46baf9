//! Submissions: what `seedbed submit` packs can be checked without anything else.

use std::fs;
use std::io::{Cursor, Read, Write};
use std::path::PathBuf;
use std::process::Output;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use sha2::{Digest, Sha256};

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
        self.succeed("lab", &["study", "register", STUDY]);
        self.succeed("lab", &["study", "confirm", STUDY]);
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
        printed[1].contains("2 of 2 repeated runs are bit-identical (6 runs published)"),
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
    let verify = ["study", "verify", STUDY, "--registered", "--runs=100%"];
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

/// Changes the table of an unpacked submission, and the hashes, as somebody would do who does not want the
/// change to be noticed.
fn forge(project: &Project, folder: &str, change: impl Fn(&mut Vec<Vec<String>>)) {
    let root = project.path(folder);
    let results = "scenarios/papers/results/small";
    let table = root.join(results).join("results.csv.gz");
    let mut text = String::new();
    GzDecoder::new(fs::File::open(&table).unwrap())
        .read_to_string(&mut text)
        .unwrap();
    let mut reader = csv::ReaderBuilder::new();
    let reader = reader.has_headers(false).from_reader(text.as_bytes());
    let rows = reader.into_records().map(Result::unwrap);
    let mut rows: Vec<Vec<String>> = rows
        .map(|row| row.iter().map(str::to_owned).collect())
        .collect();
    change(&mut rows);
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        writer.write_record(&row).unwrap();
    }
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&writer.into_inner().unwrap()).unwrap();
    fs::write(&table, encoder.finish().unwrap()).unwrap();
    let hash = |path: &str| format!("{:x}", Sha256::digest(fs::read(root.join(path)).unwrap()));
    let set_hash = |file: &str, name: &str, hash: String| {
        let path = root.join(file);
        let text = fs::read_to_string(&path).unwrap();
        let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
        json["sha256"][name] = hash.into();
        fs::write(path, json.to_string()).unwrap();
    };
    let [builds, table] = ["builds.json", "results.csv.gz"].map(|name| format!("{results}/{name}"));
    set_hash(&builds, "results.csv.gz", hash(&table));
    set_hash("submission.json", &table, hash(&table));
    set_hash("submission.json", &builds, hash(&builds));
}

const VERIFY: [&str; 5] = ["study", "verify", STUDY, "--registered", "--runs=2%"];

/// All rows but the first are forged: of the second cell, every run that can be drawn.
#[test]
fn forged_rows_are_found_when_runs_are_repeated() {
    let project = Project::new();
    let folder = project.unpack_elsewhere(&project.submit());
    forge(&project, &folder, |rows| {
        let column = rows[0].iter().position(|name| name == "mean_return");
        for row in &mut rows[2..] {
            row[column.unwrap()] += "1";
        }
    });
    for _ in 0..3 {
        let output = project.seedbed(&folder, &VERIFY);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(stderr(&output).contains("not reproduced"), "{output:?}");
    }
}

#[test]
fn tables_with_impossible_or_missing_values_are_refused() {
    let project = Project::new();
    let archive = project.submit();
    let folder = project.unpack_elsewhere(&archive);
    let report = ["report", "scenarios/papers/results/small"];
    let refused = |message: &str, change: &dyn Fn(&mut Vec<Vec<String>>)| {
        ZipArchive::new(Cursor::new(&archive))
            .unwrap()
            .extract(project.path("elsewhere"))
            .unwrap();
        forge(&project, &folder, change);
        for arguments in [&report[..], &VERIFY] {
            let output = project.seedbed(&folder, arguments);
            assert_eq!(output.status.code(), Some(2), "{message}: {output:?}");
            assert!(stderr(&output).contains(message), "{message}: {output:?}");
        }
    };
    let set = |column: &'static str, value: &'static str| {
        move |rows: &mut Vec<Vec<String>>| {
            let column = rows[0].iter().position(|name| name == column).unwrap();
            value.clone_into(&mut rows[2][column]);
        }
    };
    let table = "scenarios/papers/results/small/results.csv.gz";
    for (column, value, expected) in [
        ("team_coverage", "7", "a number from 0 to 1"),
        ("team_coverage", "inf", "a number from 0 to 1"),
        ("team_coverage", "NaN", "a number from 0 to 1"),
        ("mean_return", "inf", "a number"),
        ("gradient_steps", "-1", "a number from 0"),
        ("effective_agents", "3", "a number from 1 to 2"),
    ] {
        let message =
            format!("{table}:3: `{value}` in the column `{column}`; expected {expected}\n");
        refused(&message, &set(column, value));
    }
    refused(
        "3 in the column `episodes`; the study has at most 2 per agent",
        &set("episodes", "3"),
    );
    refused("`-3` in the column `env_steps`", &set("env_steps", "-3"));
    refused(
        "expected a value as of other runs",
        &set("FinalReturn(window:2)", ""),
    );
    refused("1 of 6 runs is missing; expected one row", &|rows| {
        drop(rows.pop());
    });
    refused("the study has no (second) run of `short`", &|rows| {
        rows.push(rows[1].clone());
    });
    refused("with run seed 5", &set("seed", "5"));
    refused("expected one column `reach`, found 0", &|rows| {
        let column = rows[0].iter().position(|name| name == "reach").unwrap();
        for row in rows.iter_mut() {
            drop(row.remove(column));
        }
    });
    refused(
        "`1` in the column `agents`; the study says `2`",
        &set("agents", "1"),
    );
}

#[test]
fn every_file_of_a_submission_must_have_its_hash() {
    let project = Project::new();
    let folder = project.unpack_elsewhere(&project.submit());
    fs::write(project.path(&folder).join("README.md"), "Other results.").unwrap();
    let output = project.seedbed(&folder, &VERIFY);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(
        stderr(&output).contains("README.md: is damaged, or was changed after it was written"),
        "{output:?}"
    );
}

#[test]
fn studies_without_a_lock_or_without_all_results_are_not_packed() {
    let project = Project::new();
    let error = project.refusal(&["submit", STUDY]);
    assert!(
        error.contains("register the study with `seedbed study register`"),
        "{error}"
    );
    project.succeed("lab", &["study", "register", STUDY]);
    let error = project.refusal(&["submit", STUDY]);
    assert!(error.contains("recordings/studies/small-"), "{error}");
    project.succeed("lab", &["study", "confirm", STUDY, "--index", "0"]);
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
