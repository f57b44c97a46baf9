//! Atomic replacement of files: after a crash a file has either its old or its new content.
//!
//! New content is written to a file with a unique name beside the old one, so that several processes
//! can replace the same file at once; the last one wins.

use std::fs::{self, File};
use std::io::{ErrorKind, Read, Result, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::incomplete::Incomplete;
use seedbed_input::limits::{check_is_regular, open_regular};
use tempfile::{NamedTempFile, TempPath};

/// Replaces the file at `path`, which others read as a regular file; see [`Replacement`].
///
/// # Errors
/// There is a folder, a pipe, a socket or a device, or the operating system reports an error; then the old
/// file is kept.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    Replacement::begin(path)?.write(bytes)
}

/// Replaces the file at `path`, or writes to a device or a pipe, for users who chose it; see
/// [`Replacement`].
///
/// # Errors
/// The operating system reports an error; then the old file is kept.
pub fn write_to(path: &Path, bytes: &[u8]) -> Result<()> {
    Replacement::begin_any(path)?.write(bytes)
}

/// The new content of a file, which replaces the old one when it is complete. Without a
/// [`commit`](Self::commit), the old file is kept.
#[derive(Debug)]
pub struct Replacement {
    target: PathBuf,
    new_content: NewContent,
}

#[derive(Debug)]
enum NewContent {
    /// A file beside the old one.
    Temporary(NamedTempFile, Incomplete),
    /// A device or a pipe, which cannot be replaced.
    Direct(File),
}

impl Replacement {
    /// Prepares new content for the file at `path`, and creates its folder if necessary. If `path` is
    /// a symbolic link, the file to which it points is replaced.
    ///
    /// # Errors
    /// There is a folder, a pipe, a socket or a device, or the operating system reports an error.
    pub fn begin(path: &Path) -> Result<Self> {
        fs::metadata(path).map_or(Ok(()), |metadata| check_is_regular(&metadata))?;
        Self::begin_any(path)
    }

    /// Like [`begin`](Self::begin), but a device or a pipe is written to.
    ///
    /// # Errors
    /// The operating system reports an error.
    pub fn begin_any(path: &Path) -> Result<Self> {
        let target = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let is_special = target.metadata().is_ok_and(|metadata| !metadata.is_file());
        let new_content = if is_special {
            NewContent::Direct(File::options().write(true).open(&target)?)
        } else {
            let (file, incomplete) = temporary_file_beside(&target)?;
            NewContent::Temporary(file, incomplete)
        };
        Ok(Self {
            target,
            new_content,
        })
    }

    /// Writes the whole new content, and replaces the old one.
    fn write(self, bytes: &[u8]) -> Result<()> {
        self.file()?.write_all(bytes)?;
        self.commit()
    }

    /// The file to which the new content is written.
    ///
    /// # Errors
    /// The operating system reports an error.
    pub fn file(&self) -> Result<File> {
        match &self.new_content {
            NewContent::Temporary(file, _) => file.as_file().try_clone(),
            NewContent::Direct(file) => file.try_clone(),
        }
    }

    /// Replaces the old content.
    ///
    /// # Errors
    /// The operating system reports an error; then the old file is kept.
    pub fn commit(self) -> Result<()> {
        let NewContent::Temporary(file, _incomplete) = self.new_content else {
            return Ok(());
        };
        file.as_file().sync_all()?;
        // The file is locked until it has its name.
        let (_locked, path) = file.into_parts();
        rename(path, &self.target)?;
        sync_folder_of(&self.target)
    }
}

/// Adds to the first `length` bytes of the file at `path`; what follows them is removed. Creates the file and
/// its folder if there are no such bytes.
///
/// # Errors
/// The operating system reports an error.
pub(crate) fn append_after(
    path: &Path,
    length: u64,
    write: impl FnOnce(&mut File) -> Result<()>,
) -> Result<()> {
    if length == 0 {
        fs::create_dir_all(folder_of(path))?;
    }
    let mut file = File::options()
        .create(true)
        .truncate(false)
        .write(true)
        .open(path)?;
    file.set_len(length)?;
    file.seek(SeekFrom::Start(length))?;
    write(&mut file)?;
    file.sync_all()?;
    sync_folder_of(path)
}

/// Reads the first `length` bytes of a file.
///
/// # Errors
/// The file is shorter, no regular file, or cannot be read.
pub(crate) fn read_start(path: &Path, length: u64) -> std::result::Result<Vec<u8>, String> {
    let file = open_regular(path).map_err(|error| error.to_string())?;
    let present = file.metadata().map_err(|error| error.to_string())?.len();
    if present < length {
        return Err(format!("is too short: it has {present} of {length} bytes"));
    }
    let mut bytes = Vec::with_capacity(length as usize);
    match file.take(length).read_to_end(&mut bytes) {
        Ok(_) => Ok(bytes),
        Err(error) => Err(error.to_string()),
    }
}

/// Gives the file at `path` a second name, under which it remains when the first is replaced. A
/// file that had this name is replaced.
///
/// # Errors
/// The operating system reports an error.
pub fn keep_as(path: &Path, second_name: &Path) -> Result<()> {
    let (link, _incomplete) = temporary_file_beside(second_name)?;
    let link = link.into_temp_path();
    remove_if_exists(&link)?;
    if fs::hard_link(path, &link).is_err() {
        // Some file systems have no hard links.
        fs::copy(path, &link)?;
        File::open(&link)?.sync_all()?;
    }
    rename(link, second_name)
}

/// Gives a temporary file its final name. If both are names of one file already, the operating system keeps
/// both, and the temporary one is removed. By the standard library, whose calls a test can let fail;
/// those of `tempfile` circumvent the C library.
fn rename(mut path: TempPath, target: &Path) -> Result<()> {
    fs::rename(&path, target)?;
    path.disable_cleanup(!path.exists());
    Ok(())
}

/// Removes a file, if it exists.
///
/// # Errors
/// The operating system reports an error.
pub fn remove_if_exists(path: &Path) -> Result<()> {
    ignore_not_found(fs::remove_file(path))
}

/// Success if the file or folder to remove did not exist.
pub(crate) fn ignore_not_found(result: Result<()>) -> Result<()> {
    match result {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The error with what could not be done to which file: `cannot remove PATH: REASON`.
#[must_use]
pub fn cannot_remove(path: &Path, error: &std::io::Error) -> std::io::Error {
    let message = format!("cannot remove {}: {error}", path.display());
    std::io::Error::new(error.kind(), message)
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

/// End of the name of a file that is not complete yet.
const PART_SUFFIX: &str = ".part";

/// Number of random characters in the name of a temporary file.
const RANDOM_CHARACTERS: usize = 6;

/// An empty file in the same folder, which is created if necessary. It has the permissions of any new
/// file, and is deleted unless it is renamed.
fn temporary_file_beside(path: &Path) -> Result<(NamedTempFile, Incomplete)> {
    let folder = folder_of(path);
    fs::create_dir_all(folder)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let prefix = format!("{name}.");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(PART_SUFFIX);
    builder.rand_bytes(RANDOM_CHARACTERS);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    loop {
        let (file, incomplete) =
            Incomplete::make(|| builder.tempfile_in(folder), NamedTempFile::path)?;
        // Without locks, no file is taken for abandoned. One may be, between these two lines.
        let _ = file.as_file().lock();
        if file.path().exists() {
            return Ok((file, incomplete));
        }
    }
}

fn folder_of(path: &Path) -> &Path {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    folder.unwrap_or(Path::new("."))
}

/// Removes the new contents of files that their processes did not complete because they were killed.
/// `is_own`: whether a file with this name may be written by such processes. What cannot be removed does
/// no harm.
pub fn remove_abandoned(folder: &Path, is_own: impl Fn(&str) -> bool) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if target_of(&name.to_string_lossy()).is_some_and(&is_own) {
            let path = entry.path();
            let Ok(file) = File::options().write(true).open(&path) else {
                continue;
            };
            // Locked until it is removed: a process that has just made it sees that it is gone.
            if file.try_lock().is_ok() {
                let _ = fs::remove_file(path);
            }
        }
    }
}

/// Like [`remove_abandoned`], of new contents of the file at `path` only.
pub fn remove_abandoned_of(path: &Path) {
    if let Some(name) = path.file_name() {
        remove_abandoned(folder_of(path), |target| name == target);
    }
}

/// Name of the file that a temporary file is to replace; `None` if it is another file.
fn target_of(name: &str) -> Option<&str> {
    let (target, random) = name.strip_suffix(PART_SUFFIX)?.rsplit_once('.')?;
    let is_random = random.len() == RANDOM_CHARACTERS
        && random.bytes().all(|byte| byte.is_ascii_alphanumeric());
    is_random.then_some(target)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/file.txt");
        for content in ["old", "new"] {
            replace(&path, content.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), content);
        }
        assert_eq!(names_in(path.parent().unwrap()), ["file.txt"]);
    }

    #[test]
    fn without_a_commit_the_old_file_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file.txt");
        replace(&path, b"old").unwrap();
        let replacement = Replacement::begin(&path).unwrap();
        replacement.file().unwrap().write_all(b"half").unwrap();
        drop(replacement);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names_in(folder.path()), ["file.txt"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_remain() {
        use std::os::unix::fs::{MetadataExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file.txt", "link"].map(|name| folder.path().join(name));
        fs::write(&file, "old").unwrap();
        symlink("file.txt", &link).unwrap();
        replace(&link, b"new").unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(file.metadata().unwrap().mode() & 0o400, 0o400);
        write_to(Path::new("/dev/null"), b"nothing").unwrap();
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    }

    /// Nobody reads such a pipe: to open it would wait for ever. What is written to a device is lost.
    #[cfg(unix)]
    #[test]
    fn pipes_and_devices_in_place_of_own_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [pipe, link] = ["pipe", "link"].map(|name| folder.path().join(name));
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        std::os::unix::fs::symlink("/dev/null", &link).unwrap();
        for path in [&pipe, &link] {
            let error = replace(path, b"new").unwrap_err().to_string();
            assert!(error.starts_with("expected a regular file"), "{error}");
        }
        assert_eq!(names_in(folder.path()), ["link", "pipe"]);
    }

    /// Many threads replace the same file while its folder does not exist yet.
    #[test]
    fn concurrent_replacements_do_not_disturb_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study/study.json");
        std::thread::scope(|scope| {
            for thread in 0..16_u8 {
                let path = &path;
                scope.spawn(move || {
                    for _ in 0..20 {
                        replace(path, &[thread; 4096]).unwrap();
                        // Takes no file of another thread for abandoned.
                        remove_abandoned_of(path);
                    }
                });
            }
        });
        let bytes = fs::read(&path).unwrap();
        assert_eq!(bytes, [bytes[0]; 4096]);
        assert_eq!(names_in(path.parent().unwrap()), ["study.json"]);
    }

    /// What a killed process leaves is not locked.
    #[test]
    fn abandoned_contents_are_removed_and_others_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        let abandoned = folder.path().join("table.csv.1a2b3c.part");
        fs::write(&abandoned, "half").unwrap();
        let (of_other, _incomplete) =
            temporary_file_beside(&folder.path().join("other.csv")).unwrap();
        let kept = of_other.path().to_owned();
        let in_progress = Replacement::begin(&path).unwrap();
        for name in [
            "run.rrd.part",
            "table.csv.part",
            "table.csv.123456",
            "notes",
        ] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        remove_abandoned_of(&path);
        assert!(!abandoned.exists() && kept.exists());
        assert_eq!(names_in(folder.path()).len(), 6);
        in_progress.commit().unwrap();
        assert!(path.is_file());
    }

    #[test]
    fn a_second_name_keeps_the_content() {
        let folder = tempfile::tempdir().unwrap();
        let [file, kept] = ["file.txt", "kept.txt"].map(|name| folder.path().join(name));
        for content in ["1", "2", "3"] {
            if file.exists() {
                keep_as(&file, &kept).unwrap();
            }
            replace(&file, content.as_bytes()).unwrap();
        }
        assert_eq!(fs::read_to_string(&kept).unwrap(), "2");
        assert_eq!(names_in(folder.path()), ["file.txt", "kept.txt"]);
        // As after a crash between the two: both are names of one file, of which `rename` keeps both.
        for _ in 0..2 {
            keep_as(&file, &kept).unwrap();
            assert_eq!(names_in(folder.path()), ["file.txt", "kept.txt"]);
        }
    }
}
