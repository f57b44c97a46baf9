//! Tests of tabular tasks and algorithms: posteriors, planning, and teams.

mod belief;
mod plan;
mod team;
