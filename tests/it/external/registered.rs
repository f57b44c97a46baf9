//! Registered and published results of others, and attempts to cheat.

use std::fs;
use std::path::PathBuf;

use super::Fixture;
use crate::util::{seedbed, stderr, stdout, study_arguments, write_manifest_without_checksum};

/// A registered study of two cells with three runs each.
const REGISTERED: &str = r#"Study(
    title: "Registered",
    repeats: 3,
    cells: [(name: "a", results: Csv(files: "a/*.csv")), (name: "b", results: Csv(files: "b/*.csv"))],
    measures: [FinalReturn(window: 1)],
    claims: [(text: "more", compare: ("a", "b"), direction: More, smallest: 1, confirmatory: true)],
)"#;

impl Fixture {
    fn write_run(&self, name: &str, value: f64) {
        self.write(name, &format!("return\n0\n{value}\n"));
    }

    /// Registers a study before its files exist.
    fn registered() -> Self {
        let fixture = Self::new(REGISTERED);
        let printed = fixture.succeed(&["register"]);
        assert!(
            printed.contains(
                "of others  a: 3 runs; not fixed: run seeds, code, and when the runs were made"
            ),
            "{printed}"
        );
        fixture
    }

    fn write_all_runs(&self) {
        for number in 0..3 {
            self.write_run(&format!("a/{number}.csv"), 20.0 + f64::from(number));
            self.write_run(&format!("b/{number}.csv"), 10.0 + 0.5 * f64::from(number));
        }
    }

    /// Registers, makes all runs and confirms.
    fn confirmed() -> Self {
        let fixture = Self::registered();
        fixture.write_all_runs();
        let printed = fixture.succeed(&["confirm"]);
        assert!(printed.contains("6 finished\n"), "{printed}");
        fixture
    }
}

#[test]
fn a_study_is_registered_before_its_results_exist() {
    let fixture = Fixture::registered();
    let refused = fixture.fail(2, &[]);
    assert!(
        refused.contains("matches `a/*.csv`; expected a CSV file"),
        "{refused}"
    );
    let missing = fixture.succeed(&["confirm"]);
    assert!(
        missing.contains("3 of 3 runs of cell `a` are missing."),
        "{missing}"
    );
    assert!(
        missing.contains("1 confirmatory claim: 1 open"),
        "{missing}"
    );
    fixture.write_run("a/0.csv", 20.0);
    let missing = fixture.succeed(&["confirm"]);
    assert!(
        missing.contains("2 of 3 runs of cell `a` are missing."),
        "{missing}"
    );
    fixture.write_all_runs();
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("6 finished\n") && !confirmed.contains("missing"),
        "{confirmed}"
    );
    let note = "The runs of cell `a` were made by others. The lock does not fix their run seeds, code, and when the runs were made.";
    assert!(confirmed.contains(note) && fixture.output("claims.md").contains(note));
    let lock: serde_json::Value =
        serde_json::from_slice(&fs::read(fixture.path("mine.ron.lock")).unwrap()).unwrap();
    let registered = &lock["registered"]["results_of_others"][1];
    assert_eq!(
        registered["source"],
        r#"Csv(files:"b/*.csv",columns:(return:"return",env_steps:None,length:None,episode:None,agent:None,run:None))"#
    );
    assert_eq!(
        (&registered["cell"], &registered["runs"]),
        (&"b".into(), &3.into())
    );
}

/// A file that existed, one that continues it, and one that was moved to the other cell.
#[test]
fn files_that_existed_at_the_registration_are_not_used() {
    let fixture = Fixture::new(REGISTERED);
    fixture.write_run("a/0.csv", 99.0);
    fixture.write_run("a/1.csv", 98.0);
    fixture.write_run("b/0.csv", 97.0);
    let printed = fixture.succeed(&["register"]);
    assert!(
        printed.contains("seen       3 files of results, which `confirm` does not use"),
        "{printed}"
    );
    fixture.append("a/1.csv", "50\n");
    fs::rename(fixture.path("b/0.csv"), fixture.path("a/2.csv")).unwrap();
    for number in 3..6 {
        fixture.write_run(&format!("a/{number}.csv"), 20.0 + f64::from(number));
        fixture.write_run(&format!("b/{number}.csv"), f64::from(number));
    }
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(confirmed.contains("6 finished\n"), "{confirmed}");
    assert!(
        confirmed.contains(
            "Not used: 3 runs of cell `a`, whose files existed when the study was registered."
        ),
        "{confirmed}"
    );
    // The hash is that of `printf 'return\n0\n99\n' | sha256sum`.
    let seen = "Seen before: `a/0.csv` of cell `a`, SHA-256 ab83c352d5e40d31f140d79667eba7e4dfea9fa9a8140a01f6f261bed6293779.";
    assert!(confirmed.contains(seen), "{confirmed}");
    let rows = fixture.rows();
    let names: Vec<&str> = rows.iter().map(|row| row["run"].as_str()).collect();
    assert_eq!(
        names,
        [
            "a/3.csv", "a/4.csv", "a/5.csv", "b/3.csv", "b/4.csv", "b/5.csv"
        ]
    );
    // Files that an earlier registration saw are not forgotten.
    fs::rename(fixture.path("a/0.csv"), fixture.path("hidden")).unwrap();
    fixture.write(
        "mine.ron",
        &REGISTERED.replace("smallest: 1", "smallest: 2"),
    );
    fixture.succeed(&["register"]);
    fs::rename(fixture.path("hidden"), fixture.path("b/9.csv")).unwrap();
    fs::remove_dir_all(fixture.path("out")).unwrap();
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("runs       0 finished, 6 missing"),
        "{confirmed}"
    );
    assert!(
        confirmed.contains("Not used: 4 runs of cell `b`"),
        "{confirmed}"
    );
}

/// The axes of visits are those of runs that existed at the registration, and are not known before others exist.
#[test]
fn a_study_is_confirmed_whose_files_existed_at_the_registration() {
    let study = REGISTERED.replace(r#"Csv(files: "a/*.csv")"#, r#"Runs("runs/*")"#);
    let fixture = Fixture::new(&study);
    let out = fixture.path("runs/0");
    let run = [
        "run",
        "cartpole",
        "--set",
        "stop=Episodes(2)",
        "--set",
        "agents.count=1",
        "--no-recording",
        "--out",
    ];
    let output = seedbed(&[&run[..], &[out.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{output:?}");
    fixture.succeed(&["register"]);
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("Not used: 1 run of cell `a`") && !confirmed.contains("differs"),
        "{confirmed}"
    );
}

/// When its runs count as solved must be known before they are made.
#[test]
fn measures_need_a_threshold_before_the_files_exist() {
    let with_times = REGISTERED.replace("window: 1)],", "window: 1), EpisodesToSolve],");
    let study = with_times
        .replace(r#"Csv(files: "a/*.csv")"#, r#"Runs("a/*")"#)
        .replace(r#"Csv(files: "b/*.csv")"#, r#"Runs("b/*")"#);
    let fixture = Fixture::new(&study);
    let error = fixture.fail(2, &["register"]);
    assert!(
        error.contains("the study does not say when its runs count as solved"),
        "{error}"
    );
    assert!(!fixture.path("mine.ron.lock").exists());
}

#[test]
fn more_runs_than_registered_are_refused() {
    let fixture = Fixture::confirmed();
    fixture.write_run("a/3.csv", 100.0);
    let error = fixture.fail(2, &["confirm"]);
    assert!(
        error.contains(
            "found 4 runs, expected 3: which of them count must not depend on their results"
        ),
        "{error}"
    );
}

#[test]
fn a_changed_run_is_reported() {
    let fixture = Fixture::confirmed();
    fixture.write_run("a/1.csv", 100.0);
    let printed = fixture.fail(1, &["confirm"]);
    let expected =
        "not confirmed: The run `a/1.csv` of cell `a` was changed after it had been read.";
    assert!(printed.contains(expected), "{printed}");
    assert!(
        printed.contains("1 confirmatory claim: 1 open"),
        "{printed}"
    );
    // It stays reported when it is changed back.
    fixture.write_run("a/1.csv", 21.0);
    assert!(fixture.fail(1, &["confirm"]).contains(expected));
}

#[test]
fn a_run_that_was_moved_to_another_cell_is_reported() {
    let fixture = Fixture::confirmed();
    fs::rename(fixture.path("a/0.csv"), fixture.path("x")).unwrap();
    fs::rename(fixture.path("b/0.csv"), fixture.path("a/7.csv")).unwrap();
    fs::rename(fixture.path("x"), fixture.path("b/7.csv")).unwrap();
    let printed = fixture.fail(1, &["confirm"]);
    let expected =
        "not confirmed: The run `a/7.csv` of cell `a` had been read as `b/0.csv` of cell `b`.";
    assert!(printed.contains(expected), "{printed}");
    assert!(
        printed.contains("1 confirmatory claim: 1 open"),
        "{printed}"
    );
}

#[test]
fn a_deleted_run_leaves_claims_open() {
    let fixture = Fixture::confirmed();
    fs::remove_file(fixture.path("b/2.csv")).unwrap();
    let printed = fixture.succeed(&["confirm"]);
    assert!(
        printed.contains("1 of 3 runs of cell `b` are missing."),
        "{printed}"
    );
    assert!(
        printed.contains("1 confirmatory claim: 1 open"),
        "{printed}"
    );
    // Another run in its place does not count, under whatever name.
    fixture.write_run("b/9.csv", 5.0);
    let printed = fixture.fail(1, &["confirm"]);
    let expected =
        "The run `b/9.csv` of cell `b` was added when `b/2.csv`, which had been read, was gone.";
    assert!(printed.contains(expected), "{printed}");
    fs::remove_file(fixture.path("b/9.csv")).unwrap();
    fixture.write_run("b/2.csv", 6.0);
    let printed = fixture.fail(1, &["confirm"]);
    assert!(
        printed.contains("The run `b/2.csv` of cell `b` was changed"),
        "{printed}"
    );
}

#[test]
fn a_changed_mapping_or_threshold_is_refused() {
    let fixture = Fixture::registered();
    fixture.write(
        "mine.ron",
        &REGISTERED.replace("\"b/*.csv\"", "\"best/*.csv\""),
    );
    let error = fixture.fail(2, &["confirm"]);
    assert!(
        error.contains("settings of cell `b` were changed"),
        "{error}"
    );
    fixture.write(
        "mine.ron",
        &REGISTERED.replace("repeats: 3", "repeats: 3, solved: (return: 5)"),
    );
    let error = fixture.fail(2, &["confirm"]);
    assert!(
        error.contains("settings of cell `a` were changed"),
        "{error}"
    );
    fixture.write(
        "mine.ron",
        &REGISTERED.replace("(name: \"a\",", "(name: \"a\", repeats: 2,"),
    );
    let error = fixture.fail(2, &["confirm"]);
    assert!(error.contains("another value was changed"), "{error}");
}

/// Whoever edits what the results say of the files gets no verdict.
#[test]
fn edited_descriptions_of_files_are_reported() {
    let fixture = Fixture::new(REGISTERED);
    fixture.write_run("a/seen.csv", 99.0);
    fixture.succeed(&["register"]);
    fixture.write_all_runs();
    fixture.succeed(&["confirm"]);
    let manifest = fixture.path("out/study.json");
    let original = fs::read_to_string(&manifest).unwrap();
    let parsed: serde_json::Value = serde_json::from_str(&original).unwrap();
    let seen = &parsed["lock"]["registered"]["seen_files"][0]["file"]["sha256"];
    let run = &parsed["cells"][0]["external"]["runs"][0]["files"][0]["sha256"];
    let runs = "\"runs\": 3,";
    assert!(original.contains(runs));
    for (old, new) in [
        (run.as_str().unwrap(), seen.as_str().unwrap()),
        (runs, "\"runs\": 2,"),
        ("repeats: 3", "repeats: 2"),
        ("a/*.csv", "c/*.csv"),
    ] {
        write_manifest_without_checksum(&manifest, &original.replace(old, new));
        let out = fixture.path("out");
        let output = seedbed(&["report", out.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(1), "{old}: {output:?}");
        assert!(
            stdout(&output).contains("1 confirmatory claim: 1 open"),
            "{output:?}"
        );
    }
}

/// Without the files, nothing says whether published numbers of others are theirs.
#[test]
fn published_results_of_others_are_not_verified_without_their_files() {
    let fixture = Fixture::confirmed();
    let paths = ["out", "published"].map(|name| fixture.path(name));
    let paths = paths.each_ref().map(|path| path.to_str().unwrap());
    assert!(
        seedbed(&["report", paths[0], "--publish", paths[1]])
            .status
            .success()
    );
    for folder in [PathBuf::from(paths[0]), fixture.path("published/mine")] {
        let [study, folder] =
            [&fixture.path("mine.ron"), &folder].map(|path| path.display().to_string());
        let verify = || {
            let verify = ["verify", "--registered", "--runs=100%"];
            seedbed(&study_arguments(&study, &folder, &verify))
        };
        assert!(verify().status.success(), "{:?}", verify());
        fs::rename(fixture.path("a"), fixture.path("gone")).unwrap();
        let output = verify();
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(
            stdout(&output).contains("3 of 3 repeated runs are bit-identical"),
            "{output:?}"
        );
        let error = stderr(&output);
        assert!(
            error.contains("missing    the files of 3 runs of cell `a`, with which"),
            "{error}"
        );
        assert!(error.ends_with("error: 3 runs not reproduced\n"), "{error}");
        fs::rename(fixture.path("gone"), fixture.path("a")).unwrap();
    }
}
