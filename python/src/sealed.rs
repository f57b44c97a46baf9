//! Bytes with a header and a checksum, so that damaged ones are not read.

use xxhash_rust::xxh64::xxh64;

/// Number of bytes of the checksum at the end.
const CHECKSUM_BYTES: usize = 8;

/// The content between the header `magic`, whose last byte is the version of the format, and a
/// checksum of both.
pub(crate) fn seal(magic: [u8; 8], content: &[u8]) -> Vec<u8> {
    let mut bytes = [&magic, content].concat();
    let checksum = xxh64(&bytes, 0).to_le_bytes();
    bytes.extend(checksum);
    bytes
}

/// The content of what [`seal`] wrote. `what`: its name, such as "a state of an environment"
///
/// # Errors
/// Why the bytes are something else, or damaged.
pub(crate) fn open<'a>(magic: [u8; 8], bytes: &'a [u8], what: &str) -> Result<&'a [u8], String> {
    if !bytes.starts_with(&magic[..7]) {
        return Err(format!("the bytes are not {what} of seedbed"));
    }
    if !bytes.starts_with(&magic) {
        return Err(format!(
            "the bytes are {what} of another version of seedbed"
        ));
    }
    let end = bytes.len().saturating_sub(CHECKSUM_BYTES).max(magic.len());
    let (content, checksum) = bytes.split_at(end);
    if xxh64(content, 0).to_le_bytes() != checksum {
        return Err(damaged(what));
    }
    Ok(&content[magic.len()..])
}

/// The message for bytes that have changed.
pub(crate) fn damaged(what: &str) -> String {
    format!("{what} is damaged: bytes are missing or have changed")
}
