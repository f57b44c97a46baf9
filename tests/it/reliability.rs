//! Whatever happens to a run, what was recorded stays readable, training can go on, and one error
//! says what went wrong.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use rerun::TimelineName;
use rerun::external::re_log_encoding::rrd::DecoderApp;
use rerun::log::{Chunk, LogMsg};

use super::util::{REPOSITORY, assert_same_results, command, crash, run_command, stderr};

const SMALL: [&str; 6] = [
    "--set",
    "agents.count=2",
    "--set",
    "stop=Episodes(60)",
    "--set",
    "checkpoint_every=5",
];

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

/// Steps of agent 0's first `episodes` episodes in `episodes.csv`, with the row that ends each.
fn steps_in_table(folder: &Path, episodes: usize) -> usize {
    let table = std::fs::read_to_string(folder.join("episodes.csv")).unwrap();
    let rows = table
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect::<Vec<_>>());
    let own = rows.filter(|row| row[0] == "0").take(episodes);
    own.map(|row| row[5].parse::<usize>().unwrap() + 1).sum()
}

/// Asserts that the states on record are those of the first steps, without gaps, and how many at
/// least.
fn assert_on_record(recording: &Path, agent: &str, at_least: usize) {
    let steps = &steps_on_record(recording)[agent];
    assert_eq!(*steps, (0..steps.len() as i64).collect::<Vec<_>>());
    assert!(
        steps.len() >= at_least,
        "{} steps on record, not {at_least}",
        steps.len()
    );
}

fn uninterrupted(folder: &Path) -> PathBuf {
    let whole = folder.join("whole");
    assert!(
        run_command(&whole, &[&SMALL[..], &["--quiet"]].concat())
            .status()
            .unwrap()
            .success()
    );
    whole
}

/// Crashed between two checkpoints, twice: what the recording had at the newest of them is there,
/// without gaps, and the run can be resumed to its end.
#[test]
fn a_crashed_run_leaves_a_recording_that_opens() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, crashed) = (uninterrupted(folder.path()), folder.path().join("crashed"));
    for (more, at_checkpoint) in [
        (&["--abort-after-rounds", "13"][..], 10),
        (&["--abort-after-rounds", "9", "--resume"], 15),
    ] {
        crash(run_command(&crashed, &[&SMALL[..], more].concat()));
        let kept = steps_in_table(&whole, at_checkpoint);
        assert_on_record(&crashed.join("run.rrd.part"), "/raw/agent_0", kept);
    }
    let resumed = run_command(&crashed, &[&SMALL[..], &["--resume"]].concat()).output();
    assert!(resumed.unwrap().status.success());
    assert_same_results(&whole, &crashed);
    assert_eq!(
        steps_on_record(&whole.join("run.rrd")),
        steps_on_record(&crashed.join("run.rrd"))
    );
}

/// The system refuses to let files grow: one error, and nothing that was trained until the
/// checkpoint is lost.
#[test]
#[cfg(unix)]
fn a_full_disk_ends_a_run_that_can_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, full) = (uninterrupted(folder.path()), folder.path().join("full"));
    let blocks = std::fs::metadata(whole.join("run.rrd")).unwrap().len() * 2 / 3 / 512;
    let command = run_command(&full, &[&SMALL[..], &["--quiet"]].concat());
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
        .current_dir(REPOSITORY)
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
        said.contains("\nthe newest checkpoint is kept; resume with\n")
            && said.ends_with(" --resume\n"),
        "{said}"
    );
    assert_eq!(said.matches("error:").count(), 1, "{said}");
    assert_on_record(&full.join("run.rrd.part"), "/raw/agent_0", 100);

    assert!(
        run_command(&full, &[&SMALL[..], &["--quiet", "--resume"]].concat())
            .status()
            .unwrap()
            .success()
    );
    assert_same_results(&whole, &full);
    let steps = steps_on_record(&full.join("run.rrd"));
    assert_eq!(steps["/raw/agent_0"].len(), steps_in_table(&full, 60));
    assert_eq!(steps, steps_on_record(&whole.join("run.rrd")));
}

/// `/proc` takes in no folders, whoever asks.
#[test]
#[cfg(target_os = "linux")]
fn where_nothing_can_be_written_is_one_error_at_once() {
    let recording = Path::new("/proc/seedbed/look.rrd");
    let preview = ["preview", "cartpole", "--out", recording.to_str().unwrap()];
    let preview = command(&preview).output();
    for (output, said) in [
        (
            run_command(Path::new("/proc/seedbed/run"), &[]).output(),
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
    let output = run_command(&out, &[&format!("--live={address}")])
        .output()
        .unwrap();
    let expected =
        format!("error: no viewer responds at {address}: start one with `rerun`, or omit --live\n");
    assert_eq!((output.status.code(), stderr(&output)), (Some(1), expected));
    assert!(!out.exists());
    let output = run_command(&out, &["--live=here"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

/// A viewer that accepts and never reads: the run ends as it would without, with one warning at
/// most, and the same file but for what is unique in each.
#[test]
fn a_viewer_that_hangs_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, watched) = (uninterrupted(folder.path()), folder.path().join("watched"));
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("--live=rerun+http://{}/proxy", silent.local_addr().unwrap());
    let since = Instant::now();
    let output = run_command(&watched, &[&SMALL[..], &["--quiet", &address]].concat())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(since.elapsed() < Duration::from_mins(3));
    assert!(
        stderr(&output).matches("warning: the viewer at").count() <= 1,
        "{}",
        stderr(&output)
    );
    assert_same_results(&whole, &watched);
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
    let output = run_command(&out, &[&format!("--serve={port}")])
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
        let output = run_command(&out, &["--serve=0", other]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    }
    let tabular = [
        "run",
        "scenarios/tabular/bipolar_chain.ron",
        "--serve=0",
        "--out",
    ];
    let output = command(&tabular).arg(&out).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(!out.exists());
}

/// Somebody connects and says nothing; the run and its file are as they are without.
#[test]
fn serving_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, served) = (uninterrupted(folder.path()), folder.path().join("served"));
    let mut run = run_command(&served, &[&SMALL[..], &["--serve=0"]].concat());
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
        .and_then(|line| line.split_once("/proxy; connect a viewer with: "))
        .unwrap()
        .0;
    let silent = TcpStream::connect(address).unwrap();
    said.read_to_string(&mut rest).unwrap();
    assert!(
        run.wait().unwrap().success() && rest.starts_with("finished "),
        "{rest}"
    );
    drop(silent);
    assert_same_results(&whole, &served);
    assert_eq!(
        steps_on_record(&whole.join("run.rrd")),
        steps_on_record(&served.join("run.rrd"))
    );
}

/// The largest resident memory of a run of 32 random agents, in bytes.
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
    let mut run = run_command(folder, &many).spawn().unwrap();
    let status = PathBuf::from(format!("/proc/{}/status", run.id()));
    let mut peak = 0;
    // The system's own account grows until the process ends; then it is gone.
    while run.try_wait().unwrap().is_none() {
        peak = memory_so_far(&status).unwrap_or(peak);
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(run.wait().unwrap().success() && peak > 0, "{peak} bytes");
    peak
}

/// `VmHWM`: the largest resident memory that the process ever had, in bytes.
#[cfg(target_os = "linux")]
fn memory_so_far(status: &Path) -> Option<u64> {
    let text = std::fs::read_to_string(status).ok()?;
    let line = text.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes * 1024)
}

/// Four times as many states take the same memory, once the pictures and their samples are full (by
/// 600 episodes).
#[test]
#[cfg(target_os = "linux")]
fn memory_does_not_grow_with_the_length_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let short = peak_memory(&folder.path().join("short"), 800);
    let long = peak_memory(&folder.path().join("long"), 3200);
    assert!(long < 150_000_000, "{long} bytes");
    assert!(long < short + 15_000_000, "{short} and {long} bytes");
}
