//! Executes the runs of a study on several threads or as shards of many processes, and repeats them to verify results.

pub mod draw;
pub mod runner;
pub mod shard;
