//! Files that cannot be read or written, and files that are written in place of earlier ones.

use std::path::PathBuf;

use serde::Serialize;

use crate::storage::files;

/// Error: a file in the folder of a study cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct FileError {
    /// Path of the file.
    pub path: PathBuf,
    /// Reason, such as an error of the operating system.
    pub reason: String,
}

/// A value as JSON for readers, with a line break at the end.
pub(in crate::study) fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).expect("plain data always serializes") + "\n"
}

/// Writes a file in place of an earlier one.
pub(in crate::study) fn replace_file(path: PathBuf, bytes: &[u8]) -> Result<(), FileError> {
    files::replace(&path, bytes).map_err(|error| FileError {
        path,
        reason: error.to_string(),
    })
}
