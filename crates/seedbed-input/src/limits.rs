//! Limits of what is read from files and arguments, all in one place.
//!
//! Each is far above what a real input needs. They exist because readers must end with an error
//! that names the limit, whatever they are given, instead of overflowing the stack (nesting),
//! filling the memory (sizes), or not returning for hours (numbers of entries that are compared
//! with each other). Ranges of single numbers are part of their types: see
//! [`numbers`](super::numbers).

use std::fmt;
use std::fs::{self, File, Metadata};
use std::io::{self, Read};
use std::marker::PhantomData;
use std::path::Path;

use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};

/// Maximum size in bytes of a text that users write: a task, a scenario or a study. Such a text is
/// kept in memory several times, as text and as values.
pub const MAX_TEXT_BYTES: u64 = 16 << 20;

/// Maximum size in bytes of a table, or another file of results, that is read as a whole.
pub const MAX_TABLE_BYTES: u64 = 1 << 30;

/// Maximum depth of nested values in a RON text, each of which takes stack.
pub const MAX_NESTING: usize = seedbed_settings::MAX_NESTING;

/// Maximum length of a formula in bytes. It limits how deeply a formula can be nested, and thus
/// the stack that parsing it recursively takes.
pub const MAX_FORMULA_BYTES: usize = 1000;

/// Maximum length in bytes of a name in a task: it is parsed as formulas are, is compared with all
/// other names, and is part of the names of columns and panels.
pub const MAX_NAME_BYTES: usize = 200;

/// Maximum length in bytes of an override, such as `agents.count=16`.
pub const MAX_OVERRIDE_BYTES: usize = 10_000;

/// Maximum number of task files in a chain of `extends`.
pub const MAX_EXTENDED_FILES: usize = 8;

/// Maximum number of entries of a list of a task, such as bodies or observations. References by
/// name are looked up in these lists, so that the time of a check grows with the square.
pub const MAX_ENTRIES: usize = 1000;

/// Maximum number of points of a shape.
pub const MAX_POINTS: usize = 10_000;

/// Maximum number of observations, and of components of an action, in files that other programs
/// record.
pub const MAX_RECORDED_AXES: usize = 10_000;

/// Maximum length in bytes of a name or a unit in files that other programs record.
pub const MAX_RECORDED_NAME_BYTES: usize = 1000;

/// Maximum number of agents in files that other programs record.
pub const MAX_RECORDED_AGENTS: u32 = 1 << 16;

/// From this number of an agent on, at least a quarter of the numbers must be in use in files that other
/// programs record: each number takes memory, also without a file.
pub const MAX_SPARSE_AGENTS: u32 = 1024;

/// Maximum number of agents in results of others. Each takes memory even without an episode.
pub const MAX_AGENTS_OF_OTHERS: u64 = 1_000_000;

/// Maximum size in bytes of a small file that the program writes and reads again as a whole, such as the
/// description of a run or its checksums.
pub const MAX_SMALL_FILE_BYTES: u64 = 64 << 20;

/// Maximum size in bytes of a large file that is read as a whole, such as a checkpoint.
pub const MAX_LARGE_FILE_BYTES: u64 = 16 << 30;

/// Maximum number of cells of a study. Each is a checked scenario in memory, and its name is compared with
/// all others.
pub const MAX_CELLS: u64 = 10_000;

/// Maximum number of runs of a study: of all cells together.
pub const MAX_RUNS: u64 = 10_000_000;

/// Opens a regular file. All files that are read are opened here: a pipe, a socket or a device, of which
/// some never end and others wait for another process, is refused, and so is a folder.
///
/// # Errors
/// The file is not a regular file or cannot be opened.
pub fn open_regular(path: &Path) -> io::Result<File> {
    // Before it is opened, too: to open a pipe waits for a process that writes.
    check_is_regular(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    check_is_regular(&file.metadata()?)?;
    Ok(file)
}

/// Checks that a file is a regular one.
///
/// # Errors
/// It is a folder, a pipe, a socket or a device.
pub fn check_is_regular(metadata: &Metadata) -> io::Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    if metadata.is_dir() {
        let message = "expected a file, found a folder";
        return Err(io::Error::new(io::ErrorKind::IsADirectory, message));
    }
    Err(io::Error::new(
        io::ErrorKind::InvalidInput,
        "expected a regular file, found a pipe, a socket or a device",
    ))
}

/// Reads a regular file whole, unless it has more than `max_bytes`.
///
/// # Errors
/// The file is not a regular file, too large, or cannot be read.
pub fn read_bytes(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    bytes_of(open_regular(path)?, max_bytes)
}

/// Like [`read_bytes`], for a text.
///
/// # Errors
/// Those of [`read_bytes`], or the file is not UTF-8 ([`io::ErrorKind::InvalidData`]).
pub fn read_text(path: &Path, max_bytes: u64) -> io::Result<String> {
    text_of(open_regular(path)?, max_bytes)
}

/// All text of `source`, unless it has more than `max_bytes`.
///
/// # Errors
/// As [`read_text`].
pub fn text_of(source: impl Read, max_bytes: u64) -> io::Result<String> {
    let text = String::from_utf8(bytes_of(source, max_bytes)?);
    text.map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

/// All bytes of `source`, unless it has more than `max_bytes`. The size is limited while reading, because
/// a file can grow meanwhile.
///
/// # Errors
/// `source` is too large or cannot be read.
pub fn bytes_of(source: impl Read, max_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(max_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max_bytes {
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("expected at most {}, found more", readable_size(max_bytes)),
        ));
    }
    Ok(bytes)
}

/// Reads a list of at most [`MAX_ENTRIES`] entries: `#[serde(deserialize_with = …)]`.
///
/// # Errors
/// The list is longer, or one of its entries is wrong.
pub fn short_list<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    deserializer.deserialize_seq(ShortList(PhantomData))
}

/// Visits a list, and stops at the first entry that is too many.
struct ShortList<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for ShortList<T> {
    type Value = Vec<T>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a sequence")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut entries: A) -> Result<Vec<T>, A::Error> {
        let mut list = Vec::new();
        while let Some(entry) = entries.next_element()? {
            if list.len() == MAX_ENTRIES {
                let message =
                    format!("expected a list of at most {MAX_ENTRIES} entries, found more");
                return Err(A::Error::custom(message));
            }
            list.push(entry);
        }
        Ok(list)
    }
}

/// For example `16 MiB`.
fn readable_size(bytes: u64) -> String {
    match bytes {
        _ if bytes >= 1 << 30 => format!("{} GiB", bytes >> 30),
        _ if bytes >= 1 << 20 => format!("{} MiB", bytes >> 20),
        _ => format!("{bytes} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{parse, read_text as read_input};

    #[derive(Debug, serde::Deserialize)]
    struct Team {
        #[serde(deserialize_with = "short_list")]
        members: Vec<u32>,
    }

    fn team(members: usize) -> String {
        format!("Team(members: [{}])", "7, ".repeat(members))
    }

    #[test]
    fn a_list_has_at_most_the_maximum_of_entries() {
        let longest = parse::<Team>("team.ron", team(MAX_ENTRIES)).unwrap();
        assert_eq!(longest.value.members.len(), MAX_ENTRIES);
        let error = parse::<Team>("team.ron", team(MAX_ENTRIES + 1)).unwrap_err();
        assert_eq!(error.field, "members");
        assert_eq!(
            error.message,
            "expected a list of at most 1000 entries, found more"
        );
        let position = error.position.unwrap();
        // Each entry takes three columns, after `Team(members: [`.
        assert_eq!((position.line, position.column / 3), (1, 3019 / 3));
    }

    #[test]
    #[cfg(unix)]
    fn what_is_no_regular_file_is_refused() {
        let folder = std::env::temp_dir();
        let error = read_bytes(&folder, 100).unwrap_err();
        assert_eq!(error.to_string(), "expected a file, found a folder");
        let message = "expected a regular file, found a pipe, a socket or a device";
        for endless in ["/dev/zero", "/dev/tty", "/dev/stdin"] {
            let Ok(metadata) = fs::metadata(endless) else {
                continue;
            };
            if !metadata.is_file() {
                let error = read_bytes(Path::new(endless), 100).unwrap_err();
                assert_eq!(error.to_string(), message, "{endless}");
            }
        }
        let error = read_input(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error.to_string(), format!("/dev/zero: {message}"));
    }

    #[test]
    fn a_file_of_the_maximal_size_is_read() {
        let path = Path::new("Cargo.toml");
        let size = std::fs::metadata(path).unwrap().len();
        assert_eq!(read_bytes(path, size).unwrap().len() as u64, size);
        assert!(read_bytes(path, size - 1).is_err());
    }

    #[test]
    fn deep_nesting_is_refused() {
        let nested = |depth: usize| "[".repeat(depth) + &"]".repeat(depth);
        for depth in [MAX_NESTING + 1, 100_000] {
            let error = crate::check_ron_value(&nested(depth)).unwrap_err();
            assert_eq!(
                error, "expected fewer brackets within each other",
                "{depth}"
            );
        }
        assert_eq!(crate::check_ron_value(&nested(MAX_NESTING)), Ok(()));
    }
}
