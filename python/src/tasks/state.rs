//! The state of one copy as bytes, from which it continues with the same bits.

use seedbed_env::Physics;
use seedbed_random::Stream;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh64::xxh64;

/// Beginning of the bytes of a state; the last byte is the version of the format.
const MAGIC: &[u8; 8] = b"seedbed\x02";

/// Number of bytes of the checksum at the end.
const CHECKSUM_BYTES: usize = 8;

/// The state of one copy.
#[derive(Serialize, Deserialize)]
pub(super) struct CopyState {
    pub(super) physics: Physics,
    /// Steps since the reset.
    pub(super) steps: u32,
    /// Whether the episode has ended and the copy has not been reset since.
    pub(super) has_ended: bool,
    /// The random stream of start states; `None` before the first reset.
    pub(super) stream: Option<Stream>,
    /// What `Environment::save` returned.
    pub(super) environment: Vec<u8>,
}

impl CopyState {
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        let state = postcard::to_stdvec(self);
        bytes.extend(state.expect("plain numbers in memory can always be written"));
        let checksum = xxh64(&bytes, 0).to_le_bytes();
        bytes.extend(checksum);
        bytes
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// Why the bytes are not a state, or not an undamaged one.
    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        if !bytes.starts_with(&MAGIC[..7]) {
            return Err("the bytes are not a state of an environment of seedbed".to_owned());
        }
        if !bytes.starts_with(MAGIC) {
            return Err("the state was written by another version of seedbed".to_owned());
        }
        let damaged = || "the state is damaged: bytes are missing or have changed".to_owned();
        let end = bytes.len().saturating_sub(CHECKSUM_BYTES).max(MAGIC.len());
        let (content, checksum) = bytes.split_at(end);
        if xxh64(content, 0).to_le_bytes() != checksum {
            return Err(damaged());
        }
        postcard::from_bytes(&content[MAGIC.len()..]).map_err(|_| damaged())
    }
}
