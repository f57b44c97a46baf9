//! Reading files and looking for them.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::error::InputError;
use super::limits::{self, MAX_TEXT_BYTES};

/// Where task files, and the files that they extend, are read.
pub trait FileSource {
    /// Reads the text of the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read.
    fn read(&self, path: &Path) -> Result<String, InputError>;

    /// The folder in which names in the file at `path` are looked up.
    fn folder_of(&self, path: &Path) -> PathBuf {
        path.parent().unwrap_or(Path::new("")).to_owned()
    }

    /// Whether there is a file at `path`.
    fn is_file(&self, path: &Path) -> bool;

    /// Names, without `.ron`, of the RON files in `folder`, sorted.
    fn names_in(&self, folder: &Path) -> Vec<String>;
}

/// The file system.
#[derive(Clone, Copy, Debug)]
pub struct Disk;

impl FileSource for Disk {
    fn read(&self, path: &Path) -> Result<String, InputError> {
        read_text(path)
    }

    fn is_file(&self, path: &Path) -> bool {
        path.is_file()
    }

    fn names_in(&self, folder: &Path) -> Vec<String> {
        let folder = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries
            .map(|entry| entry.path())
            .filter(|path| is_ron(path))
            .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
            .collect();
        names.sort();
        names
    }
}

/// Reads the text of the file at `path`.
///
/// # Errors
/// The file cannot be read.
pub fn read_text(path: &Path) -> Result<String, InputError> {
    let file = limits::open_regular(path).map_err(|error| unreadable(path, &error))?;
    read_text_from(path, file)
}

/// Reads all text of `source`, which is named `path` in errors.
///
/// # Errors
/// The text cannot be read.
pub fn read_text_from(path: &Path, source: impl Read) -> Result<String, InputError> {
    let text = limits::text_of(source, MAX_TEXT_BYTES).map_err(|error| unreadable(path, &error))?;
    Ok(text.trim_start_matches('\u{feff}').to_owned())
}

/// The error that the file at `path` cannot be read.
#[must_use]
pub fn unreadable(path: &Path, error: &std::io::Error) -> InputError {
    InputError {
        origin: path.display().to_string(),
        position: None,
        field: String::new(),
        message: match error.kind() {
            ErrorKind::NotFound => "no such file".to_owned(),
            ErrorKind::IsADirectory => "expected a file, found a folder".to_owned(),
            ErrorKind::InvalidData => "expected a text file, found invalid UTF-8".to_owned(),
            _ => error.to_string(),
        },
        help: None,
    }
}

/// Whether the name of a file ends in `.ron`.
#[must_use]
pub fn is_ron(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "ron")
}

/// The folders named `folder` in `start` and its ancestors, nearest first.
#[must_use]
pub fn folders_upwards(start: &Path, folder: &str) -> Vec<PathBuf> {
    start
        .ancestors()
        .map(|ancestor| ancestor.join(folder))
        .filter(|path| path.is_dir())
        .collect()
}

/// The path of the nearest file `folder/name` in `start` or one of its ancestors.
#[must_use]
pub fn find_upwards(start: &Path, folder: &str, name: &str) -> Option<PathBuf> {
    start
        .ancestors()
        .map(|ancestor| ancestor.join(folder).join(name))
        .find(|path| path.is_file())
}
