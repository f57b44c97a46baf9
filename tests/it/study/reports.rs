//! Reports: their numbers, files, and what they say of the runs.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::{
    contents, read_summary, result_rows, run_study, stored_results, study_text, write_result_file,
    write_study,
};
use crate::util::{seedbed, stderr, stdout, write_manifest_without_checksum};

/// Hash of the build that made a run.
type Build = Option<[u8; 8]>;

/// A stored run without a hash of the build is from a program that could not read its own file. A
/// stored run with another hash is from another build.
#[test]
fn a_report_names_the_builds_of_its_runs() {
    let (_folder, study, out) = write_study(&study_text(1, ""));
    assert!(run_study(&study, &out, &[]).status.success());
    let page = || fs::read_to_string(out.join("report.html")).unwrap();
    assert!(
        !page().contains("Several builds.")
            && !page().contains("build unknown")
            && page().contains("rapier2d 0."),
        "{}",
        page()
    );
    let change_build = |index: usize, change: fn(Build) -> Build| {
        let (name, bytes) = stored_results(&out).into_iter().nth(index).unwrap();
        let ((layout, version, commit, build), others): ((u32, String, Option<String>, Build), _) =
            postcard::take_from_bytes(contents(&bytes)).unwrap();
        let head = (layout, version, commit, change(build));
        let contents = [&postcard::to_stdvec(&head).unwrap(), others].concat();
        write_result_file(&out.join("runs").join(name), contents);
        let output = stdout(&run_study(&study, &out, &[]));
        assert!(
            output.starts_with("study      small: 3 cells, 1 run each, 0 to run\n"),
            "{output}"
        );
    };
    change_build(0, |_| None);
    assert!(
        page().contains("The runs were made by 2 builds of seedbed (unknown, "),
        "{}",
        page()
    );
    change_build(1, |build| build.map(|hash| hash.map(|byte| !byte)));
    assert!(
        page().contains("The runs were made by 3 builds of seedbed (unknown, ")
            && page().contains("<code>seedbed study verify ")
    );
    assert!(run_study(&study, &out, &["verify"]).status.success());
}

/// Repeats each run of the cell `σ 9` with `seedbed run`, and compares the numbers of the report
/// with those of `episodes.csv` and `summary.json`.
#[test]
fn a_report_has_the_numbers_of_single_runs() {
    let (folder, study, out) = write_study(&study_text(5, ""));
    assert!(run_study(&study, &out, &[]).status.success());
    let rows = result_rows(&out);
    assert_eq!(rows.len(), 15);
    let mut final_returns = Vec::new();
    for row in rows.iter().filter(|row| row["cell"] == "σ 9") {
        let single_run = folder.path().join(&row["seed"]);
        run_cell_with_sigma_9(&single_run, &row["seed"]);
        let mean_return = row["mean_return"].parse::<f64>().unwrap();
        assert!((mean_return - mean_return_from(&single_run, 0)).abs() < 1e-9);
        final_returns.push(mean_return_from(&single_run, 3));
        let summary = read_summary(&single_run);
        let coverage: f64 = row["team_coverage"].parse().unwrap();
        assert!((coverage - summary["team_coverage"].as_f64().unwrap()).abs() < 1e-6);
        assert_eq!(row["env_steps"], summary["env_steps"].to_string());
    }
    let [mean, median] = reported_final_returns(&out);
    let true_mean = final_returns.iter().sum::<f64>() / 5.0;
    final_returns.sort_by(f64::total_cmp);
    assert!(
        (mean - true_mean).abs() <= 0.005 && (median - final_returns[2]).abs() <= 0.005,
        "{mean} and {median} for {final_returns:?}"
    );
}

/// Runs the scenario of the cell `σ 9` with `seedbed run`.
fn run_cell_with_sigma_9(out: &Path, run_seed: &str) {
    let arguments = [
        "run",
        "scenarios/cartpole.ron",
        "--no-recording",
        "--quiet",
        "--seed",
        run_seed,
        "--set",
        "agents.count=2",
        "--set",
        "stop=Episodes(8)",
        "--set",
        "agents.seeds=Normal(sigma: 9)",
        "--out",
        out.to_str().unwrap(),
    ];
    assert!(seedbed(&arguments).status.success());
}

/// Mean return of all agents' episodes from number `first_episode` on, from the table of a run.
fn mean_return_from(run: &Path, first_episode: usize) -> f64 {
    let mut reader = csv::Reader::from_path(run.join("episodes.csv")).unwrap();
    let rows: Vec<BTreeMap<String, String>> =
        reader.deserialize().map(|row| row.unwrap()).collect();
    let returns: Vec<f64> = rows
        .iter()
        .filter(|row| row["episode"].parse::<usize>().unwrap() >= first_episode)
        .map(|row| row["return"].parse().unwrap())
        .collect();
    returns.iter().sum::<f64>() / returns.len() as f64
}

/// The mean and the median that the report gives for the cell `σ 9`, over five runs.
fn reported_final_returns(out: &Path) -> [f64; 2] {
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let table = &page[page
        .find("<h3>return over the last 5 episodes</h3>")
        .unwrap()..];
    let row = table[table.find("<td class=\"name\">σ 9</td>").unwrap()..].replace("</td>", "");
    let cells: Vec<&str> = row.split("<td>").take(4).collect();
    assert_eq!(cells[1], "5");
    let (mean, _) = cells[2].split_once(' ').unwrap();
    [mean, cells[3]].map(|number| number.parse().unwrap())
}

#[test]
fn a_report_of_an_unfinished_study_says_what_is_missing() {
    let (_folder, study, out) = write_study(&study_text(
        6,
        r#"claims: [(text: "x", compare: ("σ 9", "σ 0"), direction: Less, smallest: 5, confirmatory: true)],"#,
    ));
    for index in ["0", "1", "6"] {
        assert!(
            run_study(&study, &out, &["--index", index])
                .status
                .success()
        );
    }
    let output = seedbed(&["report", out.to_str().unwrap()]);
    assert!(output.status.success(), "{output:?}");
    assert!(
        stdout(&output).starts_with("runs       3 finished, 15 missing\nopen             x\n"),
        "{output:?}"
    );
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    for words in [
        "15 runs are missing",
        "none: 2 runs are too few",
        "Small &amp; &lt;small&gt;",
        "no runs",
        "role=\"img\"",
    ] {
        assert!(page.contains(words), "{words}");
    }
    for network_reference in ["<script", "<link", "src=\"http", "url(http"] {
        assert!(
            !page.contains(network_reference),
            "the page must not need a network: {network_reference}"
        );
    }
    for file in [
        "figures/1-curves.svg",
        "figures/1-curves.png",
        "figures/2-visitation.svg",
        "results.csv",
        "tables.md",
    ] {
        assert!(out.join(file).is_file(), "{file}");
    }
}

#[test]
fn report_refuses_a_directory_without_a_study() {
    let folder = tempfile::tempdir().unwrap();
    let refused = seedbed(&["report", folder.path().to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(2));
    let path = folder.path().display();
    let expected = format!("error: {path}: contains no study: expected study.json in it\n");
    assert_eq!(stderr(&refused), expected);
    // The folder of a registered study has the id of its lock in its name.
    std::fs::create_dir(folder.path().join("mine-1a2b3c")).unwrap();
    std::fs::write(folder.path().join("mine-1a2b3c/study.json"), "{}").unwrap();
    for (name, reason) in [
        ("mine", "no such directory"),
        (".", "contains no study: expected study.json in it"),
    ] {
        let given = folder.path().join(name).display().to_string();
        let refused = seedbed(&["report", &given]);
        assert_eq!(refused.status.code(), Some(2));
        let errors = stderr(&refused);
        assert!(
            errors.contains(&format!(": {reason}; did you mean `")),
            "{errors}"
        );
        assert!(errors.ends_with("mine-1a2b3c`?\n"), "{errors}");
    }
}

/// The report says how `repeats` was changed after the first runs. Older versions of the program
/// did not store earlier values of `repeats`; the report then begins with the stored value.
#[test]
fn changed_repeats_are_reported() {
    let (_folder, study, out) = write_study("");
    let sentence_for = |repeats: u32| run_and_read_sentence_on_repeats(&study, &out, repeats);
    assert_eq!([sentence_for(5), sentence_for(5)], ["", ""]);
    // Without runs there were no results that could have motivated the change.
    fs::remove_dir_all(out.join("runs")).unwrap();
    assert_eq!(sentence_for(1), "");
    remove_earlier_repeats(&out);
    for (repeats, change) in [
        (2, "extended from 1 to 2"),
        (2, "extended from 1 to 2"),
        (3, "extended from 1 to 2 to 3"),
        (2, "changed from 1 to 2 to 3 to 2"),
    ] {
        assert_eq!(
            sentence_for(repeats),
            format!("The number of runs per cell was {change} after some of them had been run.")
        );
    }
}

/// Runs a study with one claim, and returns the sentence of its report on changes of `repeats`, or
/// an empty text if there is no such sentence.
fn run_and_read_sentence_on_repeats(study: &str, out: &Path, repeats: u32) -> String {
    let claim = r#"claims: [(text: "x", compare: ("σ 9", "σ 0"), direction: Less, smallest: 5)],"#;
    fs::write(study, study_text(repeats, claim)).unwrap();
    assert!(run_study(study, out, &[]).status.success());
    let [page, table] =
        ["report.html", "claims.md"].map(|file| fs::read_to_string(out.join(file)).unwrap());
    let sentence = table
        .lines()
        .find(|line| line.starts_with("The number of runs per cell was "))
        .unwrap_or_default();
    assert_eq!(
        page.contains("The number of runs per cell was "),
        !sentence.is_empty()
    );
    assert!(page.contains(sentence));
    sentence.to_owned()
}

/// Removes the field `earlier_repeats` from `study.json`, as older versions of the program wrote
/// it.
fn remove_earlier_repeats(out: &Path) {
    let path = out.join("study.json");
    let stored = fs::read_to_string(&path).unwrap();
    let without_field = stored.replace(",\n  \"earlier_repeats\": []", "");
    assert!(!without_field.contains("earlier_repeats"));
    write_manifest_without_checksum(&path, &without_field);
}

/// Files of the earlier report are removed, other files are kept. `results.csv` has one column per
/// measure of the study.
#[test]
fn a_new_report_replaces_the_earlier_report() {
    let (_folder, study, out) = write_study(&study_text(2, ""));
    assert!(run_study(&study, &out, &[]).status.success());
    fs::write(out.join("figures/9-agents.svg"), "").unwrap();
    fs::write(out.join("figures/notes.svg"), "").unwrap();
    fs::write(out.join("claims.md"), "").unwrap();
    assert!(seedbed(&["report", out.to_str().unwrap()]).status.success());
    assert_eq!(
        ["9-agents.svg", "notes.svg", "1-curves.svg"]
            .map(|file| out.join("figures").join(file).is_file()),
        [false, true, true]
    );
    assert!(!out.join("claims.md").exists());
    let row = &result_rows(&out)[0];
    assert_eq!(row["Coverage"], row["team_coverage"]);
    assert!(row["FinalReturn(window:5)"].parse::<f64>().unwrap() > 8.0);
}

#[test]
fn reports_mark_run_seeds_for_tuning() {
    let (_folder, study, out) = write_study(&study_text(2, "first_seed: 0,"));
    assert!(run_study(&study, &out, &[]).status.success());
    assert!(
        fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains("Tuning seeds.")
    );
    assert!(result_rows(&out).iter().all(|row| row["seeds"] == "tuning"));
}

/// The walls of the task are behind the states of each cell: eight corridors have walls at their sides and ends.
#[test]
fn where_agents_went_is_drawn_with_the_walls_of_the_task() {
    let text = r#"Study(
        title: "map", scenario: "corridors", set: ["agents.count=2", "stop=Episodes(1)"],
        cells: [(name: "own"), (name: "same", set: ["agents.seeds=Normal(sigma: 0)"])],
        repeats: 1, measures: [FinalReturn()], figures: [Scatter(), Scatter(axes: ("x_dot", "east"))],
    )"#;
    let (_folder, study, out) = write_study(text);
    assert!(run_study(&study, &out, &[]).status.success());
    let figure = |number: u32| {
        let file = format!("figures/{number}-scatter.svg");
        fs::read_to_string(out.join(file)).unwrap()
    };
    let lines = |svg: &str| svg.matches("stroke-width=\"1\"").count();
    let (map, other) = (figure(1), figure(2));
    assert!(map.contains("y [m]") && other.contains("east [m]"));
    assert!(
        lines(&map) > lines(&other) + 2 * 8,
        "{} {}",
        lines(&map),
        lines(&other)
    );
}
