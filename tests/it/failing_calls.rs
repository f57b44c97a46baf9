//! Stops a command at the n-th call with which it changes a file, or lets this call fail, for all n or
//! for a sample of them. Afterwards the command is continued, and its results must be those of an
//! undisturbed one.
//!
//! The library `tests/shim/failing_calls.c` stands between the command and libc. It is compiled by the
//! test.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use tempfile::TempDir;

use super::reliability::recorded_steps;
use super::util::{REPOSITORY, assert_same_results, command, files_below, stderr};

const SIGKILL: i32 = 9;

/// What happens at a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    /// The process is killed before the call.
    Kill,
    /// The process is killed after the call.
    KillAfter,
    /// The process is killed when half of a write is done.
    ShortWrite,
    /// The disk is full.
    Full,
    /// The disk is broken.
    Broken,
    /// A signal interrupts the call once.
    Interrupted,
}

const ACTIONS: [Action; 6] = [
    Action::Kill,
    Action::KillAfter,
    Action::ShortWrite,
    Action::Full,
    Action::Broken,
    Action::Interrupted,
];

impl Action {
    /// As the library expects it.
    fn word(self) -> &'static str {
        match self {
            Self::Kill => "kill",
            Self::KillAfter => "after",
            Self::ShortWrite => "short",
            Self::Full => "28",
            Self::Broken => "5",
            Self::Interrupted => "4",
        }
    }

    fn kills(self) -> bool {
        matches!(self, Self::Kill | Self::KillAfter | Self::ShortWrite)
    }
}

/// The compiled library, in a temporary folder.
struct Shim {
    folder: TempDir,
}

impl Shim {
    fn compile() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let source = Path::new(REPOSITORY).join("tests/shim/failing_calls.c");
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"]);
        compiler
            .arg(folder.path().join("shim.so"))
            .arg(source)
            .arg("-ldl");
        let output = compiler.output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        Self { folder }
    }

    /// Lets a command be preceded by the library, which counts the calls below `folder`.
    fn precede(&self, mut command: Command, folder: &Path) -> Command {
        command
            .env("LD_PRELOAD", self.folder.path().join("shim.so"))
            .env("SHIM_FOLDER", folder);
        command
    }

    /// Names and paths of the calls of a command, which must succeed.
    fn calls(&self, command: Command, folder: &Path) -> Vec<String> {
        let report = tempfile::NamedTempFile::new().unwrap();
        let mut command = self.precede(command, folder);
        let output = command.env("SHIM_REPORT", report.path()).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let text = fs::read_to_string(report.path()).unwrap();
        text.lines().map(str::to_owned).collect()
    }

    /// Runs a command, with something happening at the call `number`, from 1. Also returns this call, which
    /// need not be that of another execution, and `None` if the command did not come to it: which calls there
    /// are depends on the time that it takes.
    fn disturb(
        &self,
        command: Command,
        folder: &Path,
        number: usize,
        action: Action,
    ) -> (Output, Option<String>) {
        let report = tempfile::NamedTempFile::new().unwrap();
        let mut command = self.precede(command, folder);
        command.env("SHIM_AT", number.to_string());
        command.env("SHIM_REPORT", report.path());
        let output = command.env("SHIM_ACTION", action.word()).output().unwrap();
        let calls = fs::read_to_string(report.path()).unwrap();
        (output, calls.lines().nth(number - 1).map(str::to_owned))
    }
}

/// Which calls are disturbed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Calls {
    /// About as many as this of each action. Writes to a recording, of which there are many, are
    /// sampled more thinly.
    Sample(usize),
    Every,
}

impl Calls {
    /// Numbers of calls, from 1. Samples of different actions have different calls.
    fn numbers(self, calls: &[String], action: usize) -> Vec<usize> {
        let Self::Sample(count) = self else {
            return (1..=calls.len()).collect();
        };
        let is_recording = |call: &str| call.starts_with("write ") && call.contains("run.rrd");
        let (recording, others): (Vec<usize>, Vec<usize>) =
            (1..=calls.len()).partition(|number| is_recording(&calls[number - 1]));
        let mut numbers = BTreeSet::new();
        for (group, count) in [(recording, count / 4), (others, count)] {
            let step = group.len().div_ceil(count.max(1)).max(1);
            numbers.extend(group.iter().skip(action % step).step_by(step));
        }
        numbers.into_iter().collect()
    }
}

/// A command that is disturbed in a folder of its own.
struct Experiment {
    /// Prepares the folder.
    prepare: fn(&Path),
    /// The command with results below the folder.
    command: fn(&Path) -> Command,
    /// Continues what was disturbed, with the same result.
    finish: fn(&Path),
    /// Compares the results with those in the folder of an undisturbed command.
    compare: fn(&Path, &Path),
}

impl Experiment {
    /// Disturbs calls of the command in two threads.
    fn check(&self, calls: Calls) {
        let shim = Shim::compile();
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("whole");
        (self.prepare)(&whole);
        let found = shim.calls((self.command)(&whole), &whole);
        assert!(found.len() > 20, "{found:?}");
        let mut cases: Vec<(usize, Action)> = Vec::new();
        for (index, action) in ACTIONS.into_iter().enumerate() {
            let numbers = calls.numbers(&found, index).into_iter();
            cases.extend(numbers.map(|number| (number, action)));
        }
        let count = cases.len();
        let disturbed = AtomicUsize::new(0);
        let cases = Mutex::new(cases.into_iter());
        let next = || cases.lock().unwrap().next();
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    while let Some((number, action)) = next() {
                        let place = format!("{action:?} at call {number}: {}", found[number - 1]);
                        let path = folder.path().join(format!("{number}-{}", action.word()));
                        if self.check_case(&shim, &path, &whole, (number, action), &place) {
                            disturbed.fetch_add(1, Ordering::Relaxed);
                        }
                        fs::remove_dir_all(path).unwrap();
                    }
                });
            }
        });
        let disturbed = disturbed.into_inner();
        assert!(disturbed * 4 >= count * 3, "only {disturbed} of {count}");
    }

    /// Returns whether the command came to the call that is disturbed; if not, it must have succeeded.
    fn check_case(
        &self,
        shim: &Shim,
        path: &Path,
        whole: &Path,
        (number, action): (usize, Action),
        place: &str,
    ) -> bool {
        (self.prepare)(path);
        let (output, call) = shim.disturb((self.command)(path), path, number, action);
        let Some(call) = call else {
            assert!(output.status.success(), "{place}: {}", stderr(&output));
            (self.compare)(whole, path);
            return false;
        };
        let place = &format!("{action:?} at call {number}: {call}");
        if action.kills() {
            assert_eq!(
                output.status.signal(),
                Some(SIGKILL),
                "{place}: {}",
                stderr(&output)
            );
        } else if !output.status.success() {
            assert_one_error(&output, path, place);
        }
        let is_changed = !output.status.success();
        let disk_works = matches!(action, Action::Interrupted);
        // A run continues without the checkpoint.
        let is_warned_of = stderr(&output).contains("warning: cannot write checkpoint ");
        assert!(
            is_changed || disk_works || is_warned_of || is_harmless(place),
            "{place}: the error is ignored"
        );
        let caught = std::panic::catch_unwind(|| {
            if is_changed {
                (self.finish)(path);
            }
            (self.compare)(whole, path);
        });
        assert!(
            caught.is_ok(),
            "{place}: see above; the command printed {}",
            stderr(&output)
        );
        true
    }
}

/// Whether a failure of this call need not be reported: a copy takes the place of a second name, a
/// folder that exists need not be made, and the checkpoint of a finished run is not used.
fn is_harmless(place: &str) -> bool {
    let removes_checkpoint = place.contains(": unlink") && place.ends_with(".checkpoint");
    place.contains(": linkat ") || place.contains(": mkdir ") || removes_checkpoint
}

/// Exit status 1, and exactly one error, which names a file or folder below `path`.
fn assert_one_error(output: &Output, path: &Path, place: &str) {
    let error = stderr(output);
    assert_eq!(output.status.code(), Some(1), "{place}: {error}");
    assert_eq!(error.matches("error:").count(), 1, "{place}: {error}");
    assert!(error.contains(path.to_str().unwrap()), "{place}: {error}");
}

const RUN: [&str; 13] = [
    "run",
    "scenarios/cartpole.ron",
    "--set",
    "agents.count=2",
    "--set",
    "stop=Episodes(3)",
    "--set",
    "checkpoint_every=1",
    "--set",
    "checkpoint_share=1",
    "--quiet",
    "--threads",
    "1",
];

fn run(folder: &Path) -> Command {
    let mut command = command(&RUN);
    command.arg("--out").arg(folder);
    command
}

fn overwriting_run(folder: &Path) -> Command {
    let mut command = run(folder);
    command.arg("--overwrite");
    command
}

/// Resumes a run, or starts it again if it has no checkpoint. A finished run needs neither.
fn finish_run(folder: &Path) {
    let output = run(folder).arg("--resume").output().unwrap();
    let error = stderr(&output);
    if error.contains("is finished; there is nothing to resume") {
        return;
    }
    if error.contains("contains no checkpoint to resume from; start a new run without --resume") {
        let output = run(folder).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        return;
    }
    assert!(output.status.success(), "{error}");
}

/// Equal results, and recordings of the same states that every command can read.
fn compare_runs(whole: &Path, folder: &Path) {
    assert_same_results(whole, folder);
    let steps = [whole, folder].map(|folder| recorded_steps(&folder.join("run.rrd")));
    assert!(steps[0].len() == 2 && steps[0] == steps[1]);
    let output = command(&["runs", folder.to_str().unwrap()])
        .output()
        .unwrap();
    assert!(
        output.status.success() && output.stderr.is_empty(),
        "{}",
        stderr(&output)
    );
}

const TRAINING: Experiment = Experiment {
    prepare: |_| (),
    command: run,
    finish: finish_run,
    compare: compare_runs,
};

/// A finished run with another run seed, which is overwritten.
fn prepare_other_run(folder: &Path) {
    let output = run(folder).args(["--seed", "1"]).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
}

/// A plain command says what is in the folder, or runs; afterwards no checkpoint may be there without
/// its scenario.
fn finish_overwriting(folder: &Path) {
    let has_checkpoint = folder.join("checkpoint/state.bin").is_file();
    let scenario = folder.join("scenario.ron");
    assert!(
        !has_checkpoint || scenario.is_file(),
        "the checkpoint outlives its scenario"
    );
    let output = run(folder).output().unwrap();
    let error = stderr(&output);
    if output.status.success() {
        return;
    }
    assert_eq!(output.status.code(), Some(2), "{error}");
    if error.contains(" contains a finished run; choose ") {
        let output = overwriting_run(folder).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
    } else {
        assert!(
            error.contains(" contains an interrupted run; choose --resume "),
            "{error}"
        );
        finish_run(folder);
    }
}

const OVERWRITING: Experiment = Experiment {
    prepare: prepare_other_run,
    command: overwriting_run,
    finish: finish_overwriting,
    compare: compare_runs,
};

fn prepare_study(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let scenario = Path::new(REPOSITORY).join("scenarios/tabular/deep_sea.ron");
    let text = format!(
        r#"Study(
            title: "Small",
            scenario: "{}",
            set: ["agents.count=3", "episodes=8"],
            cells: [
                (name: "seeds", set: ["algorithm=SeedSampling()"]),
                (name: "random", set: ["algorithm=Random"]),
            ],
            measures: [Regret],
            repeats: 2,
        )"#,
        scenario.display()
    );
    fs::write(folder.join("small.ron"), text).unwrap();
}

fn study(folder: &Path) -> Command {
    let mut command = command(&["study", "--jobs", "1"]);
    command.arg(folder.join("small.ron"));
    command.arg("--out").arg(folder.join("out"));
    command
}

fn finish_study(folder: &Path) {
    let output = study(folder).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
}

fn compare_studies(whole: &Path, folder: &Path) {
    let contents = |folder: &Path| {
        let out = folder.join("out");
        let runs = files_below(&out, "run").into_iter();
        let others = ["results.csv", "tables.md"].map(|name| out.join(name));
        let all: Vec<(PathBuf, Vec<u8>)> = runs
            .chain(others)
            .map(|path| {
                let bytes = fs::read(&path).unwrap();
                (path.strip_prefix(folder).unwrap().to_owned(), bytes)
            })
            .collect();
        all
    };
    let [expected, found] = [whole, folder].map(contents);
    assert_eq!(expected.len(), 4 + 2);
    assert!(expected == found);
}

const STUDY: Experiment = Experiment {
    prepare: prepare_study,
    command: study,
    finish: finish_study,
    compare: compare_studies,
};

fn prepare_training_study(folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let scenario = Path::new(REPOSITORY).join("scenarios/cartpole_1.ron");
    let text = format!(
        r#"Study(
            title: "Training",
            scenario: "{}",
            set: ["stop=Episodes(4)"],
            measures: [Coverage],
            repeats: 4,
        )"#,
        scenario.display()
    );
    fs::write(folder.join("small.ron"), text).unwrap();
}

/// Its four runs share a world, and each writes checkpoints.
fn study_with_checkpoints(folder: &Path) -> Command {
    let mut command = study(folder);
    command.args(["--checkpoint-distance", "0"]);
    command
}

const STUDY_WITH_CHECKPOINTS: Experiment = Experiment {
    prepare: prepare_training_study,
    command: study_with_checkpoints,
    finish: finish_study,
    compare: compare_studies,
};

#[test]
fn a_run_that_is_stopped_at_any_call_can_be_finished() {
    TRAINING.check(Calls::Sample(8));
}

#[test]
fn an_overwriting_run_that_is_stopped_at_any_call_can_be_finished() {
    OVERWRITING.check(Calls::Sample(6));
}

#[test]
fn a_study_that_is_stopped_at_any_call_can_be_finished() {
    STUDY.check(Calls::Sample(6));
}

#[test]
fn a_study_that_is_stopped_at_any_call_of_its_checkpoints_can_be_finished() {
    STUDY_WITH_CHECKPOINTS.check(Calls::Sample(10));
}

#[test]
#[ignore = "takes minutes"]
fn commands_that_are_stopped_at_every_call_can_be_finished() {
    for experiment in [TRAINING, OVERWRITING, STUDY, STUDY_WITH_CHECKPOINTS] {
        experiment.check(Calls::Every);
    }
}

/// A run whose recording is lost or damaged names the command that continues it without its recording,
/// and this command gives the results of an undisturbed run.
#[test]
fn a_run_without_its_recording_can_be_continued() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, lost] = ["whole", "lost run"].map(|name| folder.path().join(name));
    assert!(run(&whole).output().unwrap().status.success());
    let part = lost.join("run.rrd.part");
    let remove = |part: &Path| fs::remove_file(part).unwrap();
    let cut = |part: &Path| {
        let bytes = fs::read(part).unwrap();
        fs::write(part, &bytes[..bytes.len() / 2]).unwrap();
    };
    let change = |part: &Path| {
        let mut bytes = fs::read(part).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(part, bytes).unwrap();
    };
    for damage in [&remove as &dyn Fn(&Path), &cut, &change] {
        super::util::crash({
            let mut run = run(&lost);
            run.args(["--abort-after-rounds", "2", "--overwrite"]);
            run
        });
        damage(&part);
        let kept = part.is_file();
        let output = run(&lost).arg("--resume").output().unwrap();
        let error = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(
            error.starts_with(&format!("error: cannot resume {}", part.display())),
            "{error}"
        );
        let proposal = error.lines().last().unwrap().trim();
        assert!(proposal.ends_with(" --resume --no-recording"), "{error}");
        // The proposed command, as a user copies it.
        let mut shell = Command::new("sh");
        let output = shell
            .args(["-c", proposal])
            .current_dir(REPOSITORY)
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(stderr(&output).contains("warning: the run continues without a recording"));
        assert_same_results(&whole, &lost);
        assert_eq!(lost.join("incomplete.rrd").is_file(), kept);
        assert!(!part.exists() && !lost.join("run.rrd").exists());
        let inspected = command(&["inspect", lost.to_str().unwrap()])
            .output()
            .unwrap();
        assert!(inspected.status.success(), "{}", stderr(&inspected));
    }
}
