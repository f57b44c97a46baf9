//! The formulas of reinforcement learning as pure functions on slices, each with its source.
//!
//! Index t of a reward slice holds `R_{t+1}`, what followed action t; index t of a seed slice holds
//! `z_{k,t+1}`. They keep no state and must not
//! depend on files or threads.

pub mod advantage;
pub mod categorical;
pub mod gaussian;
pub mod information_gain;
pub mod policy_loss;
pub mod q_learning;
pub mod returns;
