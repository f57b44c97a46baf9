//! The checksums of a run's files: `SHA256SUMS`. Everything that computes numbers from a file verifies
//! it first, so that a damaged file never yields a number.
//!
//! The scenario and the copy of the task are listed from the beginning of a run, all results when it is
//! finished. While it is in progress, its growing files are verified as far as the newest checkpoint
//! describes them. The file has the format of `sha256sum`, and ends with a comment that has the
//! checksum of the lines before it.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use super::RunFolder;
use super::checkpoint::{Checkpoint, CheckpointError};
pub use super::run_folder::CHECKSUMS_NAME as FILE_NAME;
use crate::storage::files;
use crate::storage::hashes::{sha256, sha256_of_file};
use crate::storage::written::WrittenFile;
use seedbed_input::InputError;
use seedbed_input::limits::{MAX_SMALL_FILE_BYTES, read_bytes};

/// Beginning of the last line, before the checksum of all lines before it.
const END: &str = "# SHA-256 of the lines above: ";

/// Beginning of the first line.
const TITLE: &str = "# SHA-256 of files of this run: sha256sum --check SHA256SUMS\n";

/// A file is damaged, or was changed after it was written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct DamagedFile {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub reason: String,
}

/// Checksums to be written: names of files and hexadecimal digits.
#[derive(Clone, Debug, Default)]
pub struct NewChecksums {
    sums: BTreeMap<String, String>,
}

/// What is known of the files in the folder of a run when it is read.
#[derive(Clone, Debug)]
pub struct Checksums {
    folder: PathBuf,
    /// `None` if the folder has no `SHA256SUMS`.
    sums: Option<BTreeMap<String, String>>,
    /// Files of a run that is not finished, as its checkpoint describes them. It is read when it is
    /// needed.
    growing: OnceCell<Result<Vec<WrittenFile>, DamagedFile>>,
    warning: Option<String>,
}

impl NewChecksums {
    /// Adds a file in `folder` that has these contents.
    pub fn add(&mut self, folder: &RunFolder, path: &Path, contents: &[u8]) {
        self.sums
            .insert(name_in(folder.path(), path), sha256(contents));
    }

    /// Adds a file in `folder`, if it exists.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn add_file(&mut self, folder: &RunFolder, path: &Path) -> io::Result<()> {
        if path.is_file() {
            self.sums
                .insert(name_in(folder.path(), path), sha256_of_file(path)?);
        }
        Ok(())
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The operating system reports an error.
    pub fn write(&self, folder: &RunFolder) -> io::Result<()> {
        files::replace(&folder.checksums_file(), self.text().as_bytes())
    }

    fn text(&self) -> String {
        let mut text = TITLE.to_owned();
        for (name, sum) in &self.sums {
            text += &format!("{sum}  {name}\n");
        }
        let sum = sha256(&text);
        text + &format!("{END}{sum}\n")
    }
}

impl Checksums {
    /// Reads the checksums of the run in `folder`.
    ///
    /// # Errors
    /// They are damaged themselves, or cannot be read.
    pub fn read(folder: &RunFolder) -> Result<Self, DamagedFile> {
        let path = folder.checksums_file();
        let sums = match read_bytes(&path, MAX_SMALL_FILE_BYTES) {
            Ok(bytes) => Some(parse(&bytes).ok_or_else(|| damaged_checksums(&path))?),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => {
                let reason = error.to_string();
                return Err(DamagedFile { path, reason });
            }
        };
        let is_older =
            sums.is_none() && !folder.has_state_files() && folder.scenario_file().is_file();
        let warning = format!(
            "{} has no {FILE_NAME}: the files of this run cannot be verified",
            folder.path().display()
        );
        Ok(Self {
            folder: folder.path().to_owned(),
            sums,
            growing: OnceCell::new(),
            warning: is_older.then_some(warning),
        })
    }

    /// That files cannot be verified, for people.
    #[must_use]
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// Checks that the file at `path` has the bytes with which it was written, as far as they are
    /// known.
    ///
    /// # Errors
    /// It has others, or cannot be read. The run is not finished and its checkpoint is damaged.
    pub fn verify(&self, path: &Path) -> Result<(), DamagedFile> {
        if self.verify_listed(path)? {
            return Ok(());
        }
        let growing = self.growing()?;
        match growing.iter().find(|file| is_same_file(&file.path, path)) {
            Some(file) => file.written.check(path).map_err(|error| DamagedFile {
                path: path.to_owned(),
                reason: error.to_string(),
            }),
            None => Ok(()),
        }
    }

    /// Checks a file if it is in `SHA256SUMS`, and returns whether it is.
    fn verify_listed(&self, path: &Path) -> Result<bool, DamagedFile> {
        let damaged = |reason: String| DamagedFile {
            path: path.to_owned(),
            reason,
        };
        let sums = self.sums.as_ref();
        let Some(expected) = sums.and_then(|sums| sums.get(&name_in(&self.folder, path))) else {
            return Ok(false);
        };
        let found = sha256_of_file(path).map_err(|error| damaged(error.to_string()))?;
        if found == *expected {
            Ok(true)
        } else {
            Err(damaged(self.changed_reason()))
        }
    }

    fn growing(&self) -> Result<&[WrittenFile], DamagedFile> {
        let read = || {
            if RunFolder::new(&self.folder).summary_file().is_file() {
                return Ok(Vec::new());
            }
            Ok(Checkpoint::written_files(&self.folder)?.unwrap_or_default())
        };
        let growing = self.growing.get_or_init(read).as_ref();
        growing.map(Vec::as_slice).map_err(Clone::clone)
    }

    /// Checks the scenario and the copies of tasks.
    ///
    /// # Errors
    /// One of them is missing, was changed or is damaged.
    pub fn verify_scenario(&self) -> Result<(), DamagedFile> {
        let folder = RunFolder::new(&self.folder);
        self.verify_listed(&folder.scenario_file())?;
        let names = self.sums.iter().flat_map(BTreeMap::keys);
        names
            .map(|name| self.folder.join(name))
            .filter(|path| folder.is_task_file(path))
            .try_for_each(|path| self.verify_listed(&path).map(drop))
    }

    /// Checks that a file exists if it is listed: without it, the run would be taken for another one.
    ///
    /// # Errors
    /// It is missing.
    pub fn check_presence(&self, path: &Path) -> Result<(), DamagedFile> {
        let sums = self.sums.as_ref();
        let is_listed = sums.is_some_and(|sums| sums.contains_key(&name_in(&self.folder, path)));
        if !is_listed || path.is_file() {
            return Ok(());
        }
        let list = self.folder.join(FILE_NAME);
        Err(DamagedFile {
            path: path.to_owned(),
            reason: format!("no such file, although {} lists it", list.display()),
        })
    }

    /// That a file of a finished run is not listed, so that it may be damaged, for people.
    #[must_use]
    pub fn unlisted_warning(&self, path: &Path) -> Option<String> {
        let sums = self.sums.as_ref()?;
        let is_finished = sums.contains_key("summary.json");
        (is_finished && !sums.contains_key(&name_in(&self.folder, path))).then(|| {
            format!(
                "{} is not in {FILE_NAME} of its run: it cannot be verified",
                path.display()
            )
        })
    }

    fn changed_reason(&self) -> String {
        format!(
            "is damaged, or was changed after the run wrote it: its SHA-256 is not that in {0}; to use it as it is, \
             delete {0}",
            self.folder.join(FILE_NAME).display()
        )
    }
}

impl From<CheckpointError> for DamagedFile {
    fn from(error: CheckpointError) -> Self {
        Self {
            path: error.path,
            reason: error.reason,
        }
    }
}

impl From<DamagedFile> for InputError {
    fn from(error: DamagedFile) -> Self {
        Self::about(error.path.display().to_string(), error.reason)
    }
}

/// A recording gets its final name when it is complete; until then, the checkpoint has its first name.
fn is_same_file(in_checkpoint: &Path, path: &Path) -> bool {
    in_checkpoint.file_name() == path.file_name()
        || in_checkpoint.file_name() == path.with_added_extension("part").file_name()
}

/// Path of a file relative to the folder of its run, as `sha256sum` expects it.
fn name_in(folder: &Path, path: &Path) -> String {
    let name = path.strip_prefix(folder).unwrap_or(path);
    let parts = name.iter().map(|part| part.to_string_lossy());
    parts.collect::<Vec<_>>().join("/")
}

fn damaged_checksums(path: &Path) -> DamagedFile {
    DamagedFile {
        path: path.to_owned(),
        reason: "is damaged: its last line is not the checksum of the lines before it".to_owned(),
    }
}

/// The checksums of a file; `None` if it is damaged.
fn parse(bytes: &[u8]) -> Option<BTreeMap<String, String>> {
    let text = std::str::from_utf8(bytes).ok()?;
    let end = text.rfind(END)?;
    let (lines, last) = text.split_at(end);
    if last.strip_prefix(END)?.strip_suffix('\n')? != sha256(lines) {
        return None;
    }
    let lines = lines.lines().filter(|line| !line.starts_with('#'));
    let entry = |line: &str| {
        let (sum, name) = line.split_once("  ")?;
        Some((name.to_owned(), sum.to_owned()))
    };
    lines.map(entry).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// A finished run with a single table.
    fn folder_with_checksums(folder: &Path) -> RunFolder {
        let run = RunFolder::new(folder);
        fs::write(run.summary_file(), "{}").unwrap();
        fs::write(folder.join("episodes.csv"), "abc").unwrap();
        let mut sums = NewChecksums::default();
        sums.add(&run, &run.summary_file(), b"{}");
        sums.add_file(&run, &folder.join("episodes.csv")).unwrap();
        sums.add_file(&run, &run.recording_file()).unwrap();
        sums.write(&run).unwrap();
        run
    }

    /// The hash of `abc` is that of FIPS 180-4.
    #[test]
    fn files_are_listed_as_by_sha256sum() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder_with_checksums(folder.path());
        let text = fs::read_to_string(run.checksums_file()).unwrap();
        let table =
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  episodes.csv\n";
        assert!(text.contains(table), "{text}");
        assert_eq!(text.lines().count(), 4);
    }

    #[test]
    fn every_changed_bit_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder_with_checksums(folder.path());
        let table = folder.path().join("episodes.csv");
        Checksums::read(&run).unwrap().verify(&table).unwrap();
        for bit in 0..24 {
            let mut bytes = *b"abc";
            bytes[bit / 8] ^= 1 << (bit % 8);
            fs::write(&table, bytes).unwrap();
            let error = Checksums::read(&run).unwrap().verify(&table).unwrap_err();
            assert_eq!(error.path, table);
        }
        let bytes = fs::read(run.checksums_file()).unwrap();
        for bit in 0..8 * bytes.len() {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            fs::write(run.checksums_file(), changed).unwrap();
            let error = Checksums::read(&run).unwrap_err();
            assert_eq!(error.path, run.checksums_file(), "bit {bit}");
        }
    }

    #[test]
    fn files_that_are_listed_must_exist() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder_with_checksums(folder.path());
        for path in [run.summary_file(), folder.path().join("episodes.csv")] {
            fs::remove_file(&path).unwrap();
            let error = Checksums::read(&run).unwrap().check_presence(&path);
            assert_eq!(error.unwrap_err().path, path);
        }
        let unlisted = Checksums::read(&run).unwrap();
        unlisted.check_presence(&run.recording_file()).unwrap();
    }

    #[test]
    fn files_that_are_not_listed_are_accepted() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder_with_checksums(folder.path());
        fs::write(run.replay_file(), "replay").unwrap();
        let checksums = Checksums::read(&run).unwrap();
        checksums.verify(&run.replay_file()).unwrap();
        assert_eq!(checksums.warning(), None);
    }

    #[test]
    fn runs_of_earlier_versions_are_a_warning() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder_with_checksums(folder.path());
        fs::write(run.scenario_file(), "()").unwrap();
        fs::remove_file(run.checksums_file()).unwrap();
        let checksums = Checksums::read(&run).unwrap();
        checksums.verify(&run.summary_file()).unwrap();
        let warning = checksums.warning().unwrap();
        assert!(warning.contains("has no SHA256SUMS"), "{warning}");
    }
}
