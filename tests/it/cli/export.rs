//! `seedbed export`. That NumPy, PyArrow and TensorBoard read the files is checked by
//! `tests/interop/run`.

use std::path::Path;

use crate::util::{
    command, crash, names_in, run_command, run_refused, run_successful, send_signal, small_run,
    stderr, wait_until,
};

fn export(run: &Path, arguments: &[&str]) -> String {
    run_successful(&[&["export", run.to_str().unwrap()], arguments].concat())
}

/// States are those of the recording: their number follows from `episodes.csv`, and the last state
/// of an episode has neither action nor reward.
#[test]
fn states_are_written_with_the_names_of_the_task() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let path = folder.path().join("states.csv");
    let printed = export(&run, &["--to", path.to_str().unwrap()]);
    let text = std::fs::read_to_string(&path).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(
        rows[0].join(","),
        "agent,episode,round,step,x,x_dot,theta,theta_dot,force,reward,outcome"
    );
    let episodes = std::fs::read_to_string(run.join("episodes.csv")).unwrap();
    let lengths = episodes
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(5).unwrap());
    let states: usize = lengths
        .map(|length| length.parse::<usize>().unwrap() + 1)
        .sum();
    assert_eq!(rows.len() - 1, states);
    assert!(printed.ends_with(&format!("{states} rows\n")), "{printed}");
    let without_reward = rows.iter().filter(|row| row[8..10] == ["", ""]).count();
    assert_eq!(without_reward, 12, "one state of each episode");
    assert!(
        rows[1..]
            .iter()
            .all(|row| matches!(row[8], "" | "10" | "-10"))
    );
}

/// The same run gives the same bytes, and a failed export leaves an older file as it was.
#[test]
fn exports_are_reproducible() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    for name in ["states.parquet", "states.npz"] {
        let path = folder.path().join(name);
        let bytes = || {
            export(&run, &["--to", path.to_str().unwrap()]);
            std::fs::read(&path).unwrap()
        };
        assert_eq!(bytes(), bytes(), "{name}");
    }
    let logs = folder.path().join("logs");
    export(&run, &["--tensorboard", logs.to_str().unwrap()]);
    assert_eq!(names_in(&logs), ["agent_0", "agent_1", "team"]);
    let older = folder.path().join("older.csv");
    std::fs::write(&older, "mine").unwrap();
    std::fs::remove_file(run.join("run.rrd")).unwrap();
    let arguments = [
        "export",
        run.to_str().unwrap(),
        "--to",
        older.to_str().unwrap(),
    ];
    let message = run_refused(&arguments);
    assert!(
        message.contains("has no recording, from which states are exported"),
        "{message}"
    );
    assert_eq!(std::fs::read_to_string(&older).unwrap(), "mine");
    assert_eq!(
        names_in(folder.path()),
        ["logs", "older.csv", "run", "states.npz", "states.parquet"]
    );
}

/// Networks of a checkpoint are those of the run's own file, and exist before its end.
#[test]
fn networks_are_written_before_the_end_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let [run, begun, path] =
        ["run", "begun", "now.safetensors"].map(|name| folder.path().join(name));
    let arguments = ["--set", "checkpoint_every=1", "--set", "checkpoint_share=1"];
    assert!(small_run(&run, &arguments).status.success());
    let printed = export(&run, &["--to", path.to_str().unwrap()]);
    assert!(
        printed.contains("networks after 6 episodes per agent"),
        "{printed}"
    );
    let whole = std::fs::read(&path).unwrap();
    assert_eq!(
        whole,
        std::fs::read(run.join("policies.safetensors")).unwrap()
    );
    // The process ends before the checkpoint of its third round is written.
    let small = ["--set", "agents.count=2", "--abort-after-rounds", "3"];
    crash(run_command(&begun, &[&arguments[..], &small].concat()));
    let printed = export(&begun, &["--to", path.to_str().unwrap()]);
    assert!(
        printed.contains("networks after 2 episodes per agent"),
        "{printed}"
    );
    let early = std::fs::read(&path).unwrap();
    assert!(early.len() == whole.len() && early != whole);
    std::fs::remove_dir_all(begun.join("checkpoint")).unwrap();
    run_refused(&[
        "export",
        begun.to_str().unwrap(),
        "--to",
        path.to_str().unwrap(),
    ]);
    assert_eq!(std::fs::read(&path).unwrap(), early);
}

#[test]
fn unknown_formats_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    assert!(small_run(&run, &[]).status.success());
    let message = run_refused(&["export", run.to_str().unwrap(), "--to", "states.xlsx"]);
    assert_eq!(
        message,
        "error: --to states.xlsx: expected a file that ends in .csv, .parquet, .npz, .rrd or .safetensors\n"
    );
    let rows_of_networks = ["--to", "it.safetensors", "--content", "rounds"];
    let message =
        run_refused(&[&["export", run.to_str().unwrap()], &rows_of_networks[..]].concat());
    assert!(message.contains("has no rows"), "{message}");
    run_refused(&["export", run.to_str().unwrap()]);
}

/// A run of some kilobytes for each episode.
fn large_run(folder: &Path, episodes: u32) {
    let output = small_run(folder, &["--set", &format!("stop=Episodes({episodes})")]);
    assert!(output.status.success(), "{}", stderr(&output));
}

/// Signals end the process in the middle; the file that is not complete is removed, and an older one is kept.
#[cfg(unix)]
#[test]
fn interrupted_commands_leave_no_incomplete_file() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    large_run(&run, 1500);
    let [run, out] = [run, folder.path().join("out")].map(|path| path.display().to_string());
    std::fs::create_dir(&out).unwrap();
    let to = |name: &str| format!("{out}/{name}");
    let commands = [
        vec![
            "export".to_owned(),
            run.clone(),
            "--to".to_owned(),
            to("states.csv"),
        ],
        vec![
            "export".to_owned(),
            run.clone(),
            "--to".to_owned(),
            to("states.npz"),
        ],
        ["film", &run, "--seconds", "100", "--out", &to("run.gif")]
            .map(str::to_owned)
            .into(),
        [
            "preview",
            "cartpole",
            "--episodes",
            "100000",
            "--out",
            &to("preview.rrd"),
        ]
        .map(str::to_owned)
        .into(),
    ];
    for (arguments, (signal, status)) in
        commands
            .iter()
            .zip([("TERM", 143), ("INT", 130), ("INT", 130), ("TERM", 143)])
    {
        let target = Path::new(arguments.last().unwrap());
        std::fs::write(target, "older").unwrap();
        let mut process = command(arguments)
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        wait_until("a file is being written", || {
            names_in(Path::new(&out)).len() > 1
        });
        send_signal(signal, &process);
        assert_eq!(
            process.wait().unwrap().code(),
            Some(status),
            "{arguments:?}"
        );
        let name = target.file_name().unwrap().to_str().unwrap();
        assert_eq!(names_in(Path::new(&out)), [name]);
        assert_eq!(std::fs::read_to_string(target).unwrap(), "older");
        std::fs::remove_file(target).unwrap();
    }
}

/// Under a limit of the size of files, as on a full disk, an error names the file and the cause, and nothing is left.
#[cfg(target_os = "linux")]
#[test]
fn exports_that_do_not_fit_name_the_file_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    large_run(&run, 300);
    let out = folder.path().join("out");
    let program = env!("CARGO_BIN_EXE_seedbed");
    for (arguments, file) in [
        ("--to OUT/states.csv", "states.csv"),
        ("--to OUT/states.parquet", "states.parquet"),
        ("--to OUT/states.npz", "states.npz"),
        ("--to OUT/episodes.csv --content episodes", "episodes.csv"),
        ("--to OUT/rounds.parquet --content rounds", "rounds.parquet"),
        ("--to OUT/rounds.npz --content rounds", "rounds.npz"),
        ("--tensorboard OUT", ""),
    ] {
        std::fs::create_dir(&out).unwrap();
        let out_text = out.to_str().unwrap();
        let arguments = arguments.replace("OUT", out_text);
        // In blocks of 512 bytes.
        let script = format!(
            "ulimit -f 16; exec {program} export {} {arguments}",
            run.display()
        );
        let output = std::process::Command::new("sh")
            .args(["-c", &script])
            .output()
            .unwrap();
        let (start, end) = match file {
            "" => (
                format!("error: cannot write to {out_text}: "),
                String::new(),
            ),
            file => (
                format!("error: cannot write {out_text}/{file}: "),
                String::new(),
            ),
        };
        let error = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{arguments}: {error}");
        assert_eq!(error, format!("{start}File too large (os error 27){end}\n"));
        assert_eq!(names_in(&out), [""; 0], "{arguments}");
        std::fs::remove_dir(&out).unwrap();
    }
}
