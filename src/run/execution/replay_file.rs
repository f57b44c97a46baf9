//! The file of a run's replay buffer, to which each checkpoint appends the transitions that are new
//! since the one before.
//!
//! A checkpoint says how many bytes of which file are its own. Bytes after them are of a checkpoint
//! that was never completed. When more than half of the transitions in the file have left the replay
//! buffer, the next checkpoint begins a new file.

use std::fs;
use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::run::folder::checkpoint::{CheckpointError, StoredTransitions};
use crate::storage::files;
use crate::storage::written::WrittenHash;
use seedbed_learn::experience::replay::Replay;

/// Number of transitions that are encoded at once.
const TRANSITIONS_AT_ONCE: u64 = 1 << 14;

/// Writes the transitions of a run's replay buffer to files in the folder of its checkpoint.
pub(super) struct ReplayFile {
    folder: PathBuf,
    /// What was stored last; `None` before the first time.
    stored: Option<StoredTransitions>,
    /// What the newest checkpoint and the one before it have, as far as they were written since the
    /// run was begun or resumed.
    in_checkpoints: [Option<StoredTransitions>; 2],
    /// Hash of the stored transitions.
    hash: WrittenHash,
}

impl ReplayFile {
    /// For a run without checkpoint.
    pub(super) fn new(folder: PathBuf) -> Self {
        Self {
            folder,
            stored: None,
            in_checkpoints: [None, None],
            hash: WrittenHash::new(),
        }
    }

    /// Stores the transitions that are not stored yet. The files of earlier checkpoints keep all
    /// that they need.
    pub(super) fn write(&mut self, replay: &Replay) -> Result<StoredTransitions, CheckpointError> {
        let numbers = replay.numbers();
        let (old, mut hash) = match self.stored {
            Some(stored) if is_worth_keeping(&stored, &numbers) => (stored, self.hash.clone()),
            stored => (new_file(stored, numbers.start), WrittenHash::new()),
        };
        let path = path(&self.folder, old.file);
        append(&path, &old, replay, &mut hash)
            .map_err(|error| failure(&path, &error.to_string()))?;
        let stored = StoredTransitions {
            count: numbers.end - old.first,
            checksum: hash.written().hash,
            ..old
        };
        self.stored = Some(stored);
        self.hash = hash;
        Ok(stored)
    }

    /// Reads the transitions of a checkpoint into the replay buffer of a run that is resumed.
    ///
    /// # Errors
    /// The file is missing, too short or damaged, or belongs to another replay buffer.
    pub(super) fn read(
        folder: PathBuf,
        stored: StoredTransitions,
        replay: &mut Replay,
    ) -> Result<Self, CheckpointError> {
        let path = path(&folder, stored.file);
        let length = stored.count.saturating_mul(replay.encoded_length() as u64);
        let bytes = files::read_start(&path, length).map_err(|reason| failure(&path, &reason))?;
        let mut hash = WrittenHash::new();
        hash.add(&bytes);
        if hash.written().hash != stored.checksum {
            return Err(failure(&path, "is damaged: it has another checksum"));
        }
        let count = stored.end().min(replay.capacity() as u64);
        let in_buffer = bytes
            .len()
            .checked_sub(count as usize * replay.encoded_length());
        let restored = match in_buffer {
            Some(start) => replay.restore(stored.end() - count, &bytes[start..]),
            None => Err("the replay buffer has another size".to_owned()),
        };
        restored.map_err(|reason| failure(&path, &reason))?;
        Ok(Self {
            folder,
            stored: Some(stored),
            in_checkpoints: [Some(stored), None],
            hash,
        })
    }

    /// Notes what the newest checkpoint has, and deletes the files that neither it nor the one before
    /// it needs.
    pub(super) fn committed(&mut self, newest: Option<StoredTransitions>) -> io::Result<()> {
        if newest.is_none() && self.stored.is_none() {
            return Ok(());
        }
        self.in_checkpoints = [newest, self.in_checkpoints[0]];
        let [newest, previous] = self.in_checkpoints;
        let needed = [newest, previous, self.stored];
        let needed = needed.map(|stored| Some(path(&self.folder, stored?.file)));
        for entry in fs::read_dir(&self.folder)? {
            let path = Some(entry?.path());
            if let Some(unneeded) = path.as_ref().filter(|_| !needed.contains(&path))
                && is_replay_file(unneeded)
            {
                fs::remove_file(unneeded)?;
            }
        }
        Ok(())
    }
}

/// Whether new transitions should be appended to a file: the file has all transitions in the replay
/// buffer up to the new ones, and at least half of its transitions will be in the replay buffer.
fn is_worth_keeping(stored: &StoredTransitions, numbers: &Range<u64>) -> bool {
    let outdated = numbers.start - stored.first;
    stored.end() >= numbers.start && outdated <= numbers.end - numbers.start
}

/// The empty file after the one that has been used so far.
fn new_file(stored: Option<StoredTransitions>, first: u64) -> StoredTransitions {
    StoredTransitions {
        file: stored.map_or(1, |stored| stored.file + 1),
        first,
        count: 0,
        checksum: 0,
    }
}

/// Writes the transitions after the `old` ones to their file and to the hash of the old ones.
fn append(
    path: &Path,
    old: &StoredTransitions,
    replay: &Replay,
    hash: &mut WrittenHash,
) -> io::Result<()> {
    // After the old transitions there may be some of a checkpoint that was never completed.
    let length = old.count * replay.encoded_length() as u64;
    files::append_after(path, length, |file| {
        let (mut next, end, mut bytes) = (old.end(), replay.numbers().end, Vec::new());
        while next < end {
            let part = next..end.min(next + TRANSITIONS_AT_ONCE);
            bytes.clear();
            replay.encode(part.clone(), &mut bytes);
            hash.add(&bytes);
            file.write_all(&bytes)?;
            next = part.end;
        }
        Ok(())
    })
}

fn path(folder: &Path, file: u64) -> PathBuf {
    folder.join(format!("replay-{file}.bin"))
}

/// Whether a file is a replay file, such as `replay-3.bin`.
fn is_replay_file(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    let number = name.and_then(|name| name.strip_prefix("replay-")?.strip_suffix(".bin"));
    number.is_some_and(|number| number.parse::<u64>().is_ok())
}

fn failure(path: &Path, reason: &str) -> CheckpointError {
    CheckpointError {
        path: path.to_owned(),
        reason: reason.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use seedbed_env::{Status, TaskSpec};
    use seedbed_learn::experience::Episode;
    use seedbed_learn::experience::replay::RowWidths;

    const CAPACITY: usize = 10;

    const WIDTHS: RowWidths = RowWidths {
        observation: 1,
        action: 1,
    };

    /// A run with a replay buffer of [`CAPACITY`] transitions of one observation each.
    struct TestRun {
        folder: tempfile::TempDir,
        replay: Replay,
        file: ReplayFile,
    }

    impl TestRun {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            Self {
                file: ReplayFile::new(folder.path().to_owned()),
                replay: Replay::new(CAPACITY, WIDTHS),
                folder,
            }
        }

        /// Plays an episode and stores the replay buffer; `kind` distinguishes episodes.
        fn play_and_store(&mut self, steps: usize, kind: f32) -> StoredTransitions {
            self.play(steps, kind);
            let stored = self.file.write(&self.replay).unwrap();
            self.file.committed(Some(stored)).unwrap();
            stored
        }

        fn play(&mut self, steps: usize, kind: f32) {
            let episode = Episode {
                observations: (0..=steps).map(|step| kind + step as f32).collect(),
                actions: vec![1.0; steps],
                rewards: vec![kind; steps],
                outcome: Status::Truncated,
                ..Episode::start(0, 0, 0, &TaskSpec::new("test", Vec::new(), Vec::new()))
            };
            (0..steps).for_each(|step| self.replay.push(&episode, step));
        }

        fn path(&self, stored: StoredTransitions) -> PathBuf {
            path(self.folder.path(), stored.file)
        }

        /// The replay buffer of a run that is resumed from a checkpoint, and its file.
        fn read(&self, stored: StoredTransitions) -> Result<(Replay, ReplayFile), CheckpointError> {
            let mut replay = Replay::new(CAPACITY, WIDTHS);
            let file = ReplayFile::read(self.folder.path().to_owned(), stored, &mut replay)?;
            Ok((replay, file))
        }

        fn error(&self, stored: StoredTransitions) -> String {
            match self.read(stored) {
                Ok(_) => panic!("a damaged file is read"),
                Err(error) => error.to_string(),
            }
        }
    }

    /// The second checkpoint adds three transitions. A byte of the first two that is changed in
    /// the meantime stays changed, so they are not written again.
    #[test]
    fn a_checkpoint_writes_new_transitions_only() {
        let mut run = TestRun::new();
        let first = run.play_and_store(2, 0.5);
        let path = run.path(first);
        let mut bytes = fs::read(&path).unwrap();
        assert_eq!(bytes.len(), 2 * run.replay.encoded_length());
        bytes[0] ^= 1;
        fs::write(&path, &bytes).unwrap();
        let second = run.play_and_store(3, 0.25);
        assert_eq!((second.file, second.count), (first.file, 5));
        let longer = fs::read(&path).unwrap();
        assert_eq!(longer.len(), 5 * run.replay.encoded_length());
        assert_eq!(longer[..bytes.len()], bytes);
    }

    /// Every checkpoint gives the replay buffer as it was, also when old transitions are replaced,
    /// and a file of a run that was resumed after any of them continues in the same way.
    #[test]
    fn resumed_runs_continue_with_the_same_files() {
        for resumed_after in 0..6 {
            let (mut run, mut resumed) = (TestRun::new(), TestRun::new());
            for (number, steps) in [4, 5, 0, 7, 3, 25, 9].into_iter().enumerate() {
                let stored = run.play_and_store(steps, number as f32);
                let stored_by_resumed = resumed.play_and_store(steps, number as f32);
                assert_eq!(stored_by_resumed, stored);
                assert_eq!(run.read(stored).unwrap().0, run.replay);
                if number == resumed_after {
                    (resumed.replay, resumed.file) = resumed.read(stored).unwrap();
                }
            }
        }
    }

    /// With checkpoints after every four transitions, a new file begins whenever the old one would have
    /// more transitions that have left the buffer than it has in the buffer.
    #[test]
    fn files_have_at_most_twice_the_transitions_of_the_buffer() {
        let mut run = TestRun::new();
        let (mut counts, mut file_counts) = (Vec::new(), Vec::new());
        for _ in 0..8 {
            let stored = run.play_and_store(4, 0.0);
            counts.push(stored.count);
            let files = fs::read_dir(run.folder.path()).unwrap().count();
            file_counts.push(files);
        }
        assert_eq!(counts, [4, 8, 12, 16, 20, 10, 14, 18]);
        // The checkpoint before the newest still needs the earlier file once.
        assert_eq!(file_counts, [1, 1, 1, 1, 1, 2, 1, 1]);
    }

    /// A crash while transitions are appended leaves bytes that the newest checkpoint ignores and
    /// the resumed run replaces.
    #[test]
    fn bytes_of_an_unfinished_checkpoint_are_replaced() {
        let mut run = TestRun::new();
        let stored = run.play_and_store(4, 0.0);
        let replay = run.replay.clone();
        run.play(3, 9.0);
        run.file.write(&run.replay).unwrap();
        (run.replay, run.file) = run.read(stored).unwrap();
        assert_eq!(run.replay, replay);
        let stored = run.play_and_store(1, 2.0);
        assert_eq!(stored.count, 5);
        assert_eq!(run.read(stored).unwrap().0, run.replay);
    }

    #[test]
    fn damaged_files_are_refused() {
        let mut run = TestRun::new();
        let stored = run.play_and_store(4, 0.0);
        let path = run.path(stored);
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        let length = bytes.len();
        let too_short = format!("is too short: it has {} of {length} bytes", length - 1);
        assert!(
            run.error(stored).ends_with(&too_short),
            "{}",
            run.error(stored)
        );
        let mut changed = bytes.clone();
        changed[5] ^= 1;
        fs::write(&path, &changed).unwrap();
        assert!(
            run.error(stored).contains("is damaged"),
            "{}",
            run.error(stored)
        );
        fs::write(&path, &bytes).unwrap();
        assert!(run.read(stored).is_ok());
        fs::remove_file(&path).unwrap();
        assert!(
            run.error(stored).contains("replay-1.bin"),
            "{}",
            run.error(stored)
        );
    }
}
