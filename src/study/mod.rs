//! Studies: repeated runs of several cells (settings), and the evaluation of claims about them.
//!
//! A study [`mod@file`] with its [`figure`]s is read into a [`plan`] of [`experiment`]s. The
//! [`runner`] runs what is still missing, and the [`store`] keeps each result. On clusters, [`shard`]s divide the runs
//! among processes, [`run_marks`] say who executes a run, [`run_checkpoint`]s let another process continue it, and
//! [`mod@merge`] unites the results. Cells may also have results
//! that others made ([`external`]); [`run_source`] is the only place that distinguishes the two. [`comparison`] and
//! [`claims`] evaluate the [`results`], [`cost`] says what they took, [`scaling`] what larger teams gain, [`gate`] whether the task is one
//! of exploration, and the [`report`] presents them. The unit of all
//! statistics is a run of the whole team: agents and episodes of one run depend on each other, so
//! they are not independent repetitions. A [`bench`](mod@bench) compares a few scenarios without a
//! study file. [`registration`] fixes a study before its runs, [`agreement`] says whether results are those of a study, and [`power`] says how many runs it
//! needs. [`tuning`] searches for parameters with runs of such plans. This module must not depend on how agents learn.

pub mod agreement;
pub mod bench;
pub mod claims;
pub mod comparison;
pub mod completeness;
pub mod cost;
pub mod draw;
pub mod experiment;
pub mod external;
pub mod figure;
pub mod file;
mod former_digests;
pub mod gate;
pub mod measure;
pub mod merge;
pub mod plan;
pub mod power;
pub mod provenance;
pub mod published;
pub mod registration;
pub mod report;
pub mod result_file;
pub mod results;
pub mod run_checkpoint;
pub mod run_marks;
pub mod run_result;
pub mod run_source;
pub mod runner;
pub mod salvage;
pub mod scaling;
pub mod shard;
pub mod store;
pub mod submission;
mod ties;
pub mod tuning;
