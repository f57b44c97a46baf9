//! Reads `summary.json`.

use serde::de::DeserializeOwned;

use super::RunFolder;
use super::checksums::{Checksums, DamagedFile};
use crate::run::facts::Summary;
use seedbed_input::limits::{MAX_SMALL_FILE_BYTES, read_bytes};

impl Summary {
    /// The summary of the run in a folder; `None` if the run is not finished.
    ///
    /// # Errors
    /// The file is damaged or was changed after it was written, or cannot be read.
    pub fn read(folder: &RunFolder) -> Result<Option<Self>, DamagedFile> {
        read_verified(folder)
    }
}

/// Reads `summary.json` of the run in a folder, as far as `T` describes it. `None` if the run is not
/// finished.
///
/// # Errors
/// The file is damaged or was changed after it was written, or cannot be read.
pub(crate) fn read_verified<T: DeserializeOwned>(
    folder: &RunFolder,
) -> Result<Option<T>, DamagedFile> {
    let path = folder.summary_file();
    let checksums = Checksums::read(folder)?;
    checksums.check_presence(&path)?;
    if !path.is_file() {
        return Ok(None);
    }
    checksums.verify(&path)?;
    let bytes = read_bytes(&path, MAX_SMALL_FILE_BYTES).map_err(|error| error.to_string());
    let read =
        bytes.and_then(|bytes| serde_json::from_slice(&bytes).map_err(|error| error.to_string()));
    read.map(Some)
        .map_err(|reason| DamagedFile { path, reason })
}
