//! Passes finished rounds to the recorders of a run, in a thread of their own if there is more than
//! one thread.
//!
//! The thread receives rounds through a queue of limited length. If it is slower than training,
//! training waits: rounds are neither lost nor collected in memory. Recorders receive the same
//! rounds in the same order in both cases, so that files do not depend on the number of threads.
//! In teams of four agents or more, they get a pool of threads, among which they may divide their work.

use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};

use rayon::ThreadPool;

use super::Options;
use crate::run::recorder::{RecordError, Recorder, RoundRecord};
use crate::run::training::{Round, thread_count, thread_pool};
use crate::storage::written::WrittenFile;
use seedbed_learn::experience::Episode;
use seedbed_learn::team::Workers;

/// Maximum number of rounds that wait for the recorders.
const MAX_WAITING_ROUNDS: usize = 8;

/// Maximum number of episodes that wait for the recorders, if each agent has one episode per round
/// and there are not more agents than this.
const MAX_WAITING_EPISODES: usize = 2048;

/// The recorders of a run, in their order.
pub(in crate::run) type Recorders = Vec<Box<dyn Recorder>>;

/// What recorders add to a checkpoint.
#[derive(Debug, Default)]
pub(in crate::run) struct RecorderStates {
    /// The state of each recorder, in their order.
    pub(in crate::run) states: Vec<Vec<u8>>,
    /// Their files, as far as they are written.
    pub(in crate::run) files: Vec<WrittenFile>,
}

/// Passes rounds to recorders.
pub(in crate::run) enum RoundRecorder {
    /// The recorders are called directly, and may divide their work among the threads of a pool.
    Direct(Recorders, Option<ThreadPool>),
    /// The recorders are called by another thread.
    Queued(RecordingThread),
}

/// A thread that calls recorders, and the queue of what it has to do.
pub(in crate::run) struct RecordingThread {
    /// `None` when the thread has ended.
    tasks: Option<SyncSender<Task>>,
    /// The thread's answers to all tasks other than rounds.
    states: Receiver<RecorderStates>,
    warnings: Receiver<String>,
    /// `None` when the thread has ended.
    thread: Option<JoinHandle<Result<(), RecordError>>>,
}

/// What the recorders have to do next.
enum Task {
    Record(Box<FinishedRound>),
    Checkpoint(CheckpointKind),
    Finish,
}

/// What a checkpoint does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::run) enum CheckpointKind {
    /// Training continues after the checkpoint.
    Meanwhile,
    /// Training ends, for now or for good: the files contain everything recorded so far.
    AtEnd,
}

/// A round that does not borrow from the trainer, which continues meanwhile.
struct FinishedRound {
    number: u32,
    /// The episodes in (agent, episode) order.
    episodes: Vec<Episode>,
    round: Round,
}

impl RoundRecorder {
    /// Passes rounds of `agents` agents to `recorders`, in another thread unless `threads` allows
    /// one thread only. 0 threads are as many as there are cores.
    pub(in crate::run) fn new(recorders: Recorders, agents: usize, threads: usize) -> Self {
        if thread_count(threads) == 1 {
            return Self::Direct(recorders, None);
        }
        let waiting_rounds = (MAX_WAITING_EPISODES / agents.max(1)).clamp(1, MAX_WAITING_ROUNDS);
        let pool = (agents >= MIN_AGENTS_OF_POOL).then(|| thread_pool(threads, "recorder"));
        Self::Queued(RecordingThread::start(recorders, waiting_rounds, pool))
    }

    /// Passes rounds of `agents` agents to the recorders of a run. On one of several ranks, they are called in this thread, since
    /// only one thread of a rank may call MPI.
    pub(in crate::run) fn of_run(recorders: Recorders, agents: usize, options: &Options) -> Self {
        if options.ranks.is_single() {
            return Self::new(recorders, agents, options.threads);
        }
        let needs_pool = thread_count(options.threads) > 1 && !recorders.is_empty();
        let pool = needs_pool.then(|| thread_pool(options.threads, "recorder"));
        Self::Direct(recorders, pool)
    }

    /// Records a round, or lets it wait to be recorded. `episodes` are in (agent, episode) order.
    ///
    /// # Errors
    /// A file could not be written, in this round or in an earlier round that waited.
    pub(in crate::run) fn record(
        &mut self,
        number: u32,
        episodes: &[&Episode],
        round: Round,
    ) -> Result<(), RecordError> {
        match self {
            Self::Direct(recorders, pool) => {
                let record = record_of(number, episodes, &round, Workers::new(pool.as_ref()));
                record_round(recorders, &record)
            }
            Self::Queued(thread) => {
                let episodes = episodes.iter().copied().cloned().collect();
                thread.send(Task::Record(Box::new(FinishedRound {
                    number,
                    episodes,
                    round,
                })))
            }
        }
    }

    /// Waits until all rounds are recorded and written to disk, and returns the recorders' states.
    ///
    /// # Errors
    /// A file could not be written.
    pub(in crate::run) fn checkpoint(
        &mut self,
        kind: CheckpointKind,
    ) -> Result<RecorderStates, RecordError> {
        match self {
            Self::Direct(recorders, _) => checkpoint(recorders, kind),
            Self::Queued(thread) => thread.ask(Task::Checkpoint(kind)),
        }
    }

    /// Completes the files. Nothing may be recorded afterwards.
    ///
    /// # Errors
    /// A file could not be completed.
    pub(in crate::run) fn finish(&mut self) -> Result<(), RecordError> {
        match self {
            Self::Direct(recorders, _) => finish(recorders),
            Self::Queued(thread) => thread.ask(Task::Finish).map(drop),
        }
    }

    /// Takes the warnings since the last call.
    pub(in crate::run) fn take_warnings(&mut self) -> Vec<String> {
        match self {
            Self::Direct(recorders, _) => take_warnings(recorders).collect(),
            Self::Queued(thread) => thread.warnings.try_iter().collect(),
        }
    }
}

/// Number of agents from which recorders may use several threads.
const MIN_AGENTS_OF_POOL: usize = 4;

impl RecordingThread {
    fn start(recorders: Recorders, waiting_rounds: usize, pool: Option<ThreadPool>) -> Self {
        let (tasks, queue) = sync_channel(waiting_rounds);
        let (states_sender, states) = channel();
        let (warnings_sender, warnings) = channel();
        let thread = thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || {
                let workers = Workers::new(pool.as_ref());
                work(recorders, workers, &queue, &states_sender, &warnings_sender)
            })
            .expect("the system starts threads");
        Self {
            tasks: Some(tasks),
            states,
            warnings,
            thread: Some(thread),
        }
    }

    fn send(&mut self, task: Task) -> Result<(), RecordError> {
        let sent = self.tasks.as_ref().map(|tasks| tasks.send(task));
        match sent {
            Some(Ok(())) => Ok(()),
            _ => self.end(),
        }
    }

    /// Waits for the answer to a task.
    fn ask(&mut self, task: Task) -> Result<RecorderStates, RecordError> {
        self.send(task)?;
        match self.states.recv() {
            Ok(states) => Ok(states),
            Err(_) => self.end().map(|()| RecorderStates::default()),
        }
    }

    /// Waits until everything in the queue is recorded, and ends the thread. Returns the error that
    /// ended it earlier, if there was one.
    fn end(&mut self) -> Result<(), RecordError> {
        self.tasks = None;
        self.thread.take().map_or(Ok(()), |thread| {
            thread.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    }
}

/// If a run ends early, the rounds that wait are recorded.
impl Drop for RecordingThread {
    fn drop(&mut self) {
        self.tasks = None;
        if let Some(thread) = self.thread.take() {
            drop(thread.join());
        }
    }
}

/// Carries out tasks until there are no more, or until a file cannot be written.
fn work(
    mut recorders: Recorders,
    workers: Workers<'_>,
    queue: &Receiver<Task>,
    states: &Sender<RecorderStates>,
    warnings: &Sender<String>,
) -> Result<(), RecordError> {
    for task in queue {
        let answer = match task {
            Task::Record(finished) => {
                let FinishedRound {
                    number,
                    episodes,
                    round,
                } = *finished;
                let episodes: Vec<&Episode> = episodes.iter().collect();
                let record = record_of(number, &episodes, &round, workers);
                record_round(&mut recorders, &record)?;
                None
            }
            Task::Checkpoint(kind) => Some(checkpoint(&mut recorders, kind)?),
            Task::Finish => Some(finish(&mut recorders).map(|()| RecorderStates::default())?),
        };
        // Nobody reads warnings or answers after the run has ended with an error of its own.
        take_warnings(&mut recorders).for_each(|warning| drop(warnings.send(warning)));
        if let Some(answer) = answer {
            drop(states.send(answer));
        }
    }
    Ok(())
}

fn record_of<'a>(
    number: u32,
    episodes: &'a [&'a Episode],
    round: &'a Round,
    workers: Workers<'a>,
) -> RoundRecord<'a> {
    RoundRecord {
        round: number,
        episodes,
        episode_rows: &round.rows.episodes,
        round_rows: &round.rows.updates,
        step_data: &round.step_data,
        details: &round.details,
        workers,
    }
}

fn record_round(recorders: &mut Recorders, round: &RoundRecord<'_>) -> Result<(), RecordError> {
    recorders
        .iter_mut()
        .try_for_each(|recorder| recorder.record_round(round))
}

fn checkpoint(
    recorders: &mut Recorders,
    kind: CheckpointKind,
) -> Result<RecorderStates, RecordError> {
    if kind == CheckpointKind::AtEnd {
        recorders
            .iter_mut()
            .try_for_each(|recorder| recorder.flush())?;
    }
    let mut added = RecorderStates::default();
    for recorder in recorders {
        added.states.push(recorder.checkpoint()?);
        added.files.extend(recorder.written_files());
    }
    Ok(added)
}

fn finish(recorders: &mut Recorders) -> Result<(), RecordError> {
    recorders
        .iter_mut()
        .try_for_each(|recorder| recorder.finish())
}

fn take_warnings(recorders: &mut Recorders) -> impl Iterator<Item = String> {
    recorders
        .iter_mut()
        .filter_map(|recorder| recorder.take_warning())
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::*;
    use crate::run::measures::RoundRows;
    use crate::run::recorder::Attempt;
    use seedbed_env::TaskSpec;

    /// Counts of rounds, shared between a test and its recorder.
    #[derive(Default)]
    struct Counts {
        passed_on: AtomicUsize,
        recorded: AtomicUsize,
        most_waiting: AtomicUsize,
    }

    /// A recorder on a slow disk, on which the round `fails_at` cannot be written.
    struct SlowRecorder {
        counts: Arc<Counts>,
        fails_at: u32,
    }

    impl Recorder for SlowRecorder {
        fn record_round(&mut self, round: &RoundRecord<'_>) -> Result<(), RecordError> {
            thread::sleep(Duration::from_millis(2));
            let recorded = self.counts.recorded.load(Ordering::SeqCst);
            assert_eq!(round.round as usize, recorded, "in order, without gaps");
            assert_eq!(round.episodes[0].episode, round.round);
            if round.round == self.fails_at {
                return Err(full_disk());
            }
            let waiting = self.counts.passed_on.load(Ordering::SeqCst) - recorded;
            self.counts
                .most_waiting
                .fetch_max(waiting, Ordering::SeqCst);
            self.counts.recorded.fetch_add(1, Ordering::SeqCst);
            Ok(())
        }

        fn checkpoint(&mut self) -> Result<Vec<u8>, RecordError> {
            Ok(vec![self.counts.recorded.load(Ordering::SeqCst) as u8])
        }

        fn finish(&mut self) -> Result<(), RecordError> {
            Ok(())
        }

        fn take_warning(&mut self) -> Option<String> {
            let recorded = self.counts.recorded.load(Ordering::SeqCst);
            (recorded == 5).then(|| "five rounds".to_owned())
        }
    }

    fn full_disk() -> RecordError {
        RecordError {
            path: PathBuf::from("run.rrd.part"),
            attempt: Attempt::Write,
            reason: "No space left on device".to_owned(),
        }
    }

    fn slow_recorder(fails_at: u32, threads: usize) -> (RoundRecorder, Arc<Counts>) {
        let counts = Arc::new(Counts::default());
        let recorder = SlowRecorder {
            counts: Arc::clone(&counts),
            fails_at,
        };
        let recorder = RoundRecorder::new(vec![Box::new(recorder)], 1, threads);
        (recorder, counts)
    }

    fn record(
        recorder: &mut RoundRecorder,
        counts: &Counts,
        number: u32,
    ) -> Result<(), RecordError> {
        counts.passed_on.fetch_add(1, Ordering::SeqCst);
        let spec = TaskSpec::new("test", Vec::new(), Vec::new());
        let episode = Episode::start(0, number, number, &spec);
        let round = Round {
            rows: RoundRows::default(),
            step_data: Vec::new(),
            details: Vec::new(),
        };
        recorder.record(number, &[&episode], round)
    }

    /// One round is being recorded, eight wait, and one was passed on and waits for space.
    #[test]
    fn a_slow_recorder_gets_every_round_and_few_rounds_wait() {
        for threads in [1, 2] {
            let (mut recorder, counts) = slow_recorder(u32::MAX, threads);
            for number in 0..60 {
                record(&mut recorder, &counts, number).unwrap();
                if number == 29 {
                    let states = recorder.checkpoint(CheckpointKind::Meanwhile).unwrap();
                    assert_eq!(states.states, [[30]]);
                }
            }
            recorder.finish().unwrap();
            assert_eq!(counts.recorded.load(Ordering::SeqCst), 60);
            let most_waiting = counts.most_waiting.load(Ordering::SeqCst);
            assert!(most_waiting <= MAX_WAITING_ROUNDS + 2, "{most_waiting}");
        }
    }

    #[test]
    fn waiting_rounds_are_recorded_if_a_run_ends_early() {
        let (mut recorder, counts) = slow_recorder(u32::MAX, 2);
        (0..6).for_each(|number| record(&mut recorder, &counts, number).unwrap());
        drop(recorder);
        assert_eq!(counts.recorded.load(Ordering::SeqCst), 6);
    }

    /// The error of round 3 ends the run a few rounds later, with an unchanged message.
    #[test]
    fn an_error_ends_the_run() {
        for threads in [1, 2] {
            let (mut recorder, counts) = slow_recorder(3, threads);
            let error = (0..60).find_map(|number| record(&mut recorder, &counts, number).err());
            assert_eq!(error.unwrap().to_string(), full_disk().to_string());
            assert_eq!(counts.recorded.load(Ordering::SeqCst), 3);
        }
        let (mut recorder, counts) = slow_recorder(0, 2);
        drop(record(&mut recorder, &counts, 0));
        let error = recorder.checkpoint(CheckpointKind::AtEnd).unwrap_err();
        assert_eq!(error.to_string(), full_disk().to_string());
    }

    #[test]
    fn warnings_are_passed_on() {
        for threads in [1, 2] {
            let (mut recorder, counts) = slow_recorder(u32::MAX, threads);
            (0..5).for_each(|number| record(&mut recorder, &counts, number).unwrap());
            recorder.checkpoint(CheckpointKind::AtEnd).unwrap();
            assert!(recorder.take_warnings().contains(&"five rounds".to_owned()));
        }
    }
}
