//! Studies: repeated runs of several cells (settings), and the evaluation of claims about them.
//!
//! The rooms, each of which uses only those before it:
//!
//! - [`external`] reads the results that others made.
//! - [`design`] is what is to be run and claimed: the study file, its cells and runs, and its registration.
//! - [`store`] is the folder with the results: one file per run, and a description of the study.
//! - [`execute`] makes the runs that are missing, on threads or as shards of a cluster's jobs.
//! - [`evaluate`] says what the results show: measures, comparisons, verdicts, costs, and whether they are
//!   those that were registered.
//! - [`report`] presents them, and publishes them.
//!
//! A [`bench`](mod@bench) compares a few scenarios without a study file, and [`tuning`] searches for parameters. The unit of
//! all statistics is a run of the whole team: agents and episodes of one run depend on each other, so they are not
//! independent repetitions. Nothing here depends on how agents learn: what a run is says [`experiment`](crate::experiment).

pub mod bench;
pub mod design;
pub mod evaluate;
pub mod execute;
pub mod external;
mod file_error;
pub mod report;
pub mod store;
pub mod tuning;

pub use file_error::FileError;
