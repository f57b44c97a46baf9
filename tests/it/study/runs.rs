//! Which runs a study executes, and what it stores of them.

use std::fs;
use std::process::{Output, Stdio};

use super::{change_stored_runs, result_files, run_study, stored_results, study_text, write_study};
#[cfg(unix)]
use crate::util::interrupt;
use crate::util::{command, crash, files_below, seedbed, stderr, stdout, wait_until};

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
    let expected =
        "error: --index 6: expected an index from 0 to 5; `seedbed study list` shows all\n";
    assert_eq!(stderr(&beyond), expected);
    let listed = run_study(&study, &one_process_per_run, &["list"]);
    assert_eq!(stderr(&listed), "runs       6 finished\n");
    let listed = stdout(&listed);
    assert_eq!(
        listed.lines().next(),
        Some("     0  finished     run seed 1000    σ 0")
    );
    assert_eq!(listed.lines().count(), 6);
}

/// The former spelling of an action works, and says the one of today.
#[test]
fn former_spellings_of_actions_are_read() {
    let (_folder, study, out) = write_study(&study_text(1, ""));
    let path = out.to_str().unwrap();
    let former = run_study(&study, &out, &["--list"]);
    let listed = run_study(&study, &out, &["list"]);
    assert_eq!(stdout(&former), stdout(&listed));
    let count = stdout(&listed).lines().count();
    let counted = format!("runs       {count} to run\n");
    assert_eq!(stderr(&listed), counted);
    let new_spelling =
        format!("note: the new spelling is `seedbed study list {study} --out {path}`\n");
    assert_eq!(stderr(&former), new_spelling + &counted);
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

/// With four runs of each cell nothing is decided, and `check` says so before.
#[test]
fn too_few_runs_for_verdicts_are_reported() {
    let claim = r#"(text: "It helps.", compare: ("σ 9", "σ 0"), measure: Coverage, direction: More, smallest: 0.1,
        confirmatory: true)"#;
    let text = study_text(4, &format!("claims: [{claim}],"));
    let (_folder, study, out) = write_study(&text);
    let warning =
        "there are no verdicts on claims with 4 runs of each cell: expected `repeats: 5` or more";
    let checked = stdout(&seedbed(&["check", &study]));
    assert!(
        checked.contains(&format!("warning: {study}: {warning}\n")),
        "{checked}"
    );
    let output = run_study(&study, &out, &[]);
    assert!(stderr(&output).contains(warning), "{output:?}");
    let verdict = "4 runs are too few for a verdict: expected 5 or more of each cell.";
    assert!(stdout(&output).contains(verdict), "{output:?}");
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

/// The figure of visited states in the text of the study. Results without it end with curves.
const VISITATION: &str = r#", Visitation(cells: ["σ 9"], episodes: [First(2), All])"#;

/// The test changes stored results, as if another version of the program had computed them.
#[test]
fn verify_finds_runs_that_are_not_reproduced() {
    let (_folder, study, out) = write_study(&study_text(2, "").replace(VISITATION, ""));
    let without_runs = run_study(&study, &out, &["verify"]);
    let expected = format!(
        "error: {} contains no runs of this study to verify\n",
        out.display()
    );
    assert_eq!(
        (without_runs.status.code(), stderr(&without_runs)),
        (Some(2), expected)
    );
    assert!(run_study(&study, &out, &[]).status.success());
    let verified = run_study(&study, &out, &["verify", "--runs=4", "--draw=7"]);
    assert!(verified.status.success(), "{verified:?}");
    assert_eq!(
        stdout(&verified),
        "draw       7: 4 of 6 runs; to repeat these: --draw=7\n\
         verified   small: 4 of 4 repeated runs are bit-identical (6 runs stored)\n"
    );

    change_stored_runs(&out, 1001);
    let verified = run_study(&study, &out, &["verify", "--draw=7"]);
    let errors = stderr(&verified);
    assert_eq!(verified.status.code(), Some(1), "{errors}");
    assert_eq!(
        stdout(&verified),
        "draw       7: 6 of 6 runs; to repeat these: --draw=7\n\
         verified   small: 3 of 6 repeated runs are bit-identical (6 runs stored)\n"
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

/// Whoever made results does not know which runs will be repeated: each draw has at least one run of each
/// cell, and its number repeats it.
#[test]
fn runs_to_verify_are_drawn_at_random() {
    let (_folder, study, out) = write_study(&study_text(2, "").replace(VISITATION, ""));
    assert!(run_study(&study, &out, &[]).status.success());
    let number = || {
        let verified = run_study(&study, &out, &["verify", "--runs=1"]);
        assert!(verified.status.success(), "{verified:?}");
        let printed = stdout(&verified);
        // Three cells, of which each has a run that is repeated.
        assert!(printed.contains(": 3 of 6 runs; "), "{printed}");
        let draw = printed.strip_prefix("draw       ").unwrap();
        draw.split(':').next().unwrap().to_owned()
    };
    assert_ne!(number(), number());
    change_stored_runs(&out, 1001);
    let differing = |draw: usize| {
        let draw = format!("--draw={draw}");
        let verified = run_study(&study, &out, &["verify", "--runs=1", &draw]);
        stderr(&verified).matches("differs").count()
    };
    let counts: Vec<usize> = (0..6).map(differing).collect();
    assert_eq!(counts, (0..6).map(differing).collect::<Vec<usize>>());
    // Each of three runs is one of two with equal probability.
    assert!(counts.iter().any(|count| *count != counts[0]), "{counts:?}");
}

#[test]
fn runs_that_are_missing_are_not_verified() {
    let (_folder, study, out) = write_study(&study_text(2, ""));
    assert!(run_study(&study, &out, &[]).status.success());
    fs::remove_file(&result_files(&out)[0]).unwrap();
    let verified = run_study(&study, &out, &["verify", "--runs=1"]);
    assert_eq!(verified.status.code(), Some(1), "{verified:?}");
    assert!(
        stderr(&verified).contains("missing    1 of 6 runs is missing\n"),
        "{verified:?}"
    );
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
    assert_eq!(output.status.code(), Some(130), "{output:?}");
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
