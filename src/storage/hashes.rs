//! SHA-256 in hexadecimal digits, as `sha256sum` prints it.

use std::io::{self, Read};
use std::path::Path;

use sha2::{Digest, Sha256};

use seedbed_input::limits::open_regular;

pub(crate) use seedbed_settings::sha256;

/// Number of digits of a digest in names of files.
const SHOWN_DIGITS: usize = 16;

/// The digits of a digest in names of files.
pub(crate) fn shown_digits(digest: &str) -> &str {
    digest.get(..SHOWN_DIGITS).unwrap_or(digest)
}

/// The SHA-256 of the bytes of a file.
///
/// # Errors
/// It is no regular file, or cannot be read.
pub(crate) fn sha256_of_file(path: &Path) -> io::Result<String> {
    const BLOCK: usize = 1 << 16;
    let (mut file, mut hash, mut block) = (open_regular(path)?, Sha256::new(), vec![0; BLOCK]);
    loop {
        match file.read(&mut block) {
            Ok(0) => return Ok(format!("{:x}", hash.finalize())),
            Ok(count) => hash.update(&block[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}
