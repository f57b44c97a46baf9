//! Finite tasks, and teams that know their tables: what tasks are, what agents believe, and how they explore.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "tabular/environment.rs"]
mod environment;
