//! Studies of teams of several sizes: speed-up, diversity gap and slopes; and published runs that are
//! repeated.

use std::collections::BTreeMap;
use std::fs;
use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;

use super::util::{REPOSITORY, command, stderr, stdout};

/// Teams of one and four on four parallel chains, with seeds of their own and with one for all.
fn study_text() -> String {
    let scenario = Path::new(REPOSITORY).join("scenarios/tabular/parallel_chains.ron");
    format!(
        r#"Study(
            title: "Sizes",
            scenario: "{}",
            grid: [
                (name: "K", set: ["agents.count={{}}"], values: ["1", "4"]),
                (set: ["algorithm={{}}"], values: ["SeedSampling()", "SharedSeed()", "EpsilonGreedy()"], labels: ["own", "one", "ε-greedy"]),
            ],
            repeats: 30,
            measures: [Regret],
            pairs_share: "the chains",
            scaling: (measure: Regret, diversity: [("own", "one")]),
            figures: [Scaling(), Differences(compare: ("one", "own"), columns: "K", rows: "K")],
        )"#,
        scenario.display()
    )
}

/// Runs the study in a folder, and publishes its results beside it.
fn run_and_publish(folder: &Path) {
    fs::write(folder.join("sizes.ron"), study_text()).unwrap();
    for arguments in [
        &["study", "sizes.ron", "--out", "out"][..],
        &["report", "out", "--publish", "results"],
    ] {
        let output = command(arguments).current_dir(folder).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {output:?}");
    }
}

/// Mean regret of each cell, from the rows of runs.
fn mean_regrets(rows: &Path) -> BTreeMap<String, f64> {
    let mut reader = csv::Reader::from_path(rows).unwrap();
    let mut regrets: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for row in reader.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let regret = row["Regret"].parse().unwrap();
        regrets.entry(row["cell"].clone()).or_default().push(regret);
    }
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let means = regrets
        .into_iter()
        .map(|(cell, values)| (cell, mean(values)));
    means.collect()
}

/// The cells of the row of a table whose first cell is `name`, in the section that begins with `title`.
fn table_row(tables: &str, title: &str, name: &str) -> Vec<String> {
    let section = tables
        .split("## ")
        .find(|section| section.starts_with(title));
    let row = section
        .unwrap()
        .lines()
        .find(|line| line.starts_with(&format!("| {name} |")));
    let cells = row
        .unwrap_or_else(|| panic!("no {name} in {tables}"))
        .split(" | ");
    cells
        .map(|cell| cell.trim_matches(['|', ' ']).to_owned())
        .collect()
}

/// The number at the beginning of a cell, before its interval.
fn number(cell: &str) -> f64 {
    let text = cell.split(' ').next().unwrap().replace('−', "-");
    text.parse().unwrap_or_else(|_| panic!("{cell}"))
}

#[test]
fn tables_say_what_larger_teams_gain() {
    let folder = tempfile::tempdir().unwrap();
    run_and_publish(folder.path());
    let out = folder.path().join("out");
    let tables = fs::read_to_string(out.join("tables.md")).unwrap();
    let means = mean_regrets(&out.join("results.csv"));
    let best_alone = ["own", "one", "ε-greedy"].map(|method| means[&format!("K 1, {method}")]);
    let best_alone = best_alone.into_iter().fold(f64::INFINITY, f64::min);
    let close = |cell: &str, expected: f64| {
        assert!(
            (number(cell) / expected - 1.0).abs() < 1e-3,
            "{cell} instead of {expected}"
        );
    };

    let row = table_row(&tables, "Sizes of teams", "K 4, own");
    close(&row[2], means["K 4, own"]);
    close(&row[4], best_alone / means["K 4, own"]);
    close(&row[5], best_alone / means["K 4, own"] / 4.0);
    close(&row[6], means["K 4, one"] / means["K 4, own"]);
    assert_eq!(
        table_row(&tables, "Sizes of teams", "K 4, ε-greedy")[6],
        "–"
    );

    let slope = (means["K 4, own"] / means["K 1, own"]).ln() / 4_f64.ln();
    close(&table_row(&tables, "Slopes", "own")[2], slope);
    for figure in ["1-scaling.svg", "2-differences.svg"] {
        assert!(out.join("figures").join(figure).is_file(), "{figure}");
    }
}

#[test]
fn published_runs_are_repeated() {
    let folder = tempfile::tempdir().unwrap();
    run_and_publish(folder.path());
    let verify_with = |options: &[&str]| {
        let arguments = [&["study", "verify", "sizes.ron"], options].concat();
        command(&arguments)
            .current_dir(folder.path())
            .output()
            .unwrap()
    };
    let verify = |amount: &str| verify_with(&[amount]);
    let output = verify("--runs=10%");
    let expected =
        "verified   sizes: 18 of 18 repeated runs are bit-identical (180 runs published)";
    assert!(stdout(&output).contains(expected), "{output:?}");

    // Two of any cells; the same number draws the same.
    let of_any_cell = || stdout(&verify_with(&["--runs=2", "--any-cell", "--draw=7"]));
    let expected = "verified   sizes: 2 of 2 repeated runs are bit-identical (180 runs published)";
    assert!(of_any_cell().contains(expected), "{}", of_any_cell());
    assert!(
        of_any_cell()
            .starts_with("draw       7: 2 of 180 runs; to repeat these: --draw=7 --any-cell\n")
    );

    let table = folder.path().join("results/sizes/results.csv.gz");
    let mut text = String::new();
    GzDecoder::new(fs::File::open(&table).unwrap())
        .read_to_string(&mut text)
        .unwrap();
    change_last_digit_of_last_row(&mut text);
    let mut encoder = GzEncoder::new(fs::File::create(&table).unwrap(), Compression::fast());
    encoder.write_all(text.as_bytes()).unwrap();
    encoder.finish().unwrap();
    let output = verify("--runs=100%");
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let message = "results.csv.gz: is damaged, or was changed after it was written: its SHA-256";
    assert!(stderr(&output).contains(message), "{output:?}");

    // Who changes results on purpose changes the hashes, too.
    let builds = folder.path().join("results/sizes/builds.json");
    let mut description: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&builds).unwrap()).unwrap();
    description.as_object_mut().unwrap().remove("sha256");
    fs::write(&builds, description.to_string()).unwrap();
    let output = verify("--runs=100%");
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(stdout(&output).contains("179 of 180"), "{output:?}");
    assert!(
        stderr(&output).contains("differs    K 4, ε-greedy"),
        "{output:?}"
    );
}

/// Changes one digit of the mean return, which is in the middle of the row.
fn change_last_digit_of_last_row(text: &mut String) {
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let column = header
        .iter()
        .position(|name| *name == "mean_return")
        .unwrap();
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(&header).unwrap();
    for (index, row) in rows.iter().enumerate() {
        let mut values: Vec<String> = row.iter().map(str::to_owned).collect();
        if index + 1 == rows.len() {
            values[column] += "1";
        }
        writer.write_record(&values).unwrap();
    }
    *text = String::from_utf8(writer.into_inner().unwrap()).unwrap();
}

#[test]
fn an_amount_of_runs_to_verify_is_checked() {
    let output = command(&["study", "verify", "x.ron", "--runs=0%"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let expected = "expected a number of runs from 1, or a share such as 2%";
    assert!(stderr(&output).contains(expected), "{output:?}");
}
