//! The integration tests of the workbench, in one binary, so that the recording SDK is linked once.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod architecture;
mod circles;
mod cli;
#[cfg(unix)]
mod cluster;
mod comparisons;
mod damaged_files;
mod determinism;
#[cfg(unix)]
mod docs;
mod event_files;
mod external;
#[cfg(target_os = "linux")]
mod failing_calls;
mod file_map;
mod fuzz;
mod generated;
mod hostile_names;
mod learners;
mod learning;
mod messages;
mod page_numbers;
mod predictors;
mod published;
mod recording;
mod registration;
mod reliability;
mod review;
mod salvage;
mod scaling;
mod self_contained;
mod shared_world;
mod state_files;
#[cfg(unix)]
mod stopping;
mod study;
mod submission;
mod tabular;
mod thresholds;
mod tune;
mod util;
mod weights;
