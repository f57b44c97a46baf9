//! Whatever happens to a run, what was recorded stays readable, training can go on, and one error says what went wrong.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use rerun::TimelineName;
use rerun::external::re_log_encoding::rrd::DecoderApp;
use rerun::log::{Chunk, LogMsg};

const SMALL: [&str; 6] = [
    "--set",
    "agents.count=2",
    "--set",
    "stop=Episodes(60)",
    "--set",
    "checkpoint_every=5",
];

fn seedbed(folder: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_seedbed"));
    command
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["run", "scenarios/cartpole.ron", "--out"])
        .arg(folder);
    command.args(more);
    command
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The steps on record of each agent, from what can be read of a recording.
fn steps_on_record(path: &Path) -> BTreeMap<String, Vec<i64>> {
    let mut steps: BTreeMap<String, Vec<i64>> = BTreeMap::new();
    // What follows a torn message is not readable, and nothing should.
    for message in
        DecoderApp::decode_lazy(BufReader::new(File::open(path).unwrap())).map_while(Result::ok)
    {
        let LogMsg::ArrowMsg(_, arrow) = message else {
            continue;
        };
        let chunk = Chunk::from_arrow_msg(&arrow).unwrap();
        let entity = chunk.entity_path().to_string();
        if let Some(column) = chunk
            .timelines()
            .get(&TimelineName::from("env_step"))
            .filter(|_| entity.starts_with("/raw/"))
        {
            steps.entry(entity).or_default().extend(column.times_raw());
        }
    }
    steps
}

/// Steps of agent 0 in `episodes.csv`, with the row that ends each episode.
fn steps_in_table(folder: &Path) -> i64 {
    let table = std::fs::read_to_string(folder.join("episodes.csv")).unwrap();
    let rows = table
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect::<Vec<_>>());
    rows.filter(|row| row[0] == "0")
        .map(|row| row[5].parse::<i64>().unwrap() + 1)
        .sum()
}

fn same_results(one: &Path, other: &Path) {
    for name in ["episodes.csv", "rounds.csv", "policies.safetensors"] {
        assert_eq!(
            std::fs::read(one.join(name)).unwrap(),
            std::fs::read(other.join(name)).unwrap(),
            "{name}"
        );
    }
}

fn uninterrupted(folder: &Path) -> PathBuf {
    let whole = folder.join("whole");
    assert!(
        seedbed(&whole, &[&SMALL[..], &["--quiet"]].concat())
            .status()
            .unwrap()
            .success()
    );
    whole
}

/// Killed between two checkpoints: what the recording had at the first of them is there, without gaps.
#[test]
fn a_killed_run_leaves_a_recording_that_opens() {
    let folder = tempfile::tempdir().unwrap();
    let killed = folder.path().join("killed");
    let endless = [
        "--set",
        "agents.count=2",
        "--set",
        "stop=Episodes(100000)",
        "--set",
        "checkpoint_every=5",
        "--quiet",
    ];
    let mut run = seedbed(&killed, &endless)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let since = Instant::now();
    let checkpoint = killed.join("checkpoint/state.bin");
    while !checkpoint.exists() {
        assert!(since.elapsed() < Duration::from_mins(1), "no checkpoint");
        std::thread::sleep(Duration::from_millis(5));
    }
    let at_checkpoint = steps_on_record(&killed.join("run.rrd.part"));
    std::thread::sleep(Duration::from_millis(100));
    run.kill().unwrap();
    run.wait().unwrap();
    let steps = steps_on_record(&killed.join("run.rrd.part"));
    assert_eq!(steps.len(), 2);
    for (agent, steps) in &steps {
        assert!(
            steps.len() >= at_checkpoint[agent].len() && steps.len() > 5,
            "{agent}: {}",
            steps.len()
        );
        assert_eq!(
            *steps,
            (0..steps.len() as i64).collect::<Vec<_>>(),
            "{agent}"
        );
    }

    let mut resumed = seedbed(
        &killed,
        &[
            &endless[..2],
            &["--set", "stop=Episodes(100000)"],
            &endless[4..],
            &["--resume"],
        ]
        .concat(),
    );
    let mut resumed = resumed.stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(300));
    assert!(resumed.try_wait().unwrap().is_none(), "it goes on");
    resumed.kill().unwrap();
    resumed.wait().unwrap();
}

/// The system refuses to let files grow: one error, and nothing that was trained until the checkpoint is lost.
#[test]
#[cfg(unix)]
fn a_full_disk_ends_a_run_that_can_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, full) = (uninterrupted(folder.path()), folder.path().join("full"));
    let blocks = std::fs::metadata(whole.join("run.rrd")).unwrap().len() * 2 / 3 / 512;
    let command = seedbed(&full, &[&SMALL[..], &["--quiet"]].concat());
    let words = [command.get_program()]
        .into_iter()
        .chain(command.get_args())
        .map(|word| format!("'{}'", word.display()));
    let limited = format!(
        "trap '' XFSZ; ulimit -f {blocks}; exec {}",
        words.collect::<Vec<_>>().join(" ")
    );
    let output = Command::new("sh")
        .args(["-c", &limited])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.starts_with(&format!(
            "error: cannot write {}: File too large",
            full.join("run.rrd.part").display()
        )),
        "{said}"
    );
    assert!(
        said.contains("\nthe newest checkpoint is kept; go on with\n")
            && said.ends_with(" --resume\n"),
        "{said}"
    );
    assert_eq!(said.matches("error:").count(), 1, "{said}");
    let steps = &steps_on_record(&full.join("run.rrd.part"))["/raw/agent_0"];
    assert_eq!(*steps, (0..steps.len() as i64).collect::<Vec<_>>());
    assert!(steps.len() > 100, "{}", steps.len());

    assert!(
        seedbed(&full, &[&SMALL[..], &["--quiet", "--resume"]].concat())
            .status()
            .unwrap()
            .success()
    );
    same_results(&whole, &full);
    let steps = steps_on_record(&full.join("run.rrd"));
    assert_eq!(steps["/raw/agent_0"].len() as i64, steps_in_table(&full));
    assert_eq!(steps, steps_on_record(&whole.join("run.rrd")));
}

/// `/proc` takes in no folders, whoever asks.
#[test]
#[cfg(target_os = "linux")]
fn where_nothing_can_be_written_is_one_error_at_once() {
    let recording = Path::new("/proc/seedbed/look.rrd");
    let preview = ["preview", "cartpole", "--out", recording.to_str().unwrap()];
    let preview = Command::new(env!("CARGO_BIN_EXE_seedbed"))
        .args(preview)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output();
    for (output, said) in [
        (
            seedbed(Path::new("/proc/seedbed/run"), &[]).output(),
            "error: cannot write to /proc/seedbed/run: ",
        ),
        (preview, "error: cannot create /proc/seedbed: "),
    ] {
        let output = output.unwrap();
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        assert!(
            stderr(&output).starts_with(said) && stderr(&output).lines().count() == 1,
            "{}",
            stderr(&output)
        );
    }
}

/// Without a viewer nothing begins, and what was there stays.
#[test]
fn a_missing_viewer_is_one_error_before_anything_begins() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let port = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let address = format!("rerun+http://127.0.0.1:{port}/proxy");
    let output = seedbed(&out, &[&format!("--live={address}")])
        .output()
        .unwrap();
    let expected = format!(
        "error: no viewer answers at {address}; start one with `rerun`, or leave out --live\n"
    );
    assert_eq!((output.status.code(), stderr(&output)), (Some(1), expected));
    assert!(!out.exists());
    let output = seedbed(&out, &["--live=here"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

/// A viewer that accepts and never reads: the run ends as it would without, with one warning at most, and the same file but for what
/// is unique in each.
#[test]
fn a_viewer_that_hangs_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, watched) = (uninterrupted(folder.path()), folder.path().join("watched"));
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("--live=rerun+http://{}/proxy", silent.local_addr().unwrap());
    let since = Instant::now();
    let output = seedbed(&watched, &[&SMALL[..], &["--quiet", &address]].concat())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(since.elapsed() < Duration::from_mins(1));
    assert!(
        stderr(&output).matches("warning: the viewer at").count() <= 1,
        "{}",
        stderr(&output)
    );
    same_results(&whole, &watched);
    assert_eq!(
        steps_on_record(&whole.join("run.rrd")),
        steps_on_record(&watched.join("run.rrd"))
    );
}

/// At a port that is taken nothing begins.
#[test]
fn a_taken_port_is_one_error_before_anything_begins() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let output = seedbed(&out, &[&format!("--serve={port}")])
        .output()
        .unwrap();
    let said = stderr(&output);
    assert_eq!(
        (output.status.code(), said.lines().count()),
        (Some(1), 1),
        "{said}"
    );
    assert!(
        said.starts_with(&format!("error: cannot serve viewers at port {port}: ")),
        "{said}"
    );
    assert!(!out.exists());
    for other in ["--live", "--no-recording"] {
        let output = seedbed(&out, &["--serve=0", other]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    }
    let finite = [
        env!("CARGO_BIN_EXE_seedbed"),
        "run",
        "scenarios/tabular/bipolar_chain.ron",
        "--serve=0",
        "--out",
    ];
    let output = Command::new(finite[0])
        .args(&finite[1..])
        .arg(&out)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(!out.exists());
}

/// Somebody connects and says nothing; the run and its file are as they are without.
#[test]
fn serving_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, served) = (uninterrupted(folder.path()), folder.path().join("served"));
    let mut run = seedbed(&served, &[&SMALL[..], &["--serve=0"]].concat());
    let mut run = run
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let (mut said, mut line, mut rest) = (
        BufReader::new(run.stdout.take().unwrap()),
        String::new(),
        String::new(),
    );
    said.read_line(&mut line).unwrap();
    let address = line
        .strip_prefix("serving    rerun+http://")
        .and_then(|line| line.split_once("/proxy; look with: "))
        .unwrap()
        .0;
    let silent = TcpStream::connect(address).unwrap();
    said.read_to_string(&mut rest).unwrap();
    assert!(
        run.wait().unwrap().success() && rest.starts_with("finished "),
        "{rest}"
    );
    drop(silent);
    same_results(&whole, &served);
    assert_eq!(
        steps_on_record(&whole.join("run.rrd")),
        steps_on_record(&served.join("run.rrd"))
    );
}

/// `VmHWM`: the largest resident memory that the process ever had, in bytes.
#[cfg(target_os = "linux")]
fn peak_memory(folder: &Path, episodes: u32) -> u64 {
    let stop = format!("stop=Episodes({episodes})");
    let many = [
        "--set",
        "algorithm=Random",
        "--set",
        "agents.count=32",
        "--set",
        &stop,
        "--quiet",
        "--threads",
        "1",
    ];
    let command = seedbed(folder, &many);
    let words = [command.get_program()]
        .into_iter()
        .chain(command.get_args())
        .map(|word| format!("'{}'", word.display()));
    let words = words.collect::<Vec<_>>().join(" ");
    // A loop notes the process's own account of its memory until it ends.
    let script = format!(
        "{words} & while kill -0 $! 2>/dev/null; do grep VmHWM /proc/$!/status 2>/dev/null; sleep 0.01; done; wait $!"
    );
    let output = Command::new("sh")
        .args(["-c", &script])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let said = String::from_utf8(output.stdout).unwrap();
    let peak = said
        .lines()
        .filter_map(|line| line.split_whitespace().nth(1)?.parse::<u64>().ok())
        .max()
        .unwrap();
    peak * 1024
}

/// Four times as many states take the same memory, once the pictures and their samples are full (by 600 episodes).
#[test]
#[cfg(target_os = "linux")]
fn memory_does_not_grow_with_the_length_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let short = peak_memory(&folder.path().join("short"), 800);
    let long = peak_memory(&folder.path().join("long"), 3200);
    assert!(long < 150_000_000, "{long} bytes");
    assert!(long < short + 15_000_000, "{short} and {long} bytes");
}
