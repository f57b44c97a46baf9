//! Runs a fuzz target in a process of its own, with limits of memory and time.
//!
//! The test is the supervisor: it starts itself again as worker, with [`FOLDER`] in its environment.
//! The worker writes each input to a file before it reads it. If the worker ends early, the
//! supervisor keeps that file and starts a worker that continues with the next input.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use seedbed_random::{Purpose, Stream, stream};

use crate::util::stderr;

/// Maximum processor time for one input.
const MAX_PROCESSOR_TIME: Duration = Duration::from_secs(5);

/// Maximum time for one input, in which a process also waits: for others on a busy machine, or for
/// itself.
const MAX_TIME: Duration = Duration::from_mins(1);

/// Maximum size of the worker's address space in KiB. The tests themselves take a third of it.
const MAX_KIBIBYTES: u64 = 1 << 20;

/// One of so many inputs must be accepted, so that more than the first check is reached.
const MIN_ACCEPTED: u32 = 100;

/// Number of failures after which a target is not run any more.
const MAX_FAILURES: usize = 10;

/// Number of inputs after which a worker is replaced, because the parser of formulas keeps the text
/// of every formula that it has read.
const INPUTS_PER_WORKER: u32 = 20_000;

/// Set in workers: the folder in which they work.
const FOLDER: &str = "SEEDBED_FUZZ_FOLDER";
/// Number of the worker's first input.
const FIRST: &str = "SEEDBED_FUZZ_FIRST";
/// Number of the input after the worker's last.
const END: &str = "SEEDBED_FUZZ_END";
/// Random number seed; 0 by default.
const SEED: &str = "SEEDBED_FUZZ_SEED";
/// Duration; by default a fixed number of inputs is read.
const SECONDS: &str = "SEEDBED_FUZZ_SECONDS";
/// File with the only input.
const INPUT: &str = "SEEDBED_FUZZ_INPUT";

/// What is fuzzed.
pub(super) struct Fuzzing {
    /// Name of the test.
    pub(super) name: &'static str,
    /// Number of inputs in continuous integration.
    pub(super) inputs: u32,
    /// Makes the files that all inputs need, without limits of memory and time.
    pub(super) set_up: fn(&Path),
    /// The target that works in a folder.
    pub(super) open: fn(&Path) -> Box<dyn Target>,
}

/// Reads inputs.
pub(super) trait Target {
    /// File from which inputs are read.
    fn path(&self) -> PathBuf;

    /// A random input.
    fn generate(&mut self, random: &mut Stream) -> Vec<u8>;

    /// Reads the input in the file. Returns whether it was accepted. Panics if the result or the error is
    /// not as it should be.
    fn read(&mut self, input: &[u8]) -> bool;
}

/// For targets that need no files.
pub(super) fn nothing(_: &Path) {}

fn number(variable: &str) -> Option<u64> {
    let text = std::env::var(variable).ok()?;
    Some(text.parse().expect("it is a number"))
}

impl Fuzzing {
    /// Supervises workers or, in a worker, reads inputs.
    pub(super) fn run(&self) {
        match std::env::var_os(FOLDER) {
            Some(folder) => self.work(Path::new(&folder)),
            None => self.supervise(),
        }
    }

    fn supervise(&self) {
        let folder = tempfile::tempdir().unwrap();
        (self.set_up)(folder.path());
        let deadline = number(SECONDS).map(|seconds| Instant::now() + Duration::from_secs(seconds));
        let is_over = |next| match deadline {
            Some(deadline) => Instant::now() >= deadline,
            None => next >= self.inputs,
        };
        let (mut next, mut accepted, mut failures) = (0, 0, Vec::new());
        while !is_over(next) && failures.len() < MAX_FAILURES {
            let end = next.saturating_add(INPUTS_PER_WORKER);
            let end = if deadline.is_some() {
                end
            } else {
                end.min(self.inputs)
            };
            let output = self.run_worker(folder.path(), next, end);
            let done = read_progress(folder.path()).expect("the worker has begun");
            next = done.index + 1;
            accepted += done.accepted;
            if !output.status.success() {
                failures.push(self.failure(folder.path(), next - 1, &output));
            }
            if std::env::var_os(INPUT).is_some() {
                break;
            }
        }
        if deadline.is_some() {
            eprintln!(
                "{}: {next} inputs, {accepted} of them accepted, {} failures",
                self.name,
                failures.len()
            );
        }
        assert!(failures.is_empty(), "{}", failures.join("\n\n"));
        let is_complete = std::env::var_os(INPUT).is_none();
        assert!(
            !is_complete || accepted > next / MIN_ACCEPTED,
            "{}: only {accepted} of {next} inputs were accepted: they do not reach far",
            self.name
        );
    }

    fn run_worker(&self, folder: &Path, first: u32, end: u32) -> Output {
        let _ = fs::remove_file(folder.join("progress"));
        let test = format!("fuzz::{}", self.name);
        let mut command = Command::new("sh");
        command
            .args([
                "-c",
                &format!("ulimit -v {MAX_KIBIBYTES}; exec \"$0\" \"$@\""),
            ])
            .arg(std::env::current_exe().unwrap())
            .args([&test, "--exact", "--nocapture", "--test-threads=1"])
            .env(FOLDER, folder)
            .env(FIRST, first.to_string())
            .env(END, end.to_string())
            // Each thread of the C library would reserve address space of its own.
            .env("MALLOC_ARENA_MAX", "2")
            .env("RUST_BACKTRACE", "0");
        command.output().unwrap()
    }

    /// Describes a failure, and keeps its input.
    fn failure(&self, folder: &Path, index: u32, output: &Output) -> String {
        let seed = number(SEED).unwrap_or(0);
        let kept = Path::new(env!("CARGO_TARGET_TMPDIR"))
            .join(format!("fuzz-{}-{seed}-{index}", self.name));
        fs::copy(folder.join("input"), &kept).unwrap();
        format!(
            "{}, seed {seed}, input {index}: {}\n{}\nthe input is in {}",
            self.name,
            output.status,
            stderr(output).trim_end(),
            kept.display()
        )
    }

    fn work(&self, folder: &Path) {
        let mut target = (self.open)(folder);
        let watch = Watch::start();
        let only = std::env::var_os(INPUT);
        let first = number(FIRST).expect("it is set") as u32;
        let end = number(END).expect("it is set") as u32;
        let deadline = number(SECONDS).map(|seconds| Instant::now() + Duration::from_secs(seconds));
        let mut accepted = 0;
        for index in first..end {
            let input = self.input(&mut *target, index, only.as_ref());
            write(&folder.join("input"), &input);
            write(&target.path(), &input);
            Progress { index, accepted }.write(folder);
            watch.begin();
            accepted += u32::from(target.read(&input));
            watch.end();
            let is_late = deadline.is_some_and(|deadline| Instant::now() >= deadline);
            if is_late || only.is_some() || index + 1 == end {
                Progress { index, accepted }.write(folder);
                break;
            }
        }
    }

    fn input(&self, target: &mut dyn Target, index: u32, only: Option<&OsString>) -> Vec<u8> {
        if let Some(path) = only {
            return fs::read(path).unwrap();
        }
        let name = self.name.bytes().fold(0, |hash: u32, byte| {
            hash.wrapping_mul(31).wrapping_add(byte.into())
        });
        let seed = number(SEED).unwrap_or(0);
        target.generate(&mut stream(seed, Purpose::Preview, name, index))
    }
}

/// How far a worker is.
struct Progress {
    /// Number of the latest input.
    index: u32,
    /// Number of the worker's inputs that were accepted.
    accepted: u32,
}

impl Progress {
    fn write(&self, folder: &Path) {
        let text = format!("{} {}", self.index, self.accepted);
        write(&folder.join("progress"), text.as_bytes());
    }
}

/// Writes a file in place of an earlier one, which is deleted first: some file systems write a file to
/// the disk at once when another is overwritten.
fn write(path: &Path, bytes: &[u8]) {
    let _ = fs::remove_file(path);
    fs::write(path, bytes).unwrap();
}

fn read_progress(folder: &Path) -> Option<Progress> {
    let text = fs::read_to_string(folder.join("progress")).ok()?;
    let (index, accepted) = text.split_once(' ')?;
    Some(Progress {
        index: index.parse().ok()?,
        accepted: accepted.parse().ok()?,
    })
}

/// When the reading of an input began, in milliseconds; [`IDLE`] between inputs.
struct Watch {
    time: AtomicU64,
    processor_time: AtomicU64,
}

const IDLE: u64 = u64::MAX;

impl Watch {
    /// Ends the process when an input has taken too long.
    fn start() -> Arc<Self> {
        let watch = Arc::new(Self {
            time: AtomicU64::new(IDLE),
            processor_time: AtomicU64::new(IDLE),
        });
        let watched = Arc::clone(&watch);
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(MAX_PROCESSOR_TIME / 20);
                watched.check();
            }
        });
        watch
    }

    fn begin(&self) {
        self.processor_time
            .store(processor_time(), Ordering::Relaxed);
        self.time.store(now(), Ordering::Relaxed);
    }

    fn end(&self) {
        self.processor_time.store(IDLE, Ordering::Relaxed);
        self.time.store(IDLE, Ordering::Relaxed);
    }

    fn check(&self) {
        for (now, began, max) in [
            (processor_time(), &self.processor_time, MAX_PROCESSOR_TIME),
            (now(), &self.time, MAX_TIME),
        ] {
            let taken = now.saturating_sub(began.load(Ordering::Relaxed));
            if u128::from(taken) > max.as_millis() {
                eprintln!("not read within {} s", max.as_secs());
                std::process::exit(3);
            }
        }
    }
}

/// Milliseconds of the system's clock.
fn now() -> u64 {
    let time = std::time::SystemTime::UNIX_EPOCH.elapsed();
    time.unwrap_or_default().as_millis() as u64
}

/// Milliseconds for which this process has computed; 0 where the system does not say.
fn processor_time() -> u64 {
    const MILLISECONDS_PER_TICK: u64 = 10;
    let text = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name of the program, in parentheses, may have spaces. Times are the 14th and 15th field.
    let fields = text.rsplit(')').next().unwrap_or_default().split(' ');
    let ticks: u64 = fields
        .skip(12)
        .take(2)
        .filter_map(|field| field.parse::<u64>().ok())
        .sum();
    ticks * MILLISECONDS_PER_TICK
}
