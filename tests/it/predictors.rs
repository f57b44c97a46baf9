//! Studies that ask which measures go with an outcome.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::util::{REPOSITORY, command, stderr};

/// Teams in the deep sea. What they lose in the first episodes may predict what they lose in all.
fn study_text(predictors: &str) -> String {
    let scenario = Path::new(REPOSITORY).join("scenarios/tabular/deep_sea.ron");
    format!(
        r#"Study(
            title: "Predictors",
            scenario: "{}",
            cells: [
                (name: "own", set: ["algorithm=SeedSampling()"]),
                (name: "one", set: ["algorithm=SharedSeed()"]),
                (name: "random", set: ["algorithm=EpsilonGreedy()"]),
            ],
            set: ["episodes=10"],
            repeats: 25,
            measures: [Regret],
            predictors: {predictors},
        )"#,
        scenario.display()
    )
}

/// Ranks of the numbers; equal ones share the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let below = |value: f64| values.iter().filter(|&&other| other < value).count() as f64;
    let equal = |value: f64| values.iter().filter(|&&other| other == value).count() as f64;
    values
        .iter()
        .map(|&value| below(value) + 0.5 * (equal(value) + 1.0))
        .collect()
}

/// Spearman's correlation within cells, from the rows of runs.
fn correlation_within_cells(rows: &Path, measure: &str) -> f64 {
    let mut reader = csv::Reader::from_path(rows).unwrap();
    let mut cells: BTreeMap<String, [Vec<f64>; 2]> = BTreeMap::new();
    for row in reader.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let cell = cells.entry(row["cell"].clone()).or_default();
        cell[0].push(row[measure].parse().unwrap());
        cell[1].push(row["Regret"].parse().unwrap());
    }
    let mut sums = [0.0; 3];
    for [x, y] in cells.into_values() {
        let mean = 0.5 * (x.len() as f64 + 1.0);
        let [x, y] = [ranks(&x), ranks(&y)];
        if [&x, &y]
            .iter()
            .any(|ranks| ranks.iter().all(|&rank| rank == mean))
        {
            continue;
        }
        for (x, y) in x.iter().zip(&y) {
            sums[0] += (x - mean) * (x - mean);
            sums[1] += (x - mean) * (y - mean);
            sums[2] += (y - mean) * (y - mean);
        }
    }
    sums[1] / (sums[0] * sums[2]).sqrt()
}

/// The table has the correlations that follow from the rows, also after the results are published.
#[test]
fn predictors_are_correlated_with_an_outcome() {
    let folder = tempfile::tempdir().unwrap();
    let text = study_text(
        "(of: Regret, measures: [At(of: Regret, episode: 2), At(of: Regret, episode: 5)])",
    );
    fs::write(folder.path().join("predictors.ron"), text).unwrap();
    for arguments in [
        &["study", "predictors.ron", "--out", "out"][..],
        &["report", "out", "--publish", "results"],
    ] {
        let output = command(arguments).current_dir(&folder).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {output:?}");
    }
    let tables = fs::read_to_string(folder.path().join("out/tables.md")).unwrap();
    let published = folder.path().join("results/predictors/tables.md");
    assert_eq!(tables, fs::read_to_string(published).unwrap());
    let section = tables
        .split("## ")
        .find(|section| section.starts_with("Predictors of"));
    let rows: Vec<Vec<&str>> = section
        .unwrap()
        .lines()
        .filter(|line| line.starts_with("| "))
        .map(|line| line.split(" | ").collect())
        .collect();
    for (row, measure) in rows[1..]
        .iter()
        .zip(["At(of:Regret,episode:2)", "At(of:Regret,episode:5)"])
    {
        let shown: f64 = row[2]
            .split(' ')
            .next()
            .unwrap()
            .replace('−', "-")
            .parse()
            .unwrap();
        let expected = correlation_within_cells(&folder.path().join("out/results.csv"), measure);
        assert!(
            (shown - expected).abs() < 0.001,
            "{row:?}: expected {expected}"
        );
    }
    assert_eq!(rows.len(), 3, "{tables}");
}

#[test]
fn predictors_that_are_the_outcome_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (predictors, message) in [
        (
            "(of: Regret, measures: [])",
            "expected at least one measure",
        ),
        ("(of: Regret, measures: [Regret])", "is the outcome itself"),
    ] {
        fs::write(folder.path().join("predictors.ron"), study_text(predictors)).unwrap();
        let output = command(&["check", "predictors.ron"])
            .current_dir(&folder)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(message), "{}", stderr(&output));
    }
}
