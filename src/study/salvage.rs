//! Takes what is whole out of a damaged recording, run or study, and writes it to a new place.
//!
//! A file is kept if its checksum is right, and if others of its kind have none. Of files of visited states
//! the whole episodes are kept, of recordings everything before the first damage. The source is not changed.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::result_file::StoredRun;
use super::store::StudyFolder;
use crate::record::recording::whole_length;
use crate::record::state_files::{StateFiles, salvage as salvage_states};
use crate::run::checksums::{Checksums, FILE_NAME, NewChecksums, sha256};
use crate::run::files;
use crate::run::folder::RunFolder;
use crate::text::pluralize;
use seedbed_env::input::limits::{MAX_LARGE_FILE_BYTES, MAX_SMALL_FILE_BYTES, read_bytes};

/// What became of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It is whole.
    Kept,
    /// A part of it is kept; what is lost, for people.
    Cut(String),
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
        salvage_folder(from, to, MAX_DEPTH, &mut salvaged)?;
    } else {
        salvaged.push(salvage_file(from, to, None)?);
    }
    Ok(salvaged)
}

fn salvage_folder(
    from: &Path,
    to: &Path,
    depth: usize,
    salvaged: &mut Vec<SalvagedFile>,
) -> io::Result<()> {
    let mut entries: Vec<fs::DirEntry> = fs::read_dir(from)?.collect::<io::Result<_>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    let known = KnownSums::of(from);
    for entry in entries {
        let (path, kind) = (entry.path(), entry.file_type()?);
        let target = to.join(entry.file_name());
        if kind.is_dir() && depth > 0 && !known.lists_folder(&path) {
            salvage_folder(&path, &target, depth - 1, salvaged)?;
        } else if kind.is_dir() && depth > 0 {
            salvage_listed_folder(&path, &target, &known, salvaged)?;
        } else if !kind.is_file() {
            let fate = Fate::Lost("is no regular file".to_owned());
            salvaged.push(SalvagedFile { path, fate });
        } else if !is_made_again(&path) {
            salvaged.push(salvage_file(&path, &target, Some(&known))?);
        }
    }
    remove_untrue_summary(from, to, salvaged)?;
    write_checksums(to, from, salvaged)
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

/// The files of a run in a folder of it, such as its tasks.
fn salvage_listed_folder(
    from: &Path,
    to: &Path,
    known: &KnownSums,
    salvaged: &mut Vec<SalvagedFile>,
) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        if entry.file_type()?.is_file() {
            let target = to.join(entry.file_name());
            salvaged.push(salvage_file(&entry.path(), &target, Some(known))?);
        }
    }
    Ok(())
}

/// Whether a file is written again or belongs to a process.
fn is_made_again(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    name == FILE_NAME || name == ".lock"
}

/// Checksums of the files in a folder, as far as they can be read.
struct KnownSums {
    folder: PathBuf,
    /// Sums by name, also from a damaged list: an equal sum shows that a file is whole all the same.
    listed: BTreeMap<String, String>,
    checksums: Option<Checksums>,
}

impl KnownSums {
    fn of(folder: &Path) -> Self {
        let run = RunFolder::new(folder);
        let text = read_bytes(&run.checksums_file(), MAX_SMALL_FILE_BYTES).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let entry = |line: &str| {
            let (sum, name) = line.split_once("  ")?;
            Some((name.to_owned(), sum.to_owned()))
        };
        Self {
            folder: folder.to_owned(),
            listed: text.lines().filter_map(entry).collect(),
            checksums: Checksums::read(&run).ok(),
        }
    }

    fn name_of(&self, path: &Path) -> String {
        let name = path.strip_prefix(&self.folder).unwrap_or(path);
        let parts = name.iter().map(|part| part.to_string_lossy());
        parts.collect::<Vec<_>>().join("/")
    }

    fn lists_folder(&self, path: &Path) -> bool {
        let prefix = self.name_of(path) + "/";
        self.listed.keys().any(|name| name.starts_with(&prefix))
    }

    /// Why a file is not whole; `None` if it is, or if no checksum of it is known.
    fn damage(&self, path: &Path, bytes: &[u8]) -> Option<String> {
        match (self.listed.get(&self.name_of(path)), &self.checksums) {
            (Some(sum), _) if *sum == sha256(bytes) => None,
            (Some(_), _) => Some("its SHA-256 is not the listed one".to_owned()),
            (None, Some(checksums)) => checksums.verify(path).err().map(|error| error.reason),
            (None, None) => Some(format!("{FILE_NAME} is damaged and does not list it")),
        }
    }
}

fn salvage_file(path: &Path, target: &Path, known: Option<&KnownSums>) -> io::Result<SalvagedFile> {
    let fate = match read_bytes(path, MAX_LARGE_FILE_BYTES) {
        Err(error) => Fate::Lost(error.to_string()),
        Ok(bytes) => {
            let damage = known.and_then(|known| known.damage(path, &bytes));
            salvage_bytes(path, target, &bytes, damage)?
        }
    };
    let path = path.to_owned();
    Ok(SalvagedFile { path, fate })
}

fn salvage_bytes(
    path: &Path,
    target: &Path,
    bytes: &[u8],
    damage: Option<String>,
) -> io::Result<Fate> {
    let extension = path.extension().and_then(|extension| extension.to_str());
    if StateFiles::is_state_file(path) {
        return states_of(path, target);
    }
    let is_recording = path.to_string_lossy().contains(".rrd");
    if is_recording && matches!(extension, Some("rrd" | "part")) {
        return recording_of(path, target, bytes);
    }
    let damage = match extension {
        Some("run") => StoredRun::from_bytes(bytes)
            .is_none()
            .then(|| "its checksum is wrong".to_owned()),
        Some("json") if path.ends_with("study.json") => {
            let folder = StudyFolder::new(path.parent().unwrap_or(Path::new("")));
            folder.manifest().err().map(|error| error.reason)
        }
        _ => damage,
    };
    if let Some(reason) = damage {
        return Ok(Fate::Lost(reason));
    }
    files::replace(target, bytes)?;
    Ok(Fate::Kept)
}

/// The whole episodes of a file of visited states.
fn states_of(path: &Path, target: &Path) -> io::Result<Fate> {
    let Some(states) = salvage_states(path)? else {
        let reason = "its header is damaged, which says what the numbers are";
        return Ok(Fate::Lost(reason.to_owned()));
    };
    files::replace(target, &states.bytes)?;
    if states.lost_bytes == 0 && states.lost_episodes() == 0 {
        return Ok(Fate::Kept);
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

/// What precedes the first damage in a recording.
fn recording_of(path: &Path, target: &Path, bytes: &[u8]) -> io::Result<Fate> {
    let (messages, length) = match whole_length(path) {
        Ok(whole) => whole,
        Err(error) => return Ok(Fate::Lost(error.to_string())),
    };
    let length = (length as usize).min(bytes.len());
    if messages == 0 {
        return Ok(Fate::Lost("no message is whole".to_owned()));
    }
    if length == bytes.len() {
        files::replace(target, bytes)?;
        return Ok(Fate::Kept);
    }
    let is_part = target
        .extension()
        .is_some_and(|extension| extension == "part");
    let target = if is_part {
        target.to_owned()
    } else {
        target.with_added_extension("part")
    };
    files::replace(&target, &bytes[..length])?;
    Ok(Fate::Cut(format!(
        "{length} of {} bytes, {messages} messages before the first damage; a recording has no checksums of \
         its parts, so that earlier changes can remain",
        bytes.len()
    )))
}

/// Writes the checksums of the files of a run that are whole.
fn write_checksums(to: &Path, from: &Path, salvaged: &[SalvagedFile]) -> io::Result<()> {
    if !from.join(FILE_NAME).exists() {
        return Ok(());
    }
    let run = RunFolder::new(to);
    let mut sums = NewChecksums::default();
    for file in salvaged.iter().filter(|file| file.fate == Fate::Kept) {
        if let Ok(name) = file.path.strip_prefix(from) {
            sums.add_file(&run, &to.join(name))?;
        }
    }
    fs::create_dir_all(to)?;
    sums.write(&run)
}
