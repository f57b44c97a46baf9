//! Curves of a run as event files of TensorBoard, written while it trains: one directory for the team and one per
//! agent. The step is the number of environment steps of the whole team, which is the same for every algorithm and
//! never decreases, so that a resumed run can say where it continues.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::event_file::{Event, scalar_event, start_event, version_event, write_event};
use super::tensorboard::{TEAM, agent_folder, largest_number, live_file_name, remove_earlier};
use crate::run::facts::metrics::{METRICS, Metric, Scope};
use crate::run::measures::RoundRows;
use crate::run::{Observer, Progress};

/// Time between two writes: a short round must not wait for the disk.
const WRITE_EVERY: Duration = Duration::from_secs(1);

/// Writes the returns and metrics of each round.
#[derive(Debug)]
pub struct LiveCurves {
    folder: PathBuf,
    /// Name of the event file of this process in each directory.
    file_name: String,
    /// First step that this process may write: later values of an earlier process are void.
    first_step: i64,
    /// Directories whose event file is begun.
    begun: BTreeSet<String>,
    /// Events that are not written yet, by directory.
    waiting: BTreeMap<String, Vec<Event>>,
    written: Instant,
    has_failed: bool,
    on_failure: fn(&str),
}

impl LiveCurves {
    /// Prepares to write below `folder`. Curves of an earlier run there are removed, unless the run is resumed.
    /// `on_failure` is called with the reason if they cannot be written later; the run continues without them.
    ///
    /// # Errors
    /// A file cannot be removed or the directory cannot be made, or a directory has event files of other programs.
    pub fn begin(folder: &Path, is_resumed: bool, on_failure: fn(&str)) -> io::Result<Self> {
        fs::create_dir_all(folder)?;
        if !is_resumed {
            remove_earlier(folder)?;
        }
        Ok(Self {
            folder: folder.to_owned(),
            file_name: live_file_name(largest_number(folder)? + 1),
            first_step: 0,
            begun: BTreeSet::new(),
            waiting: BTreeMap::new(),
            written: Instant::now(),
            has_failed: false,
            on_failure,
        })
    }

    fn add(&mut self, directory: &str, step: u64, tag: &str, value: f64) {
        let event = at_now(scalar_event(step as i64, tag, value as f32));
        let waiting = self.waiting.entry(directory.to_owned());
        waiting.or_default().push(event);
    }

    fn add_round(&mut self, progress: &Progress, rows: &RoundRows) {
        let returns: Vec<f64> = rows.episodes.iter().map(|row| row.r#return).collect();
        let now = progress.env_steps;
        if !returns.is_empty() {
            let mean = returns.iter().sum::<f64>() / returns.len() as f64;
            self.add(TEAM, now, "return", mean);
        }
        for row in &rows.episodes {
            let agent = agent_folder(row.agent);
            self.add(&agent, row.env_steps, "return", row.r#return);
        }
        for metric in METRICS {
            if let Some(value) = metric.team_value_of_round(&rows.updates) {
                self.add(TEAM, now, metric.key, value);
            }
        }
        let is_of_agents = |metric: &&Metric| metric.scope == Scope::Agent;
        for row in &rows.updates {
            let agent = agent_folder(row.agent);
            for metric in METRICS.iter().filter(is_of_agents) {
                if let Some(value) = metric.value(row) {
                    self.add(&agent, now, metric.key, value);
                }
            }
        }
    }

    /// Writes all that waits. After a failure nothing is written any more.
    fn write(&mut self) {
        self.written = Instant::now();
        let waiting = std::mem::take(&mut self.waiting);
        if self.has_failed {
            return;
        }
        for (directory, events) in waiting {
            if let Err(error) = self.append(&directory, &events) {
                let place = self.folder.join(directory).join(&self.file_name);
                self.has_failed = true;
                return (self.on_failure)(&format!(
                    "cannot write {}: {error}; the run continues without curves for TensorBoard",
                    place.display()
                ));
            }
        }
    }

    /// Appends events to the file in a directory, which is open only meanwhile: a team may have more agents than a
    /// process may have open files.
    fn append(&mut self, directory: &str, events: &[Event]) -> io::Result<()> {
        let folder = self.folder.join(directory);
        let mut bytes = Vec::new();
        if self.begun.insert(directory.to_owned()) {
            fs::create_dir_all(&folder)?;
            write_event(&mut bytes, &at_now(version_event()))?;
            if self.first_step > 1 {
                write_event(&mut bytes, &at_now(start_event(self.first_step)))?;
            }
        }
        for event in events {
            write_event(&mut bytes, event)?;
        }
        let path = folder.join(&self.file_name);
        let mut file = OpenOptions::new().create(true).append(true).open(path)?;
        file.write_all(&bytes)
    }
}

impl Observer for LiveCurves {
    fn begun(&mut self, progress: &Progress) {
        self.first_step = progress.env_steps as i64 + 1;
    }

    fn round_finished(&mut self, progress: &Progress, rows: &RoundRows) {
        self.add_round(progress, rows);
        if self.written.elapsed() >= WRITE_EVERY {
            self.write();
        }
    }
}

/// The end of a run, or its interruption.
impl Drop for LiveCurves {
    fn drop(&mut self) {
        self.write();
    }
}

/// An event of now.
fn at_now(event: Event) -> Event {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    Event {
        wall_time: now.map_or(0.0, |now| now.as_secs_f64()),
        ..event
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::event_file::read_events;
    use crate::run::facts::EpisodeRow;
    use seedbed_env::Status;

    fn progress(rounds: u32, env_steps: u64) -> Progress {
        Progress {
            rounds,
            episodes: rounds as usize,
            max_episodes: 9,
            recent_return: 0.0,
            env_steps,
            max_env_steps: None,
        }
    }

    /// A round with one episode that ends after this number of steps of the team.
    fn add_round(curves: &mut LiveCurves, round: u32, env_steps: u64) {
        let row = EpisodeRow {
            agent: 3,
            episode: round,
            round,
            env_steps,
            r#return: f64::from(round),
            length: 10,
            outcome: Status::Truncated,
            coverage: 0.0,
            visitation_entropy: 0.0,
            team_overlap: 0.0,
            effective_agents: 1.0,
        };
        let rows = RoundRows {
            episodes: vec![row],
            updates: Vec::new(),
        };
        curves.round_finished(&progress(round + 1, env_steps), &rows);
    }

    /// Steps of the events of a file, and whether they begin a process.
    fn events(folder: &Path, name: &str) -> Vec<(i64, bool)> {
        let bytes = fs::read(folder.join("agent_3").join(name)).unwrap();
        let mut events = Vec::new();
        read_events(&bytes, |_, event| {
            events.push((event.step, event.is_start()));
        })
        .unwrap();
        events
    }

    /// Values of the first process at step 20 are void, because it was resumed from step 10.
    #[test]
    fn a_resumed_process_begins_a_file_that_says_where_it_continues() {
        let folder = tempfile::tempdir().unwrap();
        let begin = |is_resumed, env_steps| {
            let mut curves =
                LiveCurves::begin(folder.path(), is_resumed, |reason| panic!("{reason}")).unwrap();
            curves.begun(&progress(0, env_steps));
            curves
        };
        let mut curves = begin(false, 0);
        add_round(&mut curves, 0, 10);
        add_round(&mut curves, 1, 20);
        drop(curves);
        add_round(&mut begin(true, 10), 1, 21);
        let [first, second] = [1, 2].map(live_file_name);
        assert_eq!(
            events(folder.path(), &first),
            [(0, false), (10, false), (20, false)]
        );
        assert_eq!(
            events(folder.path(), &second),
            [(0, false), (11, true), (21, false)]
        );
        add_round(&mut begin(false, 0), 0, 9);
        assert_eq!(events(folder.path(), &first), [(0, false), (9, false)]);
        assert_eq!(
            fs::read_dir(folder.path().join("agent_3")).unwrap().count(),
            1
        );
    }
}
