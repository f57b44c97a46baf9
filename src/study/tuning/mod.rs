//! Tuning: a search for parameters by which every method of a comparison gets the same number of runs.
//!
//! The tuning [`mod@file`] names methods and a [space](file::Parameter) of parameters. The [`plan`] draws
//! configurations of each method from named random streams; they are the cells of a study in memory, so
//! that their runs are executed and stored as those of any study. The [`schedule`] divides the budget by
//! successive halving, the [`search`] decides which configurations go on, and [`output`] writes what was
//! found. Configurations depend on the search seed and the names of methods only, and the decisions on
//! stored results only: neither on the number of threads nor on interruptions.

pub mod file;
pub mod output;
pub mod plan;
pub mod schedule;
pub mod search;
mod space;
