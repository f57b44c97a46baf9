//! Takes what is whole out of a damaged recording, run or study, and writes it to a new place.
//!
//! A file is kept if its checksum is right, and if others of its kind have none. Of files of visited states
//! the whole episodes are kept, of recordings everything before the first damage. Files of which a damaged
//! list says nothing certain are kept, but not listed again: the new `SHA256SUMS` has only files that are as
//! their run wrote them. The source is not changed.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::record::recording::whole_length;
use crate::record::state_files::{StateFiles, salvage as salvage_states};
use crate::run::folder::RunFolder;
use crate::run::folder::checkpoint;
use crate::run::folder::checksums::{Checksums, DamagedFile, FILE_NAME, NewChecksums};
use crate::run::folder::is_state_file;
use crate::storage::files;
use crate::storage::hashes::sha256;
use crate::study::evaluate::published;
use crate::study::store::StudyFolder;
use crate::study::store::result_file::StoredRun;
use crate::text::pluralize;
use seedbed_input::limits::{MAX_LARGE_FILE_BYTES, MAX_SMALL_FILE_BYTES, read_bytes};

/// What became of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It is whole.
    Kept,
    /// A part of it is kept; what is lost, for people.
    Cut(String),
    /// It is kept, but may be damaged; why, for people.
    Unverified(String),
    /// It is lost, and why.
    Lost(String),
}

/// A file of the source, and what became of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SalvagedFile {
    /// Its path.
    pub path: PathBuf,
    /// What became of it.
    pub fate: Fate,
}

/// Maximum number of directories in each other.
const MAX_DEPTH: usize = 8;

/// Takes what is whole out of the file or the directory `from`, and writes it to `to`, which does not
/// exist. Returns what became of each file.
///
/// # Errors
/// A file cannot be written, or the directory cannot be read.
pub fn salvage(from: &Path, to: &Path) -> io::Result<Vec<SalvagedFile>> {
    let mut salvaged = Vec::new();
    if from.is_dir() {
        salvage_folder(from, to, MAX_DEPTH, &Sums::new(), &mut salvaged)?;
    } else {
        salvaged.push(salvage_file(from, to, None)?);
    }
    Ok(salvaged)
}

fn salvage_folder(
    from: &Path,
    to: &Path,
    depth: usize,
    inherited: &Sums,
    salvaged: &mut Vec<SalvagedFile>,
) -> io::Result<()> {
    let mut entries: Vec<fs::DirEntry> = fs::read_dir(from)?.collect::<io::Result<_>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    let known = KnownSums::of(from, inherited);
    salvaged.extend(known.damaged_list());
    for entry in entries {
        let (path, kind) = (entry.path(), entry.file_type()?);
        let target = to.join(entry.file_name());
        if kind.is_dir() && depth > 0 {
            salvage_folder(&path, &target, depth - 1, &known.listed, salvaged)?;
        } else if !kind.is_file() {
            let fate = Fate::Lost("is no regular file".to_owned());
            salvaged.push(SalvagedFile { path, fate });
        } else if !is_made_again(&path) {
            salvaged.push(salvage_file(&path, &target, Some(&known))?);
        }
    }
    remove_untrue_summary(from, to, salvaged)?;
    write_checksums(to, from, &known, salvaged)
}

/// Removes the summary of files of visited states that have lost episodes.
fn remove_untrue_summary(from: &Path, to: &Path, salvaged: &mut [SalvagedFile]) -> io::Result<()> {
    let (of_source, of_target) = (RunFolder::new(from), RunFolder::new(to));
    let is_true = !of_target.has_state_files() || StateFiles::open_folder(to).is_ok();
    if is_true || !of_target.summary_file().is_file() {
        return Ok(());
    }
    files::remove_if_exists(&of_target.summary_file())?;
    let mut found = salvaged.iter_mut();
    if let Some(file) = found.find(|file| file.path == of_source.summary_file()) {
        file.fate = Fate::Lost("other episodes than in it are left".to_owned());
    }
    Ok(())
}

/// Whether a file is written again or belongs to a process.
fn is_made_again(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    name == FILE_NAME || name == ".lock"
}

/// SHA-256 of files by their paths.
type Sums = BTreeMap<PathBuf, ListedSum>;

#[derive(Clone)]
struct ListedSum {
    sha256: String,
    /// Whether the list is whole. An equal sum in a damaged list shows that a file is whole all the same.
    is_certain: bool,
}

/// Checksums of the files in a folder, as far as they can be read.
struct KnownSums {
    /// Those of this folder and of the folders that it is in.
    listed: Sums,
    checksums: Result<Checksums, DamagedFile>,
}

/// What is known of the contents of a file.
enum Contents {
    /// Nothing says that they are damaged.
    Right,
    /// They are damaged, and why.
    Damaged(String),
    /// They may be damaged, and why.
    Uncertain(String),
}

impl KnownSums {
    fn of(folder: &Path, inherited: &Sums) -> Self {
        let run = RunFolder::new(folder);
        let mut known = Self {
            listed: inherited.clone(),
            checksums: Checksums::read(&run),
        };
        let text = read_bytes(&run.checksums_file(), MAX_SMALL_FILE_BYTES).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let lines = text.lines().filter_map(|line| line.split_once("  "));
        let is_certain = known.checksums.is_ok();
        lines.for_each(|(sha256, name)| known.add(folder.join(name), sha256, is_certain));
        for (path, sha256) in published::listed_hashes(folder) {
            known.add(path, &sha256, true);
        }
        known
    }

    fn add(&mut self, path: PathBuf, sha256: &str, is_certain: bool) {
        let sha256 = sha256.to_owned();
        self.listed.insert(path, ListedSum { sha256, is_certain });
    }

    /// The list of the folder, if it is damaged.
    fn damaged_list(&self) -> Option<SalvagedFile> {
        let error = self.checksums.as_ref().err()?;
        let fate = Fate::Cut(format!(
            "{}; sums that are those of files are kept",
            error.reason
        ));
        let path = error.path.clone();
        Some(SalvagedFile { path, fate })
    }

    fn contents(&self, path: &Path, bytes: &[u8]) -> Contents {
        match (self.listed.get(path), &self.checksums) {
            (Some(sum), _) if sum.sha256 == sha256(bytes) => Contents::Right,
            (Some(sum), _) if sum.is_certain => {
                Contents::Damaged("its SHA-256 is not the listed one".to_owned())
            }
            (_, Err(_)) | (Some(_), _) => Contents::Uncertain(format!(
                "{FILE_NAME} is damaged and does not have its SHA-256"
            )),
            (None, Ok(checksums)) => Self::growing(checksums, path),
        }
    }

    /// Of a file that no list has, in a run that may be in progress.
    fn growing(checksums: &Checksums, path: &Path) -> Contents {
        match checksums.verify(path) {
            Ok(()) => Contents::Right,
            Err(error) if error.path == path => Contents::Damaged(error.reason),
            Err(checkpoint) => Contents::Uncertain(checkpoint.to_string()),
        }
    }
}

fn salvage_file(path: &Path, target: &Path, known: Option<&KnownSums>) -> io::Result<SalvagedFile> {
    let fate = match read_bytes(path, MAX_LARGE_FILE_BYTES) {
        Err(error) => Fate::Lost(error.to_string()),
        Ok(bytes) => {
            let contents = known.map(|known| known.contents(path, &bytes));
            salvage_bytes(path, target, &bytes, contents.unwrap_or(Contents::Right))?
        }
    };
    let path = path.to_owned();
    Ok(SalvagedFile { path, fate })
}

fn salvage_bytes(path: &Path, target: &Path, bytes: &[u8], contents: Contents) -> io::Result<Fate> {
    if is_state_file(path) {
        return states_of(path, target, contents);
    }
    let extension = path.extension().and_then(|extension| extension.to_str());
    let is_recording = path.to_string_lossy().contains(".rrd");
    if is_recording && matches!(extension, Some("rrd" | "part")) {
        return recording_of(path, target, bytes, contents);
    }
    if let Some(reason) = own_damage(path, bytes) {
        return Ok(Fate::Lost(reason));
    }
    let fate = match contents {
        Contents::Damaged(reason) => return Ok(Fate::Lost(reason)),
        Contents::Uncertain(reason) => Fate::Unverified(reason),
        Contents::Right => Fate::Kept,
    };
    files::replace(target, bytes)?;
    Ok(fate)
}

/// Why a file that has a checksum of its own is not whole.
fn own_damage(path: &Path, bytes: &[u8]) -> Option<String> {
    if path.extension().is_some_and(|extension| extension == "run") {
        let is_whole = StoredRun::from_bytes(bytes).is_some();
        (!is_whole).then(|| "its checksum is wrong".to_owned())
    } else if path.ends_with("study.json") {
        let folder = StudyFolder::new(path.parent().unwrap_or(Path::new("")));
        folder.manifest().err().map(|error| error.reason)
    } else if checkpoint::is_checkpoint(path) {
        checkpoint::damage(bytes)
    } else {
        None
    }
}

/// The whole episodes of a file of visited states.
fn states_of(path: &Path, target: &Path, contents: Contents) -> io::Result<Fate> {
    let Some(states) = salvage_states(path)? else {
        let reason = "its header is damaged, which says what the numbers are";
        return Ok(Fate::Lost(reason.to_owned()));
    };
    files::replace(target, &states.bytes)?;
    if states.lost_bytes == 0 && states.lost_episodes() == 0 {
        return Ok(match contents {
            Contents::Right => Fate::Kept,
            Contents::Damaged(reason) | Contents::Uncertain(reason) => Fate::Unverified(reason),
        });
    }
    let last = states.episodes.last().map_or(0, |last| last + 1);
    let lost: Vec<String> = (0..last)
        .filter(|episode| states.episodes.binary_search(episode).is_err())
        .map(|episode| episode.to_string())
        .take(10)
        .collect();
    let whole = pluralize(states.episodes.len(), "whole episode");
    let lost_bytes = pluralize(states.lost_bytes, "byte");
    let lost_episodes = pluralize(states.lost_episodes() as usize, "episode");
    Ok(Fate::Cut(format!(
        "{whole}, numbered again from 0; {lost_bytes} lost, and {lost_episodes} before the last whole one{}",
        if lost.is_empty() {
            String::new()
        } else {
            format!(": {}", lost.join(", "))
        }
    )))
}

/// What precedes the first damage in a recording. If it is damaged, it does not get the name of a whole
/// recording.
fn recording_of(path: &Path, target: &Path, bytes: &[u8], contents: Contents) -> io::Result<Fate> {
    let (messages, length) = match whole_length(path) {
        Ok(whole) => whole,
        Err(error) => return Ok(Fate::Lost(error.to_string())),
    };
    let length = (length as usize).min(bytes.len());
    if messages == 0 {
        return Ok(Fate::Lost("no message is whole".to_owned()));
    }
    let (target, fate) = if length < bytes.len() {
        let lost = format!(
            "{length} of {} bytes, {messages} messages before the first damage; a recording has no checksums of \
             its parts, so that earlier changes can remain",
            bytes.len()
        );
        (unfinished(target), Fate::Cut(lost))
    } else {
        match contents {
            Contents::Right => (target.to_owned(), Fate::Kept),
            Contents::Uncertain(reason) => (target.to_owned(), Fate::Unverified(reason)),
            Contents::Damaged(reason) => (
                unfinished(target),
                Fate::Unverified(format!(
                    "{reason}; all {messages} messages can be read, but numbers in them are wrong"
                )),
            ),
        }
    };
    files::replace(&target, &bytes[..length])?;
    Ok(fate)
}

/// The path of a recording that is not whole.
fn unfinished(recording: &Path) -> PathBuf {
    if recording
        .extension()
        .is_some_and(|extension| extension == "part")
    {
        recording.to_owned()
    } else {
        recording.with_added_extension("part")
    }
}

/// Writes the checksums of those files of a run that its list has and that are whole.
fn write_checksums(
    to: &Path,
    from: &Path,
    known: &KnownSums,
    salvaged: &[SalvagedFile],
) -> io::Result<()> {
    if !from.join(FILE_NAME).exists() {
        return Ok(());
    }
    let run = RunFolder::new(to);
    let mut sums = NewChecksums::default();
    let is_whole =
        |file: &&SalvagedFile| file.fate == Fate::Kept && known.listed.contains_key(&file.path);
    for file in salvaged.iter().filter(is_whole) {
        if let Ok(name) = file.path.strip_prefix(from) {
            sums.add_file(&run, &to.join(name))?;
        }
    }
    fs::create_dir_all(to)?;
    sums.write(&run)
}
