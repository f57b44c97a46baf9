//! Tabular runs: beliefs and agent seeds, planning, and the exploration of teams.

mod belief;
mod planner;
mod team;
