//! Attempts to cheat: runs, locks and descriptions of results that are edited, added or deleted.

use std::fs;

use super::{Fixture, edit_json, with_repeats};
use crate::util::{run_refused, stderr, write_manifest_without_checksum};

#[test]
fn more_runs_than_registered_are_refused_and_not_used() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let verdict = fixture.claims_table();
    fixture.write_study(&with_repeats(8));
    let error = fixture.refusal();
    assert!(
        error.contains("numbers of runs per cell are 6 in the lock and 8 in the study"),
        "{error}"
    );
    // A run under another name is not one of the registered runs.
    let file = &fixture.result_files()[0];
    let name = file.file_stem().unwrap().to_str().unwrap();
    fs::copy(file, file.with_file_name(format!("{name}7.run"))).unwrap();
    assert!(
        fixture
            .report()
            .contains("note       Not registered and not used: 1 result file in the directory.")
    );
    let rows = |table: &str| table.lines().take(3).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(rows(&fixture.claims_table()), rows(&verdict));
}

#[test]
fn an_edited_run_is_not_used_and_is_repeated() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let file = &fixture.result_files()[3];
    let original = fs::read(file).unwrap();
    let mut edited = original.clone();
    let middle = edited.len() / 2;
    edited[middle] ^= 1;
    fs::write(file, edited).unwrap();
    let error = run_refused(&["report", fixture.path("out").to_str().unwrap()]);
    let expected = format!("error: {} is damaged, was changed", file.display());
    assert!(error.starts_with(&expected), "{error}");
    assert!(
        error.ends_with("seedbed study confirm small.ron\n"),
        "{error}"
    );
    fixture.succeed(&["confirm"]);
    assert_eq!(fs::read(file).unwrap(), original);
    assert!(
        fixture
            .succeed(&["verify", "--registered", "--runs=12"])
            .contains("12 of 12 repeated runs are bit-identical")
    );
}

#[test]
fn a_deleted_run_leaves_claims_open_and_is_repeated() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let file = &fixture.result_files()[5];
    let original = fs::read(file).unwrap();
    fs::remove_file(file).unwrap();
    let report = fixture.report();
    assert!(
        report.contains("note       1 run of the registered runs: missing."),
        "{report}"
    );
    assert!(report.contains("1 confirmatory claim: 1 open"), "{report}");
    fixture.succeed(&["confirm"]);
    assert_eq!(fs::read(file).unwrap(), original);
}

/// The lock says which build registered the study. A lock of another build differs in its id, too;
/// here its contents are changed by hand, with and without the id of the new contents.
#[test]
fn an_edited_lock_is_refused_and_another_build_is_reported() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let lock = fixture.path("small.ron.lock");
    let text = fs::read_to_string(&lock).unwrap();
    fs::write(
        &lock,
        text.replace("smallest", "largest")
            .replace("| 5 |", "| 1 |"),
    )
    .unwrap();
    let error = fixture.refusal();
    assert!(
        error.contains("this lock was changed after it was made"),
        "{error}"
    );
    for no_lock in [&b"{"[..], b"no JSON", b"\xff\xfe", b"[]"] {
        fs::write(&lock, no_lock).unwrap();
        let error = fixture.refusal();
        assert!(error.contains("this is no lock of a study: "), "{error}");
    }
    // The same in the stored results: the report says so, and gives no verdict.
    let manifest = fixture.path("out/study.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let build = text.split("\"build\": \"").nth(1).unwrap()[..16].to_owned();
    write_manifest_without_checksum(&manifest, &text.replace(&build, "0123456789abcdef"));
    let report = fixture.refuted_report();
    assert!(
        report.contains("not confirmed: The lock was changed after it was made"),
        "{report}"
    );
    assert!(
        report.contains("note       Runs were made by another build"),
        "{report}"
    );
    assert!(report.contains("1 confirmatory claim: 1 open"), "{report}");
    let page = fs::read_to_string(fixture.path("out/report.html")).unwrap();
    assert!(page.contains("Not confirmed."));
}

/// A claim in the reported study that the lock does not have.
#[test]
fn a_claim_edited_in_the_results_is_reported() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let manifest = fixture.path("out/study.json");
    let text = fs::read_to_string(&manifest).unwrap();
    write_manifest_without_checksum(&manifest, &text.replace("smallest: 5", "smallest: 1"));
    let report = fixture.refuted_report();
    assert!(
        report.contains("not confirmed: The reported study differs from its lock: the claim"),
        "{report}"
    );
    assert!(
        fixture
            .claims_table()
            .starts_with("Not final: not what was registered")
    );
}

/// Whoever changes what the results say of themselves gets no verdict: the number of runs, with the
/// other runs deleted or not, the settings and descriptions of cells, texts, and the name.
#[test]
fn edited_descriptions_of_results_are_reported() {
    let edits = [
        ("\"repeats\": 6", "\"repeats\": 5"),
        ("SeedSampling()\\\"", "ThompsonResampling\\\""),
        ("\"agents\": 10", "\"agents\": 999"),
        ("\"max_episodes\": 40", "\"max_episodes\": 5"),
        ("less regret", "more regret"),
        ("title: \\\"Small", "title: \\\"Preregistered"),
        ("\"quick\": false", "\"quick\": true"),
        ("\"name\": \"small\"", "\"name\": \"large\""),
    ];
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let manifest = fixture.path("out/study.json");
    let original = fs::read(&manifest).unwrap();
    for (old, new) in edits {
        fixture.edit_manifest(old, new);
        fixture.refuted_report();
        fs::write(&manifest, &original).unwrap();
    }
    assert!(
        fixture
            .report()
            .contains("1 confirmatory claim: 1 supported")
    );
}

/// Exchanges the settings of both cells, also in the lock that the results have.
fn swap_cells(json: &mut serde_json::Value) {
    for key in ["digest", "sha256"] {
        let first = json["cells"][0][key].take();
        json["cells"][0][key] = json["cells"][1][key].take();
        json["cells"][1][key] = first;
    }
    if json["lock"].is_null() {
        return;
    }
    let registered = &mut json["lock"]["registered"];
    for key in ["cells", "cell_hashes"] {
        if registered[key].is_array() {
            let first = registered[key][0][1].take();
            registered[key][0][1] = registered[key][1][1].take();
            registered[key][1][1] = first;
        }
    }
}

fn drop_cell(json: &mut serde_json::Value) {
    json["cells"].as_array_mut().unwrap().pop();
}

/// A forged description with the right runs is not that of the study, whether it is registered or not.
#[test]
fn verify_compares_descriptions_with_the_study() {
    type Edit = fn(&mut serde_json::Value);
    let edits: [(&str, Edit); 7] = [
        ("the cell `random` is missing", drop_cell),
        ("settings of cell `seeds` are others; ", swap_cells),
        (
            "there are 5 runs of each cell where the study has 6",
            |json| {
                json["repeats"] = 5.into();
            },
        ),
        ("the first run seed is 1001 where", |json| {
            json["first_seed"] = 1001.into();
        }),
        ("the claim `seeds | random | Regret | Less | 5", |json| {
            let study = json["study"].as_str().unwrap();
            json["study"] = study.replace("smallest: 5", "smallest: 1").into();
        }),
        (
            "a text, a figure, a measure or another value was changed",
            |json| {
                let study = json["study"].as_str().unwrap();
                json["study"] = study.replace("\"Small\"", "\"Large\"").into();
            },
        ),
        ("the description of cell `seeds` was changed", |json| {
            json["cells"][0]["agents"] = 9.into();
        }),
    ];
    for confirm in [&["confirm"][..], &[]] {
        let fixture = Fixture::new(&with_repeats(6));
        if !confirm.is_empty() {
            fixture.succeed(&["register"]);
        }
        fixture.succeed(confirm);
        let registered: &[&str] = if confirm.is_empty() {
            &[]
        } else {
            &["--registered"]
        };
        let verify = [&["verify", "--runs=100%"], registered].concat();
        fixture.succeed(&verify);
        let manifest = fixture.path("out/study.json");
        let original = fs::read(&manifest).unwrap();
        for (expected, edit) in &edits {
            edit_json(&manifest, edit);
            let output = fixture.study(&verify);
            assert_eq!(output.status.code(), Some(1), "{expected}: {output:?}");
            let error = stderr(&output);
            assert!(error.contains(expected), "{expected}: {error}");
            fs::write(&manifest, &original).unwrap();
        }
    }
}

/// The runs of a lock that was edited together with its id are those of no lock that others have.
#[test]
fn verify_compares_the_lock_of_results_with_that_of_the_study() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    edit_json(&fixture.path("out/study.json"), |json| {
        json["lock"]["registered"]["build"] = "0123456789abcdef".into();
    });
    let output = fixture.study(&["verify", "--registered"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(
        stderr(&output).contains("the lock was changed"),
        "{output:?}"
    );
}

/// Runs that a longer study has in addition were not made.
#[test]
fn results_of_a_shorter_study_are_not_verified() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.succeed(&[]);
    fixture.write_study(&with_repeats(8));
    let output = fixture.study(&["verify"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let expected = "there are 6 runs of each cell where the study has 8\n";
    assert!(stderr(&output).contains(expected), "{output:?}");
}
