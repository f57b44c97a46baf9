//! Studies on clusters: shards, many processes at once, marks of runs, job scripts, merging.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use super::util::{
    command, files_below, run_command, send_signal, small_run, stderr, stdout, study_arguments,
    wait_until,
};
use crate::study::{change_stored_runs, run_study, stored_results, study_text, write_study};

/// A study of long runs, of which none ends during a test.
fn long_study_text() -> String {
    study_text(1, "").replace("Episodes(8)", "Episodes(1000000)")
}

fn succeeds(output: &Output) {
    assert!(output.status.success(), "{}", stderr(output));
}

/// Error of a command that must be refused.
fn refused(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(2), "{}", stderr(output));
    stderr(output)
}

/// The state of each run that `list` prints, with what follows it.
fn listed(study: &str, out: &Path) -> Vec<String> {
    let output = run_study(study, out, &["list"]);
    succeeds(&output);
    stdout(&output)
        .lines()
        .map(|line| line[8..].to_owned())
        .collect()
}

fn start(study: &str, out: &Path, extra_arguments: &[&str]) -> Child {
    let out = out.to_str().unwrap();
    command(&study_arguments(study, out, extra_arguments))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn shards_together_are_the_whole_study() {
    let (_folder, study, whole) = write_study(&study_text(5, ""));
    succeeds(&run_study(&study, &whole, &[]));
    let sharded = whole.with_extension("sharded");
    let shards: Vec<Child> = ["0/3", "1/3", "2/3"]
        .iter()
        .map(|shard| start(&study, &sharded, &["--jobs", "1", "--shard", shard]))
        .collect();
    let mut runs = 0;
    for shard in shards {
        let output = shard.wait_with_output().unwrap();
        succeeds(&output);
        let text = stdout(&output);
        let (_, rest) = text.split_once("/3: ").unwrap();
        let count: usize = rest.split_once(" run").unwrap().0.parse().unwrap();
        assert!(text.contains(&format!("{count} to run")), "{text}");
        assert!(text.contains("results    "), "{text}");
        assert!((4..=6).contains(&count), "15 runs in three shards: {text}");
        runs += count;
    }
    assert_eq!((runs, stored_results(&whole).len()), (15, 15));
    assert_eq!(stored_results(&sharded), stored_results(&whole));
    let again = run_study(&study, &sharded, &["--shard", "1/3"]);
    succeeds(&again);
    assert!(stdout(&again).contains("0 to run"), "{}", stdout(&again));
    assert!(files_below(&sharded, "running").is_empty());
    assert!(!sharded.join("report.html").exists());
}

#[test]
fn wrong_shards_are_refused() {
    let (_folder, study, out) = write_study(&study_text(1, ""));
    for (shard, part) in [
        ("3/3", "there is no shard 3 of 3"),
        ("0/0", "the number of shards is 0"),
        ("/3", "is the environment variable of the index set?"),
        ("-1/3", "`-1` is not the number of a shard"),
    ] {
        let error = refused(&run_study(&study, &out, &["--shard", shard]));
        assert!(error.contains(part), "{shard}: {error}");
    }
    for other in [
        &["--index", "0"][..],
        &["list"],
        &["verify"],
        &["merge", "--from", "x"],
        &["script"],
        &["register"],
        &["power"],
    ] {
        let arguments = [other, &["--shard", "0/3"]].concat();
        let error = refused(&run_study(&study, &out, &arguments));
        let is_refused = ["cannot be used with", "unexpected argument '--shard' found"];
        let is_refused = is_refused.iter().any(|part| error.contains(part));
        assert!(is_refused, "{other:?}: {error}");
    }
    let two = refused(
        &command(&["study", &study, &study, "--shard", "0/2"])
            .output()
            .unwrap(),
    );
    assert!(two.contains("error: "), "{two}");
    assert!(!out.exists());
}

/// As the tasks of an array, which a scheduler starts together.
#[test]
fn forty_processes_begin_a_study_at_once() {
    let (_folder, study, out) = write_study(&study_text(14, ""));
    let processes: Vec<Child> = (0..40)
        .map(|index| start(&study, &out, &["--index", &index.to_string()]))
        .collect();
    for process in processes {
        succeeds(&process.wait_with_output().unwrap());
    }
    assert_eq!(stored_results(&out).len(), 40);
    let names = super::util::names_in(&out);
    assert_eq!(names, [".lock", "runs", "study.json"]);
    assert_eq!(super::util::names_in(&out.join("runs")).len(), 40);
}

#[test]
fn a_list_shows_running_and_interrupted_runs() {
    let (_folder, study, out) = write_study(&long_study_text());
    for signal in ["TERM", "KILL"] {
        let mut child = start(&study, &out, &["--index", "1"]);
        let is_running = || listed(&study, &out)[1].starts_with("running ");
        wait_until("the run is marked", || {
            assert_eq!(child.try_wait().unwrap(), None, "the run ended early");
            is_running()
        });
        let process = format!("process {} on ", child.id());
        assert!(listed(&study, &out)[1].contains(&process));
        assert!(listed(&study, &out)[0].starts_with("to run "));
        send_signal(signal, &child);
        child.wait().unwrap();
        let state = listed(&study, &out)[1].clone();
        assert!(
            state.starts_with("interrupted ") && state.contains(&process),
            "{signal}: {state}"
        );
    }
}

/// A mark that a dead process left keeps no run from being executed, and is removed.
#[test]
fn marks_do_not_outlive_a_finished_run() {
    let (_folder, study, out) = write_study(&study_text(1, ""));
    succeeds(&run_study(&study, &out, &["--shard", "0/1"]));
    let results = stored_results(&out);
    let result = files_below(&out, "run")[0].clone();
    let mark = result.with_extension("running");
    let text =
        r#"{"host": "other", "process": 1, "slurm_job": "5_7", "started": 0, "stopped": false}"#;
    for option in [&["--shard", "0/1"][..], &[]] {
        fs::write(&mark, text).unwrap();
        let finished = listed(&study, &out);
        assert!(finished.iter().all(|run| run.starts_with("finished ")));
        fs::remove_file(&result).unwrap();
        let states = listed(&study, &out).join("\n");
        let expected = "(Slurm job 5_7, process 1 on other, since 1970-01-01T00:00:00Z)";
        assert!(
            states.contains("running ") && states.contains(expected),
            "{states}"
        );
        succeeds(&run_study(&study, &out, option));
        assert_eq!(stored_results(&out), results);
        assert!(!mark.exists(), "{option:?}");
    }
}

#[test]
fn failed_runs_of_a_shard_are_reported_again() {
    let text = study_text(2, "").replace("sigma: 9", "sigma: 1e30");
    let (_folder, study, out) = write_study(&text);
    for to_run in ["6 to run", "0 to run"] {
        let output = run_study(&study, &out, &["--shard", "0/1"]);
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        assert!(stdout(&output).contains(to_run), "{}", stdout(&output));
        assert!(stderr(&output).contains("failed     σ 9, run seed 1000: non-finite"));
        assert!(stderr(&output).ends_with("error: 2 runs failed\n"));
    }
    let states = listed(&study, &out);
    assert_eq!(
        states
            .iter()
            .filter(|run| run.starts_with("failed "))
            .count(),
        2
    );
}

/// A folder with a program `sbatch` that stores its arguments and its script in the folder.
fn fake_sbatch(folder: &Path) -> PathBuf {
    let programs = folder.join("programs");
    fs::create_dir(&programs).unwrap();
    let program = programs.join("sbatch");
    let text = "#!/bin/sh\nhere=\"$(dirname \"$0\")\"\nprintf '%s\\n' \"$@\" >>\"$here/arguments\"\n\
                cat >\"$here/report.sh\"\n";
    fs::write(&program, text).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    programs
}

/// The script is run as Slurm would, in a folder whose name a shell would change.
#[test]
fn a_printed_script_runs_the_study_and_its_report() {
    let (folder, _, whole) = write_study("");
    let top = folder.path().join("it's $HOME, 50% \"ours\"");
    fs::create_dir(&top).unwrap();
    // Each of its runs is estimated at more than a minute, and ends much earlier.
    let text = study_text(2, "").replace("Episodes(8)", "Solved(return: 12, at_most: 100000)");
    let study = top.join("größe.ron");
    fs::write(&study, text).unwrap();
    let printed = command(&[
        "study",
        "script",
        "größe.ron",
        "--out",
        "out",
        "--max-tasks",
        "3",
    ])
    .current_dir(&top)
    .output()
    .unwrap();
    succeeds(&printed);
    let hint = "submit it with: seedbed study script größe.ron --out out --max-tasks 3 > gr__e.sbatch; \
                sbatch gr__e.sbatch\n";
    // Words with letters that a shell might change are quoted.
    let hint = hint.replace(" größe.ron", " 'größe.ron'");
    let notes = stderr(&printed).replace(" größe.ron", " 'größe.ron'");
    assert!(notes.contains("6 runs in 3 tasks"), "{notes}");
    assert!(notes.ends_with(&hint), "{notes}");
    assert!(!top.join("out").exists(), "the script is only printed");

    let script = stdout(&printed);
    assert!(script.contains("\n#SBATCH --array=0-2\n"), "{script}");
    let programs = fake_sbatch(&top);
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    for task in ["1", "0", "2", "0"] {
        let output = Command::new("bash")
            .args(["-c", &script])
            .env("PATH", &path)
            .env("SLURM_ARRAY_JOB_ID", "7")
            .env("SLURM_ARRAY_TASK_ID", task)
            .env("SLURM_ARRAY_TASK_MIN", "0")
            .env("SLURM_JOB_ACCOUNT", "our account")
            .current_dir("/")
            .output()
            .unwrap();
        succeeds(&output);
    }
    succeeds(&run_study(study.to_str().unwrap(), &whole, &[]));
    assert_eq!(stored_results(&top.join("out")), stored_results(&whole));
    let log = fs::read_to_string(top.join("out/slurm/7_0.out")).unwrap();
    assert!(
        log.contains("shard 0/3: ") && log.contains(" 0 to run"),
        "{log}"
    );

    // The first task submits the report job once, also if it is requeued.
    let arguments = fs::read_to_string(programs.join("arguments")).unwrap();
    let report_log = top.join("out/slurm/7_report.out");
    let escaped = report_log.to_str().unwrap().replace('%', "%%");
    assert_eq!(
        arguments,
        format!(
            "--job-name=gr__e-report\n--dependency=afterany:7\n--account=our account\n--output={escaped}\n"
        )
    );
    let report = Command::new("sh").arg(programs.join("report.sh")).output();
    succeeds(&report.unwrap());
    let read = |out: &Path| fs::read_to_string(out.join("results.csv")).unwrap();
    assert_eq!(read(&top.join("out")), read(&whole));
}

/// Two clusters with a part each, and one more with a run that both have.
#[test]
fn merged_results_are_those_of_the_whole_study() {
    let (folder, study, whole) = write_study(&study_text(3, ""));
    succeeds(&run_study(&study, &whole, &[]));
    let [a, b, target] = ["a", "b", "target"].map(|name| folder.path().join(name));
    succeeds(&run_study(&study, &a, &["--shard", "0/2"]));
    succeeds(&run_study(&study, &b, &["--shard", "1/2"]));
    for index in ["0", "1", "2"] {
        succeeds(&run_study(&study, &b, &["--index", index]));
    }
    let distinct = stored_results(&whole).len();
    let equal = stored_results(&a).len() + stored_results(&b).len() - distinct;
    assert!(equal > 0);
    let sources = ["merge", "--from", a.to_str().unwrap(), b.to_str().unwrap()];
    let merged = run_study(&study, &target, &sources);
    succeeds(&merged);
    let expected =
        format!("merged     small: {distinct} new, {equal} equal, 0 refused\nto run     0 runs\n");
    assert!(stdout(&merged).contains(&expected), "{}", stdout(&merged));
    // A run of each directory is repeated.
    let repeated = stdout(&merged).matches("verified   ").count();
    assert_eq!(repeated, 2, "{}", stdout(&merged));
    assert_eq!(stored_results(&target), stored_results(&whole));
    let again = run_study(&study, &target, &sources);
    assert!(stdout(&again).contains("0 new"), "{}", stdout(&again));
    succeeds(&run_study(&study, &target, &[]));
    let rows = |out: &Path| fs::read(out.join("results.csv")).unwrap();
    assert_eq!(rows(&target), rows(&whole));
}

#[test]
fn conflicting_and_damaged_results_are_not_merged() {
    let (folder, study, target) = write_study(&study_text(2, ""));
    let source = folder.path().join("source");
    succeeds(&run_study(&study, &source, &[]));
    succeeds(&run_study(&study, &target, &["--index", "0"]));
    change_stored_runs(&target, 1000);
    let before = stored_results(&target);
    let merge = || {
        run_study(
            &study,
            &target,
            &["merge", "--from", source.to_str().unwrap()],
        )
    };
    let error = refused(&merge());
    let name = before.keys().next().unwrap();
    for folder in [&target, &source] {
        let file = folder.join("runs").join(name);
        assert!(error.contains(file.to_str().unwrap()), "{error}");
    }
    assert!(
        error.contains("error: 1 run refused, and nothing was copied"),
        "{error}"
    );
    assert_eq!(stored_results(&target), before);

    fs::remove_file(target.join("runs").join(name)).unwrap();
    let damaged = source.join("runs").join(name);
    let mut bytes = fs::read(&damaged).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&damaged, bytes).unwrap();
    let error = refused(&merge());
    assert!(
        error.contains(&format!("{} is damaged", damaged.display())),
        "{error}"
    );
    assert_eq!(stored_results(&target).len(), 0);
}

/// What is no regular file is refused as what is damaged, and so is what cannot be a lock.
#[test]
fn pipes_and_devices_in_place_of_files_of_a_study_are_refused() {
    let (folder, study, target) = write_study(&study_text(2, ""));
    let source = folder.path().join("source");
    succeeds(&run_study(&study, &source, &[]));
    let name = stored_results(&source).keys().next().unwrap().clone();
    let stored = source.join("runs").join(name);
    let reason = "expected a regular file, found a pipe, a socket or a device";
    let make_pipe =
        |path: &Path| assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    fs::remove_file(&stored).unwrap();
    make_pipe(&stored);
    let merge = ["merge", "--from", source.to_str().unwrap(), "--unverified"];
    for place in ["pipe", "device"] {
        let error = refused(&run_study(&study, &target, &merge));
        let expected = format!(
            "\nerror: {}: {reason}; nothing was copied\n",
            stored.display()
        );
        assert!(error.ends_with(&expected), "{place}: {error}");
        fs::remove_file(&stored).unwrap();
        std::os::unix::fs::symlink("/dev/null", &stored).unwrap();
    }
    let copied = target.join("runs").exists() && !stored_results(&target).is_empty();
    assert!(!copied);

    let lock = PathBuf::from(format!("{study}.lock"));
    make_pipe(&lock);
    let error = refused(&run_study(&study, &target, &["confirm"]));
    assert_eq!(error, format!("error: {}: {reason}\n", lock.display()));
}

#[test]
fn only_other_directories_of_the_same_study_are_merged() {
    let (folder, study, target) = write_study(&study_text(1, ""));
    let quick = folder.path().join("quick");
    succeeds(&run_study(&study, &quick, &["--quick", "--index", "0"]));
    succeeds(&run_study(&study, &target, &["--index", "0"]));
    for (source, part) in [
        (folder.path(), "contains no study"),
        (&target, "is the directory of the results itself"),
        (&quick, "contains the quick study `small`"),
    ] {
        let error = refused(&run_study(
            &study,
            &target,
            &["merge", "--from", source.to_str().unwrap()],
        ));
        assert!(error.contains(part), "{error}");
    }
}

/// Claims that were changed after their runs in another directory remain late.
#[test]
fn merging_keeps_the_history_of_claims() {
    let claim = |smallest: &str| {
        format!(
            r#"claims: [(text: "c", compare: ("σ 9", "σ 0"), direction: Less, smallest: {smallest})],"#
        )
    };
    let (folder, study, source) = write_study(&study_text(1, &claim("1")));
    succeeds(&run_study(&study, &source, &[]));
    fs::write(&study, study_text(1, &claim("2"))).unwrap();
    let target = folder.path().join("target");
    succeeds(&run_study(
        &study,
        &target,
        &["merge", "--from", source.to_str().unwrap()],
    ));
    let text = fs::read_to_string(target.join("study.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        manifest["late_claims"].as_array().unwrap().len(),
        1,
        "{text}"
    );
}

/// Several processes would write to one directory, and a build without MPI cannot divide a run.
#[test]
fn a_run_is_not_repeated_by_every_process_of_mpirun() {
    let folder = tempfile::tempdir().unwrap();
    let of_four = run_command(&folder.path().join("run"), &[])
        .env("OMPI_COMM_WORLD_SIZE", "4")
        .output()
        .unwrap();
    assert_eq!(
        refused(&of_four),
        "error: 4 processes of mpirun would all do this run; divide it over them with --mpi\n"
    );
    if cfg!(not(feature = "mpi")) {
        let message = refused(&small_run(&folder.path().join("run"), &["--mpi"]));
        assert!(message.starts_with("error: this build has no MPI; install one that has"));
    }
    assert!(!folder.path().join("run").exists());
}
