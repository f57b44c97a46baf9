//! Studies on the command line: runs, stored results, claims and reports.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use super::util::{REPOSITORY, command, crash, files_below, seedbed, stderr, stdout, wait_until};

/// A study of two agents and few episodes: two cells that differ, and a third with the settings of the
/// first.
fn text(repeats: u32, more: &str) -> String {
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
            {more}
        )"#,
        scenario.display()
    )
}

/// A temporary directory, the path of a study file in it, and a path for its results.
fn study_in_folder(text: &str) -> (tempfile::TempDir, String, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let study = folder.path().join("small.ron");
    fs::write(&study, text).unwrap();
    let (study, out) = (
        study.to_str().unwrap().to_owned(),
        folder.path().join("out"),
    );
    (folder, study, out)
}

fn run(study: &str, out: &Path, more: &[&str]) -> Output {
    seedbed(&[&["study", study, "--out", out.to_str().unwrap()], more].concat())
}

/// Number of bytes of the build's hash at the end of a result file.
const BUILD_HASH: usize = 8;

/// Contents of the result files, by file name.
fn results(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let named = |path: PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        (name, fs::read(path).unwrap())
    };
    result_files(out).into_iter().map(named).collect()
}

fn result_files(out: &Path) -> Vec<PathBuf> {
    files_below(&out.join("runs"), "run")
}

#[test]
fn results_depend_neither_on_jobs_nor_on_processes() {
    let (_folder, study, out) = study_in_folder(&text(2, ""));
    assert!(run(&study, &out, &["--jobs", "2"]).status.success());
    let whole = results(&out);
    assert_eq!(whole.len(), 6);
    let (_folder, _, alone) = study_in_folder("");
    assert!(run(&study, &alone, &["--jobs", "1"]).status.success());
    assert_eq!(results(&alone), whole);

    let (_folder, _, single) = study_in_folder("");
    for index in ["4", "0", "5", "1", "2", "3"] {
        assert!(run(&study, &single, &["--index", index]).status.success());
    }
    assert_eq!(results(&single), whole);
    let beyond = run(&study, &single, &["--index", "6"]);
    assert_eq!(beyond.status.code(), Some(2));
    let expected = "error: --index 6: expected an index from 0 to 5; --list shows all\n";
    assert_eq!(stderr(&beyond), expected);
    let listed = stdout(&run(&study, &single, &["--list"]));
    assert_eq!(
        listed.lines().next(),
        Some("     0  finished  run seed 1000    σ 0")
    );
    assert_eq!(listed.lines().count(), 6);
}

/// The study crashes when two of twelve runs are finished.
#[test]
fn a_crashed_study_runs_its_missing_runs() {
    let (_folder, study, out) = study_in_folder(&text(4, ""));
    let path = out.to_str().unwrap();
    let arguments = ["study", &study, "--out", path, "--jobs", "1"];
    crash(command(
        &[&arguments[..], &["--abort-after-runs", "2"]].concat(),
    ));
    assert_eq!(result_files(&out).len(), 2);

    let output = run(&study, &out, &[]);
    assert!(output.status.success(), "{output:?}");
    assert!(
        stdout(&output).starts_with("study      small: 3 cells, 4 runs each, 10 to run\n"),
        "{output:?}"
    );
    let (_folder, _, without_crash) = study_in_folder("");
    assert!(run(&study, &without_crash, &[]).status.success());
    assert_eq!(results(&out), results(&without_crash));
}

/// Two cells with equal settings are run once and reported twice, with the states that either of them
/// needs.
#[test]
fn cells_with_equal_settings_share_their_runs() {
    let text = text(1, "")
        .replace("TwoPoint(sigma: 0)", "Normal(sigma: 0.0)")
        .replace(r#"cells: ["σ 9"]"#, r#"cells: ["σ 0 again"]"#);
    let (_folder, study, out) = study_in_folder(&text);
    let output = stdout(&run(&study, &out, &[]));
    assert!(
        output.starts_with("study      small: 3 cells, 1 run each, 2 to run\n"),
        "{output}"
    );
    assert_eq!(result_files(&out).len(), 2);
    assert!(
        stdout(&run(&study, &out, &[]))
            .starts_with("study      small: 3 cells, 1 run each, 0 to run\n")
    );
    let table = fs::read_to_string(out.join("results.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 3, "{table}");
}

/// Changed bytes of a stored result stand for results of other code.
#[test]
fn verify_finds_runs_that_are_not_reproduced() {
    let (_folder, study, out) = study_in_folder(&text(2, ""));
    let empty = run(&study, &out, &["--verify"]);
    let expected = format!(
        "error: {} contains no runs of this study to verify\n",
        out.display()
    );
    assert_eq!((empty.status.code(), stderr(&empty)), (Some(2), expected));
    assert!(run(&study, &out, &[]).status.success());
    let before = results(&out);
    let verified = run(&study, &out, &["--verify=4"]);
    assert!(verified.status.success(), "{verified:?}");
    assert_eq!(
        stdout(&verified),
        "verified   small: 4 of 4 repeated runs are bit-identical (6 runs stored)\n"
    );

    let results_of = |seed: u64| {
        before
            .keys()
            .filter(move |name| name.ends_with(&format!("-{seed}.run")))
    };
    for name in results_of(1001) {
        let mut bytes = before[name].clone();
        // The curves are stored before the build's hash: this changes the sign of one value.
        let last = bytes.len() - BUILD_HASH - 2;
        bytes[last] ^= 0x80;
        fs::write(out.join("runs").join(name), bytes).unwrap();
    }
    let verified = run(&study, &out, &["--verify"]);
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

/// A result without a build's hash is from an older version, one with another hash from another
/// build.
#[test]
fn a_report_names_the_builds_of_its_runs() {
    let (_folder, study, out) = study_in_folder(&text(1, ""));
    assert!(run(&study, &out, &[]).status.success());
    let page = || fs::read_to_string(out.join("report.html")).unwrap();
    assert!(
        !page().contains("Several builds.")
            && !page().contains("build unknown")
            && page().contains("rapier2d 0."),
        "{}",
        page()
    );
    let change = |number: usize, change: fn(&mut Vec<u8>)| {
        let (name, mut bytes) = results(&out).into_iter().nth(number).unwrap();
        change(&mut bytes);
        fs::write(out.join("runs").join(name), bytes).unwrap();
        let output = stdout(&run(&study, &out, &[]));
        assert!(
            output.starts_with("study      small: 3 cells, 1 run each, 0 to run\n"),
            "{output}"
        );
    };
    change(0, |bytes| bytes.truncate(bytes.len() - BUILD_HASH));
    assert!(
        page().contains("The runs were made by 2 builds of seedbed (unknown, "),
        "{}",
        page()
    );
    change(1, |bytes| *bytes.last_mut().unwrap() ^= 1);
    assert!(
        page().contains("The runs were made by 3 builds of seedbed (unknown, ")
            && page().contains(" --verify</code>.")
    );
    assert!(run(&study, &out, &["--verify"]).status.success());
}

/// Ctrl-C interrupts the study that is in progress.
#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_second_of_two_studies() {
    let (folder, study, _) = study_in_folder(&text(1, ""));
    let long = folder.path().join("long.ron");
    fs::write(&long, text(30, "").replace("Episodes(8)", "Episodes(100)")).unwrap();
    let mut command = command(&["study", &study, long.to_str().unwrap(), "--jobs", "1"]);
    let mut child = command
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // One of its 90 runs is finished, so another is in progress.
    let runs = folder.path().join("recordings/studies/long/runs");
    wait_until("the second study's first run is finished", || {
        assert_eq!(child.try_wait().unwrap(), None, "the studies ended early");
        runs.is_dir() && !files_below(&runs, "run").is_empty()
    });
    assert!(
        Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status()
            .unwrap()
            .success()
    );
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
    let (_folder, study, out) = study_in_folder(&text(2, ""));
    assert!(run(&study, &out, &[]).status.success());
    let to_run = |text: &str| {
        fs::write(&study, text).unwrap();
        let output = run(&study, &out, &[]);
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
    assert_eq!(to_run(&text(2, "").replace("Small", "Another")), "0 to run");
    assert_eq!(to_run(&text(3, "")), "3 to run");
    assert_eq!(
        to_run(&text(3, "").replace("sigma: 9", "sigma: 8")),
        "3 to run"
    );
    // States are kept of the first run of a cell only, so only that run is repeated.
    assert_eq!(
        to_run(&text(3, "").replace("First(2)", "First(3)")),
        "1 to run"
    );
}

#[test]
fn a_failed_run_is_reported() {
    let (_folder, study, out) = study_in_folder(&text(5, "").replace("sigma: 9", "sigma: 1e30"));
    for to_run in ["15 to run", "0 to run"] {
        let output = run(&study, &out, &[]);
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
        "the page gives the reason"
    );
    assert!(stdout(&run(&study, &out, &["--retry"])).contains("5 to run"));
}

/// Rows of `results.csv`, by column.
fn rows(out: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(out.join("results.csv")).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
}

/// Each run is repeated by `seedbed run`, and its numbers are computed from `episodes.csv` and
/// `summary.json`.
#[test]
fn a_report_has_the_numbers_of_single_runs() {
    let (folder, study, out) = study_in_folder(&text(5, ""));
    assert!(run(&study, &out, &[]).status.success());
    let rows = rows(&out);
    assert_eq!(rows.len(), 15);
    let mut finals = Vec::new();
    for row in rows.iter().filter(|row| row["cell"] == "σ 9") {
        let single = folder.path().join(&row["seed"]);
        let set = [
            "--set",
            "agents.count=2",
            "--set",
            "stop=Episodes(8)",
            "--set",
            "agents.seeds=Normal(sigma: 9)",
        ];
        let base = [
            "run",
            "scenarios/cartpole.ron",
            "--no-recording",
            "--quiet",
            "--seed",
            &row["seed"],
            "--out",
        ];
        assert!(
            seedbed(&[&base, &[single.to_str().unwrap()][..], &set].concat())
                .status
                .success()
        );
        let mut reader = csv::Reader::from_path(single.join("episodes.csv")).unwrap();
        let episodes: Vec<BTreeMap<String, String>> =
            reader.deserialize().map(|row| row.unwrap()).collect();
        let mean = |from: usize| {
            let late = episodes
                .iter()
                .filter(|row| row["episode"].parse::<usize>().unwrap() >= from);
            let returns: Vec<f64> = late.map(|row| row["return"].parse().unwrap()).collect();
            returns.iter().sum::<f64>() / returns.len() as f64
        };
        assert!((row["mean_return"].parse::<f64>().unwrap() - mean(0)).abs() < 1e-9);
        finals.push(mean(3));
        let summary: serde_json::Value =
            serde_json::from_slice(&fs::read(single.join("summary.json")).unwrap()).unwrap();
        let coverage: f64 = row["team_coverage"].parse().unwrap();
        assert!((coverage - summary["team_coverage"].as_f64().unwrap()).abs() < 1e-6);
        assert_eq!(row["env_steps"], summary["env_steps"].to_string());
    }
    finals.sort_by(f64::total_cmp);
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let table = &page[page
        .find("<h3>return over the last 5 episodes</h3>")
        .unwrap()..];
    let row = table[table.find("<td class=\"name\">σ 9</td>").unwrap()..].replace("</td>", "");
    let cells: Vec<&str> = row.split("<td>").take(3).collect();
    assert_eq!(cells[1], "5");
    let median: f64 = cells[2].parse().unwrap();
    assert!(
        (median - finals[2]).abs() <= 0.005,
        "{median} for {finals:?}"
    );
}

/// A study of two tabular tasks and two algorithms; figures pool the tasks.
fn tabular_text() -> String {
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
                (text: "less regret", compare: ("deep_sea, seeds", "deep_sea, random"), direction: Less, size: 5),
                (text: "far less regret", compare: ("deep_sea, seeds", "deep_sea, random"), direction: Less, size: 1000),
                (text: "the goal sooner", compare: ("deep_sea, seeds", "deep_sea, random"), measure: FirstGoal, direction: Less, size: 5),
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

/// Regret and coverage are those of `seedbed run` with the same scenario and run seed.
#[test]
fn tabular_scenarios_are_studied() {
    let (folder, study, out) = study_in_folder(&tabular_text());
    let output = run(&study, &out, &[]);
    assert!(
        stdout(&output).contains("3 of 3 claims replicated, 1 of them smaller than claimed\n"),
        "{output:?}"
    );
    assert!(
        stdout(&output).contains("\nreplicated, smaller than claimed far less regret\n"),
        "{output:?}"
    );
    let rows = rows(&out);
    assert_eq!(rows.len(), 30);
    for row in rows
        .iter()
        .filter(|row| row["cell"] == "bipolar_chain, seeds")
    {
        assert_as_single_run(row, folder.path());
    }
    assert!(
        rows.iter()
            .filter(|row| row["cell"].starts_with("deep_sea"))
            .all(|row| row["episodes"] == "40")
    );
    assert_pairs_of_one_task(&out);
    assert_smaller_than_claimed(&out);
    assert_figures(&out);
    let alone = study_in_folder("").2;
    assert!(run(&study, &alone, &["--jobs", "1"]).status.success());
    assert_eq!(results(&alone), results(&out));
}

/// Asserts that a row has the numbers of `seedbed run` with its run seed.
fn assert_as_single_run(row: &BTreeMap<String, String>, folder: &Path) {
    let single = folder.join(&row["seed"]);
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
        single.to_str().unwrap(),
    ];
    assert!(seedbed(&arguments).status.success());
    let summary: serde_json::Value =
        serde_json::from_slice(&fs::read(single.join("summary.json")).unwrap()).unwrap();
    let number = |column: &str| row[column].parse::<f64>().unwrap();
    assert!(
        (number("regret") - summary["regret_per_agent"].as_f64().unwrap()).abs() < 1e-4,
        "{row:?}"
    );
    let visited = summary["states_visited"].as_f64().unwrap() / summary["states"].as_f64().unwrap();
    assert!((number("team_coverage") - visited).abs() < 1e-6);
    assert_eq!(row["env_steps"], summary["env_steps"].to_string());
    assert_eq!(
        (row["episodes_to_solve"].as_str(), row["episodes"].as_str()),
        ("", "1")
    );
}

/// The second cell of each task is compared with the first.
fn assert_pairs_of_one_task(out: &Path) {
    let tables = fs::read_to_string(out.join("tables.md")).unwrap();
    let titles: Vec<&str> = tables
        .lines()
        .filter_map(|line| line.strip_prefix("## "))
        .collect();
    assert!(
        titles[0] == "regret per agent"
            && titles.last() == Some(&"Paired comparisons: regret per agent"),
        "{titles:?}"
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

fn assert_smaller_than_claimed(out: &Path) {
    let table = fs::read_to_string(out.join("claims.md")).unwrap();
    // All six pairs have the same sign: p = 2/2⁶, times three claims.
    let row = table.lines().nth(2).unwrap();
    let (head, tail) = (
        "| less regret | regret per agent: deep_sea, seeds − deep_sea, random, claimed below 0, by 5 | −",
        " | 6 | 0.0938 | replicated |",
    );
    assert!(row.starts_with(head) && row.ends_with(tail), "{table}");
    assert!(
        table
            .lines()
            .nth(3)
            .unwrap()
            .ends_with(" | replicated, smaller than claimed |"),
        "{table}"
    );
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(
        page.matches(">replicated, smaller than claimed</p>")
            .count(),
        1
    );
}

fn assert_figures(out: &Path) {
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
        "titles leave out what all panels have in common"
    );
    let pooled = fs::read_to_string(out.join("figures/4-intervals.svg")).unwrap();
    for words in [">seeds<", "n = 12", ">crowd<", "n = 6"] {
        assert!(pooled.contains(words), "{words}");
    }
}

/// `σ 0` and `σ 0 again` are bit-identical: no claim of a difference may be replicated, and six pairs
/// are too few to show that there is none.
#[test]
fn a_claim_without_an_effect_is_not_replicated() {
    let claim = |direction: &str| {
        format!(
            r#"(text: "{direction}", compare: ("σ 0 again", "σ 0"), direction: {direction}, size: 5)"#
        )
    };
    let claims = ["More", "Less", "Same"].map(claim).join(", ");
    let (_folder, study, out) = study_in_folder(&text(6, &format!("claims: [{claims}],")));
    let printed = stdout(&run(&study, &out, &[]));
    for line in [
        "not replicated   More",
        "not replicated   Less",
        "inconclusive     Same",
        "0 of 3 claims replicated",
    ] {
        assert!(printed.contains(line), "{line} in {printed}");
    }
    // Without any difference p is 1, which is no evidence that there is none.
    let table = fs::read_to_string(out.join("claims.md")).unwrap();
    let p: Vec<&str> = table
        .lines()
        .skip(2)
        .take(3)
        .map(|row| row.split(" | ").nth(4).unwrap())
        .collect();
    assert_eq!(p, ["1.0000", "1.0000", "–"]);
    assert!(
        table.contains("\n\np-values are those of tests for a difference"),
        "{table}"
    );
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(
        (
            page.matches("; p = 1.0000 (Holm). ").count(),
            page.matches(">Effect: mean difference between runs of the same seed.<")
                .count()
        ),
        (2, 1)
    );
    let sides = ["above", "below"].map(|side| {
        page.matches(&format!("; P(first {side} second) = 0.5 ("))
            .count()
    });
    assert_eq!(sides, [1, 2]);
}

#[test]
fn a_report_of_an_unfinished_study_says_what_is_missing() {
    let (_folder, study, out) = study_in_folder(&text(
        6,
        r#"claims: [(text: "x", compare: ("σ 9", "σ 0"), direction: Less, size: 5)],"#,
    ));
    for index in ["0", "1", "6"] {
        assert!(run(&study, &out, &["--index", index]).status.success());
    }
    let output = seedbed(&["report", out.to_str().unwrap()]);
    assert!(output.status.success(), "{output:?}");
    assert!(
        stdout(&output).starts_with("runs       3 finished, 15 missing\ninconclusive     x\n"),
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
    for foreign in ["<script", "<link", "src=\"http", "url(http"] {
        assert!(
            !page.contains(foreign),
            "the page needs no network: {foreign}"
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

    let nothing = seedbed(&["report", out.join("runs").to_str().unwrap()]);
    assert_eq!(nothing.status.code(), Some(2));
    assert!(
        stderr(&nothing).starts_with("error: not the results of a study: "),
        "{nothing:?}"
    );
}

/// No run solves its task in eight episodes, so it is unknown which cell is faster.
#[test]
fn claims_about_unsolved_runs_are_inconclusive() {
    let claim = |direction: &str, test: &str| {
        format!(
            r#"(text: "{direction} {test}", compare: ("σ 9", "σ 0"), measure: EpisodesToSolve, direction: {direction}, size: 5, test: {test})"#
        )
    };
    let claims = [
        claim("More", "Paired"),
        claim("Less", "Independent"),
        claim("Same", "Paired"),
    ]
    .join(", ");
    let (_folder, study, out) = study_in_folder(&text(30, &format!("claims: [{claims}],")));
    let output = run(&study, &out, &[]);
    assert_eq!(
        stdout(&output).matches("inconclusive     ").count(),
        3,
        "{output:?}"
    );
    assert!(
        fs::read_to_string(out.join("claims.md"))
            .unwrap()
            .contains("| unknown (−∞ to ∞) | 30 | 1.0000 | inconclusive |")
    );
}

#[test]
fn a_claim_that_was_written_after_its_runs_is_late() {
    let claim = |size: u32| {
        format!(r#"claims: [(text: "x", compare: ("σ 9", "σ 0"), direction: Less, size: {size})],"#)
    };
    let verdict = |size: u32, out: &Path, study: &str| {
        fs::write(study, text(6, &claim(size))).unwrap();
        assert!(run(study, out, &[]).status.success());
        let page = fs::read_to_string(out.join("report.html")).unwrap();
        assert_eq!(
            page.contains(", claimed late</p>"),
            fs::read_to_string(out.join("claims.md"))
                .unwrap()
                .contains("claimed late")
        );
        page.contains(", claimed late</p>")
    };
    let (_folder, study, out) = study_in_folder("");
    assert_eq!(
        [5, 5, 6, 6, 5].map(|size| verdict(size, &out, &study)),
        [false, false, true, true, true]
    );
}

/// Older versions did not store earlier numbers of runs.
#[test]
fn changed_repeats_are_reported() {
    let (_folder, study, out) = study_in_folder("");
    let claim = r#"claims: [(text: "x", compare: ("σ 9", "σ 0"), direction: Less, size: 5)],"#;
    let reported = |repeats: u32| {
        fs::write(&study, text(repeats, claim)).unwrap();
        assert!(run(&study, &out, &[]).status.success());
        let [page, table] =
            ["report.html", "claims.md"].map(|file| fs::read_to_string(out.join(file)).unwrap());
        let words = table
            .lines()
            .find(|line| line.starts_with("The number of runs per cell was "))
            .unwrap_or_default()
            .to_owned();
        assert_eq!(
            page.contains("The number of runs per cell was "),
            !words.is_empty()
        );
        assert!(page.contains(&words));
        words
    };
    assert_eq!([reported(5), reported(5)], ["", ""]);
    // Without runs there were no results that could have motivated the change.
    fs::remove_dir_all(out.join("runs")).unwrap();
    assert_eq!(reported(1), "");
    let stored = fs::read_to_string(out.join("study.json")).unwrap();
    fs::write(
        out.join("study.json"),
        stored.replace(",\n  \"earlier_repeats\": []", ""),
    )
    .unwrap();
    assert!(
        !fs::read_to_string(out.join("study.json"))
            .unwrap()
            .contains("earlier_repeats")
    );
    assert_eq!(
        reported(2),
        "The number of runs per cell was extended from 1 to 2 after some of them had been run."
    );
    assert_eq!(
        reported(2),
        "The number of runs per cell was extended from 1 to 2 after some of them had been run."
    );
    assert_eq!(
        reported(3),
        "The number of runs per cell was extended from 1 to 2 to 3 after some of them had been run."
    );
    assert_eq!(
        reported(2),
        "The number of runs per cell was changed from 1 to 2 to 3 to 2 after some of them had been run."
    );
}

#[test]
fn a_directory_has_one_study() {
    let (folder, study, out) = study_in_folder(&text(2, ""));
    assert!(run(&study, &out, &[]).status.success());
    let refused = |output: Output| {
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        stderr(&output)
    };
    let holds = format!(
        "error: {} contains the study `small`; choose another directory with --out\n",
        out.display()
    );
    assert_eq!(refused(run(&study, &out, &["--quick"])), holds);
    let other = folder.path().join("other.ron");
    fs::copy(&study, &other).unwrap();
    assert_eq!(refused(run(other.to_str().unwrap(), &out, &[])), holds);
    fs::create_dir(folder.path().join("b")).unwrap();
    let same_name = folder.path().join("b/small.ron");
    fs::copy(&study, &same_name).unwrap();
    let both = refused(seedbed(&["study", &study, same_name.to_str().unwrap()]));
    assert!(
        both.starts_with(
            "error: two studies are named `small` and would both write to recordings/studies/small"
        ),
        "{both}"
    );
}

/// Figures of an earlier report are removed, other files are kept. Each measure of the study has a
/// column.
#[test]
fn a_report_replaces_the_report_before() {
    let (_folder, study, out) = study_in_folder(&text(2, ""));
    assert!(run(&study, &out, &[]).status.success());
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
    let row = &rows(&out)[0];
    assert_eq!(row["Coverage"], row["team_coverage"]);
    assert!(row["FinalReturn(window:5)"].parse::<f64>().unwrap() > 8.0);
}

#[test]
fn tuning_seeds_are_marked() {
    let (_folder, study, out) = study_in_folder(&text(2, "first_seed: 0,"));
    assert!(run(&study, &out, &[]).status.success());
    assert!(
        fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains("Tuning seeds.")
    );
    assert!(rows(&out).iter().all(|row| row["seeds"] == "tuning"));
}
