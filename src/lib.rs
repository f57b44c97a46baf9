//! A workbench for coordinated exploration in concurrent reinforcement learning.

pub mod agent;
pub mod env;
pub mod experience;
pub mod input;
pub mod nn;
pub mod random;
pub mod record;
pub mod rl;
pub mod seed;
