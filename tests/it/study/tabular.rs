//! A study of tabular scenarios.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::{read_summary, result_rows, run_study, stored_results, write_study};
use crate::util::{REPOSITORY, seedbed, stdout};

/// A study of two tabular tasks and two algorithms. Two of its figures pool the tasks.
fn tabular_study_text() -> String {
    let folder = Path::new(REPOSITORY).join("scenarios/tabular");
    format!(
        r#"Study(
            title: "Tabular",
            grid: [
                (scenario: "{}/{{}}.ron", values: ["deep_sea", "bipolar_chain"], with: [["episodes=40"], ["agents.starts=Together"]]),
                (set: ["algorithm={{}}"], values: ["SeedSampling()", "Random"], labels: ["seeds", "random"]),
            ],
            cells: [(name: "crowd", scenario: "{}/deep_sea.ron", set: ["agents.count=30"])],
            set: ["agents.count=10"],
            repeats: 6,
            measures: [Regret, Reach, FirstGoal, Coverage, Last(of: EffectiveAgents)],
            claims: [
                (text: "less regret", compare: ("deep_sea, seeds", "deep_sea, random"), direction: Less, smallest: 5, confirmatory: true),
                (text: "far less regret", compare: ("deep_sea, seeds", "deep_sea, random"), direction: Less, smallest: 0.1, claimed: 1000, confirmatory: true),
                (text: "the goal sooner", compare: ("deep_sea, seeds", "deep_sea, random"), measure: FirstGoal, direction: Less, smallest: 5),
            ],
            figures: [
                Curves(of: Regret, window: 3, cells: ["deep_sea, seeds", "deep_sea, random"]),
                Visitation(cells: ["deep_sea, seeds", "deep_sea, random"], episodes: [First(5), All]),
                Profiles(measure: Reach, over: ["deep_sea", "bipolar_chain"]),
                Intervals(measure: Coverage, over: ["deep_sea", "bipolar_chain"], cells: ["deep_sea, seeds", "bipolar_chain, seeds", "crowd"]),
            ],
        )"#,
        folder.display(),
        folder.display()
    )
}

/// The results have the numbers of single runs, and do not depend on the number of jobs. The report
/// has comparisons, verdicts and figures.
#[test]
fn a_study_of_tabular_scenarios_is_run_and_reported() {
    let (folder, study, out) = write_study(&tabular_study_text());
    let output = run_study(&study, &out, &[]);
    assert!(
        stdout(&output).contains(
            "2 confirmatory claims: 1 supported, 1 supported, smaller than claimed; 1 exploratory comparison\n"
        ),
        "{output:?}"
    );
    assert!(
        stdout(&output).contains("\nsupported, smaller than claimed far less regret\n"),
        "{output:?}"
    );
    let rows = result_rows(&out);
    assert_eq!(rows.len(), 30);
    for row in rows
        .iter()
        .filter(|row| row["cell"] == "bipolar_chain, seeds")
    {
        assert_row_equals_single_run(row, folder.path());
    }
    assert!(
        rows.iter()
            .filter(|row| row["cell"].starts_with("deep_sea"))
            .all(|row| row["episodes"] == "40")
    );
    assert_cells_are_compared_within_tasks(&out);
    assert_claim_verdicts(&out);
    assert_figures_of_tabular_study(&out);
    let (_folder, _, one_job) = write_study("");
    assert!(
        run_study(&study, &one_job, &["--jobs", "1"])
            .status
            .success()
    );
    assert_eq!(stored_results(&one_job), stored_results(&out));
}

/// Asserts that a row has the regret and coverage of `seedbed run` with the same scenario and run
/// seed.
fn assert_row_equals_single_run(row: &BTreeMap<String, String>, folder: &Path) {
    let single_run = folder.join(&row["seed"]);
    let arguments = [
        "run",
        "scenarios/tabular/bipolar_chain.ron",
        "--no-recording",
        "--set",
        "agents.count=10",
        "--set",
        "agents.starts=Together",
        "--seed",
        &row["seed"],
        "--out",
        single_run.to_str().unwrap(),
    ];
    assert!(seedbed(&arguments).status.success());
    let summary = read_summary(&single_run);
    let number = |column: &str| row[column].parse::<f64>().unwrap();
    assert!(
        (number("regret") - summary["regret_per_agent"].as_f64().unwrap()).abs() < 1e-4,
        "{row:?}"
    );
    let coverage =
        summary["states_visited"].as_f64().unwrap() / summary["states"].as_f64().unwrap();
    assert!((number("team_coverage") - coverage).abs() < 1e-6);
    assert_eq!(row["env_steps"], summary["env_steps"].to_string());
    assert_eq!(
        (row["episodes_to_solve"].as_str(), row["episodes"].as_str()),
        ("", "1")
    );
}

/// The second cell of each task is compared with the first cell of the same task.
fn assert_cells_are_compared_within_tasks(out: &Path) {
    let tables = fs::read_to_string(out.join("tables.md")).unwrap();
    let titles: Vec<&str> = tables
        .lines()
        .filter_map(|line| line.strip_prefix("## "))
        .collect();
    assert!(
        titles[0].starts_with("Cost until solved")
            && titles[1] == "regret per agent"
            && titles.last() == Some(&"Comparisons: regret per agent"),
        "{titles:?}"
    );
    // Ten agents, each of which plays 40 episodes of 10 steps; tabular tasks have no threshold.
    assert!(
        tables.contains("| deep_sea, seeds | 10 | – | 40 | 4000 | 0 |\n"),
        "{tables}"
    );
    assert!(
        tables.contains("| bipolar_chain, random | bipolar_chain, seeds | "),
        "{tables}"
    );
    assert!(
        tables.contains("| deep_sea, random | deep_sea, seeds | ")
            && !tables.contains("| deep_sea, seeds | bipolar"),
        "{tables}"
    );
}

/// The second claim has the right direction, but its source says a far larger difference. The third
/// is exploratory.
fn assert_claim_verdicts(out: &Path) {
    let table = fs::read_to_string(out.join("claims.md")).unwrap();
    // Every run with seeds has less regret than every random run, so p = 1/C(12, 6) = 1/924 for both
    // confirmatory claims, twice as much after Holm's correction.
    let row = table.lines().nth(2).unwrap();
    let (row_start, row_end) = (
        "| less regret | regret per agent: deep_sea, seeds − deep_sea, random, claimed below 0; smallest effect of interest 5 | −",
        " | 6 | 0.0022 | supported |",
    );
    assert!(
        row.starts_with(row_start) && row.ends_with(row_end),
        "{table}"
    );
    assert!(
        table
            .lines()
            .nth(3)
            .unwrap()
            .ends_with(" | 0.0022 | supported, smaller than claimed |"),
        "{table}"
    );
    assert!(
        table
            .lines()
            .nth(4)
            .unwrap()
            .ends_with(" | – | exploratory |"),
        "{table}"
    );
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(
        page.matches(">supported, smaller than claimed</p>").count(),
        1
    );
}

fn assert_figures_of_tabular_study(out: &Path) {
    for file in [
        "1-curves.svg",
        "2-visitation.svg",
        "3-profiles.svg",
        "4-intervals.svg",
    ] {
        assert!(out.join("figures").join(file).is_file(), "{file}");
    }
    let panels = fs::read_to_string(out.join("figures/2-visitation.svg")).unwrap();
    assert!(
        panels.contains(">seeds: first 5 episodes, "),
        "titles of panels omit the words that all panels share"
    );
    let pooled = fs::read_to_string(out.join("figures/4-intervals.svg")).unwrap();
    for words in [">seeds<", "n = 12", ">crowd<", "n = 6"] {
        assert!(pooled.contains(words), "{words}");
    }
}
