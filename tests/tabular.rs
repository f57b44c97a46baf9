//! Finite tasks, and teams that know their tables: what tasks are, what agents believe, and how they explore.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "tabular/belief.rs"]
mod belief;
#[path = "tabular/environment.rs"]
mod environment;
#[path = "tabular/plan.rs"]
mod plan;
#[path = "tabular/team.rs"]
mod team;
