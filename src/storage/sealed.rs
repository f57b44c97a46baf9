//! Files whose damage is noticed: a header with kind, version, length and hash, then the contents.
//!
//! | Bytes | Contents |
//! |---|---|
//! | 8 | `seedbed` and a zero |
//! | 4 | the kind, such as `ckpt` |
//! | 4 | version of the contents, little-endian |
//! | 8 | length of the contents in bytes |
//! | 8 | XXH64 of kind, version, length and contents |
//!
//! The hash finds accidents of disks and transfers. It does not protect against people who want to
//! change a file.

use xxhash_rust::xxh64::Xxh64;

const MAGIC: &[u8; 8] = b"seedbed\0";
const HASH_START: usize = 24;
const HEADER_LENGTH: usize = 32;

/// Kind and version of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Format {
    /// Four letters that name the kind.
    pub(crate) kind: [u8; 4],
    /// Version of the contents that this program writes and reads.
    pub(crate) version: u32,
}

/// Why contents cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SealError {
    /// The file does not begin with the header of this kind.
    #[error("has another format: it was not written by this version of seedbed")]
    OtherKind,
    /// The contents have another version.
    #[error("is of format {found}; this seedbed reads format {expected}")]
    OtherVersion {
        /// Version of the file.
        found: u32,
        /// Version that this program reads.
        expected: u32,
    },
    /// The file is shorter or longer than its header says.
    #[error("is damaged: it has {found} bytes instead of {expected}")]
    Length {
        /// Length of the file.
        found: u64,
        /// Length according to the header.
        expected: u64,
    },
    /// The file has another hash.
    #[error("is damaged: its checksum does not match")]
    Hash,
}

/// The bytes of a file with these contents.
pub(crate) fn seal(format: Format, contents: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER_LENGTH + contents.len());
    bytes.extend(MAGIC);
    bytes.extend(format.kind);
    bytes.extend(format.version.to_le_bytes());
    bytes.extend((contents.len() as u64).to_le_bytes());
    let hash = hash(&bytes[MAGIC.len()..HASH_START], contents);
    bytes.extend(hash.to_le_bytes());
    bytes.extend(contents);
    bytes
}

/// The contents of a file.
///
/// # Errors
/// The file is of another kind or version, or damaged.
pub(crate) fn unseal(format: Format, bytes: &[u8]) -> Result<&[u8], SealError> {
    let Some((header, contents)) = bytes.split_first_chunk::<HEADER_LENGTH>() else {
        return Err(if bytes.starts_with(MAGIC) {
            length_error(bytes.len(), HEADER_LENGTH as u64)
        } else {
            SealError::OtherKind
        });
    };
    let (start, stored_hash) = header.split_at(HASH_START);
    let (kind, version, length) = (&start[8..12], word(&start[12..16]), word(&start[16..24]));
    if !start.starts_with(MAGIC) || kind != format.kind {
        return Err(SealError::OtherKind);
    }
    if length != contents.len() as u64 {
        let expected = length.saturating_add(HEADER_LENGTH as u64);
        return Err(length_error(bytes.len(), expected));
    }
    if hash(&start[MAGIC.len()..], contents) != word(stored_hash) {
        return Err(SealError::Hash);
    }
    // Last, because the version of a damaged file means nothing.
    if version != u64::from(format.version) {
        return Err(SealError::OtherVersion {
            found: version as u32,
            expected: format.version,
        });
    }
    Ok(contents)
}

fn length_error(found: usize, expected: u64) -> SealError {
    SealError::Length {
        found: found as u64,
        expected,
    }
}

fn hash(start: &[u8], contents: &[u8]) -> u64 {
    let mut hash = Xxh64::new(0);
    hash.update(start);
    hash.update(contents);
    hash.digest()
}

/// A little-endian number of at most eight bytes.
fn word(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .rev()
        .fold(0, |number, &byte| number << 8 | u64::from(byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORMAT: Format = Format {
        kind: *b"test",
        version: 3,
    };

    #[test]
    fn contents_are_read_back() {
        for contents in [&b""[..], b"some contents"] {
            assert_eq!(unseal(FORMAT, &seal(FORMAT, contents)), Ok(contents));
        }
    }

    #[test]
    fn every_changed_bit_and_every_length_is_noticed() {
        let bytes = seal(FORMAT, b"some contents");
        for bit in 0..8 * bytes.len() {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(unseal(FORMAT, &changed).is_err(), "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(unseal(FORMAT, &bytes[..length]).is_err(), "{length} bytes");
        }
        let longer = [&bytes[..], b"x"].concat();
        let (found, expected) = (46, 45);
        assert_eq!(
            unseal(FORMAT, &longer),
            Err(SealError::Length { found, expected })
        );
    }

    #[test]
    fn other_kinds_and_versions_are_named() {
        let bytes = seal(FORMAT, b"x");
        let other_kind = Format {
            kind: *b"else",
            ..FORMAT
        };
        assert_eq!(unseal(other_kind, &bytes), Err(SealError::OtherKind));
        assert_eq!(unseal(FORMAT, b"postcard"), Err(SealError::OtherKind));
        let (found, expected) = (3, 4);
        let newer = Format {
            version: expected,
            ..FORMAT
        };
        assert_eq!(
            unseal(newer, &bytes),
            Err(SealError::OtherVersion { found, expected })
        );
    }
}
