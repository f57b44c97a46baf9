//! Files whose damage is noticed, and which a crash leaves old or new, never half written.
//!
//! [`files`] replaces whole files, `sealed` gives them a header with kind, version, length and
//! checksum, [`written`] follows growing files, `hashes` has the checksums that people compare, and
//! [`file_lock`] lets one process write. Files are read by `seedbed_input::limits`, which accepts only
//! regular files of limited size. Must not depend on the meaning of the files.

pub mod file_lock;
pub mod files;
pub(crate) mod hashes;
pub mod incomplete;
pub(crate) mod sealed;
pub mod written;
