//! The integration tests of the workbench, in one binary, so that the recording SDK is linked once.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod architecture;
mod cli;
mod determinism;
#[cfg(unix)]
mod docs;
mod learning;
mod messages;
mod published;
mod recording;
mod registration;
mod reliability;
mod review;
mod state_files;
mod study;
mod tabular;
mod util;
mod weights;
