//! How much of a growing file was written at a checkpoint, and whether the file still begins with it.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh64::Xxh64;

use seedbed_input::limits::open_regular;

/// The beginning of a file. What follows after it was not yet certain to be kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Written {
    /// Length in bytes.
    pub length: u64,
    /// XXH64 of these bytes; it means nothing if there are none.
    pub hash: u64,
}

/// A file with the part of it that was written at a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenFile {
    /// Path of the file.
    pub path: PathBuf,
    /// What the file begins with.
    pub written: Written,
}

/// Length and hash of the bytes that have been written so far.
#[derive(Clone)]
pub(crate) struct WrittenHash {
    length: u64,
    hash: Xxh64,
}

impl Written {
    /// Checks that the file at `path` begins with what was written.
    ///
    /// # Errors
    /// The file is shorter, has other bytes or cannot be read.
    pub fn check(self, path: &Path) -> io::Result<()> {
        WrittenHash::of_file(&mut open_regular(path)?, self).map(drop)
    }
}

impl WrittenHash {
    /// Nothing is written yet.
    pub(crate) fn new() -> Self {
        Self {
            length: 0,
            hash: Xxh64::new(0),
        }
    }

    /// The beginning of a file, which is read from its start.
    ///
    /// # Errors
    /// The file does not begin with what was `written`, or cannot be read.
    pub(crate) fn of_file(file: &mut File, written: Written) -> io::Result<Self> {
        let mut start = BufReader::new(file).take(written.length);
        let mut found = Self::new();
        loop {
            let bytes = start.fill_buf()?;
            if bytes.is_empty() {
                break;
            }
            found.add(bytes);
            let count = bytes.len();
            start.consume(count);
        }
        found.compare(written)?;
        Ok(found)
    }

    fn compare(&self, written: Written) -> io::Result<()> {
        let length = written.length;
        if self.length < length {
            let reason = format!("shorter than the {length} bytes of its checkpoint");
            return Err(io::Error::other(reason));
        }
        if length > 0 && self.written() != written {
            let reason = format!(
                "was changed or damaged after its checkpoint: its first {length} bytes have another checksum"
            );
            return Err(io::Error::other(reason));
        }
        Ok(())
    }

    /// Adds bytes that were written.
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.hash.update(bytes);
        self.length += bytes.len() as u64;
    }

    /// What has been written so far.
    pub(crate) fn written(&self) -> Written {
        Written {
            length: self.length,
            hash: self.hash.digest(),
        }
    }
}

/// A file that is written from its beginning to its end, with the hash of what was written.
pub(crate) struct HashedFile {
    file: File,
    hash: WrittenHash,
}

impl HashedFile {
    /// A file that is empty.
    pub(crate) fn new(file: File) -> Self {
        let hash = WrittenHash::new();
        Self { file, hash }
    }

    /// Opens a file that begins with what was `written`, and removes the rest.
    ///
    /// # Errors
    /// The file does not begin with it, or cannot be opened.
    pub(crate) fn open(path: &Path, written: Written) -> io::Result<Self> {
        let mut file = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .open(path)?;
        let hash = WrittenHash::of_file(&mut file, written)?;
        file.set_len(written.length)?;
        file.seek(SeekFrom::End(0))?;
        Ok(Self { file, hash })
    }

    /// What has been written of the file.
    pub(crate) fn written(&self) -> Written {
        self.hash.written()
    }

    /// Writes everything to the disk; returns what has been written.
    ///
    /// # Errors
    /// The operating system reports an error.
    pub(crate) fn sync(&self) -> io::Result<Written> {
        self.file.sync_data()?;
        Ok(self.written())
    }
}

impl Write for HashedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.hash.add(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every changed bit of what was written and every shorter file is noticed; what follows is not.
    #[test]
    fn changes_of_the_beginning_are_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        let mut hash = WrittenHash::new();
        hash.add(b"first row\n");
        hash.add(b"second row\n");
        let written = hash.written();
        let check = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            written.check(&path)
        };
        let longer = b"first row\nsecond row\nthird r";
        let length = written.length as usize;
        assert_eq!(length, 21);
        assert!(check(&longer[..length]).is_ok() && check(longer).is_ok());
        for bit in 0..8 * longer.len() {
            let mut changed = *longer;
            changed[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(check(&changed).is_ok(), bit >= 8 * length, "bit {bit}");
        }
        assert!((0..length).all(|length| check(&longer[..length]).is_err()));
    }

    #[test]
    fn a_file_without_checkpoint_may_have_any_contents() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        std::fs::write(&path, "row").unwrap();
        Written::default().check(&path).unwrap();
    }
}
