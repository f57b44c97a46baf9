//! Locks of files, which keep several processes from writing to one folder.

use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use super::files::cannot_remove;

/// A lock file that this process has locked. It is unlocked when dropped, and when the process ends.
#[derive(Debug)]
pub struct FileLock {
    file: File,
    path: PathBuf,
    is_effective: bool,
}

impl FileLock {
    /// Locks the file at `path`, and creates it if necessary. An `exclusive` lock is for one process;
    /// other locks can be held by several processes at once. `None` if a lock of another process
    /// conflicts. On a file system without locks, the lock has [no effect](Self::is_effective).
    ///
    /// # Errors
    /// The operating system reports an error.
    pub fn acquire(path: &Path, exclusive: bool) -> io::Result<Option<Self>> {
        let mut options = File::options();
        let file = options
            .create(true)
            .truncate(false)
            .write(true)
            .open(path)?;
        let result = if exclusive {
            file.try_lock()
        } else {
            file.try_lock_shared()
        };
        let is_effective = match result {
            Ok(()) => true,
            Err(TryLockError::WouldBlock) => return Ok(None),
            Err(TryLockError::Error(error)) if means_no_locks(&error) => false,
            Err(TryLockError::Error(error)) => return Err(error),
        };
        Ok(Some(Self {
            file,
            path: path.to_owned(),
            is_effective,
        }))
    }

    /// Whether another process is kept from locking the same file. False on file systems without
    /// locks, such as some of clusters.
    #[must_use]
    pub fn is_effective(&self) -> bool {
        self.is_effective
    }

    /// Unlocks the file and removes it.
    ///
    /// # Errors
    /// `cannot remove PATH: REASON`.
    pub fn remove(self) -> io::Result<()> {
        let mut removed = std::fs::remove_file(&self.path);
        if self.is_effective {
            removed = removed.and_then(|()| self.file.unlock());
        }
        removed.map_err(|error| cannot_remove(&self.path, &error))
    }
}

/// Whether the error is that a file system has no locks, or that its server of locks does not run.
fn means_no_locks(error: &io::Error) -> bool {
    const NO_LOCKS_AVAILABLE: i32 = 37;
    error.kind() == io::ErrorKind::Unsupported
        || (cfg!(target_os = "linux") && error.raw_os_error() == Some(NO_LOCKS_AVAILABLE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_lock_of_a_file_conflicts_unless_both_are_shared() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(".lock");
        let acquire = |exclusive| FileLock::acquire(&path, exclusive).unwrap();
        let shared = acquire(false).unwrap();
        assert!(shared.is_effective() && acquire(false).is_some() && acquire(true).is_none());
        drop(shared);
        let exclusive = acquire(true).unwrap();
        assert!(acquire(false).is_none());
        exclusive.remove().unwrap();
        assert!(!path.exists() && acquire(true).is_some());
    }

    #[test]
    fn only_missing_support_means_no_locks() {
        let errors = [95, 38, 37, 5, 28].map(io::Error::from_raw_os_error);
        if cfg!(target_os = "linux") {
            let found = errors.map(|error| means_no_locks(&error));
            assert_eq!(found, [true, true, true, false, false]);
        }
    }
}
