//! Checkpoints of runs of a study: all that another process needs to continue a run that was stopped.
//!
//! A checkpoint is one file beside the result file of its run. It is replaced as a whole, so that
//! several processes can execute the same run, and it is removed when the result is stored. Only the
//! build that wrote it reads it. A file that is of no use costs time, never a wrong number:
//!
//! | Part | Contents |
//! |---|---|
//! | 4 bytes | length of the head, little-endian |
//! | head | `Head`, sealed: which run, how far, lengths of the next two parts |
//! | state | `State`: the trainer, and what is measured so far |
//! | transitions | of the replay buffer, if there is one |
//! | 8 bytes | XXH64 of everything before, little-endian |

use std::fmt::{self, Display, Formatter};
use std::fs;
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::experiment::run_result::MeasuredRun;
use crate::provenance::{self, BuildId};
use crate::run::execution::checkpoint_schedule::CheckpointSchedule;
use crate::run::training::Trainer;
use crate::storage::files::Replacement;
use crate::storage::hashes::shown_digits;
use crate::storage::sealed::{self, Format, SealError};
use crate::storage::written::{HashedFile, WrittenHash};
use seedbed_input::limits::open_regular;
use seedbed_learn::experience::replay::Replay;

/// Extension of checkpoints.
const EXTENSION: &str = "checkpoint";

const FORMAT: Format = Format {
    kind: *b"srun",
    version: 4,
};

/// Path of the checkpoint of the run with this digest and run seed, in a folder of result files.
pub(crate) fn file_in(folder: &Path, digest: &str, run_seed: u64) -> PathBuf {
    folder.join(format!("{}-{run_seed}.{EXTENSION}", shown_digits(digest)))
}

/// Share of the time of a thread that checkpoints may take.
const SHARE: f64 = 0.01;

/// Time from the start of a run to its first checkpoint, and between two checkpoints.
const MIN_DISTANCE: Duration = Duration::from_secs(30);

/// Work, as time, that an interruption may lose.
const MAX_LOSS: Duration = Duration::from_secs(3);

/// Number of transitions that are encoded at once.
const TRANSITIONS_AT_ONCE: u64 = 1 << 14;

const CHECKSUM_BYTES: usize = 8;

/// How the runs of a study keep their checkpoints.
#[derive(Clone, Copy)]
pub struct RunCheckpoints<'a> {
    folder: &'a Path,
    share: f64,
    min_distance: Duration,
    max_loss: Duration,
    notify: &'a (dyn Fn(&CheckpointEvent<'_>) + Sync),
}

/// What happened to the checkpoint of a run.
#[derive(Clone, Copy, Debug)]
pub enum CheckpointEvent<'a> {
    /// A run continues from its checkpoint.
    Resumed {
        /// The checkpoint.
        file: &'a Path,
        /// How far it is.
        progress: SavedProgress,
    },
    /// A checkpoint is not used, and its run starts again.
    Unusable {
        /// The checkpoint.
        file: &'a Path,
        /// What is wrong.
        reason: &'a str,
    },
    /// A checkpoint could not be written. The run continues, and the checkpoint before it is kept.
    NotWritten {
        /// The checkpoint.
        file: &'a Path,
        /// The error of the operating system.
        reason: &'a str,
    },
}

/// How far a run was when its checkpoint was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SavedProgress {
    /// Number of finished episodes per agent.
    pub episodes: u32,
    /// Maximum number of episodes per agent.
    pub max_episodes: u32,
}

impl CheckpointEvent<'_> {
    /// Whether something went wrong.
    #[must_use]
    pub fn is_warning(&self) -> bool {
        !matches!(self, Self::Resumed { .. })
    }
}

impl Display for CheckpointEvent<'_> {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Resumed { file, progress } => write!(formatter, "{}: {progress}", file.display()),
            Self::Unusable { file, reason } => write!(
                formatter,
                "checkpoint {}: {reason}; its run starts again",
                file.display()
            ),
            Self::NotWritten { file, reason } => write!(
                formatter,
                "cannot write checkpoint {}: {reason}; the one before it, if any, is kept",
                file.display()
            ),
        }
    }
}

impl Display for SavedProgress {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let Self {
            episodes,
            max_episodes,
        } = self;
        write!(formatter, "{episodes} of at most {max_episodes} episodes")
    }
}

impl<'a> RunCheckpoints<'a> {
    /// Checkpoints in a folder of result files. `notify` is called with what happens to them.
    #[must_use]
    pub fn new(folder: &'a Path, notify: &'a (dyn Fn(&CheckpointEvent<'_>) + Sync)) -> Self {
        Self {
            folder,
            share: SHARE,
            min_distance: MIN_DISTANCE,
            max_loss: MAX_LOSS,
            notify,
        }
    }

    /// As [`new`](Self::new), but checkpoints are written as often as this minimum time between two of
    /// them allows, whatever share of the time they take, and at every interruption.
    #[must_use]
    pub fn with_min_distance(self, min_distance: Duration) -> Self {
        Self {
            share: 1.0,
            min_distance,
            max_loss: Duration::ZERO,
            ..self
        }
    }

    /// The checkpoint of the run with this digest, run seed and numbers of first episodes of which it
    /// samples visited states. The run begins now. `together`: number of runs that share its thread.
    /// `None` if the build of this program is unknown.
    pub(crate) fn of_run(
        &'a self,
        (digest, run_seed, windows): (String, u64, &[u32]),
        max_episodes: u32,
        together: usize,
    ) -> Option<RunCheckpoint<'a>> {
        let share = self.share / together as f64;
        Some(RunCheckpoint {
            path: file_in(self.folder, &digest, run_seed),
            run: RunIdentity {
                build: provenance::build_id()?,
                digest,
                run_seed,
                windows: windows.to_vec(),
            },
            schedule: CheckpointSchedule::with_share(share, self.min_distance),
            max_episodes,
            max_loss: self.max_loss,
            latest_update: Instant::now(),
            saved_rounds: 0,
            is_broken: false,
            notify: self.notify,
        })
    }
}

/// Everything on which the bits of a checkpoint depend.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct RunIdentity {
    build: BuildId,
    digest: String,
    run_seed: u64,
    windows: Vec<u32>,
}

/// The first part of a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    run: RunIdentity,
    progress: SavedProgress,
    /// Number of bytes of the state.
    state: u64,
    /// The transitions of the replay buffer; `None` if the team has none.
    transitions: Option<Transitions>,
}

/// The transitions in a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Transitions {
    /// Number of the first one.
    first: u64,
    /// Number of bytes of all of them.
    bytes: u64,
}

/// The second part of a checkpoint. `M` is borrowed when it is written.
#[derive(Serialize, Deserialize)]
struct State<M> {
    trainer: Vec<u8>,
    measured: M,
}

/// The checkpoint of one run.
pub(crate) struct RunCheckpoint<'a> {
    path: PathBuf,
    run: RunIdentity,
    max_episodes: u32,
    schedule: CheckpointSchedule,
    max_loss: Duration,
    /// When the run began or its latest round ended.
    latest_update: Instant,
    /// Number of rounds in the checkpoint that this process has read or written.
    saved_rounds: u32,
    /// Whether the latest checkpoint could not be written.
    is_broken: bool,
    notify: &'a (dyn Fn(&CheckpointEvent<'_>) + Sync),
}

impl RunCheckpoint<'_> {
    /// The trainer and the measures of the run as they are in its checkpoint, if there is one that can
    /// be used.
    ///
    /// # Errors
    /// If the trainer cannot be built.
    pub(crate) fn resume<E>(
        &mut self,
        new_trainer: impl FnOnce() -> Result<Trainer, E>,
    ) -> Result<Option<(Trainer, MeasuredRun)>, E> {
        let contents = match Contents::read(&self.path, &self.run) {
            Ok(Some(contents)) => contents,
            Ok(None) => return Ok(None),
            Err(damage) => return Ok(self.refuse(&damage.to_string())),
        };
        let mut trainer = new_trainer()?;
        Ok(match contents.restore(&mut trainer) {
            Ok(measured) => {
                self.saved_rounds = trainer.rounds();
                (self.notify)(&CheckpointEvent::Resumed {
                    file: &self.path,
                    progress: contents.head.progress,
                });
                Some((trainer, measured))
            }
            Err(reason) => self.refuse(&reason),
        })
    }

    fn refuse<T>(&self, reason: &str) -> Option<T> {
        let file = &self.path;
        (self.notify)(&CheckpointEvent::Unusable { file, reason });
        None
    }

    /// Writes a checkpoint between two rounds if it is time, or if the run is interrupted and would lose
    /// more than a few seconds.
    pub(crate) fn update(
        &mut self,
        trainer: &Trainer,
        measured: &MeasuredRun,
        is_interrupted: bool,
    ) {
        let (rounds, start) = (trainer.rounds(), Instant::now());
        let last_round = start.duration_since(self.latest_update);
        self.latest_update = start;
        let is_due = if is_interrupted {
            self.schedule.distance(start) >= self.max_loss
        } else {
            // A round that takes this long may be abandoned, and the run continues with that before it.
            last_round >= MAX_LOSS || self.schedule.is_due(rounds, start)
        };
        if !is_due || rounds == self.saved_rounds {
            return;
        }
        let progress = SavedProgress {
            episodes: trainer.measures().episodes_per_agent() as u32,
            max_episodes: self.max_episodes,
        };
        match self.write(trainer, measured, progress) {
            Ok(()) => (self.saved_rounds, self.is_broken) = (rounds, false),
            Err(error) => self.report_failure(&error),
        }
        self.schedule.written(start);
    }

    /// Reports that a checkpoint could not be written, once until one is written again.
    fn report_failure(&mut self, error: &io::Error) {
        if !std::mem::replace(&mut self.is_broken, true) {
            (self.notify)(&CheckpointEvent::NotWritten {
                file: &self.path,
                reason: &error.to_string(),
            });
        }
    }

    fn write(
        &self,
        trainer: &Trainer,
        measured: &MeasuredRun,
        progress: SavedProgress,
    ) -> io::Result<()> {
        let state = State {
            trainer: trainer.save(),
            measured,
        };
        let state = postcard::to_stdvec(&state).expect("plain data always serializes");
        let replay = trainer.replay();
        let head = Head {
            run: self.run.clone(),
            progress,
            state: state.len() as u64,
            transitions: replay.map(Transitions::of),
        };
        let head = postcard::to_stdvec(&head).expect("plain data always serializes");
        let head = sealed::seal(FORMAT, &head);
        let replacement = Replacement::begin(&self.path)?;
        let mut file = HashedFile::new(replacement.file()?);
        file.write_all(&(head.len() as u32).to_le_bytes())?;
        file.write_all(&head)?;
        file.write_all(&state)?;
        if let Some(replay) = replay {
            write_transitions(&mut file, replay)?;
        }
        let checksum = file.written().hash;
        file.write_all(&checksum.to_le_bytes())?;
        replacement.commit()
    }
}

impl Transitions {
    fn of(replay: &Replay) -> Self {
        Self {
            first: replay.numbers().start,
            bytes: (replay.len() * replay.encoded_length()) as u64,
        }
    }
}

fn write_transitions(file: &mut impl Write, replay: &Replay) -> io::Result<()> {
    let (mut numbers, mut bytes) = (replay.numbers(), Vec::new());
    while !numbers.is_empty() {
        let end = numbers.end.min(numbers.start + TRANSITIONS_AT_ONCE);
        bytes.clear();
        replay.encode(numbers.start..end, &mut bytes);
        file.write_all(&bytes)?;
        numbers.start = end;
    }
    Ok(())
}

/// A verified checkpoint.
#[derive(Debug)]
struct Contents {
    head: Head,
    /// State, transitions and checksum.
    rest: Vec<u8>,
}

/// Why a checkpoint is not used.
#[derive(Debug, thiserror::Error)]
enum Damage {
    #[error("cannot be read: {0}")]
    Unreadable(#[from] io::Error),
    #[error("is damaged: it has no beginning")]
    TooShort,
    #[error(transparent)]
    Seal(#[from] SealError),
    #[error("is damaged: {0}")]
    Head(#[from] postcard::Error),
    #[error("was written by another build of seedbed")]
    OtherBuild,
    #[error("is of another run")]
    OtherRun,
    #[error("has samples of other visited states than the study needs now")]
    OtherWindows,
}

impl Contents {
    /// Reads and verifies the checkpoint of a run; `None` if there is none.
    fn read(path: &Path, run: &RunIdentity) -> Result<Option<Self>, Damage> {
        let mut file = match open_regular(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            file => file?,
        };
        let (head_bytes, head) = read_head(&mut file)?;
        run.check_same(&head.run)?;
        let expected = head.length_of_rest();
        let mut rest = Vec::new();
        file.take(expected.saturating_add(1))
            .read_to_end(&mut rest)?;
        if rest.len() as u64 != expected {
            let before = head_bytes.len() as u64;
            return Err(SealError::Length {
                found: before + rest.len() as u64,
                expected: before.saturating_add(expected),
            }
            .into());
        }
        let Some((contents, checksum)) = rest.split_last_chunk::<CHECKSUM_BYTES>() else {
            return Err(SealError::Hash.into());
        };
        let mut hash = WrittenHash::new();
        hash.add(&head_bytes);
        hash.add(contents);
        if hash.written().hash != u64::from_le_bytes(*checksum) {
            return Err(SealError::Hash.into());
        }
        Ok(Some(Self { head, rest }))
    }

    /// Restores a new trainer, and returns the measures so far.
    fn restore(&self, trainer: &mut Trainer) -> Result<MeasuredRun, String> {
        let (state, rest) = self.rest.split_at(self.head.state as usize);
        let state: State<MeasuredRun> =
            postcard::from_bytes(state).map_err(|error| error.to_string())?;
        trainer.restore(&state.trainer)?;
        match (self.head.transitions, trainer.replay_mut()) {
            (None, None) => {}
            (Some(stored), Some(replay)) => {
                replay.restore(stored.first, &rest[..stored.bytes as usize])?;
            }
            _ => return Err("is of another algorithm".to_owned()),
        }
        Ok(state.measured)
    }
}

impl Head {
    /// Number of bytes after the head.
    fn length_of_rest(&self) -> u64 {
        let transitions = self.transitions.map_or(0, |transitions| transitions.bytes);
        let checksum = CHECKSUM_BYTES as u64;
        self.state
            .saturating_add(transitions)
            .saturating_add(checksum)
    }
}

impl RunIdentity {
    fn check_same(&self, found: &Self) -> Result<(), Damage> {
        if found.build != self.build {
            Err(Damage::OtherBuild)
        } else if (&found.digest, found.run_seed) != (&self.digest, self.run_seed) {
            Err(Damage::OtherRun)
        } else if found.windows != self.windows {
            Err(Damage::OtherWindows)
        } else {
            Ok(())
        }
    }
}

/// Reads the beginning of a checkpoint: its bytes, and what they say.
fn read_head(file: &mut impl Read) -> Result<(Vec<u8>, Head), Damage> {
    let mut length = [0; 4];
    let complete = file.read_exact(&mut length);
    complete.map_err(|error| match error.kind() {
        ErrorKind::UnexpectedEof => Damage::TooShort,
        _ => error.into(),
    })?;
    let mut bytes = length.to_vec();
    file.take(u32::from_le_bytes(length).into())
        .read_to_end(&mut bytes)?;
    let head = postcard::from_bytes(sealed::unseal(FORMAT, &bytes[length.len()..])?)?;
    Ok((bytes, head))
}

/// How far the checkpoint of a run is; `None` if there is none, or if it is not of this build. Only its
/// head is read.
pub(crate) fn progress(path: &Path) -> Option<SavedProgress> {
    let (_, head) = read_head(&mut open_regular(path).ok()?).ok()?;
    (Some(head.run.build) == provenance::build_id()).then_some(head.progress)
}

/// Removes a checkpoint that is of no use any more. One that cannot be removed does no harm.
pub(crate) fn remove(path: &Path) {
    // A failing call would be one more that changes files.
    if path.exists() {
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::sync::Mutex;

    use super::*;
    use crate::run::Plan;

    const WINDOWS: [u32; 1] = [5];

    /// Trains for some rounds with checkpoints after each. Returns the trainer, its measures and the
    /// events.
    fn train(folder: &Path, rounds: u32) -> (Trainer, MeasuredRun, Vec<String>) {
        let overrides = ["agents.count=2", "algorithm.hidden=[3]"].map(str::to_owned);
        let plan = Plan::load(Path::new("scenarios/cartpole.ron"), &overrides).unwrap();
        let events = Mutex::new(Vec::new());
        let notify = |event: &CheckpointEvent<'_>| events.lock().unwrap().push(event.to_string());
        let checkpoints = RunCheckpoints::new(folder, &notify).with_min_distance(Duration::ZERO);
        let mut checkpoint = checkpoints
            .of_run(("digest".to_owned(), 0, &WINDOWS), 200, 1)
            .unwrap();
        let new_trainer = || Trainer::from_scenario(&plan.scenario, &plan.description, 1);
        let (mut trainer, mut measured) =
            checkpoint.resume(new_trainer).unwrap().unwrap_or_else(|| {
                let trainer = new_trainer().unwrap();
                let measured = MeasuredRun::begin(&trainer, 0, &WINDOWS);
                (trainer, measured)
            });
        for _ in 0..rounds {
            let rows = trainer.advance().unwrap().rows;
            measured.add_round(&trainer, &rows);
            checkpoint.update(&trainer, &measured, false);
        }
        drop(checkpoint);
        (trainer, measured, events.into_inner().unwrap())
    }

    fn path(folder: &Path) -> PathBuf {
        file_in(folder, "digest", 0)
    }

    /// Two rounds, and two more in another process, have the state of four rounds.
    #[test]
    fn a_run_continues_with_the_rounds_that_are_missing() {
        let folder = tempfile::tempdir().unwrap();
        let [stopped, whole] = ["a", "b"].map(|name| folder.path().join(name));
        train(&stopped, 2);
        let path = path(&stopped);
        let expected = SavedProgress {
            episodes: 2,
            max_episodes: 200,
        };
        assert_eq!(progress(&path), Some(expected));
        let (trainer, measured, events) = train(&stopped, 2);
        let text = format!("{}: 2 of at most 200 episodes", path.display());
        assert_eq!(events, [text]);
        let (whole_trainer, whole_measured, events) = train(&whole, 4);
        assert!(events.is_empty(), "{events:?}");
        assert!(trainer.rounds() == 4 && trainer.save() == whole_trainer.save());
        let bytes = |measured: MeasuredRun| postcard::to_stdvec(&measured.finish()).unwrap();
        assert!(bytes(measured) == bytes(whole_measured));
    }

    #[test]
    fn a_change_of_any_byte_is_found() {
        let folder = tempfile::tempdir().unwrap();
        train(folder.path(), 1);
        let path = path(folder.path());
        let (_, Head { run, .. }) = read_head(&mut File::open(&path).unwrap()).unwrap();
        assert!(Contents::read(&path, &run).unwrap().is_some());
        let bytes = fs::read(&path).unwrap();
        for position in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[position] ^= 1 << (position % 8);
            fs::write(&path, &changed).unwrap();
            assert!(Contents::read(&path, &run).is_err(), "byte {position}");
        }
        for length in (0..bytes.len()).step_by(7) {
            fs::write(&path, &bytes[..length]).unwrap();
            assert!(Contents::read(&path, &run).is_err(), "{length} bytes");
        }
    }

    /// A file is where the folder of results should be: each write fails, and one is reported.
    #[test]
    fn a_checkpoint_that_cannot_be_written_is_reported_once() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("runs"), "a file").unwrap();
        let (trainer, _, mut events) = train(&folder.path().join("runs"), 3);
        assert_eq!(trainer.rounds(), 3);
        events.retain(|event| !event.contains("cannot be read"));
        let [event] = &events[..] else {
            panic!("{events:?}");
        };
        assert!(event.starts_with("cannot write checkpoint "), "{event}");
    }
}
