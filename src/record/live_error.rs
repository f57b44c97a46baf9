//! Why a run cannot be shown in viewers.

use std::io;

/// Why a run cannot be shown in viewers.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The text is not an address.
    #[error(
        "invalid viewer address `{0}`: expected an address such as {DEFAULT}",
        DEFAULT = super::recording::DEFAULT_VIEWER
    )]
    InvalidAddress(String),
    /// No viewer listens at the address.
    #[error("no viewer responds at {0}: start one with `rerun`, or omit --live")]
    NoViewer(String),
    /// The port cannot be used.
    #[error(
        "cannot serve viewers at port {port}: {reason}; choose another port with --serve=PORT, or send the run to a viewer at this port with --live"
    )]
    Port {
        /// The port of this machine.
        port: u16,
        /// What the operating system said.
        reason: io::Error,
    },
    /// This build cannot write or show recordings.
    #[error("{}", super::UNAVAILABLE)]
    Unavailable,
}
