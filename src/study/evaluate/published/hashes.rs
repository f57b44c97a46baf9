//! The hashes of published results: those that were written with them, and those of the submission that
//! they are part of. They show damage and careless changes. Who changes results on purpose can write
//! other hashes, too; that is found when runs are repeated.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use crate::storage::hashes::sha256;
use crate::study::evaluate::results::ResultsError;
use seedbed_input::limits::{MAX_SMALL_FILE_BYTES, MAX_TABLE_BYTES, read_bytes};

/// Name of the description of a submission, in its directory.
pub(in crate::study) const SUBMISSION: &str = "submission.json";

/// What is read of the description of a submission, and of the builds of published results.
#[derive(Deserialize)]
struct Listed {
    #[serde(default)]
    sha256: BTreeMap<String, String>,
}

/// The paths and SHA-256 that the builds of published results and the description of a submission in
/// `folder` list, as far as they can be read.
pub(crate) fn listed_hashes(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut listed = Vec::new();
    for name in [super::BUILDS, SUBMISSION] {
        let bytes = read_bytes(&folder.join(name), MAX_SMALL_FILE_BYTES).unwrap_or_default();
        if let Ok(Listed { sha256 }) = serde_json::from_slice(&bytes) {
            let sums = sha256.into_iter();
            listed.extend(sums.map(|(name, sha256)| (folder.join(name), sha256)));
        }
    }
    listed
}

/// Checks all files of the submission that a directory with results is part of, if it is part of one.
pub(super) fn check_submission(folder: &Path) -> Result<(), ResultsError> {
    let Ok(folder) = folder.canonicalize() else {
        return Ok(());
    };
    let found = folder
        .ancestors()
        .find(|root| root.join(SUBMISSION).exists());
    let Some(root) = found else {
        return Ok(());
    };
    let path = root.join(SUBMISSION);
    let error = |message: String| table_error(&path, message);
    let bytes = read_bytes(&path, MAX_SMALL_FILE_BYTES).map_err(|e| error(e.to_string()))?;
    let submission: Listed = serde_json::from_slice(&bytes)
        .map_err(|e| error(format!("expected the description of a submission: {e}")))?;
    let contains = |name: &Path| {
        let place = folder.strip_prefix(root).unwrap_or(&folder).join(name);
        let place: Vec<_> = place.iter().map(|part| part.to_string_lossy()).collect();
        submission.sha256.contains_key(&place.join("/"))
    };
    // A directory above the results may have another submission, such as one that was unpacked there.
    if !contains(Path::new(super::TABLE)) && !contains(Path::new(super::MANIFEST)) {
        return Ok(());
    }
    check_files(root, &submission.sha256, &path)
}

/// Checks that the files in a directory have these hashes, which are those in the file at `listed`.
pub(super) fn check_files(
    root: &Path,
    sha256_of: &BTreeMap<String, String>,
    listed: &Path,
) -> Result<(), ResultsError> {
    for (name, expected) in sha256_of {
        let relative = PathBuf::from(name);
        let is_within = relative
            .components()
            .all(|part| matches!(part, Component::Normal(_)));
        if !is_within {
            let message = format!("expected paths of files in its directory, found `{name}`");
            return Err(table_error(listed, message));
        }
        let path = root.join(&relative);
        let bytes = read_bytes(&path, MAX_TABLE_BYTES);
        let bytes = bytes.map_err(|error| table_error(&path, error.to_string()))?;
        if sha256(&bytes) != *expected {
            let message = format!(
                "is damaged, or was changed after it was written: its SHA-256 is not that in {}",
                listed.display()
            );
            return Err(table_error(&path, message));
        }
    }
    Ok(())
}

fn table_error(path: &Path, message: String) -> ResultsError {
    ResultsError::Table {
        path: path.to_owned(),
        line: None,
        message,
    }
}
