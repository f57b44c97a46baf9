//! Finite tasks, and teams that know their tables: what tasks are, what agents believe, and how
//! they explore.

mod belief;
mod plan;
mod team;
