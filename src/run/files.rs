//! Atomic replacement of files: after a crash a file has either its old or its new content.

use std::fs::{self, File};
use std::io::{Result, Write};
use std::path::Path;

/// Replaces the file at `path`, and creates its folder if necessary.
///
/// # Errors
/// The operating system reports an error; then the old file is kept.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let part_path = path.with_added_extension("part");
    let written = write(&part_path, bytes).and_then(|()| fs::rename(&part_path, path));
    if written.is_err() {
        // Only the first error is reported.
        let _ = fs::remove_file(&part_path);
    }
    written?;
    sync_folder_of(path)
}

/// Syncs the folder of a file. Only then a new name is certain to exist after a crash.
///
/// # Errors
/// The operating system reports an error.
pub fn sync_folder_of(path: &Path) -> Result<()> {
    path.parent()
        .filter(|folder| !folder.as_os_str().is_empty())
        .map_or(Ok(()), |folder| File::open(folder)?.sync_all())
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    file.sync_all()
}
