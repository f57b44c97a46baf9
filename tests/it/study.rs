//! Studies on the command line: runs, stored results, claims and reports.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

#[cfg(unix)]
use super::util::interrupt;
use super::util::{
    REPOSITORY, command, crash, files_below, seedbed, stderr, stdout, wait_until,
    write_manifest_without_checksum,
};

/// A study of two agents and few episodes. It has three cells: the results of `σ 0` and `σ 9`
/// differ, those of `σ 0 again` equal those of `σ 0`.
pub(crate) fn study_text(repeats: u32, extra_fields: &str) -> String {
    let scenario = Path::new(REPOSITORY).join("scenarios/cartpole.ron");
    format!(
        r#"Study(
            title: "Small & <small>",
            scenario: "{}",
            set: ["agents.count=2", "stop=Episodes(8)"],
            grid: [(name: "σ", set: ["agents.seeds={{}}"], values: ["Normal(sigma: 0)", "Normal(sigma: 9)", "TwoPoint(sigma: 0)"],
                labels: ["0", "9", "0 again"])],
            repeats: {repeats},
            measures: [FinalReturn(window: 5), Coverage],
            figures: [Curves(window: 3), Visitation(cells: ["σ 9"], episodes: [First(2), All])],
            {extra_fields}
        )"#,
        scenario.display()
    )
}

/// Writes a study file in a temporary directory. Returns the directory, the path of the study file,
/// and a path for results.
pub(crate) fn write_study(text: &str) -> (tempfile::TempDir, String, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("small.ron");
    fs::write(&study, text).unwrap();
    let (study, out) = (
        study.to_str().unwrap().to_owned(),
        folder.path().join("out"),
    );
    (folder, study, out)
}

pub(crate) fn run_study(study: &str, out: &Path, extra_arguments: &[&str]) -> Output {
    seedbed(
        &[
            &["study", study, "--out", out.to_str().unwrap()],
            extra_arguments,
        ]
        .concat(),
    )
}

/// Number of bytes of the checksum at the end of a result file.
const CHECKSUM_BYTES: usize = 8;

/// Replaces the contents of a result file, with a valid checksum.
pub(crate) fn write_result_file(path: &Path, mut contents: Vec<u8>) {
    let checksum = xxhash_rust::xxh64::xxh64(&contents, 0);
    contents.extend(checksum.to_le_bytes());
    fs::write(path, contents).unwrap();
}

/// The contents of a result file without the checksum.
pub(crate) fn contents(file: &[u8]) -> &[u8] {
    &file[..file.len() - CHECKSUM_BYTES]
}

/// Contents of the result files of runs, by file name.
pub(crate) fn stored_results(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let name_and_bytes = |path: PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, fs::read(path).unwrap())
    };
    result_files(out).into_iter().map(name_and_bytes).collect()
}

fn result_files(out: &Path) -> Vec<PathBuf> {
    files_below(&out.join("runs"), "run")
}

#[test]
fn results_depend_neither_on_jobs_nor_on_processes() {
    let (_folder, study, out) = write_study(&study_text(2, ""));
    assert!(run_study(&study, &out, &["--jobs", "2"]).status.success());
    let results = stored_results(&out);
    assert_eq!(results.len(), 6);
    let (_folder, _, one_job) = write_study("");
    assert!(
        run_study(&study, &one_job, &["--jobs", "1"])
            .status
            .success()
    );
    assert_eq!(stored_results(&one_job), results);

    let (_folder, _, one_process_per_run) = write_study("");
    for index in ["4", "0", "5", "1", "2", "3"] {
        assert!(
            run_study(&study, &one_process_per_run, &["--index", index])
                .status
                .success()
        );
    }
    assert_eq!(stored_results(&one_process_per_run), results);
    let beyond = run_study(&study, &one_process_per_run, &["--index", "6"]);
    assert_eq!(beyond.status.code(), Some(2));
    let expected = "error: --index 6: expected an index from 0 to 5; --list shows all\n";
    assert_eq!(stderr(&beyond), expected);
    let listed = stdout(&run_study(&study, &one_process_per_run, &["--list"]));
    assert_eq!(
        listed.lines().next(),
        Some("     0  finished     run seed 1000    σ 0")
    );
    assert_eq!(listed.lines().count(), 6);
}

/// The study crashes when two of twelve runs are finished.
#[test]
fn a_crashed_study_runs_only_its_missing_runs() {
    let (_folder, study, out) = write_study(&study_text(4, ""));
    let path = out.to_str().unwrap();
    let arguments = ["study", &study, "--out", path, "--jobs", "1"];
    crash(command(
        &[&arguments[..], &["--abort-after-runs", "2"]].concat(),
    ));
    assert_eq!(result_files(&out).len(), 2);

    let output = run_study(&study, &out, &[]);
    assert!(output.status.success(), "{output:?}");
    assert!(
        stdout(&output).starts_with("study      small: 3 cells, 4 runs each, 10 to run\n"),
        "{output:?}"
    );
    let (_folder, _, without_crash) = write_study("");
    assert!(run_study(&study, &without_crash, &[]).status.success());
    assert_eq!(stored_results(&out), stored_results(&without_crash));
}

/// Two cells with equal settings are run once and reported twice. The stored runs have the visited
/// states that the figures of either cell need.
#[test]
fn cells_with_equal_settings_share_their_runs() {
    let text = study_text(1, "")
        .replace("TwoPoint(sigma: 0)", "Normal(sigma: 0.0)")
        .replace(r#"cells: ["σ 9"]"#, r#"cells: ["σ 0 again"]"#);
    let (_folder, study, out) = write_study(&text);
    let output = stdout(&run_study(&study, &out, &[]));
    assert!(
        output.starts_with("study      small: 3 cells, 1 run each, 2 to run\n"),
        "{output}"
    );
    assert_eq!(result_files(&out).len(), 2);
    assert!(
        stdout(&run_study(&study, &out, &[]))
            .starts_with("study      small: 3 cells, 1 run each, 0 to run\n")
    );
    let table = fs::read_to_string(out.join("results.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 3, "{table}");
}

/// The test changes stored results, as if another version of the program had computed them.
#[test]
fn verify_finds_runs_that_are_not_reproduced() {
    let visitation = r#", Visitation(cells: ["σ 9"], episodes: [First(2), All])"#;
    let (_folder, study, out) = write_study(&study_text(2, "").replace(visitation, ""));
    let without_runs = run_study(&study, &out, &["--verify"]);
    let expected = format!(
        "error: {} contains no runs of this study to verify\n",
        out.display()
    );
    assert_eq!(
        (without_runs.status.code(), stderr(&without_runs)),
        (Some(2), expected)
    );
    assert!(run_study(&study, &out, &[]).status.success());
    let verified = run_study(&study, &out, &["--verify=4"]);
    assert!(verified.status.success(), "{verified:?}");
    assert_eq!(
        stdout(&verified),
        "verified   small: 4 of 4 repeated runs are bit-identical (6 runs stored)\n"
    );

    change_stored_curves(&out, 1001);
    let verified = run_study(&study, &out, &["--verify"]);
    let errors = stderr(&verified);
    assert_eq!(verified.status.code(), Some(1), "{errors}");
    assert_eq!(
        stdout(&verified),
        "verified   small: 3 of 6 repeated runs are bit-identical (6 runs stored)\n"
    );
    assert!(
        errors.contains("differs    σ 9, run seed 1001: ") && !errors.contains("run seed 1000"),
        "{errors}"
    );
    assert!(
        errors.ends_with("error: 3 runs not reproduced\n"),
        "{errors}"
    );
}

/// Changes the sign of one value in the stored results of all runs with a run seed.
pub(crate) fn change_stored_curves(out: &Path, run_seed: u64) {
    let file_end = format!("-{run_seed}.run");
    for (name, bytes) in stored_results(out) {
        if name.ends_with(&file_end) {
            let mut contents = contents(&bytes).to_vec();
            // The last byte is the number of windows of visited states, 0; the curves are before it.
            let sign_byte = contents.len() - 2;
            contents[sign_byte] ^= 0x80;
            write_result_file(&out.join("runs").join(name), contents);
        }
    }
}

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
            && page().contains(" --verify</code>.")
    );
    assert!(run_study(&study, &out, &["--verify"]).status.success());
}

/// Ctrl-C interrupts the study that is in progress. The first study is finished already.
#[cfg(unix)]
#[test]
fn ctrl_c_interrupts_the_second_of_two_studies() {
    let (folder, study, _) = write_study(&study_text(1, ""));
    let long = folder.path().join("long.ron");
    fs::write(
        &long,
        study_text(30, "").replace("Episodes(8)", "Episodes(100)"),
    )
    .unwrap();
    let mut command = command(&["study", &study, long.to_str().unwrap(), "--jobs", "1"]);
    let mut child = command
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // When one of the 90 runs of this study is finished, another run is in progress.
    let runs = folder.path().join("recordings/studies/long/runs");
    wait_until("the second study's first run is finished", || {
        assert_eq!(child.try_wait().unwrap(), None, "the studies ended early");
        runs.is_dir() && !files_below(&runs, "run").is_empty()
    });
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    let errors = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert!(
        errors.ends_with("interrupted; repeat the command to resume long\n"),
        "{errors}"
    );
    assert!(!errors.contains("warning"), "{errors}");
    assert!(
        folder
            .path()
            .join("recordings/studies/small/report.html")
            .is_file()
    );
}

#[test]
fn a_changed_study_repeats_affected_runs_only() {
    let (_folder, study, out) = write_study(&study_text(2, ""));
    assert!(run_study(&study, &out, &[]).status.success());
    let runs_to_repeat = |text: &str| {
        fs::write(&study, text).unwrap();
        let output = run_study(&study, &out, &[]);
        assert!(output.status.success(), "{output:?}");
        let printed = stdout(&output);
        printed
            .lines()
            .next()
            .unwrap()
            .rsplit(", ")
            .next()
            .unwrap()
            .to_owned()
    };
    assert_eq!(
        runs_to_repeat(&study_text(2, "").replace("Small", "Another")),
        "0 to run"
    );
    assert_eq!(runs_to_repeat(&study_text(3, "")), "3 to run");
    assert_eq!(
        runs_to_repeat(&study_text(3, "").replace("sigma: 9", "sigma: 8")),
        "3 to run"
    );
    // Visited states of other episodes are stored, so that the runs are repeated.
    assert_eq!(
        runs_to_repeat(&study_text(3, "").replace("First(2)", "First(3)")),
        "3 to run"
    );
}

#[test]
fn failed_runs_are_reported_and_repeated_with_retry() {
    let (_folder, study, out) = write_study(&study_text(5, "").replace("sigma: 9", "sigma: 1e30"));
    for to_run in ["15 to run", "0 to run"] {
        let output = run_study(&study, &out, &[]);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(
            stdout(&output).contains(to_run) && stdout(&output).contains("10 finished, 5 failed"),
            "{output:?}"
        );
        assert!(
            stderr(&output).ends_with("error: 5 runs failed\n"),
            "{output:?}"
        );
    }
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(
        page.contains("σ 9, seed 1000: non-finite network parameters (agent")
            && page.contains("5 runs failed."),
        "the report must give the reason"
    );
    assert!(stdout(&run_study(&study, &out, &["--retry"])).contains("5 to run"));
}

/// Rows of `results.csv`, each as values by column.
pub(crate) fn result_rows(out: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(out.join("results.csv")).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
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

fn read_summary(run: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(run.join("summary.json")).unwrap()).unwrap()
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
        tables.contains("| deep_sea, seeds | 10 | – | 40 | 4000 | 0 | – | – |"),
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

/// The results of `σ 0` and `σ 0 again` are bit-identical: no claim of a difference may be supported.
/// A margin of 500 is wider than any return, one of 0.001 is narrower than six runs can show.
#[test]
fn a_claim_without_an_effect_is_not_supported() {
    let claim = |direction: &str, smallest: &str| {
        format!(
            r#"(text: "{direction} {smallest}", compare: ("σ 0 again", "σ 0"), direction: {direction}, smallest: {smallest}, because: "x", confirmatory: true)"#
        )
    };
    let claims = [
        ("More", "500"),
        ("Less", "0.001"),
        ("Same", "500"),
        ("Same", "0.001"),
        ("NotMore", "500"),
        ("NotLess", "500"),
    ];
    let claims = claims
        .map(|(direction, smallest)| claim(direction, smallest))
        .join(", ");
    let (_folder, study, out) = write_study(&study_text(6, &format!("claims: [{claims}],")));
    let printed = stdout(&run_study(&study, &out, &[]));
    for line in [
        "refuted              More 500",
        "open                 Less 0.001",
        "no relevant effect   Same 500",
        "open                 Same 0.001",
        "no relevant increase NotMore 500",
        "no relevant decrease NotLess 500",
        "6 confirmatory claims: 1 refuted, 2 open, 1 no relevant effect, 1 no relevant increase, 1 no relevant decrease",
    ] {
        assert!(printed.contains(line), "{line} in {printed}");
    }
    assert_no_effect_on_page(&out);
}

/// For each claim the page shows the probability that a run of the first cell has a return above, or
/// below, that of the second cell: 0.5.
fn assert_no_effect_on_page(out: &Path) {
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let effect = ">Effect: difference between the means. Test: studentized permutation test.<";
    assert_eq!(page.matches(effect).count(), 6);
    let counts_of_sides = ["above", "below"].map(|side| {
        page.matches(&format!("; P(first {side} second) = 0.5 ("))
            .count()
    });
    assert_eq!(counts_of_sides, [2, 4]);
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
    assert!(
        stderr(&refused).starts_with("error: not the results of a study: "),
        "{refused:?}"
    );
}

/// No run solves its task within eight episodes: all times are eight, which may be a ceiling, and
/// shows neither an effect nor that there is none.
#[test]
fn claims_about_unsolved_runs_are_open() {
    let claim = |direction: &str| {
        format!(
            r#"(text: "{direction}", compare: ("σ 9", "σ 0"), measure: EpisodesToSolve, direction: {direction}, smallest: 5, because: "x", confirmatory: true)"#
        )
    };
    let claims = ["More", "Less", "Same"].map(claim).join(", ");
    let (_folder, study, out) = write_study(&study_text(30, &format!("claims: [{claims}],")));
    let output = run_study(&study, &out, &[]);
    assert_eq!(stdout(&output).matches("\nopen ").count(), 3, "{output:?}");
    let table = fs::read_to_string(out.join("claims.md")).unwrap();
    assert!(
        table.contains("| 0 (0 to 0), 8 against 8 | 30 | 1.0000 | open |"),
        "{table}"
    );
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(
        page.matches("they may be at a floor or a ceiling").count(),
        3
    );
}

#[test]
fn a_claim_that_changed_after_its_runs_is_marked_as_late() {
    let claim = |size: u32| {
        format!(
            r#"claims: [(text: "x", compare: ("σ 9", "σ 0"), direction: Less, smallest: {size})],"#
        )
    };
    let is_late = |size: u32, out: &Path, study: &str| {
        fs::write(study, study_text(6, &claim(size))).unwrap();
        assert!(run_study(study, out, &[]).status.success());
        let page = fs::read_to_string(out.join("report.html")).unwrap();
        assert_eq!(
            page.contains(", claimed late</p>"),
            fs::read_to_string(out.join("claims.md"))
                .unwrap()
                .contains("claimed late")
        );
        page.contains(", claimed late</p>")
    };
    let (_folder, study, out) = write_study("");
    assert_eq!(
        [5, 5, 6, 6, 5].map(|size| is_late(size, &out, &study)),
        [false, false, true, true, true]
    );
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

#[test]
fn a_directory_has_one_study() {
    let (folder, study, out) = write_study(&study_text(2, ""));
    assert!(run_study(&study, &out, &[]).status.success());
    let error_of = |output: Output| {
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        stderr(&output)
    };
    let expected = format!(
        "error: {} contains the study `small`; choose another directory with --out\n",
        out.display()
    );
    assert_eq!(error_of(run_study(&study, &out, &["--quick"])), expected);
    let other = folder.path().join("other.ron");
    fs::copy(&study, &other).unwrap();
    assert_eq!(
        error_of(run_study(other.to_str().unwrap(), &out, &[])),
        expected
    );
    fs::create_dir(folder.path().join("b")).unwrap();
    let same_name = folder.path().join("b/small.ron");
    fs::copy(&study, &same_name).unwrap();
    let error = error_of(seedbed(&["study", &study, same_name.to_str().unwrap()]));
    assert!(
        error.starts_with(
            "error: two studies are named `small` and would both write to recordings/studies/small"
        ),
        "{error}"
    );
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
