//! Files whose content is not complete yet. They are removed when a command fails and when a signal ends the
//! process, which runs no destructors.

use std::ffi::OsString;
use std::fs;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// All such files of this process.
static INCOMPLETE: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file that is removed if it still has this path when this is dropped, or when a signal ends the process.
#[derive(Debug)]
pub struct Incomplete {
    path: PathBuf,
}

impl Incomplete {
    /// The file of a recording while it is written: `path` is that of the complete one.
    #[must_use]
    pub fn recording(path: &Path) -> Self {
        let mut part = OsString::from(path);
        part.push(".part");
        let path = PathBuf::from(part);
        all().push(path.clone());
        Self { path }
    }

    /// The file that `make` makes, and its path. No signal ends the process in between.
    pub(super) fn make<T>(
        make: impl FnOnce() -> std::io::Result<T>,
        path: impl FnOnce(&T) -> &Path,
    ) -> std::io::Result<(T, Self)> {
        let mut all = all();
        let file = make()?;
        let path = path(&file).to_owned();
        all.push(path.clone());
        Ok((file, Self { path }))
    }
}

impl Drop for Incomplete {
    fn drop(&mut self) {
        let mut all = all();
        if self.path.exists() {
            let _ = fs::remove_file(&self.path);
        }
        all.retain(|path| *path != self.path);
    }
}

/// Removes all incomplete files of this process, which must end now: it can make no other ones.
pub fn remove_all_before_exit() {
    let all = all();
    for path in all.iter() {
        let _ = fs::remove_file(path);
    }
    mem::forget(all);
}

fn all() -> MutexGuard<'static, Vec<PathBuf>> {
    INCOMPLETE.lock().unwrap_or_else(PoisonError::into_inner)
}
