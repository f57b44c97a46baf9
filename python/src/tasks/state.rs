//! The state of one copy as bytes, from which it continues with the same bits.

use seedbed_env::Physics;
use seedbed_random::Stream;
use serde::{Deserialize, Serialize};

use crate::sealed::{damaged, open, seal};

/// Beginning of the bytes of a state; the last byte is the version of the format.
const MAGIC: [u8; 8] = *b"seedbed\x02";

/// What the bytes are, in messages.
const WHAT: &str = "a state of an environment";

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
        let state = postcard::to_stdvec(self);
        seal(
            MAGIC,
            &state.expect("plain numbers in memory can always be written"),
        )
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// Why the bytes are not a state, or not an undamaged one.
    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let content = open(MAGIC, bytes, WHAT)?;
        postcard::from_bytes(content).map_err(|_| damaged(WHAT))
    }
}
