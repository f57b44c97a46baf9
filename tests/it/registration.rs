//! Registered studies on the command line: locks, confirmations, and attempts to cheat.

use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::Output;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use sha2::{Digest, Sha256};

use super::util::{
    REPOSITORY, run_refused, seedbed, stderr, stdout, study_arguments,
    write_manifest_without_checksum,
};

/// A study in a directory of its own, with its own copy of the scenario.
struct Fixture {
    folder: tempfile::TempDir,
}

impl Fixture {
    /// A study with these claims and further fields, of six finite runs of each of two cells.
    fn new(fields: &str) -> Self {
        let fixture = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let scenario = Path::new(REPOSITORY).join("scenarios/tabular/deep_sea.ron");
        fs::copy(scenario, fixture.path("deep_sea.ron")).unwrap();
        fixture.write_study(fields);
        fixture
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write_study(&self, fields: &str) {
        let text = format!(
            r#"Study(
                title: "Small",
                scenario: "deep_sea.ron",
                set: ["agents.count=10", "episodes=40"],
                cells: [
                    (name: "seeds", set: ["algorithm=SeedSampling()"]),
                    (name: "random", set: ["algorithm=Random"]),
                ],
                measures: [Regret],
                {fields}
            )"#
        );
        fs::write(self.path("small.ron"), text).unwrap();
    }

    fn study(&self, arguments: &[&str]) -> Output {
        let paths = [self.path("small.ron"), self.path("out")];
        let [study, out] = paths.each_ref().map(|path| path.to_str().unwrap());
        seedbed(&study_arguments(study, out, arguments))
    }

    /// The arguments must succeed. Returns the standard output.
    fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.study(arguments);
        assert!(output.status.success(), "{output:?}");
        stdout(&output)
    }

    /// Registers and confirms the study. Returns the output of `confirm`.
    fn confirm(&self) -> String {
        self.succeed(&["register"]);
        self.succeed(&["confirm"])
    }

    /// `confirm` must be refused as invalid input. Returns the error.
    fn refusal(&self) -> String {
        let output = self.study(&["confirm"]);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        stderr(&output)
    }

    /// Writes the report again, and returns the standard output.
    fn report(&self) -> String {
        let output = seedbed(&["report", self.path("out").to_str().unwrap()]);
        assert!(output.status.success(), "{output:?}");
        stdout(&output)
    }

    /// Writes the report again, which must fail because the results do not confirm what was
    /// registered, without any verdict. Returns the standard output.
    fn refuted_report(&self) -> String {
        let output = seedbed(&["report", self.path("out").to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        let printed = stdout(&output);
        assert!(
            printed.contains("claims     1 confirmatory claim: 1 open"),
            "{printed}"
        );
        assert!(printed.contains("not confirmed: "), "{printed}");
        printed
    }

    /// Publishes the results. Returns the folder with the published results.
    fn publish(&self) -> PathBuf {
        let [out, parent] = ["out", "published"].map(|name| self.path(name));
        let paths = [&out, &parent].map(|path| path.to_str().unwrap());
        let output = seedbed(&["report", paths[0], "--publish", paths[1]]);
        assert!(output.status.success(), "{output:?}");
        parent.join("small")
    }

    /// Replaces a text in the stored description of the results.
    fn edit_manifest(&self, old: &str, new: &str) {
        let path = self.path("out/study.json");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(old), "{old} in {text}");
        write_manifest_without_checksum(&path, &text.replace(old, new));
    }

    /// Paths of the result files, in the order of their names.
    fn result_files(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path("out/runs")).unwrap();
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }

    fn claims_table(&self) -> String {
        fs::read_to_string(self.path("out/claims.md")).unwrap()
    }
}

const CLAIM: &str = r#"claims: [(text: "less regret", compare: ("seeds", "random"), direction: Less, smallest: 5, confirmatory: true)],"#;

fn with_repeats(repeats: u32) -> String {
    format!("repeats: {repeats}, {CLAIM}")
}

#[test]
fn a_registered_study_is_confirmed_with_run_seeds_from_its_lock() {
    let fixture = Fixture::new(&with_repeats(6));
    assert!(
        fixture
            .refusal()
            .contains("register the study with `seedbed study register` first")
    );
    let registered = fixture.succeed(&["register"]);
    assert!(
        registered.contains("registered small: 1 confirmatory claim, 2 cells, 6 runs each"),
        "{registered}"
    );
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("1 confirmatory claim: 1 supported"),
        "{confirmed}"
    );
    let lock: serde_json::Value =
        serde_json::from_slice(&fs::read(fixture.path("small.ron.lock")).unwrap()).unwrap();
    let id = lock["id"].as_str().unwrap();
    assert!(fixture.claims_table().contains(&format!("lock `{id}`")));
    let listed = fixture.succeed(&["list", "--registered"]);
    assert!(
        listed.lines().all(|line| !line.contains("run seed 1000 ")),
        "{listed}"
    );
    assert_eq!(listed.matches("finished").count(), 12);
    // The same file is the same lock, and has no history.
    let again = fixture.succeed(&["register"]);
    assert!(
        again.contains(&id[..12]) && !again.contains("history"),
        "{again}"
    );
}

#[test]
fn a_changed_claim_is_refused_and_a_new_lock_names_the_old_one() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let seeds_before = fixture.succeed(&["list", "--registered"]);
    fixture.write_study(&with_repeats(6).replace("smallest: 5", "smallest: 1"));
    let error = fixture.refusal();
    assert!(
        error.contains("the study differs from its lock: the claim `seeds | random | Regret"),
        "{error}"
    );
    let registered = fixture.succeed(&["register"]);
    assert!(
        registered.contains("history    1 lock before this one"),
        "{registered}"
    );
    assert!(
        registered.contains("withdrawn  seeds | random | Regret | Less | 5"),
        "{registered}"
    );
    // All runs of the new lock are other runs.
    let other_lock = fixture.refusal();
    assert!(
        other_lock.contains("contains this study with other run seeds"),
        "{other_lock}"
    );
    fs::remove_dir_all(fixture.path("out")).unwrap();
    fixture.succeed(&["confirm"]);
    assert_ne!(fixture.succeed(&["list", "--registered"]), seeds_before);
    let table = fixture.claims_table();
    assert!(
        table.contains("An earlier lock: ") && table.contains("was withdrawn: `seeds"),
        "{table}"
    );
}

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
fn another_scenario_is_refused() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let scenario = fixture.path("deep_sea.ron");
    let text = fs::read_to_string(&scenario).unwrap();
    fs::write(
        &scenario,
        text.replacen("Scenario", "Scenario ", 1)
            .replace("width: 10", "width: 9"),
    )
    .unwrap();
    fixture.write_study(&with_repeats(6).replace("repeats", "first_seed: 1000, repeats"));
    fixture.succeed(&["confirm"]);
    fixture.write_study(&with_repeats(6));
    let study = fixture.path("small.ron");
    let text = fs::read_to_string(&study).unwrap();
    fs::write(&study, text.replace("episodes=40", "episodes=41")).unwrap();
    let error = fixture.refusal();
    assert!(
        error.contains("the scenario, the task or the settings of cell `seeds` were changed"),
        "{error}"
    );
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

/// The effect is so large that it is decided at the first of two looks.
#[test]
fn a_decided_study_stops_at_an_early_look() {
    let looks = with_repeats(20).replace("claims:", "looks: [10, 20], claims:");
    let fixture = Fixture::new(&looks);
    let confirmed = fixture.confirm();
    assert!(
        confirmed.contains("look       1 of 2: 10 runs per cell"),
        "{confirmed}"
    );
    assert!(
        confirmed.contains("decided    all confirmatory claims, at look 1 of 2"),
        "{confirmed}"
    );
    assert!(
        confirmed.contains("runs       20 finished\n"),
        "{confirmed}"
    );
    assert_eq!(fixture.result_files().len(), 20);
}

#[test]
fn a_study_without_confirmatory_claims_is_not_registered() {
    let fixture = Fixture::new("repeats: 6,");
    let output = fixture.study(&["register"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("the study has no confirmatory claim"),
        "{output:?}"
    );
}

#[test]
fn runs_from_before_the_registration_are_reported() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.succeed(&[]);
    fixture.succeed(&["register"]);
    fs::remove_dir_all(fixture.path("out")).unwrap();
    let confirmed = fixture.succeed(&["confirm"]);
    assert!(
        confirmed.contains("note       When the study was registered, 6 runs of cell `seeds` with other run seeds had been made."),
        "{confirmed}"
    );
}

#[test]
fn power_says_how_many_runs_each_claim_needs() {
    let fixture = Fixture::new(
        &with_repeats(6).replace("confirmatory", "expected: Deviation(10), confirmatory"),
    );
    let printed = fixture.succeed(&["power"]);
    // An effect of half a standard deviation at the level 0.025: 64 runs per cell, 86 for
    // a power of 0.9.
    assert!(
        printed.contains("0.0250     0.12       64       86  less regret"),
        "{printed}"
    );
}

/// Published results: the tables and verdicts of the report, computed from one row per run.
#[test]
fn published_results_give_the_tables_of_the_report() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let published = fixture.publish();
    for file in ["claims.md", "tables.md"] {
        let of_report = fs::read_to_string(fixture.path("out").join(file)).unwrap();
        fs::write(published.join(file), "").unwrap();
        let output = seedbed(&["report", published.to_str().unwrap()]);
        assert!(output.status.success(), "{output:?}");
        assert_eq!(fs::read_to_string(published.join(file)).unwrap(), of_report);
    }
}

#[test]
fn damaged_and_foreign_rows_of_published_results_are_refused() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let published = fixture.publish();
    let table = published.join("results.csv.gz");
    let bytes = fs::read(&table).unwrap();
    let refusal = |bytes: &[u8]| {
        fs::write(&table, bytes).unwrap();
        let output = seedbed(&["report", published.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        stderr(&output)
    };
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    assert!(refusal(&flipped).contains("results.csv.gz"));
    assert!(refusal(&bytes[..bytes.len() - 9]).contains("results.csv.gz"));
    let builds = fs::read(published.join("builds.json")).unwrap();
    fs::write(published.join("builds.json"), "{").unwrap();
    assert!(refusal(&bytes).contains("builds.json: "));
    fs::write(published.join("builds.json"), builds).unwrap();
    let text = decompressed(&bytes);
    for (old, new, expected) in [
        ("\nseeds,", "\nother,", ":2: the study has no cell `other`"),
        (",finished,", ",ended,", ":2: `ended` in the column `state`"),
        (
            "gradient_steps",
            "steps",
            "expected one column `gradient_steps`, found 0",
        ),
    ] {
        let edited = text.replacen(old, new, 1);
        assert_ne!(edited, text, "{old}");
        write_published_table(&published, &edited);
        let error = refusal(&fs::read(&table).unwrap());
        assert!(error.contains(expected), "{error}");
    }
}

/// Without a row of each run there are no tables and no verdict, also if the hash is that of the table.
#[test]
fn a_row_that_was_deleted_from_published_results_is_missed() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let published = fixture.publish();
    let text = decompressed(&fs::read(published.join("results.csv.gz")).unwrap());
    let all_but_last: Vec<&str> = text.lines().collect();
    let all_but_last = all_but_last[..all_but_last.len() - 1].join("\n");
    write_published_table(&published, &all_but_last);
    let output = seedbed(&["report", published.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let error = stderr(&output);
    assert!(error.contains(" is missing; expected one row"), "{error}");
}

fn decompressed(bytes: &[u8]) -> String {
    let mut text = String::new();
    GzDecoder::new(bytes).read_to_string(&mut text).unwrap();
    text
}

/// Replaces the table of published results, and its hash.
fn write_published_table(published: &Path, text: &str) {
    write_published_bytes(published, &compressed(text));
}

fn write_published_bytes(published: &Path, bytes: &[u8]) {
    let builds = published.join("builds.json");
    let mut json: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&builds).unwrap()).unwrap();
    json["sha256"]["results.csv.gz"] = format!("{:x}", Sha256::digest(bytes)).into();
    fs::write(builds, json.to_string()).unwrap();
    fs::write(published.join("results.csv.gz"), bytes).unwrap();
}

fn compressed(text: &str) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap()
}

/// In the deep sea, random agents hardly ever reach the treasure, and teams that sample seeds do.
#[test]
fn a_study_says_whether_its_task_is_one_of_exploration() {
    let gate = r#"exploration: (undirected: ["random"], measure: Reach),"#;
    let fixture = Fixture::new(&format!("repeats: 3, {gate}"));
    let printed = fixture.succeed(&[]);
    let expected = "gate       `DeepSea` with K = 10 is a task of exploration: the share of agents that \
                    reached the goal is ";
    assert!(printed.contains(expected), "{printed}");
    let swapped = Fixture::new(&format!("repeats: 3, {}", gate.replace("random", "seeds")));
    let printed = swapped.succeed(&[]);
    assert!(
        printed.contains("`DeepSea` with K = 10 is no task of exploration"),
        "{printed}"
    );
}

/// Changes what a folder of results says of itself.
fn edit_json(path: &Path, edit: impl Fn(&mut serde_json::Value)) {
    let mut json = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    edit(&mut json);
    json.as_object_mut().unwrap().remove("sha256");
    fs::write(path, json.to_string()).unwrap();
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

/// Two cells with equal settings share their runs, and each row is compared.
#[test]
fn forged_rows_of_a_cell_with_equal_settings_are_found() {
    let fixture = Fixture::new(&with_repeats(6));
    let study = fixture.path("small.ron");
    let text = fs::read_to_string(&study).unwrap();
    let twin = r#"(name: "twin", set: ["algorithm=Random"]), ],
                measures"#;
    fs::write(
        &study,
        text.replacen("],\n                measures", twin, 1),
    )
    .unwrap();
    fixture.succeed(&[]);
    let published = fixture.publish();
    let verify = || {
        let paths = [&study, &published].map(|path| path.to_str().unwrap());
        seedbed(&study_arguments(
            paths[0],
            paths[1],
            &["verify", "--runs=100%"],
        ))
    };
    assert!(verify().status.success(), "{:?}", verify());
    let table = decompressed(&fs::read(published.join("results.csv.gz")).unwrap());
    let forged: Vec<String> = table
        .lines()
        .map(|row| match row.strip_prefix("twin,") {
            Some(values) => format!("twin,{}", values.replacen("0.", "0.0", 1)),
            None => row.to_owned(),
        })
        .collect();
    assert_ne!(forged.join("\n") + "\n", table);
    write_published_table(&published, &(forged.join("\n") + "\n"));
    let output = verify();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(
        stdout(&output).contains("6 of 12 repeated runs"),
        "{output:?}"
    );
    let manifest = published.join("study.json");
    edit_json(&manifest, |json| {
        json["cells"][2]["digest"] = "0000000000000000".into();
    });
    edit_json(&published.join("builds.json"), |_| {});
    let output = verify();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(
        stderr(&output).contains("settings of cell `twin` are others"),
        "{output:?}"
    );
}

/// Every reader of gzip reads all members of a file (RFC 1952), and so does the report.
#[test]
fn all_members_of_a_compressed_table_are_read() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let published = fixture.publish();
    let table = published.join("results.csv.gz");
    let text = decompressed(&fs::read(&table).unwrap());
    let (first, rest) = text.split_at(text.len() / 2);
    let report = |bytes: Vec<u8>| {
        write_published_bytes(&published, &bytes);
        seedbed(&["report", published.to_str().unwrap()])
    };
    let output = report([compressed(first), compressed(rest)].concat());
    assert!(output.status.success(), "{output:?}");
    let row = text.lines().last().unwrap();
    for (more, expected) in [
        (
            compressed(row),
            ":14: the study has no (second) run of `random`",
        ),
        (
            b"no gzip at all".to_vec(),
            "results.csv.gz: is no whole file of gzip: ",
        ),
    ] {
        let output = report([compressed(&text), more].concat());
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(stderr(&output).contains(expected), "{output:?}");
    }
    let output = report(b"hello".to_vec());
    assert!(
        stderr(&output).contains("is no whole file of gzip"),
        "{output:?}"
    );
}

/// Whoever does not like what a later look found cannot leave it out.
#[test]
fn a_look_that_was_removed_is_missing() {
    let looks = with_repeats(6).replace("claims:", "looks: [3, 6], claims:");
    // Three runs of each cell are too few for a verdict at this level.
    let fixture = Fixture::new(&looks);
    let confirmed = fixture.confirm();
    assert!(
        confirmed.contains("runs       12 finished\n"),
        "{confirmed}"
    );
    let published = fixture.publish();
    let lock: serde_json::Value =
        serde_json::from_slice(&fs::read(fixture.path("small.ron.lock")).unwrap()).unwrap();
    let id = lock["id"].as_str().unwrap();
    // The last digits of a row's run seed, by the definition of run seeds.
    let is_of_second_look = |text: &str| {
        (3..6).any(|index| {
            let hash = Sha256::digest(format!("{id}:{index}"));
            let seed = hash[..6]
                .iter()
                .fold(0_u64, |seed, byte| seed << 8 | u64::from(*byte));
            text.contains(&seed.to_string())
        })
    };
    let table = decompressed(&fs::read(published.join("results.csv.gz")).unwrap());
    let kept: Vec<&str> = table
        .lines()
        .filter(|row| !is_of_second_look(row))
        .collect();
    assert_eq!(kept.len(), 7);
    write_published_table(&published, &kept.join("\n"));
    let output = seedbed(&["report", published.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let expected = "6 of 12 runs are missing; expected one row for each run";
    assert!(stderr(&output).contains(expected), "{output:?}");
    for file in fixture.result_files() {
        if is_of_second_look(file.to_str().unwrap()) {
            fs::remove_file(file).unwrap();
        }
    }
    let report = fixture.report();
    assert!(
        report.contains("runs       6 finished, 6 missing\n"),
        "{report}"
    );
    assert!(
        report.contains("note       6 runs of the registered runs: missing."),
        "{report}"
    );
}

#[test]
fn results_that_do_not_confirm_their_lock_are_not_published() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    fixture.edit_manifest("smallest: 5", "smallest: 1");
    let [out, parent] = ["out", "published"].map(|name| fixture.path(name));
    let paths = [&out, &parent].map(|path| path.to_str().unwrap());
    let output = seedbed(&["report", paths[0], "--publish", paths[1]]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let expected = "do not confirm what was registered: The reported study differs from its lock";
    assert!(stderr(&output).contains(expected), "{output:?}");
    assert!(!parent.exists());
}

/// `builds.json` has the SHA-256 of the table.
#[test]
fn a_damaged_table_of_published_results_is_not_salvaged() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.confirm();
    let published = fixture.publish();
    let table = published.join("results.csv.gz");
    let bytes = fs::read(&table).unwrap();
    fs::write(&table, &bytes[..bytes.len() / 2]).unwrap();
    let output = seedbed(&["salvage", published.to_str().unwrap()]);
    assert!(output.status.success(), "{output:?}");
    let printed = stdout(&output);
    assert!(
        printed.contains("results.csv.gz: its SHA-256 is not the listed one"),
        "{printed}"
    );
    assert!(
        printed.contains("4 files whole, 0 in part, 1 lost"),
        "{printed}"
    );
}

/// The folder of figures, too, has files of processes that were killed.
#[test]
fn incomplete_figures_are_removed() {
    let fixture = Fixture::new(&with_repeats(6));
    fixture.succeed(&[]);
    let part = fixture.path("out/figures/1-curves.svg.abc123.part");
    fs::create_dir_all(part.parent().unwrap()).unwrap();
    fs::write(&part, "").unwrap();
    fixture.succeed(&[]);
    assert!(!part.exists());
}
