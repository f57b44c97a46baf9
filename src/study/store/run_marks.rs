//! Marks of runs that a process executes: small files beside the results, which `study list` reads; they exclude nobody.
//!
//! Results never depend on marks, and a mark never keeps a run from being executed. Marks use no locks,
//! which some file systems of clusters do not have: a mark whose process is gone, or whose heartbeat has
//! stopped, is that of an interrupted run.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use serde::{Deserialize, Serialize};

use seedbed_input::limits::{MAX_SMALL_FILE_BYTES, read_bytes};

/// Extension of marks.
pub(super) const EXTENSION: &str = "running";

/// How long a run lasts before it is marked, so that short runs write no marks.
const MIN_DURATION: Duration = Duration::from_secs(1);

/// Time between two heartbeats: changes of the time at which a mark was modified.
const HEARTBEAT: Duration = Duration::from_secs(20);

/// Age of the latest heartbeat after which a run counts as interrupted. Network file systems show
/// changes of others up to a minute late.
const MAX_SILENCE: Duration = Duration::from_mins(3);

/// Who executes a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunMark {
    /// Name of the machine.
    pub host: String,
    /// Process id.
    pub process: u32,
    /// Slurm job, such as `1234_7`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slurm_job: Option<String>,
    /// When the run was begun, in seconds since 1970 (UTC).
    pub started: u64,
    /// Whether the process stopped before the run was finished.
    pub stopped: bool,
    /// What identifies the process among all processes that its machine ever has; `None` if the system
    /// does not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    identity: Option<ProcessIdentity>,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct ProcessIdentity {
    /// Id of the start of the machine.
    boot: String,
    /// Namespace of process ids.
    namespace: PathBuf,
    /// When the process was started, in ticks since the start of the machine.
    start: u64,
}

impl ProcessIdentity {
    fn of_this_process() -> Option<Self> {
        Self::of(std::process::id())
    }

    /// The identity of a process of this machine; `None` if there is none.
    fn of(process: u32) -> Option<Self> {
        let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
        // The name of the program is in parentheses and may contain anything. It is followed by the
        // state, and the start is the twentieth field from there.
        let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
        if matches!(*fields.first()?, "Z" | "X") {
            return None;
        }
        Some(Self {
            boot: fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?,
            namespace: fs::read_link("/proc/self/ns/pid").ok()?,
            start: fields.get(19)?.parse().ok()?,
        })
    }

    /// Whether process ids of this process and that one mean the same processes.
    fn is_visible_from(&self, other: &Self) -> bool {
        (&self.boot, &self.namespace) == (&other.boot, &other.namespace)
    }
}

impl RunMark {
    fn of_this_process() -> Self {
        let name = fs::read_to_string("/proc/sys/kernel/hostname");
        let name = name.or_else(|_| std::env::var("HOSTNAME").or(std::env::var("COMPUTERNAME")));
        Self {
            host: name.map_or_else(|_| "unknown".to_owned(), |name| name.trim().to_owned()),
            process: std::process::id(),
            slurm_job: slurm_job(|name| std::env::var(name).ok()),
            started: seconds_since_1970(),
            stopped: false,
            identity: ProcessIdentity::of_this_process(),
        }
    }

    fn write(&self, path: &Path) -> io::Result<()> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::write(path, serde_json::to_vec(self)?)
    }

    /// Whether the run is still executed, if its latest heartbeat is that old.
    fn is_running(&self, silence: Duration) -> bool {
        let here = ProcessIdentity::of_this_process();
        match (&self.identity, here) {
            _ if self.stopped => false,
            (Some(identity), Some(here)) if identity.is_visible_from(&here) => {
                ProcessIdentity::of(self.process).as_ref() == Some(identity)
            }
            _ => silence < MAX_SILENCE,
        }
    }
}

fn seconds_since_1970() -> u64 {
    let time = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    time.unwrap_or_default().as_secs()
}

/// The Slurm job of an environment, such as `1234_7`.
fn slurm_job(variable: impl Fn(&str) -> Option<String>) -> Option<String> {
    match (
        variable("SLURM_ARRAY_JOB_ID"),
        variable("SLURM_ARRAY_TASK_ID"),
    ) {
        (Some(job), Some(task)) => Some(format!("{job}_{task}")),
        _ => variable("SLURM_JOB_ID"),
    }
}

/// A mark that was found, and whether its run is still executed. `None` if there is none.
pub(super) fn find(path: &Path) -> Option<(RunMark, bool)> {
    let bytes = read_bytes(path, MAX_SMALL_FILE_BYTES).ok()?;
    let modified = fs::metadata(path).and_then(|metadata| metadata.modified());
    // A clock that is behind makes heartbeats of the future.
    let silence = modified.ok()?.elapsed().unwrap_or_default();
    let mark: RunMark = serde_json::from_slice(&bytes).ok()?;
    let is_running = mark.is_running(silence);
    Some((mark, is_running))
}

/// Removes the marks in a folder of results.
pub(super) fn remove_all(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path
            .extension()
            .is_some_and(|extension| extension == EXTENSION)
        {
            let _ = fs::remove_file(path);
        }
    }
}

/// Marks the runs that this process executes, from a thread of its own. What cannot be written is
/// ignored: marks are for people.
pub(in crate::study) struct RunMarks {
    process: RunMark,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    state: Mutex<State>,
    ended: Condvar,
}

struct State {
    runs: BTreeMap<PathBuf, ActiveRun>,
    latest_heartbeat: Instant,
    has_ended: bool,
}

struct ActiveRun {
    mark: RunMark,
    begun: Instant,
    /// Whether this process has written the mark.
    is_written: bool,
    /// Whether an earlier process left a mark.
    was_marked: bool,
}

impl RunMarks {
    pub(in crate::study) fn new() -> Self {
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                runs: BTreeMap::new(),
                latest_heartbeat: Instant::now(),
                has_ended: false,
            }),
            ended: Condvar::new(),
        });
        let of_thread = Arc::clone(&shared);
        let thread = std::thread::Builder::new()
            .name("marks".to_owned())
            .spawn(move || of_thread.keep_up_to_date());
        Self {
            process: RunMark::of_this_process(),
            shared,
            thread: thread.ok(),
        }
    }

    /// Marks a run as executed by this process, unless it ends within a second.
    pub(in crate::study) fn begin(&self, path: PathBuf) {
        let mark = RunMark {
            started: seconds_since_1970(),
            ..self.process.clone()
        };
        let run = ActiveRun {
            mark,
            begun: Instant::now(),
            is_written: false,
            was_marked: path.exists(),
        };
        self.shared.lock().runs.insert(path, run);
    }

    /// Removes the mark of a run whose result is stored.
    pub(in crate::study) fn end(&self, path: &Path) {
        let run = self.shared.lock().runs.remove(path);
        if run.is_some_and(|run| run.is_written || run.was_marked) {
            let _ = fs::remove_file(path);
        }
    }
}

impl Drop for RunMarks {
    /// Marks the runs that are not finished as interrupted.
    fn drop(&mut self) {
        self.shared.lock().has_ended = true;
        self.shared.ended.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        for (path, run) in std::mem::take(&mut self.shared.lock().runs) {
            let mark = RunMark {
                stopped: true,
                ..run.mark
            };
            let _ = mark.write(&path);
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn keep_up_to_date(&self) {
        let mut state = self.lock();
        while !state.has_ended {
            state.update();
            let waited = self.ended.wait_timeout(state, MIN_DURATION);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl State {
    /// Writes the marks of runs that have lasted long enough and, when it is time, a heartbeat of each.
    fn update(&mut self) {
        let is_due = self.latest_heartbeat.elapsed() >= HEARTBEAT;
        for (path, run) in &mut self.runs {
            if !run.is_written && run.begun.elapsed() >= MIN_DURATION {
                run.is_written = run.mark.write(path).is_ok();
            } else if run.is_written && is_due {
                let _ = touch(path);
            }
        }
        if is_due {
            self.latest_heartbeat = Instant::now();
        }
    }
}

fn touch(path: &Path) -> io::Result<()> {
    let file = File::options().write(true).open(path)?;
    file.set_modified(SystemTime::now())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn elsewhere(mark: &RunMark) -> RunMark {
        RunMark {
            identity: None,
            ..mark.clone()
        }
    }

    /// Of this machine the process decides, of another one the heartbeat.
    #[test]
    fn marks_of_dead_processes_are_those_of_interrupted_runs() {
        let here = RunMark::of_this_process();
        let [new, old] = [Duration::ZERO, MAX_SILENCE];
        assert!(elsewhere(&here).is_running(new) && !elsewhere(&here).is_running(old));
        let stopped = RunMark {
            stopped: true,
            ..elsewhere(&here)
        };
        assert!(!stopped.is_running(new));
        if cfg!(target_os = "linux") {
            assert!(here.is_running(new) && here.is_running(old));
            let mut reused = here.clone();
            reused.identity.as_mut().unwrap().start -= 1;
            assert!(!reused.is_running(new), "a later process has its id");
            let mut rebooted = here;
            rebooted.identity.as_mut().unwrap().boot.clear();
            assert!(rebooted.is_running(new) && !rebooted.is_running(old));
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_ended_process_has_no_identity() {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let id = child.id();
        child.wait().unwrap();
        assert!(ProcessIdentity::of(id) != ProcessIdentity::of_this_process());
    }

    #[test]
    fn short_runs_write_no_mark_and_unfinished_ones_are_marked_as_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let [finished, unfinished, earlier] =
            ["a", "b", "c"].map(|name| folder.path().join(name).with_extension(EXTENSION));
        RunMark::of_this_process().write(&earlier).unwrap();
        let marks = RunMarks::new();
        for path in [&finished, &unfinished, &earlier] {
            marks.begin(path.clone());
        }
        marks.end(&finished);
        marks.end(&earlier);
        assert!(!finished.exists() && !earlier.exists() && !unfinished.exists());
        drop(marks);
        let (mark, is_running) = find(&unfinished).unwrap();
        assert!(mark.stopped && !is_running);
        remove_all(folder.path());
        assert_eq!(find(&unfinished), None);
    }

    /// A run that has lasted a second is marked, and the heartbeat of a mark is renewed when it is due.
    #[test]
    fn long_runs_are_marked_and_have_a_heartbeat() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a").with_extension(EXTENSION);
        let long_ago = |duration| Instant::now().checked_sub(duration).unwrap();
        let mut state = State {
            runs: BTreeMap::new(),
            latest_heartbeat: Instant::now(),
            has_ended: false,
        };
        let run = ActiveRun {
            mark: RunMark::of_this_process(),
            begun: Instant::now(),
            is_written: false,
            was_marked: false,
        };
        state.runs.insert(path.clone(), run);
        state.update();
        assert!(!path.exists());
        state.runs.get_mut(&path).unwrap().begun = long_ago(MIN_DURATION);
        state.update();
        let (mark, is_running) = find(&path).unwrap();
        assert!(is_running && mark.process == std::process::id());
        let modified = || fs::metadata(&path).unwrap().modified().unwrap();
        let file = File::options().write(true).open(&path).unwrap();
        let old = SystemTime::UNIX_EPOCH;
        file.set_modified(old).unwrap();
        state.update();
        assert_eq!(modified(), old, "not due");
        state.latest_heartbeat = long_ago(HEARTBEAT);
        state.update();
        assert!(modified().elapsed().unwrap() < MAX_SILENCE);
    }

    #[test]
    fn jobs_of_arrays_are_named_by_their_task() {
        let environment = |variables: &'static [(&str, &str)]| {
            move |name: &str| {
                let mut found = variables.iter().filter(move |(key, _)| *key == name);
                found.next().map(|(_, value)| (*value).to_owned())
            }
        };
        assert_eq!(slurm_job(environment(&[])), None);
        let single = environment(&[("SLURM_JOB_ID", "12")]);
        assert_eq!(slurm_job(single).as_deref(), Some("12"));
        let array = environment(&[
            ("SLURM_JOB_ID", "13"),
            ("SLURM_ARRAY_JOB_ID", "12"),
            ("SLURM_ARRAY_TASK_ID", "7"),
        ]);
        assert_eq!(slurm_job(array).as_deref(), Some("12_7"));
    }
}
