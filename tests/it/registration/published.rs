//! Published results: their tables, and rows that are damaged, deleted or forged.

use std::fs;
use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use sha2::{Digest, Sha256};

use super::{Fixture, edit_json, with_repeats};
use crate::util::{seedbed, stderr, stdout, study_arguments};

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
    let [of_report, of_published] = [fixture.path("out/figures"), published]
        .map(|folder| fs::read_to_string(folder.join("claims.svg")).unwrap());
    assert_eq!(of_report, of_published);
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
        printed.contains("5 files whole, 0 in part, 1 lost"),
        "{printed}"
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
