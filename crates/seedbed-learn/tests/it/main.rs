//! The tests of learning that need several modules: gradients and information gain.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod gradients;
mod information_gain;
