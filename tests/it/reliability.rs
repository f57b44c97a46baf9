//! After a crash, a full disk or an unresponsive viewer, the recording stays readable, the run can
//! be resumed, and the command prints one error.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Output, Stdio};
use std::time::{Duration, Instant};

use rerun::TimelineName;
use rerun::external::re_log_encoding::rrd::DecoderApp;
use rerun::log::{Chunk, LogMsg};

use super::util::{REPOSITORY, assert_same_results, command, crash, run_command, stderr};

const SHORT_RUN: [&str; 8] = [
    "--set",
    "agents.count=2",
    "--set",
    "stop=Episodes(60)",
    "--set",
    "checkpoint_every=5",
    "--set",
    "checkpoint_share=1",
];

/// Numbers of the recorded steps, by entity `/raw/agent_K`, up to the first message that cannot be
/// read.
pub(crate) fn recorded_steps(path: &Path) -> BTreeMap<String, Vec<i64>> {
    let mut steps: BTreeMap<String, Vec<i64>> = BTreeMap::new();
    // Decoding stops at an incomplete message, which must be the last message.
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

/// Number of rows that `/raw/agent_0` should have for the first `episodes` episodes, computed from
/// `episodes.csv`: one row per step, and one for the last observation of each episode.
fn expected_row_count(folder: &Path, episodes: usize) -> usize {
    let table = std::fs::read_to_string(folder.join("episodes.csv")).unwrap();
    let rows = table
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect::<Vec<_>>());
    let rows_of_agent_0 = rows.filter(|row| row[0] == "0").take(episodes);
    rows_of_agent_0
        .map(|row| row[5].parse::<usize>().unwrap() + 1)
        .sum()
}

/// Asserts that the recorded steps of an agent are 0, 1, 2, … without gaps, and that there are at
/// least `min_steps`.
fn assert_recorded_without_gaps(recording: &Path, agent: &str, min_steps: usize) {
    let steps = recorded_steps(recording).remove(agent).unwrap_or_default();
    assert_eq!(steps, (0..steps.len() as i64).collect::<Vec<_>>());
    assert!(
        steps.len() >= min_steps,
        "{} recorded steps, expected at least {min_steps}",
        steps.len()
    );
}

fn finish_uninterrupted_run(folder: &Path) -> PathBuf {
    let uninterrupted = folder.join("whole");
    assert!(
        run_command(&uninterrupted, &[&SHORT_RUN[..], &["--quiet"]].concat())
            .status()
            .unwrap()
            .success()
    );
    uninterrupted
}

/// A run crashes twice, each time between two checkpoints. Its recording can be read, and the rows
/// up to the newest checkpoint that are not in it are in the checkpoint: after the run is resumed, no
/// row is missing.
#[test]
fn a_crashed_run_leaves_a_readable_recording() {
    let folder = tempfile::tempdir().unwrap();
    let (uninterrupted, crashed) = (
        finish_uninterrupted_run(folder.path()),
        folder.path().join("crashed"),
    );
    // A resumed recording has all rows up to the checkpoint at round 10 from which it is resumed.
    for (extra_arguments, episodes_in_file) in [
        (&["--abort-after-rounds", "13"][..], 0),
        (&["--abort-after-rounds", "9", "--resume"], 10),
    ] {
        crash(run_command(
            &crashed,
            &[&SHORT_RUN[..], extra_arguments].concat(),
        ));
        let min_steps = expected_row_count(&uninterrupted, episodes_in_file);
        assert_recorded_without_gaps(&crashed.join("run.rrd.part"), "/raw/agent_0", min_steps);
    }
    let resumed = run_command(&crashed, &[&SHORT_RUN[..], &["--resume"]].concat()).output();
    assert!(resumed.unwrap().status.success());
    assert_same_results(&uninterrupted, &crashed);
    assert_eq!(
        recorded_steps(&uninterrupted.join("run.rrd")),
        recorded_steps(&crashed.join("run.rrd"))
    );
}

/// With a limit on the size of files, the run fails with one error, and it can be resumed from its
/// newest checkpoint without the limit.
#[test]
#[cfg(unix)]
fn a_run_that_fills_the_disk_can_be_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let (uninterrupted, disk_full) = (
        finish_uninterrupted_run(folder.path()),
        folder.path().join("full"),
    );
    let recording = std::fs::metadata(uninterrupted.join("run.rrd")).unwrap();
    let output = run_with_file_size_limit(&disk_full, recording.len() * 2 / 3);
    let printed = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{printed}");
    assert!(
        printed.starts_with(&format!(
            "error: cannot write {}: File too large",
            disk_full.join("run.rrd.part").display()
        )),
        "{printed}"
    );
    assert!(
        printed.contains("\nthe newest checkpoint is kept; resume with\n")
            && printed.ends_with(" --resume\n"),
        "{printed}"
    );
    assert_eq!(printed.matches("error:").count(), 1, "{printed}");
    assert_recorded_without_gaps(&disk_full.join("run.rrd.part"), "/raw/agent_0", 100);

    assert!(
        run_command(
            &disk_full,
            &[&SHORT_RUN[..], &["--quiet", "--resume"]].concat()
        )
        .status()
        .unwrap()
        .success()
    );
    assert_same_results(&uninterrupted, &disk_full);
    let steps = recorded_steps(&disk_full.join("run.rrd"));
    assert_eq!(
        steps["/raw/agent_0"].len(),
        expected_row_count(&disk_full, 60)
    );
    assert_eq!(steps, recorded_steps(&uninterrupted.join("run.rrd")));
}

/// Starts a run that cannot write files longer than `max_bytes`, rounded down to blocks of 512
/// bytes.
#[cfg(unix)]
fn run_with_file_size_limit(folder: &Path, max_bytes: u64) -> Output {
    let command = run_command(folder, &[&SHORT_RUN[..], &["--quiet"]].concat());
    let quoted_arguments = [command.get_program()]
        .into_iter()
        .chain(command.get_args())
        .map(|word| format!("'{}'", word.display()));
    let shell_command = format!(
        "trap '' XFSZ; ulimit -f {}; exec {}",
        max_bytes / 512,
        quoted_arguments.collect::<Vec<_>>().join(" ")
    );
    Command::new("sh")
        .args(["-c", &shell_command])
        .current_dir(REPOSITORY)
        .output()
        .unwrap()
}

/// No user can create a folder in `/proc`.
#[test]
#[cfg(target_os = "linux")]
fn an_unwritable_output_path_is_one_error() {
    let recording = Path::new("/proc/seedbed/look.rrd");
    let preview = ["preview", "cartpole", "--out", recording.to_str().unwrap()];
    let preview = command(&preview).output();
    for (output, printed) in [
        (
            run_command(Path::new("/proc/seedbed/run"), &[]).output(),
            "error: cannot write to /proc/seedbed/run: ",
        ),
        (preview, "error: cannot create /proc/seedbed: "),
    ] {
        let output = output.unwrap();
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        assert!(
            stderr(&output).starts_with(printed) && stderr(&output).lines().count() == 1,
            "{}",
            stderr(&output)
        );
    }
}

/// If no viewer listens at the address of `--live`, the command fails before it creates the output
/// folder.
#[test]
fn a_missing_viewer_is_one_error_before_the_run_starts() {
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

/// A viewer that accepts the connection and never reads causes at most one warning. Results and
/// recorded steps are the same as without a viewer.
#[test]
fn results_do_not_depend_on_a_viewer_that_hangs() {
    let folder = tempfile::tempdir().unwrap();
    let (uninterrupted, with_viewer) = (
        finish_uninterrupted_run(folder.path()),
        folder.path().join("with_viewer"),
    );
    let unresponsive_viewer = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!(
        "--live=rerun+http://{}/proxy",
        unresponsive_viewer.local_addr().unwrap()
    );
    let start = Instant::now();
    let output = run_command(
        &with_viewer,
        &[&SHORT_RUN[..], &["--quiet", &address]].concat(),
    )
    .output()
    .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(start.elapsed() < Duration::from_mins(3));
    assert!(
        stderr(&output).matches("warning: the viewer at").count() <= 1,
        "{}",
        stderr(&output)
    );
    assert_same_results(&uninterrupted, &with_viewer);
    assert_eq!(
        recorded_steps(&uninterrupted.join("run.rrd")),
        recorded_steps(&with_viewer.join("run.rrd"))
    );
}

/// If the port of `--serve` is in use, the command fails before it creates the output folder.
#[test]
fn a_port_in_use_is_one_error_before_the_run_starts() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let output = run_command(&out, &[&format!("--serve={port}")])
        .output()
        .unwrap();
    let printed = stderr(&output);
    assert_eq!(
        (output.status.code(), printed.lines().count()),
        (Some(1), 1),
        "{printed}"
    );
    assert!(
        printed.starts_with(&format!("error: cannot serve viewers at port {port}: ")),
        "{printed}"
    );
    assert!(!out.exists());
    for conflicting_option in ["--live", "--no-recording"] {
        let output = run_command(&out, &["--serve=0", conflicting_option])
            .output()
            .unwrap();
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

/// Starts a run with `--serve=0`. Returns its process, its further output, and the address at which it
/// serves.
fn start_serving(run: &mut Command) -> (Child, BufReader<ChildStdout>, String) {
    let mut run = run
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut printed = BufReader::new(run.stdout.take().unwrap());
    let mut line = String::new();
    printed.read_line(&mut line).unwrap();
    let address = line.strip_prefix("serving    rerun+http://");
    let address = address.and_then(|line| line.split_once("/proxy; connect a viewer with: "));
    let address = address.unwrap().0.to_owned();
    (run, printed, address)
}

/// Waits for the end of a run that must succeed.
fn finish(mut run: Child, mut printed: BufReader<ChildStdout>) {
    let mut output = String::new();
    printed.read_to_string(&mut output).unwrap();
    let is_success = run.wait().unwrap().success();
    assert!(is_success && output.starts_with("finished "), "{output}");
}

/// Results and recorded steps are the same with `--serve`, even if a client connects and never
/// sends a request.
#[test]
fn results_do_not_depend_on_serving_viewers() {
    let folder = tempfile::tempdir().unwrap();
    let (uninterrupted, served) = (
        finish_uninterrupted_run(folder.path()),
        folder.path().join("served"),
    );
    let mut run = run_command(&served, &[&SHORT_RUN[..], &["--serve=0"]].concat());
    let (run, printed, address) = start_serving(&mut run);
    let unresponsive_viewer = TcpStream::connect(address).unwrap();
    finish(run, printed);
    drop(unresponsive_viewer);
    assert_same_results(&uninterrupted, &served);
    assert_eq!(
        recorded_steps(&uninterrupted.join("run.rrd")),
        recorded_steps(&served.join("run.rrd"))
    );
}

/// The process may open 200 files. Clients beyond those that it accepts do not take them away from the
/// run, which writes its checkpoints and results.
#[test]
#[cfg(target_os = "linux")]
fn more_clients_than_files_that_may_be_open_do_not_end_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let command = format!(
        "ulimit -n 200; exec {} run scenarios/cartpole.ron --out {} {} --serve=0",
        env!("CARGO_BIN_EXE_seedbed"),
        folder.path().join("run").display(),
        SHORT_RUN.join(" ").replace("(60)", "'(600)'"),
    );
    let mut run = Command::new("sh");
    run.args(["-c", &command]).current_dir(REPOSITORY);
    let (run, printed, address) = start_serving(&mut run);
    let clients: Vec<_> = (0..400).map(|_| TcpStream::connect(&address)).collect();
    finish(run, printed);
    assert!(clients.iter().filter(|client| client.is_ok()).count() > 200);
}

/// Runs 32 random agents, and returns the peak resident memory of the process in bytes.
#[cfg(target_os = "linux")]
fn peak_memory(folder: &Path, episodes: u32) -> u64 {
    let stop = format!("stop=Episodes({episodes})");
    let arguments = [
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
    let mut run = run_command(folder, &arguments).spawn().unwrap();
    let status = PathBuf::from(format!("/proc/{}/status", run.id()));
    let mut peak = 0;
    // The peak that the system reports never decreases, and is not available after the process
    // ends.
    while run.try_wait().unwrap().is_none() {
        peak = read_peak_memory(&status).unwrap_or(peak);
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(run.wait().unwrap().success() && peak > 0, "{peak} bytes");
    peak
}

/// Peak resident memory of a process so far, in bytes: `VmHWM` of `/proc/PID/status`.
#[cfg(target_os = "linux")]
fn read_peak_memory(status: &Path) -> Option<u64> {
    let text = std::fs::read_to_string(status).ok()?;
    let line = text.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes * 1024)
}

/// A run of three times as many episodes needs no more memory. The images and samples of visited
/// states reach their maximum size within 600 episodes, so both runs are longer than that.
#[test]
#[cfg(target_os = "linux")]
fn peak_memory_does_not_grow_with_the_number_of_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let short = peak_memory(&folder.path().join("short"), 700);
    let long = peak_memory(&folder.path().join("long"), 2100);
    assert!(long < 150_000_000, "{long} bytes");
    assert!(long < short + 9_000_000, "{short} and {long} bytes");
}
