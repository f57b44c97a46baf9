//! Reinforcement learning: networks, formulas, agent seeds, shared experience, agents and teams.
//!
//! [`Team`](team::Team) is the interface for training loops: K agents that act concurrently and
//! learn from shared experience. [`algorithms`] has the teams that a scenario can name. Their parts
//! are in [`agent`] (policies, exploration bonuses), [`nn`] (networks), [`rl`] (formulas), [`seed`]
//! (agent seeds), [`experience`] (episodes and the replay buffer) and [`rollout`] (the episodes that
//! agents are playing).
//!
//! This crate does not open files, choose the number of threads, read clocks, or write recordings.

pub mod agent;
pub mod algorithms;
pub mod experience;
pub mod math;
pub mod nn;
pub mod rl;
pub mod rollout;
pub mod scaling;
pub mod seed;
pub mod team;

pub use seedbed_env::cancellation;
