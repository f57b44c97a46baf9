//! Formulas of reinforcement learning as pure functions on slices, each with its source.
//!
//! Entry t of a slice of rewards is `R_{t+1}`, the reward that followed action t; entry t of a
//! slice of reward seeds is `z_{k,t+1}`. This module must not depend on files or threads.

pub mod advantage;
pub mod categorical;
pub mod correlated_noise;
pub mod gaussian;
pub mod index_conditioned;
pub mod information_gain;
pub mod policy_loss;
pub mod q_learning;
pub mod returns;
pub mod soft_actor_critic;
pub mod squashed_gaussian;
pub mod state_entropy;
pub mod state_regions;
